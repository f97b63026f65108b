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

from nineaudit.array import BoolArray, FloatArray, Sensor, SensorArray
from nineaudit.estimate.motion import Motion
from nineaudit.physics import kinematics

PARAMETERS = ("gain", "zero", "tilt_1", "tilt_2", "position_x", "position_y", "position_z", "timing")
SOURCES = {
    "gain": ("gain",),
    "zero": ("zero",),
    "alignment": ("tilt_1", "tilt_2"),
    "position": ("position_x", "position_y", "position_z"),
    "timing": ("timing",),
}
"""The rows of a budget, and the calibration errors that each holds; noise is the last row."""


def perpendicular(axis: FloatArray) -> FloatArray:
    """(2,3) two unit vectors that complete `axis` (3,) to an orthonormal triad."""
    return np.asarray(np.linalg.svd(axis[None, :])[2][1:])


def perpendiculars(array: SensorArray) -> FloatArray:
    """(k,2,3) the directions of the tilts of every channel."""
    return np.stack([perpendicular(axis) for axis in array.axes])


def prior_sd(sensor: Sensor) -> FloatArray:
    """(8,) one standard deviation of each of PARAMETERS, SI, as the rig states it."""
    position = sensor.u_position if sensor.kind == "accelerometer" else 0.0
    tilt = sensor.u_alignment
    return np.array([sensor.u_gain, sensor.u_zero, tilt, tilt, position, position, position, sensor.u_timing])


def features(a0: FloatArray, alpha: FloatArray, omega: FloatArray) -> FloatArray:
    """(15,n) what every reading of a rigid body is linear in: a0, B = [α×] + [ω×][ω×] row by row, and ω.

    A point r has the specific force a(r) = a0 + B r. `a0`, `alpha`, `omega` (3,n).
    """
    (ax, ay, az), (x, y, z) = alpha, omega
    xx, yy, zz, xy, yz, zx = x * x, y * y, z * z, x * y, y * z, z * x
    spin = (-yy - zz, xy - az, zx + ay, xy + az, -zz - xx, yz - ax, zx - ay, yz + ax, -xx - yy)
    return np.vstack([a0, *spin, omega])


def sensing(axes: FloatArray, positions: FloatArray, held: BoolArray) -> FloatArray:
    """(k,15) the reading of each sensor from features(): n·(a0 + B r), or n·ω where not `held` (accelerometers)."""
    felt = np.hstack([axes, (axes[:, :, None] * positions[:, None, :]).reshape(-1, 9)])
    nothing = np.zeros_like(axes)
    return np.where(held[:, None], np.hstack([felt, nothing]), np.hstack([np.zeros_like(felt), axes]))


def sensitivities(axes: FloatArray, positions: FloatArray, held: BoolArray, across: FloatArray) -> FloatArray:
    """(k,6,15) change of a reading per unit of gain, tilts and position, from features(). `across` (k,2,3): the
    directions of the tilts."""
    out = np.zeros((len(axes), 6, 15))
    out[:, 0] = sensing(axes, positions, held)
    for j in range(2):
        out[:, 1 + j] = sensing(across[:, j], positions, held)
    for j in range(3):
        out[:, 3 + j, 3 + j : 12 + j : 3] = np.where(held[:, None], axes, 0.0)
    return out


def columns(
    array: SensorArray, readings: FloatArray, time: FloatArray, motion: Motion, across: FloatArray | None = None
) -> FloatArray:
    """(n,k,8) change of every channel's reading per unit of each of PARAMETERS.

    `readings` (n,k) SI without gaps, `time` (n,) s, `motion` of the body. Where a0 is not known (NaN), the tilts
    count as zero and are not budgeted. `across` (k,2,3): directions of the tilts, if not those of perpendicular().
    """
    across = perpendiculars(array) if across is None else across
    known = features(np.nan_to_num(motion.a0).T, motion.alpha.T, motion.omega.T)
    by = sensitivities(array.axes, array.positions, array.is_accelerometer, across)[:, 1:]
    out = np.empty((*readings.shape, 8))
    out[:, :, 0] = readings
    out[:, :, 1] = 1.0
    out[:, :, 2:7] = (by.reshape(-1, 15) @ known).reshape(len(array), 5, -1).transpose(2, 0, 1)
    out[:, :, 7] = -kinematics.differentiate(readings, time)
    return out


def prior_sds(array: SensorArray) -> FloatArray:
    """(k,8) prior_sd of every channel."""
    return np.stack([prior_sd(sensor) for sensor in array.sensors])


def all_columns(array: SensorArray, readings: FloatArray, time: FloatArray, motion: Motion) -> FloatArray:
    """(k,n,8) of every channel, scaled to one standard deviation of each parameter (prior_sd)."""
    return np.moveaxis(columns(array, readings, time, motion) * prior_sds(array), 1, 0)
