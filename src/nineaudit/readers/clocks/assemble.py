"""Traces with clocks of their own become one Recording: the only place for clocks, units and gaps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from nineaudit.array import BoolArray, FloatArray, read_only
from nineaudit.errors import RecordingError
from nineaudit.identity import began, moment
from nineaudit.readers.clocks import alignment
from nineaudit.readers.clocks.clock import clock_of, in_order
from nineaudit.readers.clocks.resample import resample_columns
from nineaudit.readers.clocks.si import in_si, si_units, stated_units
from nineaudit.readers.contents import Contents
from nineaudit.recording import Alignment, Clock, Recording, Source, Trace
from nineaudit.units import counted

if TYPE_CHECKING:
    from nineaudit.rig import Rig

LEAST_SAMPLES: Final = 8
"""Fewer samples than this are no recording."""
LATEST_S: Final = 1e11
"""Seconds (3000 years): a stamp beyond is no time, or not in seconds."""
EPOCH_S: Final = 1e6
"""Later first stamps (11 days) are dates: as floating-point seconds they keep only parts of a microsecond."""


def assemble(contents: Contents, rig: Rig, source: Source, u_parts: Mapping[str, float] | None = None) -> Recording:
    """One recording of a rig from the traces of a file.

    Units: what the recording states, else the rig's. Common time base: the stamps that all traces share, or those
    of the trace with most samples, onto which the others are interpolated (resample.py), valid only between samples no
    further apart than a gap. What their clocks leave open about their time is added to the timing uncertainty of the
    recording's rig (alignment.py). Samples whose stamp is not above all earlier ones are not used, but counted.
    `u_parts`: standard uncertainty, s, of the clock of each channel, where each is in a part of the recording; the time
    base is then that during which all parts were recording.
    Raises RecordingError: too few samples, no time that the traces have in common, a unit that is none of the quantity.
    """
    by_channel = {trace.channel: trace for trace in contents.traces}
    traces, notes = _of_our_age([by_channel[sensor.channel] for sensor in rig.array.sensors], source)
    origin, dated = _origin(traces)
    inside, huge = zip(*(in_si(trace, rig, source) for trace in traces), strict=True)
    native, clocks = _on_their_clocks(inside, origin)
    shared = _shared(native, source) if u_parts else (-np.inf, np.inf)
    base = max(range(len(native)), key=lambda i: _inside(native[i].time, shared).size)
    time = _inside(native[base].time, shared)
    _require_samples(time, clocks[base], source)
    cut = _cut(native[base], time)
    columns, alignments = _on_one_base(time, native, clocks, base, source, u_parts or {})
    readings = read_only(np.column_stack(columns))
    said = alignment.notes(alignments, native[base].channel, clocks[base].rate, si_units(rig))
    stated = stated_units(contents.traces, rig)
    return Recording(
        time=time,
        readings=readings,
        valid=read_only(np.isfinite(readings)),
        rig=alignment.with_timing(rig, alignments),
        source=replace(
            source,
            notes=(*source.notes, *notes, *dated, *filter(None, huge), *cut, *said, *stated),
            stated=(*source.stated, *began(moment(origin, False), source.path.name)),
        ),
        native=native,
        clocks=clocks,
        resampled=tuple(a.channel for a in alignments),
        alignments=alignments,
        bus=contents.bus,
    )


def _shared(native: Sequence[Trace], source: Source) -> tuple[float, float]:
    """From when every part was recording until the first one ended, s."""
    longest = max(native, key=lambda trace: trace.time.size)
    for trace in native:
        _require_overlap(longest.time, trace, source)
    return max(float(t.time[0]) for t in native), min(float(t.time[-1]) for t in native)


def _inside(time: FloatArray, span: tuple[float, float]) -> FloatArray:
    kept = (time >= span[0]) & (time <= span[1])
    return time if kept.all() else read_only(time[kept])


def _cut(base: Trace, time: FloatArray) -> tuple[str, ...]:
    """A note on the stamps of the base that are not in the common time."""
    if time.size == base.time.size:
        return ()
    first = int(np.searchsorted(base.time, time[0]))
    last = base.time.size - first - time.size
    where = f"{first} samples at the start and {last} at the end are left out: not every part was recording"
    return (f"{base.channel}: {where}",)


def _on_one_base(
    time: FloatArray,
    native: Sequence[Trace],
    clocks: Sequence[Clock],
    base: int,
    source: Source,
    u_parts: Mapping[str, float],
) -> tuple[list[FloatArray], tuple[Alignment, ...]]:
    """The readings of every trace at `time`, stamps of `native[base]`, and how those came there that have others."""
    columns: list[FloatArray] = [np.empty(0)] * len(native)
    alignments: dict[int, Alignment] = {}
    for members in _messages(native):
        first, clock = native[members[0]], clocks[members[0]]
        if _equal(first.time, native[base].time):
            start = int(np.searchsorted(first.time, time[0]))
            for i in members:
                columns[i] = native[i].values[start : start + time.size]
            continue
        _require_overlap(time, first, source)
        together = np.column_stack([native[i].values for i in members])
        values, errors = resample_columns(time, first.time, together, clock, clocks[base].rate)
        for i, column, error in zip(members, values.T, errors.tolist(), strict=True):
            u_part = u_parts.get(native[i].channel)
            columns[i] = column
            alignments[i] = alignment.align(native[i], clock, native[base], clocks[base], error, u_part)
    if not u_parts:
        alignments = alignment.in_bursts(alignments, 1.0 / clocks[base].rate)
    return columns, tuple(alignments[i] for i in sorted(alignments))


def _messages(native: Sequence[Trace]) -> list[list[int]]:
    """Columns of the traces that have all stamps in common, and the samples that are not valid."""
    alike: list[list[int]] = []
    for i, trace in enumerate(native):
        home = next((members for members in alike if _same_samples(native[members[0]], trace)), None)
        alike.append([i]) if home is None else home.append(i)
    return alike


def _same_samples(one: Trace, other: Trace) -> bool:
    return _equal(one.time, other.time) and np.array_equal(np.isfinite(one.values), np.isfinite(other.values))


def _equal(one: FloatArray, other: FloatArray) -> bool:
    return one is other or np.array_equal(one, other)


def _origin(traces: Sequence[Trace]) -> tuple[float, tuple[str, ...]]:
    """What is taken from all stamps, and the note that says so: dates are counted from the first of them."""
    starts = [float(trace.time[0]) for trace in traces if trace.time.size]
    first = min(starts, default=0.0)
    if abs(first) <= EPOCH_S:
        return 0.0, ()
    return first, (f"time stamps are dates; they are counted from the first, {first!r} s",)


def _of_our_age(traces: Sequence[Trace], source: Source) -> tuple[list[Trace], list[str]]:
    """The traces without samples whose stamps are no times, and a note on those. RecordingError: too few left."""
    kept, notes = list[Trace](), list[str]()
    for trace in traces:
        good = np.abs(trace.time) < LATEST_S
        if np.count_nonzero(good) < min(LEAST_SAMPLES, trace.time.size):
            raise RecordingError(
                "time stamps that are no times in seconds",
                file=source.path,
                place=f"channel {trace.channel}",
                found=f"{trace.time[~good][0]:.6g} s",
                advice="state their unit in the rig file ([recording] time_unit)",
            )
        if not good.all():
            said = f"{trace.channel}: {counted(int((~good).sum()), 'sample')} stamped {trace.time[~good][0]:.6g} s"
            notes.append(f"{said} or the like, which is no time, left out")
            trace = replace(trace, time=trace.time[good], values=trace.values[good])
        kept.append(trace)
    return kept, notes


def _on_their_clocks(traces: Sequence[Trace], origin: float) -> tuple[tuple[Trace, ...], tuple[Clock, ...]]:
    """The samples that are used, counted from `origin`, and what each clock did. Traces of one clock share their array
    of stamps, and its analysis."""
    found = list[tuple[FloatArray, FloatArray, BoolArray, Clock]]()
    native, clocks = list[Trace](), list[Clock]()
    for trace in traces:
        known = next((x for x in found if _equal(x[0], trace.time)), None)
        if known is None:
            time = read_only(trace.time - origin)
            used = in_order(time)
            known = trace.time, time if used.all() else read_only(time[used]), used, clock_of(time, used)
            found.append(known)
        _, time, used, clock = known
        native.append(replace(trace, time=time, values=trace.values if used.all() else read_only(trace.values[used])))
        clocks.append(clock)
    return tuple(native), tuple(clocks)


def _require_samples(time: FloatArray, clock: Clock, source: Source) -> None:
    if time.size < LEAST_SAMPLES:
        disorder = f"{clock.duplicates} repeat one before them, {clock.backward} go back"
        raise RecordingError(
            "too few samples",
            file=source.path,
            found=f"{time.size} with a time stamp of their own",
            expected=f"{LEAST_SAMPLES} or more",
            advice=f"time stamps must increase: {disorder}" if clock.duplicates + clock.backward else None,
        )


def _require_overlap(time: FloatArray, trace: Trace, source: Source) -> None:
    if trace.time.size < 2 or trace.time[0] > time[-1] or trace.time[-1] < time[0]:
        found = f"{trace.time[0]:.6g} s to {trace.time[-1]:.6g} s" if trace.time.size else "no samples"
        if trace.time.size == 1:
            found = f"a single sample, at {trace.time[0]:.6g} s"
        raise RecordingError(
            "no time in common with the other channels",
            file=source.path,
            place=f"channel {trace.channel}",
            found=found,
            expected=f"samples between {time[0]:.6g} s and {time[-1]:.6g} s",
        )
