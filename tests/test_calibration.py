"""The calibration columns are derivatives of the reading; the budget predicts the scatter it is meant for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nineaudit.array import SensorArray
from nineaudit.estimate import calibration
from nineaudit.estimate.motion import Motion
from nineaudit.physics import kinematics, rigid_body
from nineaudit.rig import parse_rig, preset_text
from nineaudit.simulate import simulate

RIG = parse_rig(preset_text("naap-gyro"))


@pytest.fixture(scope="module")
def moving():
    found = simulate(RIG, "general", seed=3, imperfect=False, noise=False)
    truth = found.truth
    motion = Motion(truth.omega, truth.alpha, truth.a0, "truth")
    return truth.time, found.recording.readings, motion


def reading(sensor, motion):
    array = SensorArray((sensor,))
    return rigid_body.predict(
        array.positions, array.axes, array.is_accelerometer, motion.a0, motion.alpha, motion.omega
    )[:, 0]


@pytest.mark.parametrize("channel", ["a0y", "a1z", "a3x", "gy"])
def test_columns_are_the_derivatives_of_the_reading(channel, moving):
    time, readings, motion = moving
    sensor = RIG.array[channel]
    y = readings[:, RIG.array.index(channel)]
    columns = calibration.columns(SensorArray((sensor,)), y[:, None], time, motion)[:, 0]
    step = 1e-6
    across = calibration.perpendicular(sensor.axis)
    changed = {
        0: (1 + step) * y,
        1: y + step,
        2: reading(replace(sensor, axis=sensor.axis + step * across[0]), motion),
        3: reading(replace(sensor, axis=sensor.axis + step * across[1]), motion),
        **{4 + j: reading(replace(sensor, position=sensor.position + step * np.eye(3)[j]), motion) for j in range(3)},
    }
    scale = np.abs(columns).max(axis=0)
    for j, value in changed.items():
        expected = (value - y) / step
        assert np.abs(columns[:, j] - expected).max() <= 1e-6 * max(scale[j], 1.0), calibration.PARAMETERS[j]


def test_time_skew_is_a_shift_of_the_curve(moving):
    time, readings, motion = moving
    sensor, y = RIG.array["a1z"], readings[:, RIG.array.index("a1z")]
    late = np.interp(time - 1e-5, time, y)
    columns = calibration.columns(SensorArray((sensor,)), y[:, None], time, motion)[:, 0]
    # linear interpolation and the central difference agree to the second order of the sampling interval
    assert np.abs(late - y - 1e-5 * columns[:, 7]).max() < 0.05 * np.abs(late - y).max()


def test_perpendicular_completes_a_triad():
    rng = np.random.default_rng(1)
    for axis in rng.standard_normal((20, 3)):
        axis /= np.linalg.norm(axis)
        triad = np.vstack([axis, calibration.perpendicular(axis)])
        assert np.allclose(triad @ triad.T, np.eye(3), atol=1e-12)


def test_prior_follows_the_rig_and_rate_sensors_have_no_position():
    accelerometer, gyro = RIG.array["a0x"], RIG.array["gx"]
    assert calibration.prior_sd(accelerometer).tolist() == [
        accelerometer.u_gain,
        accelerometer.u_zero,
        *[accelerometer.u_alignment] * 2,
        *[accelerometer.u_position] * 3,
        accelerometer.u_timing,
    ]
    assert calibration.prior_sd(gyro)[4:7].tolist() == [0.0, 0.0, 0.0]


def test_first_order_change_matches_the_simulated_instrument():
    """An instrument drawn with small errors differs from the ideal one by D θ, to second order in the errors."""
    small = {
        "u_gain": 1e-5,
        "u_zero": 1e-3,
        "u_alignment": 1e-5,
        "u_position": 1e-6,
        "u_timing": 0.0,
        "noise": 1.0,
    }
    rig = replace(RIG, array=SensorArray(tuple(replace(s, **small) for s in RIG.array.sensors)))
    drawn = simulate(rig, "general", seed=5, noise=False)
    motion = Motion(drawn.truth.omega, drawn.truth.alpha, drawn.truth.a0, "truth")
    for i in range(len(rig.array)):
        columns = calibration.columns(rig.array, drawn.ideal, drawn.truth.time, motion)[:, i]
        theta = np.concatenate(
            [[drawn.drawn["gain"][i], drawn.drawn["zero"][i]], [0.0, 0.0], drawn.drawn["position"][i], [0.0]]
        )
        left = drawn.recording.readings[:, i] - drawn.ideal[:, i] - columns @ theta
        tilts = columns[:, 2:4]
        # the two tilts are drawn about axes of the simulator's own choice: they span the same plane
        unexplained = left - tilts @ np.linalg.lstsq(tilts, left, rcond=None)[0]
        assert np.abs(unexplained).max() <= 1e-3 * np.abs(columns @ theta).max() + 1e-9


def test_differentiate_is_what_the_skew_uses():
    time = np.linspace(0.0, 1.0, 101)
    assert np.allclose(kinematics.differentiate(time[:, None] ** 2, time)[:, 0], 2 * time, atol=1e-12)
