"""NINACC [Alem77]: least squares, predictor–corrector, laboratory frame: laws, limits, and the published motion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nineaudit.array import FloatArray, Sensor, SensorArray
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.physics import kinematics, laboratory, rigid_body
from nineaudit.schemes import extra_triax, growth, ninacc
from nineaudit.selftest import alem77
from nineaudit.simulate.published import alem, alem_path
from nineaudit.simulate.truth import Truth
from nineaudit.units import G0

TRIAX = np.tile(np.eye(3), (3, 1))


def triaxes(places: FloatArray, frames: list[Rotation] | None = None) -> SensorArray:
    """A triax at each of `places` (t,3) m, its axes along the body's or turned by `frames`."""
    sensors = []
    for t, place in enumerate(places):
        axes = np.eye(3) if frames is None else frames[t].as_matrix().T
        sensors += [Sensor(f"a{t}{'xyz'[i]}", "accelerometer", place, axes[i], "") for i in range(3)]
    return SensorArray(tuple(sensors))


def read(array: SensorArray, truth: Truth) -> FloatArray:
    every = array.is_accelerometer
    return rigid_body.predict(array.positions, array.axes, every, truth.a0, truth.alpha, truth.omega)


@pytest.fixture(scope="module")
def truth() -> Truth:
    return alem(1600.0, 0.5)


@pytest.fixture(scope="module")
def skew() -> SensorArray:
    """Four triaxes anywhere, in any orientation."""
    rng = np.random.default_rng(4)
    return triaxes(rng.uniform(-0.1, 0.1, (4, 3)), [Rotation.random(rng=i) for i in range(4)])


def worst(got: FloatArray, true: FloatArray) -> float:
    return float((np.abs(got - true).max(axis=0) / np.abs(true).max(axis=0)).max())


# The published numbers


@pytest.mark.parametrize("check", alem77.checks(), ids=lambda check: check.quantity)
def test_every_published_number_comes_out(check) -> None:  # type: ignore[no-untyped-def]
    assert check.passed, f"{check.ours} against {check.expected} ± {check.tolerance}"


def test_the_predictor_corrector_is_of_fourth_order() -> None:
    """Halving the step divides the error by 2⁴."""
    errors = []
    for rate in (800.0, 1600.0, 3200.0):
        motion = alem(rate, 0.5)
        nine = alem77.array()
        got = ninacc.forward(nine, motion.time, read(nine, motion), motion.omega[0])
        errors.append(np.abs(got.omega - motion.omega).max())
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert ((ratios > 2**3.5) & (ratios < 2**5.5)).all(), ratios


def test_an_error_of_omega_grows_no_faster_than_the_rate_says() -> None:
    """Turning about one axis at constant ω, in the worst direction of a set: error ≤ e^(rate · angle) of its start."""
    nine = alem77.array()
    rate = growth.growth_rate(nine.positions, nine.axes)
    time, seen = np.arange(1601) / 1600.0, []
    for direction in np.random.default_rng(3).standard_normal((20, 3)):
        omega = np.tile(3.0 * direction / np.linalg.norm(direction), (len(time), 1))
        motion = Truth(time, omega, np.zeros_like(omega), np.zeros_like(omega))
        for kick in np.eye(3) * 1e-6:
            got = ninacc.forward(nine, time, read(nine, motion), omega[0] + kick)
            seen.append(np.log(np.linalg.norm(got.omega[-1] - omega[-1]) / 1e-6) / 3.0)
    assert 0.5 * rate < max(seen) < rate + np.log(3.0) / 3.0  # a non-normal matrix may add a factor at the start


# Laws of the least squares


def test_any_place_and_orientation_of_four_triaxes_gives_the_motion_back(truth: Truth, skew: SensorArray) -> None:
    got = ninacc.forward(skew, truth.time, read(skew, truth), truth.omega[0])
    assert worst(got.omega, truth.omega) < 1e-3
    assert worst(got.alpha, truth.alpha) < 7e-4
    assert worst(got.a0, truth.a0) < 7e-4


