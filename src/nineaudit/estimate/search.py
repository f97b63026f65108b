"""The search through the hypotheses: which are tried, in which order, and what each channel's best is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from nineaudit.array import BoolArray
from nineaudit.estimate import hypotheses as h
from nineaudit.estimate import refitted
from nineaudit.estimate.hypotheses import Hypothesis
from nineaudit.estimate.model import Data
from nineaudit.estimate.motion import has_rates
from nineaudit.estimate.separation import ENOUGH
from nineaudit.estimate.trajectory import Fit, fit
from nineaudit.physics import rigid_body

FEW_CHANNELS = 12
"""Up to so many channels every one is left out in turn; of larger arrays the most suspect ones."""
SUSPECTS, CONTENDERS, CONFIRMED = 6, 3, 2
"""Channels left out of a larger array; channels looked at closely; shapes of each fitted on their own."""
WHOLE = 1.1
"""Cost per degree of freedom above which faults of two channels are tried, whatever the limit is."""
FAR, HOPELESS = 300.0, 2.0
"""Cost by which a channel's absence may mend less than the best one's; cost per degree of freedom over the lowest at
which a fit without a channel is given up."""
SMALL_GAIN = 0.3
"""Gain error up to which its linear shape is as good as the gain itself."""
LARGE = 3.0
"""What a sample of a channel costs, over what a healthy one does, where its fault bends the fit that uses it."""
CLOSE_NATS = 20.0
"""Linear evidence under the best shape's at which another needs no fit of its own."""
WORTH_NATS = 4.0
"""Linear evidence below which no small fault needs a closer look."""


@dataclass(frozen=True, eq=False)
class Search:
    """`healthy` the fit of no fault, `found` hypotheses best first (empty: nothing worth a look), and `without` the
    fits without one channel, by column."""

    healthy: Fit
    found: tuple[Hypothesis, ...]
    without: dict[int, Fit]


def search(healthy: Fit, onset: int, wrong: BoolArray, limit: float) -> Search:
    """Compare the hypotheses about the readings of the `healthy` fit. `onset` first sample of the event; `wrong` (n,k)
    samples that their own trace shows to be wrong; `limit` of the cost per degree of freedom of one that holds."""
    data = healthy.data
    reference = h.log_evidence(healthy)
    small = h.small_faults(healthy, onset, reference)
    if healthy.statistic <= limit and max(x.evidence for x in small) < WORTH_NATS and not wrong.any():
        return Search(healthy, (), {})
    suspects = _suspects(healthy, small, wrong)
    without = _leave_out(data, healthy, suspects, small)
    close = _contenders(without, small, wrong)
    without |= {k: fit(f.data, f.omega, f.theta) for k in close if not (f := without[k]).converged}
    found = [x for k in close for x in _closely(data, healthy, without[k], k, onset, wrong[:, k], small, reference)]
    found += [refitted.left_out(data, f, k, reference) for k, f in without.items() if k not in close]
    left = max(found, key=lambda x: x.evidence).statistic if found else np.inf
    if left > min(limit, WHOLE):
        found += _swaps(healthy, without, close, min((x.statistic for x in found), default=np.inf), reference)
    if left > limit:
        found += _of_two(data, without, close, reference)
    return Search(healthy, tuple(sorted(found, key=lambda x: -x.evidence)), without)


def _suspects(healthy: Fit, small: Sequence[Hypothesis], wrong: BoolArray) -> list[int]:
    """Every channel of a small array; of a larger one those with the largest residuals, best shapes, wrong samples."""
    data = healthy.data
    used = np.flatnonzero((data.weight > 0).any(axis=0)).tolist()
    if len(used) <= FEW_CHANNELS:
        return used
    left = data.weight * (data.readings - healthy.correction - healthy.ideal)
    by_residual = np.argsort(-np.sum(left**2, axis=0))[:SUSPECTS].tolist()
    by_shape = [x.channels[0] for x in sorted(small, key=lambda x: -x.evidence)[:SUSPECTS]]
    return sorted({*by_residual, *by_shape, *np.flatnonzero(wrong.any(axis=0)).tolist()[:SUSPECTS]} & set(used))


def _leave_out(data: Data, healthy: Fit, suspects: Sequence[int], small: Sequence[Hypothesis]) -> dict[int, Fit]:
    """The fits without one channel, the likeliest first, so that hopeless ones can be given up early."""
    likely: list[int] = []
    for x in sorted(small, key=lambda x: -x.evidence):
        if x.channels[0] in suspects and x.channels[0] not in likely:
            likely.append(x.channels[0])
    found: dict[int, Fit] = {}
    lowest = np.inf
    for k in [*likely, *(k for k in suspects if k not in likely)]:
        if not _determined_without(data, k):
            continue
        found[k] = h.without(data, healthy, k, hopeless=lowest + HOPELESS * data.dof)
        lowest = min(lowest, found[k].cost)
    return found


