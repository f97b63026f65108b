"""Gain and offset of a recording path from a staircase of known levels at its input [Becker75: ten steps].

    v_j = G·l_j + O + e_j,    linearity = largest |e| over the span of the readings

The path stands behind the sensor, whose scale and offset the rig states: together scale' = G·scale and
offset' = G·offset + O. Level and reading are in the unit of the rig.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray, Sensor
from nineaudit.calibrating.fit import least_squares
from nineaudit.errors import EstimationError
from nineaudit.units import counted

LEAST_LEVELS = 3
BECKER_LEVELS = 10


@dataclass(frozen=True)
class PathGain:
    """One path: reading = `gain`·level + `offset`, standard uncertainties `u_...`, in the unit of the reading.

    `rms` and `largest` residual, `linearity` = largest over span; `levels` that differ, `runs` that were used.
    """

    channel: str
    unit: str
    gain: float
    u_gain: float
    offset: float
    u_offset: float
    rms: float
    largest: float
    linearity: float
    levels: int
    dof: int
    runs: int


def staircase(sensor: Sensor, level: FloatArray, readings: FloatArray) -> PathGain:
    """Gain and offset of a sensor's path from `readings` (n,) at `level` (n,), NaN where not read.

    Raises EstimationError: fewer than three levels, or a path that does not follow them.
    """
    read = np.isfinite(readings)
    steps, values = level[read], readings[read]
    levels = len(np.unique(steps))
    if levels < LEAST_LEVELS:
        raise EstimationError(
            "a staircase of too few levels",
            place=f"channel {sensor.channel}",
            found=f"{counted(levels, 'level')} in {counted(len(values), 'run')}, rank {min(levels, 2)} of 2",
            expected=f"{LEAST_LEVELS} that differ; {BECKER_LEVELS} show whether the path is straight",
        )
    line = least_squares(steps[:, None], values)
    gain, u_gain = float(line.x[0]), math.sqrt(float(line.covariance[0, 0]))
    if not gain > 1e-6 + 3.0 * u_gain:
        raise EstimationError(
            "the path does not follow the staircase",
            place=f"channel {sensor.channel}",
            found=f"gain {gain:.3g} ± {u_gain:.2g}",
            expected="a positive gain, well above its uncertainty",
            advice="is it the right column, is the path inverted? The rig's axis says which way a channel points",
        )
    return PathGain(
        channel=sensor.channel,
        unit=sensor.unit,
        gain=gain,
        u_gain=u_gain,
        offset=float(line.x[1]),
        u_offset=math.sqrt(float(line.covariance[1, 1])),
        rms=line.rms,
        largest=line.largest,
        linearity=line.largest / float(np.ptp(values)),
        levels=levels,
        dof=line.dof,
        runs=len(values),
    )