def test_turning_the_body_frame_turns_the_motion(truth: Truth, skew: SensorArray) -> None:
    turn = Rotation.from_euler("ZYX", [0.4, -0.7, 1.1])
    readings = read(skew, truth)
    moved = SensorArray(
        tuple(
            Sensor(s.channel, s.kind, turn.apply(np.array(s.position)), turn.apply(np.array(s.axis)), s.signal)
            for s in skew.sensors
        )
    )
    one = ninacc.forward(skew, truth.time, readings, truth.omega[0])
    other = ninacc.forward(moved, truth.time, readings, turn.apply(np.array(truth.omega[0])))
    for name in ("omega", "alpha", "a0"):
        expected = turn.apply(getattr(one, name))
        np.testing.assert_allclose(getattr(other, name), expected, atol=1e-9 * np.abs(expected).max())


def test_the_order_of_the_channels_does_not_matter(truth: Truth, skew: SensorArray) -> None:
    order = np.random.default_rng(8).permutation(len(skew)).tolist()
    readings, covariance = read(skew, truth), np.linspace(1.0, 3.0, len(skew))
    one = ninacc.forward(skew, truth.time, readings, truth.omega[0], covariance)
    other = ninacc.forward(skew.select(order), truth.time, readings[:, order], truth.omega[0], covariance[order])
    np.testing.assert_allclose(other.alpha, one.alpha, atol=1e-9 * np.abs(one.alpha).max())


def test_the_weight_is_the_inverse_covariance(skew: SensorArray) -> None:
    """Gauss–Markov: no other unbiased estimate has less variance, V itself as the weight (as printed) has more."""
    rng = np.random.default_rng(2)
    root = rng.standard_normal((len(skew), len(skew)))
    covariance = root @ root.T + 0.1 * np.eye(len(skew))
    right = ninacc.solver(skew.positions, skew.axes, covariance).k
    design = rigid_body.design(skew.positions, skew.axes)
    np.testing.assert_allclose(right @ design, np.eye(6), atol=1e-9)
    best = np.diag(np.linalg.inv(design.T @ np.linalg.inv(covariance) @ design))
    np.testing.assert_allclose(np.diag(right @ covariance @ right.T), best, rtol=1e-9)
    printed = ninacc.solver(skew.positions, skew.axes, np.linalg.inv(covariance)).k
    assert (np.diag(printed @ covariance @ printed.T) > best).all()


def test_equation_15_about_the_centroid_is_the_least_squares_of_equal_weights(truth: Truth) -> None:
    places = np.random.default_rng(5).uniform(-0.1, 0.1, (3, 3))
    array = triaxes(places)
    noisy = read(array, truth) + np.random.default_rng(6).standard_normal((len(truth.time), 9))
    solved = ninacc.solver(array.positions, array.axes)
    general = (noisy - rigid_body.centripetal(array.positions, array.axes, truth.omega)) @ solved.k[3:].T
    by_centroid = ninacc.alpha_at_centroid(places, noisy.reshape(-1, 3, 3), truth.omega)
    np.testing.assert_allclose(by_centroid, general, atol=1e-8 * np.abs(general).max())


# What cannot be done is said


def test_triaxes_on_one_line_are_refused_with_rank_and_condition() -> None:
    line = triaxes(np.outer([-1.0, 0.2, 1.0], [0.03, 0.04, 0.05]))
    with pytest.raises(EstimationError, match=r"9 channels, H of rank 5, condition number infinite.*off the line"):
        ninacc.solver(line.positions, line.axes)
    with pytest.raises(EstimationError, match="rank 2"):
        ninacc.alpha_at_centroid(line.positions[::3], np.zeros((2, 3, 3)), np.zeros((2, 3)))


def test_triaxes_nearly_on_one_line_are_refused_with_their_condition() -> None:
    places = np.outer([-1.0, 0.2, 1.0], [0.0, 0.0, 0.05])
    places[1, 0] = 1e-9
    array = triaxes(places)
    with pytest.raises(EstimationError, match=r"rank 5, condition number [0-9.]+e\+0[789]"):
        ninacc.solver(array.positions, array.axes)


