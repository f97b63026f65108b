"""Flat tops: where a channel stops following the signal at a level (SAE J211-1: look for overload in raw data).

A smooth peak falls off as L − c t²/2, so it stays within w of its top for a time ∝ √w: the stretch within 8 w is
2.8 times as long as the stretch within w. A clipped peak has steep edges instead: both are equally long.
That comparison needs no knowledge of the signal, and holds for noise and coarse quantisation alike, since both
only shorten the stretch within w. Three widths w are tried: identical values (a digital limit), four
quantisation steps (a limit that wriggles), five noise deviations (a limit before the noise is added).

The evidence of a flat stretch of n samples within w, m within 8 w, whose neighbours lie at least D lower, is
(n − 1 − (m − n)) ln(D/w): the chance that so many samples of a signal that changes by D from sample to sample
fall within w of its extreme. It adds over the stretches at one level.

Three things are flat and healthy: rest (the record begins or ends there, or nothing else moves), coasting (an
angular rate after a blow eases into its level) and a dropout (jumped to out of nowhere). They are told apart below;
a level at the stated full scale needs no such excuse.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.estimate.evidence import IntArray, Moving, Stretch, always, edge_slopes, resolution, true_runs

WIDER = 8.0
"""The wide tolerance over the narrow one."""
LONGEST = 1.5
"""Largest ratio of the two stretches that counts as flat: a parabola has 2.83, a fourth-order top 1.68."""
NATS_PER_SAMPLE = 7.0
"""Cap on the evidence of one sample (1 in 1100), so that no pair of equal samples convinces alone; and not more
than the logarithm of how many distinct values the trace has, which is all that is known of its resolution."""
RAIL_NATS = 9.2
"""Prior evidence (10⁴ : 1) of a level at the stated full scale."""


@dataclass(frozen=True)
class FlatTop:
    """A level at which a channel is flat: the `stretches` there, `level` in the unit of the trace, `nats` the
    evidence, `at_rail` whether the level is the stated full scale."""

    level: float
    stretches: tuple[Stretch, ...]
    nats: float
    at_rail: bool

    @property
    def samples(self) -> int:
        return sum(len(s) for s in self.stretches)


RAIL_TOLERANCE = 0.02
"""How far below the stated full scale, as a part of it, a level is still the rail."""


def is_rail(level: float, full_scale: float | None) -> bool:
    """Whether a level is at the stated full scale, or beyond it."""
    return full_scale is not None and abs(level) >= (1.0 - RAIL_TOLERANCE) * full_scale


def flat_tops(
    values: FloatArray,
    noise: float,
    *,
    full_scale: float | None = None,
    moving: Moving = always,
    shortest: int = 3,
    false_alarm: float = 1e-6,
) -> tuple[FlatTop, ...]:
    """Flat tops at the maximum and at the minimum of `values` (n,); at most one of each.

    `noise` and `full_scale` in the unit of the values. A level counts when one stretch holds `shortest` samples
    or more and the evidence reaches ln(1/false_alarm); a level at the rail needs less.
    """
    at = np.flatnonzero(np.isfinite(values))  # invalid samples neither end a stretch nor belong to one
    if at.size < 8 * shortest:
        return ()

    def moving_at(start: int, stop: int) -> bool:
        return moving(int(at[start]), int(at[stop - 1]) + 1)

    found = []
    for sign in (1.0, -1.0):
        signal = sign * values[at]
        top = float(signal.max())
        at_rail = is_rail(top, full_scale)
        needed = np.log(1.0 / false_alarm) - (RAIL_NATS if at_rail else 0.0)
        best = _best_width(signal, top, noise, moving_at, shortest, at_rail)
        if best is not None and best[1] >= needed:
            stretches = tuple(Stretch(int(at[s.start]), int(at[s.stop - 1]) + 1, sign * top, s.nats) for s in best[0])
            found.append(FlatTop(sign * top, stretches, best[1], at_rail))
    return tuple(found)


def _best_width(
    signal: FloatArray, top: float, noise: float, moving: Moving, shortest: int, at_rail: bool
) -> tuple[tuple[Stretch, ...], float] | None:
    """The most convincing of the three widths: its stretches and their evidence."""
    step = max(resolution(signal), 1e-9 * float(np.ptp(signal)))
    cap = min(NATS_PER_SAMPLE, float(np.log(np.unique(signal).size)))
    best: tuple[tuple[Stretch, ...], float] | None = None
    for near_width, width, noisy in (
        (0.0, step, False),
        (4 * step, 4 * step, False),
        (5 * noise, 5 * max(noise, step), True),
    ):
        needed = (4.5 if noisy else 3.0) * WIDER * width  # so that the way to the level is seen well
        if width <= 0.0 or top - signal.min() < needed:
            continue
        near = signal >= top - near_width - 1e-12 * abs(top)
        if not at_rail and _rests_there(signal >= top - WIDER * width, shortest):
            continue
        flats = [
            s
            for s in _flat_stretches(signal, near, top, width, cap)
            if (not noisy or _structureless(signal[s.start : s.stop]))
            and _arrives(signal, s, top, noise, width, at_rail)
            and (at_rail or not _eases(signal, s, top, width, dithered=noise > DITHERED * width))
            and (at_rail or moving(s.start - 1, s.stop + 1))
        ]
        nats = sum(s.nats for s in flats)
        if any(len(s) >= shortest for s in flats) and (best is None or nats > best[1]):
            best = _all_at_level(near, flats, top), nats
    return best


def _flat_stretches(signal: FloatArray, near: BoolArray, top: float, width: float, cap: float) -> Iterator[Stretch]:
    """Stretches within 8 widths of the top that are flat: at most LONGEST times what lies within one width."""
    starts, stops = true_runs(signal >= top - WIDER * width)
    count = np.concatenate([[0], np.cumsum(near)])
    for a, b in zip(*_inside(starts, stops, signal.size), strict=True):
        n, m = int(count[b] - count[a]), int(b - a)
        if n < 2 or m > LONGEST * n:
            continue
        members = np.flatnonzero(near[a:b]) + a
        drop = top - max(signal[a - 1], signal[b])
        nats = max(0, n - 1 - (m - n)) * min(float(np.log(drop / width)), cap)
        yield Stretch(int(members[0]), int(members[-1]) + 1, top, nats)


def _rests_there(close: BoolArray, shortest: int) -> bool:
    """Whether the record begins or ends at the level: then it is where the signal rests, not where it stops."""
    return bool(close[:shortest].all() or close[-shortest:].all())


def _inside(starts: IntArray, stops: IntArray, n: int) -> tuple[IntArray, IntArray]:
    """Runs that begin and end inside the record."""
    inside = (starts > 1) & (stops < n - 1)
    return starts[inside], stops[inside]


def _structureless(plateau: FloatArray) -> bool:
    """Whether the samples of a plateau scatter like noise: von Neumann's ratio, 2 for white noise, near 0 for a
    smooth curve. Needs 8 samples."""
    if plateau.size < 8:
        return False
    spread = float(np.var(plateau))
    return spread == 0.0 or float(np.mean(np.diff(plateau) ** 2)) / spread > 1.0


def _arrives(signal: FloatArray, s: Stretch, top: float, noise: float, width: float, at_rail: bool) -> bool:
    """Whether the signal outside was on its way to the level at both ends, within two sample intervals.

    A stretch that is jumped to out of nowhere is a dropout, not an overload; at the rail it is an overload.
    """
    if at_rail:
        return True
    edges = edge_slopes(signal, s.start, s.stop, top)
    return edges is not None and bool(np.all(edges[:, 0] <= 2.0 * edges[:, 1].clip(0) + 6.0 * noise + 4.0 * width))


COARSE = 240.0
"""Part of the range at which easing is looked for besides the width itself: from a tenth of the range away."""
DITHERED = 10.0
"""Noise over the width of a stretch from which noise alone would have broken the stretch up."""
EASED = 1.5
"""How much longer than at its own slope the signal must take to the level to count as coming to rest there."""


def _eases(signal: FloatArray, s: Stretch, top: float, width: float, *, dithered: bool) -> bool:
    """Whether the signal slows down towards the level, at either end: a body that coasts, not an overload.

    A signal cut off at a level goes on at its slope up to it; one that settles there, as an angular rate after a
    blow, eases in. Where noise of many widths would move a resting channel about (`dithered`), samples that stay
    within one width do not rest, however gently the signal came.
    """
    sides = signal[: s.start + 1][::-1], signal[s.stop - 1 :]
    scales = {width} if dithered else {width, max(width, float(np.ptp(signal)) / COARSE)}
    return any(_slows(top - side, scale) for side in sides for scale in scales)


def _slows(depth: FloatArray, width: float) -> bool:
    """Whether a signal left its level slowly; `depth` (m,) below it, from the last flat sample outwards.

    From 24 widths below the level, at the slope between 24 and 48 (or half the way to the bottom), the level is τ
    sample intervals away. It took more than EASED τ, and one for the sampling. (A fifth-order approach takes 2.4 τ,
    a parabola 1.6 τ.)
    """
    far = 3.0 * WIDER * width
    beyond = int(np.argmax(depth > far))
    if depth[beyond] <= far:
        return False
    deeper = min(2.0 * far, 0.5 * (far + float(depth.max())))
    farther = max(int(np.argmax(depth > deeper)), beyond + 1)
    if farther >= depth.size or depth[farther] <= depth[beyond]:
        return False
    slope = (depth[farther] - depth[beyond]) / (farther - beyond)
    return bool(beyond > EASED * depth[beyond] / slope + 1.0)


def _all_at_level(near: BoolArray, flats: list[Stretch], top: float) -> tuple[Stretch, ...]:
    """The flat stretches and every other sample at their level."""
    covered = near.copy()
    for s in flats:
        covered[s.start : s.stop] = True
    return tuple(Stretch(int(a), int(b), top) for a, b in zip(*true_runs(covered), strict=True))
