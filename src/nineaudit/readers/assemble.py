"""Traces with clocks of their own become one Recording: the only place for clocks, units and gaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from nineaudit.array import BoolArray, FloatArray, frozen
from nineaudit.errors import RecordingError
from nineaudit.readers.clock import clock_of, in_order, reach
from nineaudit.readers.contents import Contents
from nineaudit.recording import Clock, Recording, Source, Trace
from nineaudit.signals import si_factor

if TYPE_CHECKING:
    from nineaudit.rig import Rig

LEAST_SAMPLES: Final = 8
"""Fewer samples than this are no recording."""
EPOCH_S: Final = 1e6
"""Later first stamps (11 days) are dates: as floating-point seconds they keep only parts of a microsecond."""


def assemble(contents: Contents, rig: Rig, source: Source) -> Recording:
    """One recording of a rig from the traces of a file.

    Units: what the recording states, else the rig's. Common time base: the stamps that all traces share, or those
    of the trace with most samples, onto which the others are interpolated linearly, valid only between samples no
    further apart than a gap. Samples whose stamp is not above all earlier ones are not used, but counted.
    Raises RecordingError: too few samples, or no time that the traces have in common; ConfigurationError: a unit.
    """
    by_channel = {trace.channel: trace for trace in contents.traces}
    traces = [by_channel[sensor.channel] for sensor in rig.array.sensors]
    origin, notes = _origin(traces)
    traces = [_in_si(trace, rig, origin) for trace in traces]
    usable = [in_order(trace.time) for trace in traces]
    clocks = tuple(clock_of(trace.time, used) for trace, used in zip(traces, usable, strict=True))
    native = tuple(_only(trace, used) for trace, used in zip(traces, usable, strict=True))
    base = max(native, key=lambda trace: trace.time.size)
    _require_samples(base, source)
    columns = [_on(base.time, trace, clock, source) for trace, clock in zip(native, clocks, strict=True)]
    readings = frozen(np.column_stack(columns))
    stated = _stated_units(contents.traces, rig)
    return Recording(
        time=base.time,
        readings=readings,
        valid=_read_only(np.isfinite(readings)),
        rig=rig,
        source=replace(source, notes=(*source.notes, *notes, *stated)),
        native=native,
        clocks=clocks,
        resampled=tuple(t.channel for t in native if not np.array_equal(t.time, base.time)),
    )


def _origin(traces: Sequence[Trace]) -> tuple[float, tuple[str, ...]]:
    """What is taken from all stamps, and the note that says so: dates are counted from the first of them."""
    starts = [float(trace.time[0]) for trace in traces if trace.time.size]
    first = min(starts, default=0.0)
    if abs(first) <= EPOCH_S:
        return 0.0, ()
    return first, (f"time stamps are dates; they are counted from the first, {first!r} s",)


def _in_si(trace: Trace, rig: Rig, origin: float) -> Trace:
    sensor = rig.array[trace.channel]
    factor = si_factor(sensor, trace.unit)
    values = np.where(np.isfinite(trace.values), trace.values * factor - sensor.offset, np.nan)
    return replace(trace, time=frozen(trace.time - origin), values=frozen(values))


def _only(trace: Trace, used: BoolArray) -> Trace:
    if used.all():
        return trace
    return replace(trace, time=frozen(trace.time[used]), values=frozen(trace.values[used]))


def _require_samples(base: Trace, source: Source) -> None:
    if base.time.size < LEAST_SAMPLES:
        raise RecordingError(
            "too few samples",
            file=source.path,
            found=f"{base.time.size} with a time stamp of their own",
            expected=f"{LEAST_SAMPLES} or more",
        )


def _on(time: FloatArray, trace: Trace, clock: Clock, source: Source) -> FloatArray:
    """(n,) readings of a trace at (n,) s, NaN where no valid samples close enough lie on both sides."""
    if np.array_equal(trace.time, time):
        return trace.values
    if trace.time.size < 2 or trace.time[0] > time[-1] or trace.time[-1] < time[0]:
        found = f"{trace.time[0]:.6g} s to {trace.time[-1]:.6g} s" if trace.time.size else "no samples"
        raise RecordingError(
            "no time in common with the other channels",
            file=source.path,
            place=f"channel {trace.channel}",
            found=found,
            expected=f"samples between {time[0]:.6g} s and {time[-1]:.6g} s",
        )
    return interpolate(time, trace, reach(clock))


def interpolate(time: FloatArray, trace: Trace, furthest: float) -> FloatArray:
    """(n,) values at (n,) s, linear between the samples on both sides; NaN where they are not within `furthest` s
    of each other, where one is not valid, and outside. On a sample's own stamp its value, whatever is next to it.
    """
    right = np.clip(np.searchsorted(trace.time, time), 1, trace.time.size - 1)
    left = right - 1
    step = trace.time[right] - trace.time[left]
    weight = (time - trace.time[left]) / step
    low, high = trace.values[left], trace.values[right]
    between = low + weight * (high - low)
    inside = (weight >= 0) & (weight <= 1) & (step <= furthest)
    values = np.where(inside, between, np.nan)
    return np.where(weight == 0, low, np.where(weight == 1, high, values))


def _stated_units(traces: Sequence[Trace], rig: Rig) -> tuple[str, ...]:
    """A note on the channels whose unit the recording states otherwise than the rig."""
    other = [
        f"{t.channel} in {t.unit} (rig: {rig.array[t.channel].unit})"
        for t in traces
        if t.unit and t.unit.strip() != rig.array[t.channel].unit
    ]
    return (f"units as the recording states them: {', '.join(other)}",) if other else ()


def _read_only(mask: BoolArray) -> BoolArray:
    mask.setflags(write=False)
    return mask
