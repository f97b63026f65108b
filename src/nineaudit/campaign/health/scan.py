"""Does an unknown of the model change in the campaign? Score tests of steps, ramps and shock history.

A change x_i → x_i + β f(t) has, with every other unknown of the model eliminated, the score and the information

    u_f = Σ_j f_j A_ijᵀ (η'_j − Λ'_j A_j x̂),    I_ff' = Σ_j f_j f'_j A_ijᵀ Λ'_j A_ij − g_fᵀ H⁻¹ g_f',
    g_f = Σ_j f_j A_jᵀ Λ'_j A_ij

In H the level x_i has the prior of the rig's stated u. A constant error beyond u would pay for a change that lets the
level fall back to 0: its gain in Z² tends to x²/(1 + I_0), I_0 the information before the change, and a shape that soon
is constant would be found. A change shall be told by what changes alone: a free level, f' = 1, is eliminated too,

    u = u_f − (I_f1/I_11) u_1,    I = I_ff − I_f1²/I_11

and under no change Z = u/√I is standard normal (Rao 1948), whatever the level; the change itself is β = u/I. The
recordings of an unknown are put into at most BINS runs of equal length, and shapes are constant in each:

    step       from the start of a run on                 ramp        linear in time from the start of a run on
    count      recordings before, by their number         worst       hardest shock before, by its size

Where readings scatter more than the model says, as successive ones tell (von Neumann 1941), Z is made smaller by it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from statistics import NormalDist
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.campaign.health.crowd import BINS, LEAST_INFORMATION, LEAST_RECORDINGS, Track, track
from nineaudit.campaign.health.look import Look, Sight
from nineaudit.campaign.health.model import Change

FALSE_ALARM: Final = 1e-3
"""Probability that a sensor without a change is accused in a campaign."""
PER_SENSOR: Final = 8
"""Unknowns of a sensor and its seat: gain, two tilts each, three positions."""
SHAPES: Final = 2 * BINS
"""At most: steps at 49 places, ramps from 48, two shapes of shock history."""

EVEN: Final = 6
"""Digits of |Z| to which changes are equal, as a tilt of a sensor that never moved and its seat's: the first counts."""


ALIKE: Final = 1.3
"""Ratio of two scatters, each estimated by 30 recordings, within which they may be the same (2 standard deviations)."""


def threshold() -> float:
    """|Z| above which a change is significant: Bonferroni over all shapes of all unknowns of a sensor, two-sided."""
    return NormalDist().inv_cdf(1.0 - FALSE_ALARM / (2.0 * PER_SENSOR * SHAPES))


@dataclass(frozen=True, eq=False)
class Found:
    """The best change of one unknown: `shape` (step, ramp, count, worst) from `first` on, the index of a recording
    (the first that it can be in, and `earliest`, `latest` by shapes that explain nearly as much); `z`, what it is worth
    (`gain`, of 2 ln L), how far it goes (`size`), and the `track`."""

    unknown: int
    shape: str
    first: int
    earliest: int
    latest: int
    z: float
    gain: float
    size: float
    amount: FloatArray
    track: Track


def scan(seen: Look, size: int, margin: float = np.inf) -> list[Found]:
    """The best change of every unknown that is seen, the significant first, by what they explain, while Z² is within
    `margin` of the first; of what the model has already nothing is left to be seen. `size`: recordings of the
    campaign."""
    solution = seen.solution
    residuals = [solution.residual(one) for one in solution.marginals]
    ranked = [one for sight in seen.sights for one in _best(sight, residuals)]
    ranked.sort(key=lambda one: (abs(one.z[one.top]) < threshold(), -round(_gain(one), EVEN), one.unknown))
    return [_found(one, size) for one in ranked if _less(ranked[0], one) < margin]


@dataclass(frozen=True, eq=False)
class Best:
    """The largest |Z| of an unknown: the `place` of it in the crowd of `sight`, the shape `top` of all `z` (S,), its
    `size`, `each` (J,) recording's own, and what Z was divided by for their scatter (`wider`)."""

    unknown: int
    sight: Sight
    place: int
    top: int
    z: FloatArray
    size: float
    each: FloatArray
    wider: float


def _gain(one: Best) -> float:
    """2 Δ ln L of a change. A scatter that may be that of the model, estimated by so few, is no reason to take another:
    at Z = 50 a tenth of it is worth 500."""
    return float(one.z[one.top] * (one.wider if one.wider < ALIKE else 1.0)) ** 2


