"""The 3-2-2-2 closed forms (METHODS.md 1.1), their misprints (1.2), noise (4) and the t⁴ example (7.3)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nineaudit.array import FloatArray, Sensor, SensorArray, frozen
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.physics import nap
from nineaudit.physics.kinematics import integrate
from nineaudit.physics.rigid_body import acceleration_at, predict

ARMS = np.array([0.05, 0.06, 0.07])
SIGNED = np.array([-0.05, 0.06, -0.03])
Motion = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def sensors(arms: FloatArray, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> SensorArray:
    made = []
    for channel in nap.CHANNELS:
        point, axis = int(channel[1]), "xyz".index(channel[2])
        position = np.array(centre) + (np.eye(3)[point - 1] * arms[point - 1] if point else 0.0)
        made.append(Sensor(channel, "accelerometer", frozen(position), frozen(np.eye(3)[axis]), channel))
    return SensorArray(tuple(made))


def ideal(arms: FloatArray, motion: Motion) -> FloatArray:
    array = sensors(arms)
    _, a0, alpha, omega = motion
    return predict(array.positions, array.axes, array.is_accelerometer, a0, alpha, omega)


def sines(rate: float = 10_000.0, duration: float = 0.15, seed: int = 3) -> Motion:
    """time, a0, α, ω of a general motion of 5 to 25 Hz, ω(0) not zero, to about 50 rad/s and 300 g."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(duration * rate)) / rate
    turn = 2 * np.pi * rng.uniform(5, 25, (3, 3, 1))
    phase, size = rng.uniform(0, 2 * np.pi, (3, 3, 1)), rng.uniform(8, 20, (3, 3, 1))
    omega = (size * np.sin(turn * time + phase)).sum(axis=1).T
    alpha = (size * turn * np.cos(turn * time + phase)).sum(axis=1).T
    a0 = (1000.0 * np.sin(turn * time + 2 * phase)).sum(axis=1).T
    return time, a0, alpha, omega


def polynomial(time: FloatArray, seed: int = 6) -> Motion:
    """α of degree 5 in each axis, so that quadrature is exact on any time base; ω(0) not zero."""
    rng = np.random.default_rng(seed)
    s = time / time[-1]
    factors = rng.normal(0, 2000, (6, 3))
    alpha = np.stack([s**p for p in range(6)], axis=1) @ factors
    omega = np.stack([time[-1] * s ** (p + 1) / (p + 1) for p in range(6)], axis=1) @ factors
    return time, rng.normal(0, 800, (len(time), 3)), alpha, omega + rng.normal(0, 20, 3)


def uneven(count: int = 400) -> FloatArray:
    return np.cumsum(np.random.default_rng(7).uniform(0.6e-4, 1.4e-4, count))


def worst(got: FloatArray, truth: FloatArray) -> float:
    return float(np.abs(got - truth).max() / np.abs(truth).max())


def test_channels_are_the_array() -> None:
    assert sensors(ARMS).channels == nap.CHANNELS


@pytest.mark.parametrize("arms", [ARMS, SIGNED])
def test_alpha_and_products_are_those_of_the_motion(arms: FloatArray) -> None:
    motion = sines()
    _, _, alpha, omega = motion
    readings = ideal(arms, motion)
    np.testing.assert_allclose(nap.alpha(readings, arms), alpha, atol=1e-10 * np.abs(alpha).max())
    x, y, z = omega.T
    np.testing.assert_allclose(nap.products(readings, arms), np.stack([y * z, z * x, x * y], axis=1), atol=1e-8)


@pytest.mark.parametrize("arms", [ARMS, SIGNED])
@pytest.mark.parametrize("channel", nap.CHANNELS)
def test_closed_forms_are_exact_on_noiseless_motion(channel: str, arms: FloatArray) -> None:
    """To 1e-12: sampled sines, polynomials on an uneven time base, and with ω known otherwise."""
    column = nap.CHANNELS.index(channel)
    for motion in (sines(), polynomial(uneven())):
        time, _, _, omega = motion
        readings = ideal(arms, motion)
        truth = readings[:, column]
        assert worst(nap.rebuild(channel, readings, arms, time, omega[0]), truth) < 1e-12
        assert worst(nap.rebuild(channel, readings, arms, time, omega_known=omega), truth) < 1e-12