@pytest.mark.parametrize("channels", [0, 3, 5])
def test_too_few_channels_are_refused(channels: int) -> None:
    with pytest.raises(EstimationError, match=f"{channels} channels"):
        ninacc.solver(np.zeros((channels, 3)), TRIAX[:channels])


def test_a_covariance_that_is_none_is_refused(skew: SensorArray) -> None:
    for bad in (np.zeros(12), np.ones(3), np.full(12, np.nan)):
        with pytest.raises(EstimationError, match="covariance"):
            ninacc.solver(skew.positions, skew.axes, bad)


def test_uneven_steps_and_short_records_are_refused(truth: Truth) -> None:
    nine, readings = alem77.array(), read(alem77.array(), truth)
    for time, rows in ((truth.time**2, slice(None)), (truth.time[:3], slice(3))):
        with pytest.raises(EstimationError, match="even steps"):
            ninacc.forward(nine, time, readings[rows], truth.omega[0])


def test_divergence_is_named_with_its_sample(truth: Truth) -> None:
    nine = alem77.array()
    with pytest.raises(EstimationError, match=r"sample \d+ of 801.*diverges"):
        ninacc.forward(nine, truth.time, read(nine, truth), np.full(3, 1e6))


# The laboratory frame


def test_the_euler_matrix_is_equation_19_put_right() -> None:
    (yaw, pitch, roll) = angles = np.array([0.3, -0.5, 0.9])
    about_z, about_y, about_x = (Rotation.from_euler(a, b).as_matrix() for a, b in zip("zyx", angles, strict=True))
    to_body = about_x.T @ about_y.T @ about_z.T
    found = laboratory.attitude_of(angles)
    np.testing.assert_allclose(found, to_body.T, atol=1e-15)
    assert found[0, 0] == pytest.approx(np.cos(yaw) * np.cos(pitch))  # printed: another product
    np.testing.assert_allclose(laboratory.euler_of(found[None])[0], [yaw, pitch, roll])


def test_the_euler_rates_are_those_of_the_motion(truth: Truth) -> None:
    """Eq 22 with row 2 and element 3,1 put right, against the angles differentiated by hand."""
    euler, _ = alem_path(1600.0, 0.5)
    np.testing.assert_allclose(laboratory.euler_rates(euler[0], truth.omega), euler[1], atol=1e-11)


def test_gimbal_lock_stops_the_euler_rates_and_not_the_attitude() -> None:
    time = np.linspace(0.0, 1.0, 1001)
    omega = np.tile([0.0, np.pi, 0.0], (1001, 1))
    turned = kinematics.orientation(omega, time)
    np.testing.assert_allclose(turned[-1], np.diag([-1.0, 1.0, -1.0]), atol=1e-12)
    euler = laboratory.euler_of(turned)
    np.testing.assert_allclose(laboratory.attitude_of(euler), turned, atol=1e-7)
    with pytest.raises(EstimationError, match="gimbal lock"):
        laboratory.euler_rates(euler, omega)


def test_quaternions_do_not_jump_and_give_the_attitude_back() -> None:
    time = np.linspace(0.0, 2.0, 2001)
    turned = kinematics.orientation(np.tile([3.0, 4.0, 12.0], (2001, 1)), time)
    found = laboratory.quaternion_of(turned)
    assert np.linalg.norm(np.diff(found, axis=0), axis=1).max() < 13.0 * 1e-3 / 2 * 1.001  # half the angle of a step
    np.testing.assert_allclose(Rotation.from_quat(found).as_matrix(), turned, atol=1e-12)


def test_gravity_closes_its_loop(truth: Truth) -> None:
    """What accelerometers feel of the motion under gravity, less gravity by the attitude, is the motion."""
    euler, shift = alem_path(1600.0, 0.5)
    down = np.array([0.0, 0.0, G0])
    felt = alem(1600.0, 0.5, gravity=tuple(down))
    attitude = laboratory.attitude_of(euler[0])
    back = laboratory.without_gravity(felt.a0, attitude, down)
    np.testing.assert_allclose(back, truth.a0, atol=1e-9)
    zeroed = laboratory.without_gravity(felt.a0 - felt.a0[0], attitude, down, rest=0)
    np.testing.assert_allclose(zeroed - zeroed[0], back - back[0], atol=1e-9)
    a, _, _ = laboratory.origin_path(truth.time, back, attitude, shift[1][0], shift[0][0])
    np.testing.assert_allclose(a, shift[2], atol=1e-9)