def _less(best: Best, one: Best) -> float:
    """By how much Z² of `one` is less. Of what explains the same, one has the recordings of a seat, another those of
    one stay there: their scatter is estimated by each, and where it is ALIKE, that of the best is taken for both."""
    alike = best.wider / ALIKE < one.wider < best.wider * ALIKE
    z = float(one.z[one.top]) * (one.wider / best.wider if alike else 1.0)
    return float(best.z[best.top]) ** 2 - z**2


def _best(sight: Sight, residuals: list[FloatArray]) -> list[Best]:
    """Of the unknowns of a crowd of which some shape can be told from what else is unknown."""
    crowd = sight.crowd
    scores = crowd.scores(residuals)
    by_bin = np.add.reduceat(scores, np.searchsorted(crowd.bin, np.arange(crowd.bins)), axis=1)
    part = sight.shared / sight.level[:, None]
    score = sight.shapes.applied(by_bin) - part * by_bin.sum(axis=1)[:, None]
    info = sight.info - part * sight.shared
    seen = info > LEAST_INFORMATION * np.maximum(sight.plain, 1.0)
    each = crowd.standardised(scores)
    wider = np.array([_excess(*one) for one in zip(each, crowd.weight, strict=True)])
    info = np.where(seen, info, 1.0)
    z = np.where(seen, score / np.sqrt(info), 0.0) / wider[:, None]
    tops = np.argmax(np.round(np.abs(z), EVEN), axis=1)
    return [
        Best(int(crowd.unknowns[i]), sight, i, k, z[i], float(score[i, k] / info[i, k]), each[i], float(wider[i]))
        for i, k in enumerate(tops.tolist())
        if seen[i].any()
    ]


def _found(one: Best, size: int) -> Found:
    sight, crowd, z, top = one.sight, one.sight.crowd, one.z, one.top
    names = sight.shapes.names
    near = [k for k, (name, _) in enumerate(names) if name == names[top][0] and z[top] ** 2 - z[k] ** 2 < 3.84]
    first, earliest = (int(crowd.index[np.searchsorted(crowd.bin, names[k][1])]) for k in (top, min(near)))
    latest = int(crowd.index[np.searchsorted(crowd.bin, names[max(near)][1], side="right") - 1])
    amount = np.zeros(size)
    amount[crowd.index] = sight.shapes.values(one.place, top)[crowd.bin]
    return Found(
        one.unknown,
        names[top][0],
        first,
        earliest,
        latest,
        float(z[top]),
        _gain(one),
        one.size,
        amount,
        track(crowd, one.place, one.each),
    )


def excess(track: Track) -> float:
    """Scatter of successive estimates over what the model says, 1 at least: a change is in few of the differences."""
    return _excess(track.z, track.weight)


def _excess(z: FloatArray, weight: FloatArray) -> float:
    told = weight > LEAST_INFORMATION
    if told.sum() < 2 * LEAST_RECORDINGS:
        return 1.0
    variance = 1.0 / weight[told]
    estimate = z[told] * np.sqrt(variance)
    steps = np.diff(estimate) ** 2 / (variance[1:] + variance[:-1])
    few = max(len(steps) // 25, 2)  # a bad test is in two differences; it is left to outlying()
    return float(np.sqrt(max(np.sort(steps)[:-few].mean() / _trimmed(few / len(steps)), 1.0)))


@cache
def _trimmed(part: float) -> float:
    """Mean of the squares of a standard normal without its largest `part`."""
    limit = NormalDist().inv_cdf(1.0 - part / 2.0)
    return (1.0 - part - 2.0 * limit * NormalDist().pdf(limit)) / (1.0 - part)


def outlying(found: Found) -> IntArray:
    """Bad tests: recordings unlike those about them without which a change is not significant; if it is, those of which
    one alone says more than the change."""
    track, wider = found.track, excess(found.track)
    near = np.array([np.median(track.z[max(i - 3, 0) : i + 4]) for i in range(len(track.z))])
    odd = np.abs(track.z - near) > 5.0 * wider
    if not odd.any():
        return np.zeros(0, dtype=np.intp)
    shape = found.amount[track.index]
    centred = shape - np.average(shape, weights=np.maximum(track.weight, LEAST_INFORMATION))
    kept = ~odd
    left = centred[kept] @ (track.z * np.sqrt(track.weight))[kept]
    power = float(np.sqrt((centred[kept] ** 2) @ track.weight[kept]))
    significant = abs(left) >= threshold() * power
    bad = odd & (np.abs(track.z) > abs(found.z) * wider) if significant else odd
    return np.asarray(track.index[bad])


def change(found: Found) -> Change:
    """The change as the model takes it."""
    return Change(found.unknown, found.amount)