@pytest.mark.parametrize("arms", [ARMS, SIGNED])
def test_constraints_hold_on_noiseless_motion(arms: FloatArray) -> None:
    for motion in (sines(), polynomial(uneven())):
        time, _, _, omega = motion
        readings = ideal(arms, motion)
        residuals = nap.constraint_residuals(readings, arms, time, omega[0])
        assert np.abs(residuals).max() < 1e-12 * np.abs(readings).max() / np.abs(arms).min()
        assert worst(nap.omega(readings, arms, time, omega[0]), omega) < 1e-12


@pytest.mark.parametrize("channel", nap.CHANNELS)
def test_the_channel_itself_has_no_say(channel: str) -> None:
    motion = sines()
    time, _, _, omega = motion
    readings = ideal(ARMS, motion)
    expected = nap.rebuild(channel, readings, ARMS, time, omega[0])
    for value in (0.0, 1e12, np.nan, np.inf):
        readings[:, nap.CHANNELS.index(channel)] = value
        np.testing.assert_array_equal(nap.rebuild(channel, readings, ARMS, time, omega[0]), expected)


def test_matrix_forms_are_the_written_forms() -> None:
    """METHODS.md 1.1 word for word, on readings that are no rigid-body motion at all."""
    rx, ry, rz = ARMS
    time = np.arange(500) / 5000.0
    readings = np.random.default_rng(11).normal(0, 500, (500, 9))
    a0x, a0y, a0z, a1y, a1z, a2x, a2z, a3x, a3y = readings.T
    wx0, wy0, wz0 = start = np.array([3.0, -7.0, 11.0])
    wx, wy, wz = nap.omega(readings, ARMS, time, start).T
    Z = integrate((a1y - a0y) / (2 * rx) - a2x / (2 * ry), time, wz0)
    Y = integrate(a3x / (2 * rz) - (a1z - a0z) / (2 * rx), time, wy0)
    Zy = integrate(a1y / (2 * rx) - (a2x - a0x) / (2 * ry), time, wz0)
    Xy = integrate((a2z - a0z) / (2 * ry) - a3y / (2 * rz), time, wx0)
    Xz = integrate(a2z / (2 * ry) - (a3y - a0y) / (2 * rz), time, wx0)
    Yz = integrate((a3x - a0x) / (2 * rz) - a1z / (2 * rx), time, wy0)
    written = {
        "a2z": 2 * ry * (wy * wz - (a3y - a0y) / (2 * rz)) + a0z,
        "a3y": 2 * rz * (wy * wz - (a2z - a0z) / (2 * ry)) + a0y,
        "a3x": 2 * rz * (wz * wx - (a1z - a0z) / (2 * rx)) + a0x,
        "a1z": 2 * rx * (wz * wx - (a3x - a0x) / (2 * rz)) + a0z,
        "a1y": 2 * rx * (wx * wy - (a2x - a0x) / (2 * ry)) + a0y,
        "a2x": 2 * ry * (wx * wy - (a1y - a0y) / (2 * rx)) + a0x,
        "a0x": (
            ry**2 * (a3x + rz / rx * (a1z - a0z))
            + rz**2 * (a2x + ry / rx * (a1y - a0y))
            - 2 * ry * rz * wx * (ry * Z + rz * Y)
        )
        / (ry**2 + rz**2),
        "a0y": (
            rx**2 * (a3y + rz / ry * (a2z - a0z))
            + rz**2 * (a1y + rx / ry * (a2x - a0x))
            - 2 * rx * rz * wy * (rx * Zy + rz * Xy)
        )
        / (rx**2 + rz**2),
        "a0z": (
            rx**2 * (a2z + ry / rz * (a3y - a0y))
            + ry**2 * (a1z + rx / rz * (a3x - a0x))
            - 2 * rx * ry * wz * (rx * Yz + ry * Xz)
        )
        / (rx**2 + ry**2),
    }
    assert set(written) == set(nap.CHANNELS)
    for channel, form in written.items():
        got = nap.rebuild(channel, readings, ARMS, time, start)
        np.testing.assert_allclose(got, form, atol=1e-9 * np.abs(form).max(), err_msg=channel)