def _determined_without(data: Data, *channels: int) -> bool:
    """Whether the other channels still determine the motion: the accelerometers, but for one direction of α that
    products of ω may tell (coplanar triaxes), or rates on three axes."""
    kept = [k for k in np.flatnonzero((data.weight > 0).any(axis=0)).tolist() if k not in channels]
    array = data.array.select(kept)
    held = array.is_accelerometer
    design = rigid_body.design(array.positions[held], array.axes[held])
    rank = int(np.linalg.matrix_rank(design, tol=1e-6)) if held.any() else 0
    return rank >= 5 or (has_rates(array) and int(held.sum()) >= 3)


def _contenders(without: dict[int, Fit], small: Sequence[Hypothesis], wrong: BoolArray) -> list[int]:
    """The channels to look at closely. A free waveform explains at least as well as any fault of its channel, so
    that a channel whose absence mends far less than another's is out."""
    excess = {k: f.cost - f.data.dof for k, f in without.items()}
    lowest = min(excess.values(), default=0.0)
    scale = max(1.0, min((f.statistic for f in without.values()), default=1.0))
    hopeful = [k for k in without if excess[k] - lowest < FAR * scale]
    mends = sorted(hopeful, key=lambda k: excess[k])[:CONTENDERS]
    explains: list[int] = []
    for x in sorted(small, key=lambda x: -x.evidence):
        if x.channels[0] in hopeful and x.channels[0] not in explains and x.evidence > WORTH_NATS:
            explains.append(x.channels[0])
    return sorted({*mends, *explains[:CONTENDERS], *(k for k in hopeful if wrong[:, k].any())})


def _closely(
    data: Data,
    healthy: Fit,
    left: Fit,
    channel: int,
    onset: int,
    wrong: BoolArray,
    small: Sequence[Hypothesis],
    reference: float,
) -> list[Hypothesis]:
    """Everything about one channel, the best shapes fitted on their own."""
    shapes = [(x, healthy) for x in small if x.channels == (channel,)]
    large = healthy.cost - left.cost > LARGE * float((data.weight[:, channel] > 0).sum())
    shapes += [(x, left) for x in h.curves(data, left, channel, onset, reference, large)]
    shapes.sort(key=lambda pair: -pair[0].evidence)
    likely = [pair for pair in shapes[:CONFIRMED] if pair[0].evidence > shapes[0][0].evidence - CLOSE_NATS]
    # evidence about the fit without the channel may promise too much: it must not keep the best of the other out
    mine = [x for x, near in shapes if near is healthy and x.evidence > WORTH_NATS][:1]
    likely += [(x, healthy) for x in mine if all(x is not other for other, _ in likely)]
    found = [h.confirm(data, near, x, reference) for x, near in likely]
    found.append(refitted.any_waveform(data, left, channel, reference))
    # where a small gain mends the record, a large one is the same
    mended = found[0].word == "gain" and found[0].statistic <= WHOLE and abs(found[0].parameters["size"]) < SMALL_GAIN
    ways = (refitted.noisy, refitted.delayed) if mended else (refitted.scaled, refitted.noisy, refitted.delayed)
    found += [x for way in ways if (x := way(data, left, channel, reference)) is not None]
    if wrong.any():
        found.append(refitted.without_samples(data, left, channel, wrong, reference))
    return found


def _swaps(
    healthy: Fit, without: dict[int, Fit], close: Sequence[int], best: float, reference: float
) -> list[Hypothesis]:
    """No single channel mends the record (`best`: what it costs at best): two of them taken for each other."""
    data = healthy.data
    kinds = data.array.is_accelerometer
    among = list(without) if len(without) <= FEW_CHANNELS else list(close)
    pairs = [(i, j) for i, j in combinations(among, 2) if kinds[i] == kinds[j]]
    likely = refitted.swap_costs(healthy, pairs, ENOUGH)[:2]
    return [refitted.swapped(data, pair, reference, HOPELESS * best * data.dof, len(pairs)) for _, pair in likely]


def _of_two(data: Data, without: dict[int, Fit], close: Sequence[int], reference: float) -> list[Hypothesis]:
    """The best of one channel is not that of a healthy record: two of them free."""
    found = []
    for i, j in combinations(close, 2):
        if not _determined_without(data, i, j):
            continue
        both = h.without(h.masked(data, i), without[i], j)
        if both.data.dof > 0:
            found.append(refitted.two_waveforms(data, both, (i, j), reference))
    return found
