"""What readers and writers agree on: units of signals and of time, and numbers that survive the way there and back."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, Kind, Sensor
from nineaudit.presets import nearest
from nineaudit.units import Quantity, factor

QUANTITY: Final[dict[Kind, Quantity]] = {"accelerometer": "acceleration", "gyroscope": "angular_rate"}

MCAP_ORIGIN: Final = "time_origin_ns"
"""Our metadata key in an MCAP log, whose times cannot be negative: nanoseconds to add to every log time."""
CAN_ORIGIN: Final = "nineaudit time origin {} s"
"""Our note in a CAN log, for the same reason: seconds to add to every stamp."""
_TIME_UNIT = re.compile(r"[_ \[(](s|sec|seconds?|ms|msec|us|µs|ns)[\])]?$")


def time_unit(name: str, stated: str | None) -> str | None:
    """Unit of a time column: as stated, else by the suffix of its name (time_ms, "Time [s]"), else None."""
    return stated or next(iter(_TIME_UNIT.findall(name)), None)


def can_origin(text: str) -> float:
    """Seconds that the note CAN_ORIGIN in `text` states, 0 without one."""
    found = re.search(re.escape(CAN_ORIGIN).replace(r"\{\}", r"([-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)"), text)
    return float(found[1]) if found else 0.0


def si_factor(sensor: Sensor, unit: str | None) -> float:
    """SI value of one unit of a signal: of the `unit` the recording states, else of the rig's; then over the
    sensor's calibrated scale. What was read is value·si_factor − sensor.offset.

    A recording in the rig's own unit is scaled as the rig says (mV by its sensitivity).
    Raises ConfigurationError naming signal and unit when the unit is unknown or of another quantity.
    """
    stated = (unit or "").strip()
    if not stated or stated == sensor.unit:
        return sensor.to_si
    return factor(stated, QUANTITY[sensor.kind], place=f"signal {sensor.signal}") / sensor.scale


def in_unit(values: FloatArray, scale: float, offset: float = 0.0) -> FloatArray:
    """Numbers q with q·scale − offset equal to `values` bit for bit, wherever the floats of a machine allow it.

    A quotient is rounded, and times `scale` it may miss by one unit in the last place; then a neighbour is taken
    that does not. Readings that came from a file (q·scale) are always met exactly; others to one such unit.
    """
    quotient = np.asarray((values + offset) / scale, dtype=np.float64)
    for towards in (np.inf, -np.inf):
        neighbour = np.nextafter(quotient, towards)
        better = (quotient * scale - offset != values) & (neighbour * scale - offset == values)
        quotient = np.where(better, neighbour, quotient)
    return quotient


def suggestion(name: str, known: Iterable[str]) -> str | None:
    """Advice that names what was probably meant, or else some of what there is; None where there is nothing."""
    names = list(dict.fromkeys(known))
    close = nearest(name, names)
    if close is not None:
        return f"did you mean {close!r}?"
    shown = ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
    return f"there is {shown}" if names else None