def test_misprints_of_equations_25_and_28b() -> None:
    """METHODS.md 1.2: as printed they miss by more than a per cent; put right they are exact."""
    motion = sines()
    time, a0, alpha, omega = motion
    rx, ry, rz = ARMS
    wx, wy, _ = omega.T
    readings = ideal(ARMS, motion)
    a0x, a0y, _, a1y, _, a2x, _, a3x, _ = readings.T
    a1x = acceleration_at(np.array([rx, 0, 0]), a0, alpha, omega)[:, 0]  # printed, though no channel of the array
    wy_printed = integrate((a3x - a0x) / (2 * rz) - (a1x - a0x) / (2 * rx), time, omega[0, 1])
    for printed, corrected, truth in (
        (
            2 * ry * (wx * wy_printed - (a1y - a0y) / (2 * rz)) + a0x,
            2 * ry * (wx * wy - (a1y - a0y) / (2 * rx)) + a0x,
            a2x,
        ),
        (
            -2 * rx * (wx * wy_printed - (a1y - a0y) / (2 * rx)) + a2x,
            a2x - 2 * ry * (wx * wy - (a1y - a0y) / (2 * rx)),
            a0x,
        ),
    ):
        assert worst(corrected, truth) < 1e-12
        assert np.sqrt(np.mean((printed - truth) ** 2) / np.mean(truth**2)) > 0.01


def test_takhounts_counter_example() -> None:
    """METHODS.md 7.3 [Takhounts09 eqs 15-20]: arm channels t, centre 0: a plausible α that no rigid body has.

    The products of the integrated ω grow as t⁴, those of the accelerometers as t.
    """
    time = np.linspace(0.0, 1.0, 1001)
    readings = np.repeat(time[:, None], 9, axis=1) * [0, 0, 0, 1, 1, 1, 1, 1, 1]
    rate = nap.omega(readings, ARMS, time)[-1]
    np.testing.assert_allclose(nap.alpha(readings, ARMS)[-1], [1.1905, -2.8571, 1.6667], atol=5e-5)
    np.testing.assert_allclose(rate[[1, 2, 0]] * rate[[2, 0, 1]], [-1.1905, 0.4960, -0.8503], atol=5e-5)
    np.testing.assert_allclose(nap.products(readings, ARMS)[-1], [15.476, 17.143, 18.333], atol=5e-4)
    np.testing.assert_allclose(
        nap.constraint_residuals(readings, ARMS, time)[-1], [16.6667, 16.6468, 19.1837], atol=1e-3
    )


def test_noise_gains() -> None:
    """METHODS.md 7.8 and 4: √3 and √1.5 of equal arms, 1.07 and 1.10 of the bounds √(13/5) and √(5/4)."""
    equal = np.full(3, 0.05)
    gains = [nap.noise_gain(channel, equal) for channel in nap.CHANNELS]
    np.testing.assert_allclose(gains, [np.sqrt(1.5)] * 3 + [np.sqrt(3.0)] * 6, rtol=1e-12)
    assert gains[3] / np.sqrt(13 / 5) == pytest.approx(1.07, abs=0.005)
    assert gains[0] / np.sqrt(5 / 4) == pytest.approx(1.10, abs=0.005)


@pytest.mark.parametrize("channel", nap.CHANNELS)
def test_scatter_of_the_rebuilt_channel_is_the_predicted_one(channel: str) -> None:
    sigma, count = 3.0, 4000
    noise = np.random.default_rng(nap.CHANNELS.index(channel)).normal(0, sigma, (count, 9))
    rebuilt = nap.rebuild(channel, noise, ARMS, np.arange(count) / 10_000.0)
    # four standard errors of a standard deviation from `count` samples
    assert rebuilt.std() / sigma == pytest.approx(nap.noise_gain(channel, ARMS), rel=4 / np.sqrt(2 * count))


def test_integrated_noise_grows_as_the_root_of_time() -> None:
    """METHODS.md 4: sd ω = σ√(hT)/r, here from the weights themselves; the ends weigh a little more."""
    count, rate, arms = 400, 2000.0, np.full(3, 0.05)
    weights = integrate(np.eye(count), np.arange(count) / rate)[-1]
    sd = np.linalg.norm(weights) * np.linalg.norm(nap.alpha_rows(arms)[0])
    assert sd == pytest.approx(np.sqrt(count) / rate / 0.05, rel=0.01)


