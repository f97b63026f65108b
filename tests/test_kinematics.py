"""Quadrature, differences and attitude: exactness, order, noise and published numbers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nineaudit.array import FloatArray
from nineaudit.errors import EstimationError
from nineaudit.physics import kinematics


def uneven(count: int, seed: int = 1) -> FloatArray:
    return np.cumsum(np.random.default_rng(seed).uniform(0.6e-3, 1.4e-3, count))


@pytest.mark.parametrize("degree", range(6))
def test_integral_is_exact_for_polynomials_to_degree_five(degree: int) -> None:
    for time in (np.linspace(0.0, 1.0, 101), uneven(300), 100.0 + np.arange(500) / 500.0):
        s = (time - time[0]) / (time[-1] - time[0])
        truth = (time[-1] - time[0]) * s ** (degree + 1) / (degree + 1)
        assert np.abs(kinematics.integrate(s**degree, time) - truth).max() < 2e-13


@pytest.mark.parametrize("count", range(1, 7))
def test_short_records_are_integrated_by_what_they_have(count: int) -> None:
    time = np.array([0.0, 0.1, 0.2, 0.35, 0.4, 0.5])[:count]
    degree = count - 1
    got = kinematics.integrate(time**degree, time, 2.0)
    np.testing.assert_allclose(got, 2.0 + time**count / count, atol=1e-13)


def test_truncation_error_is_the_one_of_the_docstring() -> None:
    """(191/60480) h⁶ [f⁽⁵⁾]: an eighth of a period from both ends, where the end stencils play no part."""
    turn = 2 * np.pi * 40.0
    for rate in (1000.0, 2000.0):
        time = np.arange(round(rate)) / rate
        got = kinematics.integrate(np.cos(turn * time), time)
        inside = slice(10, -10)
        error = (got - np.sin(turn * time) / turn)[inside]
        fifth = -(turn**5) * np.sin(turn * time)[inside]
        bound = 191 / 60480 / rate**6 * np.ptp(fifth)
        assert np.ptp(error) == pytest.approx(bound, rel=0.05)


def test_integral_of_noise_is_no_larger_than_by_the_trapezoid() -> None:
    """Every sample inside weighs one step: Σw² is that of the trapezoid but for the ends."""
    count, step = 200, 1e-3
    weights = kinematics.integrate(np.eye(count), np.arange(count) * step)[-1]
    np.testing.assert_allclose(weights[6:-6], step, rtol=1e-12)
    trapezoid = step * np.r_[0.5, np.ones(count - 2), 0.5]
    assert np.linalg.norm(weights) == pytest.approx(np.linalg.norm(trapezoid), rel=0.01)


def test_integral_is_linear_and_starts_where_told() -> None:
    rng = np.random.default_rng(2)
    time, (f, g) = uneven(50), rng.normal(size=(2, 50, 3))
    start = np.array([1.0, -2.0, 3.0])
    got = kinematics.integrate(2.0 * f - g, time, start)
    apart = 2.0 * kinematics.integrate(f, time) - kinematics.integrate(g, time)
    np.testing.assert_allclose(got, start + apart, atol=1e-14)
    np.testing.assert_array_equal(got[0], start)
    np.testing.assert_allclose(kinematics.integrate(f[:, 0], time), kinematics.integrate(f, time)[:, 0])


def test_a_gap_is_crossed_by_the_trapezoid() -> None:
    """A polynomial through clusters 1 ms apart would swing wildly over 200 ms."""
    time = np.r_[np.arange(50) * 1e-3, 0.25 + np.arange(50) * 1e-3]
    noise = np.random.default_rng(3).normal(size=100)
    increment = np.diff(kinematics.integrate(noise, time))[49]
    assert increment == pytest.approx((time[50] - time[49]) * (noise[49] + noise[50]) / 2.0)


@pytest.mark.parametrize("time", [np.array([0.0, 1.0, 1.0]), np.array([0.0, 2.0, 1.0]), np.array([0.0, np.nan, 1.0])])
def test_time_that_does_not_increase_is_refused(time: FloatArray) -> None:
    for function in (kinematics.integrate, kinematics.differentiate):
        with pytest.raises(EstimationError, match="not increasing"):
            function(np.zeros(3), time)


def test_values_that_do_not_fit_the_time_base_are_refused() -> None:
    with pytest.raises(EstimationError, match="do not match"):
        kinematics.integrate(np.zeros((4, 3)), np.arange(3.0))
    with pytest.raises(EstimationError, match="at least 3 samples"):
        kinematics.differentiate(np.zeros(2), np.arange(2.0))


def test_derivative_is_exact_for_quadratics_and_undoes_the_integral() -> None:
    time = uneven(200)
    got = kinematics.differentiate(3.0 * time**2 - time, time)
    np.testing.assert_allclose(got, 6.0 * time - 1.0, atol=1e-9)
    smooth = np.stack([np.sin(30 * time), np.cos(20 * time)], axis=1)
    back = kinematics.differentiate(kinematics.integrate(smooth, time), time)
    # second order: h² f″/6 inside, twice that at the ends, and as much again for uneven steps
    assert np.abs(back - smooth).max() < 2 * (1.4e-3) ** 2 * 30**2 / 3


def test_resultant() -> None:
    np.testing.assert_allclose(kinematics.resultant(np.array([[3.0, 4.0, 12.0], [0, 0, 0]])), [13.0, 0.0])


def test_attitude_of_a_constant_rate_and_hus_recursion() -> None:
    """METHODS.md 7.6 [Hu77]: 30 rad/s, 1 ms, 150 steps: 4.5 rad, but I + hΩ gives 4.498651, norm 1.069798."""
    time = np.arange(151) * 1e-3
    attitude = kinematics.orientation(np.tile([0.0, 0.0, 30.0], (151, 1)), time)
    np.testing.assert_allclose(attitude[-1], Rotation.from_rotvec([0, 0, 4.5]).as_matrix(), atol=1e-13)

    hu = np.linalg.matrix_power(np.eye(3) + 1e-3 * 30.0 * np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 0]]), 150)
    assert np.linalg.norm(hu[0]) == pytest.approx(1.069798, abs=1e-6)
    assert np.arctan2(hu[0, 1], hu[0, 0]) % (2 * np.pi) == pytest.approx(4.498651, abs=1e-6)


def test_turning_45_degrees_about_z_then_20_about_the_bodys_y() -> None:
    """METHODS.md 7.6: the matrix is Rz(45) Ry(20) for v_inertial = C v_body."""
    time = np.linspace(0.0, 1.0, 2001)
    pulse = 8.0 * np.sin(2 * np.pi * time) ** 4 / 3.0 * 2.0  # area 1 in each half second
    omega = np.zeros((2001, 3))
    omega[:1001, 2] = np.radians(45.0) * pulse[:1001]
    omega[1000:, 1] = np.radians(20.0) * pulse[1000:]
    expected = Rotation.from_euler("ZY", [45, 20], degrees=True).as_matrix()
    np.testing.assert_allclose(kinematics.orientation(omega, time)[-1], expected, atol=1e-9)


def spinning(rate: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """time, ω in the body and C = Rz(at) Rx(bt): ω = (b, a sin bt, a cos bt)."""
    a, b, time = 20.0, 35.0, np.arange(round(0.5 * rate) + 1) / rate
    omega = np.stack([np.full_like(time, b), a * np.sin(b * time), a * np.cos(b * time)], axis=1)
    return time, omega, Rotation.from_euler("ZX", np.stack([a * time, b * time], axis=1)).as_matrix()


def test_attitude_of_a_general_motion_is_fourth_order() -> None:
    errors = []
    for rate in (1000.0, 2000.0):
        time, omega, truth = spinning(rate)
        errors.append(np.abs(kinematics.orientation(omega, time) - truth).max())
    assert errors[0] < 1e-5
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.15)


def test_attitude_is_a_rotation_and_obeys_its_equation() -> None:
    time, omega, _ = spinning(20_000.0)
    start = Rotation.from_rotvec([0.3, -0.8, 1.9]).as_matrix()
    attitude = kinematics.orientation(omega, time, start)
    np.testing.assert_allclose(attitude[0], start, atol=1e-15)
    np.testing.assert_allclose(
        attitude @ attitude.transpose(0, 2, 1), np.broadcast_to(np.eye(3), attitude.shape), atol=1e-12
    )
    v = np.array([0.2, -0.5, 0.9])
    moved = kinematics.differentiate(attitude @ v, time)
    expected = np.einsum("nij,nj->ni", attitude, np.cross(omega, v))
    assert np.abs(moved - expected)[1:-1].max() < (1 / 20_000.0) ** 2 * 60.0**3


def test_attitude_refuses_gaps() -> None:
    with pytest.raises(EstimationError, match="gaps"):
        kinematics.orientation(np.full((3, 3), np.nan), np.arange(3.0))
