"""RQ101-105, RQ108: is the record complete, and were its samples taken when the time stamps say?

Time stamps are as recorded: `Clock` of each native trace. Channels with one clock are one subject.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from nineaudit.array import Sensor
from nineaudit.case import Case
from nineaudit.finding import Measure, NotApplicable
from nineaudit.recording import Alignment, Clock
from nineaudit.units import counted


def completeness(case: Case, *, max_missing: float) -> Sequence[Measure]:
    """RQ101: the part of each channel's samples that are not valid."""
    missing = 1.0 - case.recording.valid.mean(axis=0)
    return [
        Measure(
            value=float(part),
            limit=max_missing,
            unit="1",
            channels=(name,),
            interval=_invalid_interval(case, i),
            detail="missing part of the samples",
        )
        for i, (name, part) in enumerate(zip(case.recording.channels, missing, strict=True))
    ]


def gaps(case: Case, *, max_in_a_row: int) -> Sequence[Measure]:
    """RQ102: samples lost in the longest gap of each clock."""
    return [
        Measure(
            value=_lost(clock, _longest(clock)),
            limit=float(max_in_a_row),
            unit="samples",
            channels=channels,
            interval=_longest(clock),
            detail=f"{counted(len(clock.gaps), 'gap')}, about {counted(clock.lost, 'sample')} lost, the longest gap"
            if clock.gaps
            else "no gap, the longest",
        )
        for clock, channels in _clocks(case)
    ]


def jitter(case: Case, *, max_part: float) -> Sequence[Measure]:
    """RQ103: scatter of the sampling intervals as a part of the interval."""
    return [
        Measure(
            value=clock.jitter * clock.rate,
            limit=max_part,
            unit="1",
            channels=channels,
            detail=f"sampling intervals of {1e3 / clock.rate:.4g} ms scatter by",
        )
        for clock, channels in _clocks(case)
    ]


def disorder(case: Case, *, max_samples: int) -> Sequence[Measure]:
    """RQ104: samples with the time stamp of the one before them, or an earlier one."""
    return [
        Measure(
            value=float(clock.duplicates + clock.backward),
            limit=float(max_samples),
            unit="samples",
            channels=channels,
            interval=None if clock.first_disorder is None else (clock.first_disorder, clock.first_disorder),
            detail=f"{clock.duplicates} repeated and {clock.backward} backward time stamps,",
        )
        for clock, channels in _clocks(case)
    ]


def sampling_rate(case: Case, *, min_ratio: float, tolerance: float) -> Sequence[Measure] | NotApplicable:
    """RQ105: channel frequency class over sampling rate against 1/min_ratio; `tolerance` (relative) for the
    clock. Turned round, so that a slow record exceeds its limit."""
    cfc = case.recording.rig.cfc
    if cfc is None:
        return NotApplicable("the rig says that the recording is not filtered")
    return [
        Measure(
            value=cfc / clock.rate,
            limit=(1.0 + tolerance) / min_ratio,
            unit="1",
            channels=channels,
            detail=f"{clock.rate:.6g} Hz is {clock.rate / cfc:.4g} times CFC{cfc:g}; class over rate",
        )
        for clock, channels in _clocks(case)
    ]


def common_time(case: Case, *, coverage: float) -> Sequence[Measure] | NotApplicable:
    """RQ108: how far each clock runs away from the base's along the record, and how far their skew moves beside that,
    against `coverage` times what the rig and the alignment say of their timing."""
    if not case.recording.alignments:
        return NotApplicable("all channels have the same time stamps")
    alike: dict[tuple[float, ...], list[Alignment]] = {}
    for a in case.recording.alignments:
        covered = coverage * float(np.hypot(case.array[a.channel].u_timing, _base(case).u_timing))
        alike.setdefault((covered, a.drift, a.rate, *np.nan_to_num([a.skew, a.slip])), []).append(a)
    found = [measure for (covered, *_), group in alike.items() for measure in _against_base(case, group, covered)]
    return found or NotApplicable("no drift is seen, and the stamps are too coarse or too few to show a small one")


def _base(case: Case) -> Sensor:
    """The first channel whose time stamps are those of the common time base."""
    return next(s for s in case.array.sensors if s.channel not in case.recording.resampled)


def _against_base(case: Case, alike: Sequence[Alignment], covered: float) -> Iterator[Measure]:
    """What is measured of one clock: its drift, unless none is seen and none could be, and the change of its skew."""
    one, base = alike[0], _base(case).channel
    channels = tuple(a.channel for a in alike)
    span = float(case.time[-1] - case.time[0])
    if 2.0 * one.u_drift * span <= covered or abs(one.drift) > 2.0 * one.u_drift:
        ratio = f"{one.ratio[0]}:{one.ratio[1]}"
        off = f"{1e6 * one.drift:+.3g} ± {1e6 * one.u_drift:.2g} ppm off {ratio} against {base}"
        said = f"rate {off}: along {span:.3g} s their time runs apart by"
        yield Measure(abs(one.drift) * span, covered, "s", one.u_drift * span, channels, detail=said)
    if np.isfinite(one.slip):
        apart = f"stamped {1e3 * one.skew:.4g} ms after {base}" if np.isfinite(one.skew) else f"skew to {base} slides"
        said = f"{apart}, and besides a steady drift that changes by"
        yield Measure(one.slip, covered, "s", one.u_slip, channels, detail=said)


def _clocks(case: Case) -> Iterator[tuple[Clock, tuple[str, ...]]]:
    """Each distinct clock with its channels; no names where one clock serves the whole recording."""
    shared: dict[Clock, list[str]] = {}
    for trace, clock in zip(case.recording.native, case.recording.clocks, strict=True):
        shared.setdefault(clock, []).append(trace.channel)
    for clock, channels in shared.items():
        yield clock, () if len(shared) == 1 else tuple(channels)


def _longest(clock: Clock) -> tuple[float, float] | None:
    return max(clock.gaps, key=lambda gap: gap[1] - gap[0], default=None)


def _lost(clock: Clock, gap: tuple[float, float] | None) -> float:
    """Samples that a gap from the last sample before it to the first after it holds."""
    return 0.0 if gap is None else max(float(np.round((gap[1] - gap[0]) * clock.rate)) - 1.0, 0.0)


def _invalid_interval(case: Case, column: int) -> tuple[float, float] | None:
    """From the first to the last invalid sample."""
    bad = np.flatnonzero(~case.recording.valid[:, column])
    return None if not bad.size else (float(case.time[bad[0]]), float(case.time[bad[-1]]))


CHECKS = {
    "RQ101": completeness,
    "RQ102": gaps,
    "RQ103": jitter,
    "RQ104": disorder,
    "RQ105": sampling_rate,
    "RQ108": common_time,
}