@pytest.mark.parametrize(("channel", "arm", "signs"), [("a1y", 0, (-1, -1, 1)), ("a2x", 1, (1, 1, 1))])
def test_signature_of_a_fault(channel: str, arm: int, signs: tuple[int, int, int]) -> None:
    """METHODS.md 3: e in a1y leaves (−ωyE, −ωxE, e)/2rx in the constraints, in a2x (ωyE, ωxE, e)/2ry."""
    motion = sines()
    time, _, _, omega = motion
    readings = ideal(ARMS, motion)
    fault = 300.0 * np.sin(40.0 * time) ** 2
    readings[:, nap.CHANNELS.index(channel)] += fault
    total = integrate(fault, time)
    expected = np.stack([omega[:, 1] * total, omega[:, 0] * total, fault], axis=1) * signs / (2 * ARMS[arm])
    got = nap.constraint_residuals(readings, ARMS, time, omega[0])
    np.testing.assert_allclose(got, expected, atol=1e-8)


def test_twins_of_a_planar_motion_cannot_be_told_apart() -> None:
    """About z, ωx = ωy = 0: the same residual from a1y and, scaled by the arms, from a2x."""
    time, a0, alpha, omega = sines()
    planar = (time, a0, alpha * [0, 0, 1], omega * [0, 0, 1])
    fault, found = 200.0 * np.sin(60.0 * time), []
    for channel, arm in (("a1y", 0), ("a2x", 1)):
        readings = ideal(ARMS, planar)
        readings[:, nap.CHANNELS.index(channel)] += fault * ARMS[arm]
        found.append(nap.constraint_residuals(readings, ARMS, time, planar[3][0]))
    np.testing.assert_allclose(found[0], found[1], atol=1e-8)


def test_unknown_channel_and_impossible_arms_are_told() -> None:
    with pytest.raises(ConfigurationError, match="'a1x'; expected one of a0x"):
        nap.closed_form("a1x", ARMS)
    for arms in (np.array([0.05, 0.0, 0.05]), np.array([0.05, 0.05]), np.array([0.05, np.nan, 0.05])):
        with pytest.raises(EstimationError, match="three lengths in m, none zero"):
            nap.alpha_rows(arms)


@pytest.mark.parametrize("arms", [ARMS, SIGNED])
def test_layout_by_geometry_whatever_the_names_order_centre_and_extra_sensors(arms: FloatArray) -> None:
    array = sensors(arms, centre=(0.01, -0.02, 0.3))
    rng = np.random.default_rng(2)
    named = [replace(s, channel=f"ch{i}") for i, s in enumerate(array.sensors)]
    odd = replace(named[0], channel="odd", axis=frozen([0.6, 0.8, 0.0]))
    gyro = replace(named[1], channel="gyro", kind="gyroscope")
    mixed = [*named, odd, gyro]
    order = rng.permutation(len(mixed))
    found = nap.layout(SensorArray(tuple(mixed[i] for i in order)))
    assert found is not None
    columns, got = found
    assert [mixed[order[c]].channel for c in columns] == [f"ch{i}" for i in range(9)]
    np.testing.assert_allclose(got, arms, atol=1e-15)


def test_layout_refuses_what_is_no_3222_and_keeps_its_tolerances() -> None:
    array = sensors(ARMS)
    assert nap.layout(SensorArray(array.sensors[:8])) is None
    assert nap.layout(SensorArray(())) is None
    reversed_ = replace(array.sensors[3], axis=frozen([0.0, -1.0, 0.0]))
    assert nap.layout(SensorArray((*array.sensors[:3], reversed_, *array.sensors[4:]))) is None

    off = frozen(array.sensors[3].position + np.array([0.0, 4e-4, 0.0]))
    moved = SensorArray((*array.sensors[:3], replace(array.sensors[3], position=off), *array.sensors[4:]))
    assert nap.layout(moved) is None
    assert nap.layout(moved, position_tolerance=5e-4) is not None

    tilt = frozen([np.sin(0.01), np.cos(0.01), 0.0])
    tilted = SensorArray((*array.sensors[:3], replace(array.sensors[3], axis=tilt), *array.sensors[4:]))
    assert nap.layout(tilted) is None
    assert nap.layout(tilted, angle_tolerance=0.011) is not None


def test_layout_takes_the_longest_arms() -> None:
    short = [replace(s, channel="s" + s.channel) for s in sensors(0.5 * ARMS).sensors[3:]]
    found = nap.layout(SensorArray((*sensors(ARMS).sensors[:3], *short, *sensors(ARMS).sensors[3:])))
    assert found is not None
    np.testing.assert_allclose(found[1], ARMS)
