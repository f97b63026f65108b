"""Traces of a file in SI: the unit of each, and numbers that can be no readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from nineaudit.array import Sensor, read_only
from nineaudit.errors import ConfigurationError, RecordingError
from nineaudit.recording import Source, Trace
from nineaudit.signals import si_factor
from nineaudit.units import counted

if TYPE_CHECKING:
    from nineaudit.rig import Rig

LARGEST: Final = 1e75
"""m/s² or rad/s beyond which a number is no reading: its fourth power could not be held."""


def in_si(trace: Trace, rig: Rig, source: Source) -> tuple[Trace, str]:
    """Values in SI, calibrated, NaN where there is no number that can be a reading; and what is said of those."""
    sensor = rig.array[trace.channel]
    with np.errstate(over="ignore"):
        values = trace.values * _factor(sensor, trace.unit, source)
        values -= sensor.offset
    huge = int(np.count_nonzero(np.abs(values) >= LARGEST))
    values[~(np.abs(values) < LARGEST)] = np.nan
    said = f"{trace.channel}: {counted(huge, 'number')} beyond {LARGEST:g} m/s² or rad/s, no readings" if huge else ""
    return replace(trace, values=read_only(values)), said


def si_units(rig: Rig) -> dict[str, str]:
    """The unit of every channel in SI, as it is said."""
    return {s.channel: "m/s²" if s.kind == "accelerometer" else "rad/s" for s in rig.array.sensors}


def stated_units(traces: Sequence[Trace], rig: Rig) -> tuple[str, ...]:
    """A note on the channels whose unit the recording states otherwise than the rig."""
    other = [
        f"{t.channel} in {t.unit} (rig: {rig.array[t.channel].unit})"
        for t in traces
        if t.unit and t.unit.strip() != rig.array[t.channel].unit
    ]
    return (f"units as the recording states them: {', '.join(other)}",) if other else ()


def _factor(sensor: Sensor, unit: str | None, source: Source) -> float:
    """si_factor. RecordingError: the recording's unit is none of the quantity."""
    try:
        return si_factor(sensor, unit)
    except ConfigurationError as error:
        raise RecordingError(
            error.what,
            file=source.path,
            place=error.place,
            found=error.found,
            expected=error.expected,
            advice=f"if these readings are in the rig's {sensor.unit} all the same, mend that unit in the file or the "
            "database, or make the whole name of a table's column, brackets too, the rig's signal",
        ) from error
