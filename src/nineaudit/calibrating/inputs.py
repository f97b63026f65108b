"""What each sensor felt in the runs of a calibration: gravity, and on a rate table the centripetal acceleration.

On a table that turns at Ω about the vertical, the origin of the rig at R·o from its axis (o the body direction that
points away from the axis, u the one that points up), a sensor at r feels

    f = Ω u × (Ω u × (R o + r)) + g u        accelerometer: specific force, m/s²
    f = Ω u                                  rate sensor, rad/s; Ω > 0 is counter-clockwise seen from above

Held still, Ω = 0: gravity alone, ±g along the six body directions in six flips.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, Sensor
from nineaudit.calibrating.sheet import Sheet, directions, in_unit_of
from nineaudit.errors import RecordingError

RATE: Final = {
    "rate_rad_s": 1.0, "rate_deg_s": math.pi / 180.0, "rate_rpm": math.pi / 30.0,
}  # fmt: skip
RADIUS: Final = {"radius_m": 1.0, "radius_cm": 1e-2, "radius_mm": 1e-3, "radius_in": 0.0254}
FLIP_COLUMNS: Final = ("up",)
TABLE_COLUMNS: Final = ("up", "out", *RATE, *RADIUS)
_SQUARE: Final = math.sin(math.radians(5.0))
"""`up` and `out` are set by hand to some degrees: beyond, one of them was written down wrong."""


@dataclass(frozen=True, eq=False)
class Runs:
    """Of every run, `up` and `out` (n,3) unit vectors in the body, `rate` (n,) rad/s, `radius` (n,) m."""

    up: FloatArray
    out: FloatArray
    rate: FloatArray
    radius: FloatArray


def flips(sheet: Sheet) -> Runs:
    """Static positions: the column `up` says which body direction pointed up. RecordingError where it does not."""
    up = directions(sheet, "up")
    nothing = np.zeros(len(up))
    return Runs(up, np.roll(up, 1, axis=1), nothing, nothing)


def rate_table(sheet: Sheet) -> Runs:
    """Runs on a rate table: columns `up`, `out`, one of RATE, one of RADIUS (of the rig's origin from the axis).

    Raises RecordingError: a column that is missing or bad, a run whose `up` and `out` are not at right angles.
    """
    up, out = directions(sheet, "up"), directions(sheet, "out")
    cosine = np.einsum("ni,ni->n", up, out)
    slanted = np.flatnonzero(np.abs(cosine) > _SQUARE)
    if slanted.size:
        angle = math.degrees(math.acos(float(np.clip(cosine[slanted[0]], -1.0, 1.0))))
        raise RecordingError(
            "up and out are not at right angles",
            file=sheet.path,
            place=f"line {sheet.lines[slanted[0]]}",
            found=f"{angle:.1f}°",
            expected="90° within 5°: the table's axis is vertical",
        )
    return Runs(up, out, in_unit_of(sheet, RATE), in_unit_of(sheet, RADIUS))


def felt(sensor: Sensor, runs: Runs, gravity: float) -> FloatArray:
    """f (n,3) at a sensor in every run, m/s² or rad/s, body frame; `gravity` of the place in m/s²."""
    turning = runs.rate[:, None] * runs.up
    if sensor.kind == "gyroscope":
        return turning
    place = runs.radius[:, None] * runs.out + sensor.position
    return np.asarray(np.cross(turning, np.cross(turning, place)) + gravity * runs.up)


METHODS: Final[Mapping[str, tuple[Callable[[Sheet], Runs], tuple[str, ...]]]] = {
    "rate-table": (rate_table, TABLE_COLUMNS),
    "flips": (flips, FLIP_COLUMNS),
}
"""By name, what reads the runs, and the columns that are not channels."""
