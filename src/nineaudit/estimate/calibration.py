"""What a small calibration error of one sensor does to its reading.

With true specific force a at the sensor, reading y = (1+g) n·a + b (METHODS.md 1), to first order in each error:

    gain g                δy = y g
    zero b                δy = b
    tilt τ_j (j = 1, 2)   δy = (u_j·a) τ_j,                    u_1, u_2 ⊥ n
    position e_j          δy = n·(α × e_j + ω × (ω × e_j))     (accelerometers)
    time skew s           δy = −(dy/dt) s

A rate sensor has ω in the place of a, and no position. These columns are the matrix D of METHODS.md 2 and the
sensitivity coefficients of the error-propagation budget (GUM 5.1.3).
"""

from __future__ import annotations

import numpy as np

from nineaudit.array import FloatArray, Sensor, SensorArray
from nineaudit.estimate.motion import Motion
from nineaudit.physics import kinematics, rigid_body

PARAMETERS = ("gain", "zero", "tilt_1", "tilt_2", "position_x", "position_y", "position_z", "timing")


def perpendicular(axis: FloatArray) -> FloatArray:
    """(2,3) two unit vectors that complete `axis` (3,) to an orthonormal triad."""
    return np.asarray(np.linalg.svd(axis[None, :])[2][1:])


def prior_sd(sensor: Sensor) -> FloatArray:
    """(8,) one standard deviation of each of PARAMETERS, SI, as the rig states it."""
    position = sensor.u_position if sensor.kind == "accelerometer" else 0.0
    tilt = sensor.u_alignment
    return np.array([sensor.u_gain, sensor.u_zero, tilt, tilt, position, position, position, sensor.u_timing])


def columns(sensor: Sensor, reading: FloatArray, time: FloatArray, motion: Motion) -> FloatArray:
    """(n,8) change of one sensor's reading per unit of each of PARAMETERS.

    `reading` (n,) SI without gaps, `time` (n,) s, `motion` of the body. Where a0 is not known (NaN), the tilts
    count as zero and are not budgeted.
    """
    out = np.zeros((len(time), 8))
    out[:, 0] = reading
    out[:, 1] = 1.0
    if sensor.kind == "gyroscope":
        sensed = motion.omega
    else:
        sensed = np.nan_to_num(rigid_body.acceleration_at(sensor.position, motion.a0, motion.alpha, motion.omega))
        for j, e in enumerate(np.eye(3)):
            moved = rigid_body.acceleration_at(e, np.zeros_like(motion.a0), motion.alpha, motion.omega)
            out[:, 4 + j] = moved @ sensor.axis
    out[:, 2:4] = sensed @ perpendicular(sensor.axis).T
    out[:, 7] = -kinematics.differentiate(reading[:, None], time)[:, 0]
    return out


def all_columns(array: SensorArray, readings: FloatArray, time: FloatArray, motion: Motion) -> FloatArray:
    """(k,n,8) of every channel, scaled to one standard deviation of each parameter (prior_sd)."""
    return np.stack([columns(s, readings[:, i], time, motion) * prior_sd(s) for i, s in enumerate(array.sensors)])
