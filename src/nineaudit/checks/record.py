"""RQ201-204: does a channel's own trace show that it stopped following the signal?

What counts as evidence is told in estimate/evidence.py and estimate/flat_tops.py; here it is counted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from nineaudit.array import Sensor
from nineaudit.case import Case
from nineaudit.estimate.evidence import Stretch
from nineaudit.estimate.flat_tops import FlatTop
from nineaudit.estimate.single_channel import ChannelEvidence
from nineaudit.finding import Measure
from nineaudit.recording import Trace
from nineaudit.units import display


def stuck(case: Case) -> Sequence[Measure]:
    """RQ201: the longest run of one value while the array moves, against what noise and resolution explain."""
    out = []
    for sensor, trace, found in _channels(case):
        longest = max(found.stuck, key=len, default=None)
        at = "" if longest is None else f" at {_shown(case, sensor, longest.level)}"
        out.append(
            Measure(
                value=0.0 if longest is None else float(len(longest)),
                limit=found.stuck_limit,
                unit="samples",
                channels=(trace.channel,),
                interval=_interval(trace, found.stuck),
                detail=f"unexplained run of one value{at}",
            )
        )
    return out


def flat_topped(case: Case, *, max_samples: int) -> Sequence[Measure]:
    """RQ202: samples at a level at which the trace is flat-topped, at the rail or below it."""
    return [
        Measure(
            value=float(sum(len(s) for s in found.clipped)),
            limit=float(max_samples),
            unit="samples",
            channels=(trace.channel,),
            interval=_interval(trace, found.clipped),
            detail=_levels(case, sensor, found.flat_tops),
        )
        for sensor, trace, found in _channels(case)
    ]


def spiky(case: Case, *, max_spikes: int) -> Sequence[Measure]:
    """RQ203: isolated outliers that no other channel witnesses."""
    return [
        Measure(
            value=float(len(found.spikes)),
            limit=float(max_spikes),
            unit="spikes",
            channels=(trace.channel,),
            interval=_interval(trace, found.spikes),
            detail="isolated outliers,",
        )
        for _, trace, found in _channels(case)
    ]


def dropped_out(case: Case, *, max_samples: int) -> Sequence[Measure]:
    """RQ204: samples in stretches that are jumped to and from, at a constant value."""
    return [
        Measure(
            value=float(sum(len(s) for s in found.dropouts)),
            limit=float(max_samples),
            unit="samples",
            channels=(trace.channel,),
            interval=_interval(trace, found.dropouts),
            detail=_lost(case, sensor, found.dropouts),
        )
        for sensor, trace, found in _channels(case)
    ]


def _channels(case: Case) -> Iterator[tuple[Sensor, Trace, ChannelEvidence]]:
    traces = {trace.channel: trace for trace in case.recording.native}
    for sensor, found in zip(case.array.sensors, case.evidence, strict=True):
        yield sensor, traces[sensor.channel], found


def _interval(trace: Trace, stretches: tuple[Stretch, ...]) -> tuple[float, float] | None:
    """From the first to the last sample concerned."""
    if not stretches:
        return None
    first, last = min(s.start for s in stretches), max(s.stop for s in stretches)
    return float(trace.time[first]), float(trace.time[last - 1])


def _shown(case: Case, sensor: Sensor, value: float) -> str:
    unit = "m/s^2" if sensor.kind == "accelerometer" else "rad/s"
    return display(value, unit, case.recording.rig.units)


def _lost(case: Case, sensor: Sensor, dropouts: tuple[Stretch, ...]) -> str:
    if not dropouts:
        return "signal lost,"
    count = "once" if len(dropouts) == 1 else f"{len(dropouts)} times"
    return f"signal lost {count}, reading {_shown(case, sensor, dropouts[0].level)},"


def _levels(case: Case, sensor: Sensor, tops: tuple[FlatTop, ...]) -> str:
    """``flat-topped at 42 g (at the rail) in 1 stretch,``: where, and whether the sensor says so."""
    if not tops:
        return "flat-topped,"
    told = []
    for top in tops:
        where = "at the rail" if top.at_rail else "below the rail" if sensor.full_scale else "rail not stated"
        count = len(top.stretches)
        plural = "es" if count > 1 else ""
        told.append(f"{_shown(case, sensor, top.level)} ({where}) in {count} stretch{plural}")
    return f"flat-topped at {' and at '.join(told)},"


CHECKS = {"RQ201": stuck, "RQ202": flat_topped, "RQ203": spiky, "RQ204": dropped_out}
