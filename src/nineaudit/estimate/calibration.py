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
from nineaudit.physics import kinematics

PARAMETERS = ("gain", "zero", "tilt_1", "tilt_2", "position_x", "position_y", "position_z", "timing")


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


def columns(
    array: SensorArray, readings: FloatArray, time: FloatArray, motion: Motion, across: FloatArray | None = None
) -> FloatArray:
    """(n,k,8) change of every channel's reading per unit of each of PARAMETERS.

    `readings` (n,k) SI without gaps, `time` (n,) s, `motion` of the body. Where a0 is not known (NaN), the tilts
    count as zero and are not budgeted. `across` (k,2,3): directions of the tilts, if not those of perpendicular().
    With B = [α×] + [ω×][ω×], a(r) = a0 + B r.
    """
    spin = _cross_matrix(motion.alpha) + _cross_matrix(motion.omega) @ _cross_matrix(motion.omega)
    sensed = np.nan_to_num(motion.a0)[:, None, :] + np.einsum("nij,kj->nki", spin, array.positions)
    held = array.is_accelerometer[:, None]
    sensed = np.where(held, sensed, motion.omega[:, None, :])
    across = perpendiculars(array) if across is None else across
    out = np.empty((*readings.shape, 8))
    out[:, :, 0] = readings
    out[:, :, 1] = 1.0
    out[:, :, 2:4] = np.einsum("kji,nki->nkj", across, sensed)
    out[:, :, 4:7] = np.where(held, np.einsum("ki,nij->nkj", array.axes, spin), 0.0)
    out[:, :, 7] = -kinematics.differentiate(readings, time)
    return out


def _cross_matrix(vectors: FloatArray) -> FloatArray:
    """[v×] (n,3,3) of v (n,3)."""
    out = np.zeros((len(vectors), 3, 3))
    out[:, 2, 1], out[:, 0, 2], out[:, 1, 0] = vectors.T
    return out - out.transpose(0, 2, 1)


def prior_sds(array: SensorArray) -> FloatArray:
    """(k,8) prior_sd of every channel."""
    return np.stack([prior_sd(sensor) for sensor in array.sensors])


def all_columns(array: SensorArray, readings: FloatArray, time: FloatArray, motion: Motion) -> FloatArray:
    """(k,n,8) of every channel, scaled to one standard deviation of each parameter (prior_sd)."""
    return np.moveaxis(columns(array, readings, time, motion) * prior_sds(array), 1, 0)
