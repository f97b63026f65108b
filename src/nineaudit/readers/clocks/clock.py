"""What the time stamps of one trace did: which are used, their interval, jitter, gaps and disorder."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.array import BoolArray, FloatArray
from nineaudit.recording import Clock

GAP: Final = 1.5
"""Sampling intervals beyond which two samples have a gap between them."""
_UNSTEADY: Final = 0.1  # of an interval: intervals that differ by less are alike
_STRIDE: Final = 32
_JITTER_REACH: Final = 5.0  # standard deviations of an interval: what jitter alone does not do
_NEIGHBOURS: Final = 4  # samples on both sides of a gap that must make up for it where nothing is lost
_MAD_TO_SD: Final = 1.4826  # of a normal distribution


def in_order(time: FloatArray) -> BoolArray:
    """(n,) true for the samples that are used: their stamp is above every earlier one that is used.

    A stamp that leaps ahead and comes back at once is itself out of order, not the many that follow it.
    """
    used = np.ones(time.size, dtype=np.bool_)
    if time.size > 2:
        steps = np.diff(time)
        back = np.flatnonzero((steps[1:] < 0) & (time[2:] > time[:-2])) + 1
        used[back[time[back] - time[back + 1] > 10 * np.median(np.abs(steps))]] = False
    kept = time[used]
    used[used] = np.r_[True, kept[1:] > np.maximum.accumulate(kept)[:-1]] if kept.size else used[used]
    return used


def clock_of(time: FloatArray, used: BoolArray) -> Clock:
    """Clock of a trace from all its stamps and which of them are used (see in_order). Times in s, rate in Hz."""
    kept, left_out = time[used], np.flatnonzero(~used)
    seen = np.maximum.accumulate(time)[np.maximum(left_out - 1, 0)] if left_out.size else left_out
    duplicates = int(np.count_nonzero(time[left_out] == seen))
    disorder = {
        "duplicates": duplicates,
        "backward": int(left_out.size) - duplicates,
        "first_disorder": float(time[left_out[0]]) if left_out.size else None,
    }
    if kept.size < 2:
        return Clock(rate=float("nan"), jitter=float("nan"), **disorder)  # type: ignore[arg-type]
    steps = np.diff(kept)
    interval, jitter = _interval(kept)
    late = np.flatnonzero(steps > _furthest(interval, jitter))
    return Clock(
        rate=1.0 / interval,
        jitter=jitter,
        gaps=tuple((float(kept[i]), float(kept[i + 1])) for i in late),
        lost=_lost(kept, late, interval),
        **disorder,  # type: ignore[arg-type]
    )


def _lost(time: FloatArray, late: NDArray[np.intp], interval: float) -> int:
    """About how many samples the gaps hold. `late`: the samples before them.

    A frame that waited makes one interval long and the next ones short, and nothing is lost: so the samples are
    counted over each gap with its neighbours, and gaps that are neighbours of each other are counted once.
    """
    lost = 0
    for group in np.split(late, np.flatnonzero(np.diff(late) > 2 * _NEIGHBOURS) + 1) if late.size else ():
        start, end = max(group[0] - _NEIGHBOURS, 0), min(group[-1] + 1 + _NEIGHBOURS, time.size - 1)
        lost += max(round((time[end] - time[start]) / interval) - int(end - start), 0)
    return lost


def reach(clock: Clock) -> float:
    """Longest interval, s, between two samples that is no gap: 1.5 sampling intervals, or what jitter explains."""
    return _furthest(1.0 / clock.rate, clock.jitter)


def _furthest(interval: float, jitter: float) -> float:
    return max(GAP * interval, interval + _JITTER_REACH * jitter)


def _interval(time: FloatArray) -> tuple[float, float]:
    """(sampling interval, robust standard deviation of the intervals) in s.

    Single intervals show the rate only as well as stamps are resolved (a date in floating-point seconds: 0.24 µs);
    so the median of many intervals at once, of those stretches where all are alike. Where stamps jitter (frames wait
    for the bus, or come in batches) no intervals are alike, and all stretches count.
    """
    steps = np.diff(time)
    interval = float(np.median(steps))
    jitter = deviation(steps, interval)
    stride = min(_STRIDE, time.size // 4)
    if stride > 1:
        odd = (np.abs(steps - interval) > _UNSTEADY * interval) & (jitter <= _UNSTEADY * interval)
        before = np.r_[0, np.cumsum(odd)]
        spans = (time[stride:] - time[:-stride])[before[stride:] == before[:-stride]]
        interval = float(np.median(spans)) / stride if spans.size else interval
    return interval, deviation(steps, interval)


def deviation(steps: FloatArray, interval: float) -> float:
    return _MAD_TO_SD * float(np.median(np.abs(steps - interval)))
