"""What one channel tells about itself, without physics: constant runs, flat tops, dropouts, spikes, steps.

Arrays in, arrays out. Every detector answers with stretches of samples (`Stretch`), so that a check can count
them, a report can mark them and a diagnosis can weigh them. Evidence is counted in nats: the logarithm of how
improbable the stretch is for a healthy channel. A wrong accusation is worse than none, so each detector asks
for several independent marks at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nineaudit.array import BoolArray, FloatArray

IntArray = NDArray[np.intp]
Moving = Callable[[int, int], bool]
"""Whether the rest of the array moves during samples start..stop-1 of the trace in question."""


@dataclass(frozen=True)
class Stretch:
    """Samples start..stop-1 of a trace, the `level` they stand at (unit of the trace), and the evidence, nats."""

    start: int
    stop: int
    level: float
    nats: float = 0.0

    def __len__(self) -> int:
        return self.stop - self.start


def always(_start: int, _stop: int) -> bool:
    """The array is taken to move all the time (or its other channels are not known)."""
    return True


def mask(stretches: tuple[Stretch, ...], n: int) -> BoolArray:
    """(n,) True in the stretches."""
    out = np.zeros(n, dtype=np.bool_)
    for s in stretches:
        out[s.start : s.stop] = True
    return out


def true_runs(flags: BoolArray) -> tuple[IntArray, IntArray]:
    """Starts and stops of the runs of True in `flags` (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return edges[::2], edges[1::2]


def constant_runs(values: FloatArray) -> tuple[IntArray, IntArray]:
    """Starts and stops of the runs of identical finite values, single samples included. NaN belongs to no run."""
    if not values.size:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    bounds = np.concatenate([[0], np.flatnonzero(values[1:] != values[:-1]) + 1, [values.size]])
    starts, stops = bounds[:-1], bounds[1:]
    finite = np.isfinite(values[starts])
    return starts[finite], stops[finite]


def resolution(values: FloatArray) -> float:
    """Quantisation step of `values` (n,): the smallest difference of two distinct values; 0 if not quantised.

    Differences below 1e-9 of the range are rounding of the number format. Values are quantised when their
    smaller differences (under ten steps) are whole numbers of steps, to a fifth of a step, nine times in ten:
    numbers at random are so four times in ten. Fewer than six differences count as quantised.
    """
    distinct = np.unique(values[np.isfinite(values)])
    steps = np.diff(distinct)
    steps = steps[steps > 1e-9 * np.ptp(distinct)] if distinct.size > 1 else steps
    if not steps.size:
        return 0.0
    ratio = steps[steps < 10.0 * steps.min()] / steps.min()
    whole = np.mean(np.abs(ratio - np.round(ratio)) < 0.2)
    return float(steps.min()) if steps.size < 6 or whole > 0.9 else 0.0


def moves(window: FloatArray, noise: FloatArray) -> bool:
    """Whether any column of `window` (m,k) scatters by more than three times its `noise` (k,), steps included."""
    finite = np.isfinite(window).all(axis=0)
    return bool(window.shape[0] > 1 and np.any(window[:, finite].std(axis=0) > 3.0 * noise[finite]))


def edge_slopes(values: FloatArray, start: int, stop: int, level: float) -> FloatArray | None:
    """How a stretch is entered and left: [[gap, slope], [gap, slope]] of its two ends; None at a record's end.

    `gap` is how far the sample outside lies from `level`; `slope` how much the signal moved towards `level` in
    the sample interval before that, both in the unit of the trace and positive towards the level.
    """
    if start < 2 or stop > values.size - 2:
        return None
    before, after = values[start - 1], values[stop]
    sides = ((before, before - values[start - 2]), (after, after - values[stop + 1]))
    out = [[abs(level - v), np.sign(level - v) * slope] for v, slope in sides]
    return np.array(out) if np.all(np.isfinite(out)) else None


BLOCK = 50
"""Samples over which the part of repeated readings is counted."""
FEWEST_BLOCKS = 2
"""Blocks outside a run without which nothing is known of the channel's noise."""
DITHERED = 0.7
"""Part of repeated readings up to which noise, not resolution, makes the next reading."""


def longest_by_chance(
    values: FloatArray, run: tuple[int, int], false_alarm: float, shortest: int
) -> tuple[float, bool]:
    """Longest run of identical values (samples) that a healthy channel has, and whether its noise dithers it.

    A part p of readings repeat the one before; a run of m then comes about n p^(m-1) times in n samples, so
    m = 1 + ln(n/false_alarm)/ln(1/p). p is that of the stillest block of the record outside `run` (start, stop).
    Without dither a smooth signal makes runs of any length at its turning points and at rest: then three times
    the longest other run. Never under `shortest`.
    """
    same = np.zeros(values.size, dtype=np.bool_)
    same[1:] = values[1:] == values[:-1]
    blocks = same[: values.size - values.size % BLOCK].reshape(-1, BLOCK).mean(axis=1)
    at = np.arange(blocks.size) * BLOCK
    outside = blocks[(at >= run[1]) | (at + BLOCK <= run[0])]
    p = max(float(outside.max(initial=0.0)), 1.0 / BLOCK)
    if p <= DITHERED and outside.size >= FEWEST_BLOCKS:
        return float(max(np.ceil(1.0 + np.log(values.size / false_alarm) / -np.log(p)), shortest)), True
    starts, stops = constant_runs(values)
    others = (stops - starts)[starts != run[0]]
    return float(max(3 * others.max(initial=0), shortest)), False


def stuck(
    values: FloatArray,
    *,
    moving: Moving = always,
    hurrying: Moving = always,
    excluded: BoolArray | None = None,
    false_alarm: float = 1e-6,
    shortest: int = 10,
) -> tuple[tuple[Stretch, ...], float]:
    """Runs of one identical value that noise and resolution do not explain while the array moves, and the limit.

    `values` (n,) as recorded; `excluded` (n,) samples explained otherwise (flat tops, dropouts). Returns the
    stretches and the longest run (samples) that counts as healthy. Of a channel that its noise does not dither
    (or that never changes at all) more is asked: the array must be `hurrying`, and the run begin and end
    abruptly.
    """
    starts, stops = constant_runs(values)
    order = [int(i) for i in np.argsort(starts - stops)[:MOST_RUNS] if stops[i] - starts[i] > shortest]
    found, limits = [], []
    for i in order:
        a, b = int(starts[i]), int(stops[i])
        limit, dithered = longest_by_chance(values, (a, b), false_alarm, shortest)
        limits.append(limit)
        if b - a <= limit or (excluded is not None and excluded[a:b].any()):
            continue
        if moving(a, b) if dithered else (hurrying(a, b) and _abrupt(stops - starts, i)):
            found.append(Stretch(a, b, float(values[a])))
    return tuple(sorted(found, key=lambda s: s.start)), max(limits, default=float(shortest))


MOST_RUNS = 20
"""How many of a channel's longest runs are looked at."""


def _abrupt(lengths: IntArray, i: int) -> bool:
    """Whether run i is twenty times as long as each of the three runs on either side.

    The longest run of a parabola is at most ten times its neighbour, of a fourth-order top at most eleven.
    """
    around = np.concatenate([lengths[max(i - 3, 0) : i], lengths[i + 1 : i + 4]])
    return bool(lengths[i] >= 20 * around.max(initial=0))


def dropouts(values: FloatArray, noise: float, *, shortest: int = 3) -> tuple[Stretch, ...]:
    """Stretches where the signal jumps to a constant value and jumps back.

    `values` (n,), `noise` its standard deviation in the same unit. The run holds `shortest` identical samples or
    more, and at both ends the signal jumps by at least eight times the noise and the resolution and four times
    its largest change in the three intervals outside: a genuine edge is sampled, a dropout is not. A level
    beyond everything outside it is no dropout but an overload, unless it is exactly 0.
    """
    floor = 8.0 * max(noise, resolution(values))
    starts, stops = constant_runs(values)
    long = (stops - starts >= shortest) & (starts >= 4) & (stops <= values.size - 4)
    out = []
    for a, b in zip(starts[long], stops[long], strict=True):
        before, after, level = values[a - 4 : a], values[b : b + 4], float(values[a])
        jumps = np.array([abs(before[-1] - level), abs(after[0] - level)])
        usual = np.array([np.abs(np.diff(before)).max(), np.abs(np.diff(after)).max()])
        if np.all(jumps > 4.0 * usual + floor) and (level == 0.0 or not _extreme(values, level)):
            out.append(Stretch(int(a), int(b), level))
    return tuple(out)


def _extreme(values: FloatArray, level: float) -> bool:
    return bool(level >= np.nanmax(values) or level <= np.nanmin(values))


def spikes(values: FloatArray, noise: float, *, threshold: float = 8.0) -> tuple[Stretch, ...]:
    """Isolated outliers of one or two samples.

    `values` (n,), `noise` its standard deviation in the same unit. The signal must jump out and back by
    `threshold` times the noise (or the resolution) and by five times the largest change among the three
    intervals on either side and across the outlier. A genuine pulse sampled four times on each edge never does
    that: its neighbours move by a quarter of its height at least.
    """
    floor = threshold * max(noise, resolution(values))
    found = [s for width in (1, 2) for s in _spikes_of(values, width, floor)]
    taken: list[Stretch] = []
    for s in sorted(found, key=lambda s: (s.start, len(s))):
        if not taken or s.start >= taken[-1].stop:
            taken.append(s)
    return tuple(taken)


def _spikes_of(values: FloatArray, width: int, floor: float) -> list[Stretch]:
    """Outliers of exactly `width` samples, by comparison of every sample with its surroundings at once."""
    n = values.size
    if n < width + 8:
        return []
    step = np.diff(values)
    at = np.arange(4, n - width - 3)  # first sample of the outlier
    rise, fall = step[at - 1], -step[at + width - 1]
    around = np.abs(np.stack([step[at + o] for o in (-4, -3, -2, width, width + 1, width + 2)]))
    across = np.abs(values[at + width] - values[at - 1])
    usual = np.maximum(around.max(axis=0), across)
    height = np.minimum(np.abs(rise), np.abs(fall))
    hit = at[(rise * fall > 0) & (height > floor + 5.0 * usual)]
    return [Stretch(int(i), int(i) + width, float(values[i])) for i in hit]