def test_velocity_of_a_point_is_the_integral_of_its_acceleration_and_position_that_of_velocity(truth: Truth) -> None:
    euler, shift = alem_path(1600.0, 0.5)
    attitude = laboratory.attitude_of(euler[0])
    origin = laboratory.origin_path(truth.time, truth.a0, attitude, shift[1][0], shift[0][0])
    point = np.array([0.05, -0.08, 0.12])
    path = laboratory.point_path(point, origin, truth.alpha, truth.omega, attitude)
    v = kinematics.integrate(path.a, truth.time, path.v[0])
    x = kinematics.integrate(path.v, truth.time, path.x[0])
    assert worst(v, path.v) < 1e-3
    assert worst(x, path.x) < 1e-3
    np.testing.assert_allclose(np.linalg.norm(path.x - origin[2], axis=1), np.linalg.norm(point), rtol=1e-12)
    felt = rigid_body.acceleration_at(point, truth.a0, truth.alpha, truth.omega)
    np.testing.assert_allclose(path.a_body, felt, atol=1e-10 * np.abs(felt).max())


# The extra triax


def test_an_extra_triax_is_found_by_its_beginning_and_nothing_else_is() -> None:
    array = triaxes(np.eye(3) * 0.05)
    assert extra_triax.triax_columns(array, "a1") == [3, 4, 5]
    with pytest.raises(ConfigurationError, match="b: none"):
        extra_triax.triax_columns(array, "b")
    apart = SensorArray(tuple(Sensor(f"t{s.channel}", s.kind, s.position, s.axis, "") for s in array.sensors[::4]))
    with pytest.raises(ConfigurationError, match=r"mm from their middle, axes of rank 3"):
        extra_triax.triax_columns(apart, "t")


def test_a_gain_error_of_the_extra_triax_shows_in_hic_by_its_power(truth: Truth) -> None:
    """HIC and GSI go with the acceleration to the power 2.5: 1 % of gain is 1.01^2.5 − 1 = 2.52 %."""
    array = triaxes(np.vstack([np.eye(3) * 0.08, np.zeros((1, 3))]))
    readings = read(array, truth)
    columns = extra_triax.triax_columns(array, "a3")
    motion = ninacc.forward(array.select(range(9)), truth.time, readings[:, :9], truth.omega[0])
    good = extra_triax.check(array, columns, truth.time, readings, motion)
    assert good.passed
    assert abs(good.hic_deviation) < 1e-4
    readings[:, columns] *= 1.01
    bad = extra_triax.check(array, columns, truth.time, readings, motion)
    assert not bad.passed
    assert 1.0 + bad.hic_deviation == pytest.approx(1.01**-2.5, abs=1e-4)
    assert 1.0 + bad.gsi_deviation == pytest.approx(1.01**-2.5, abs=1e-4)


def test_triaxes_nearly_on_one_line_are_warned_of_with_the_condition_number() -> None:
    """0.1 mm off a line of 100 mm; the layout of the paper says nothing."""
    line = triaxes(np.array([[0.05, 0.0, 0.0], [0.0, 1e-4, 0.0], [-0.05, 0.0, 0.0]]))
    time = np.arange(10) * 1e-3
    condition = ninacc.solver(line.positions, line.axes).condition
    said = ninacc.forward(line, time, np.zeros((10, 9)), np.zeros(3)).method
    assert condition > ninacc.POOR_CONDITION
    assert f"condition number {condition:.2g}" in said
    assert "off the line" in said
    assert "condition" not in ninacc.forward(alem77.array(), time, np.zeros((10, 9)), np.zeros(3)).method
