"""The channels of a large array left out one by one, and what their readings claim to be.

Evidence is the logarithm of how much better a fault explains a channel than its stated calibration errors do, all other
channels taken at their word. In exact Gaussian theory the evidence of no fault is the same whichever channel is left
out, so that the claims of different channels compare. Each fit starts anew from the rate sensors: the fit with every
channel in it may be bent by the fault.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from nineaudit.array import BoolArray
from nineaudit.estimate.claims import Claim, claims, taken_for
from nineaudit.estimate.model import Data
from nineaudit.estimate.prediction import predict
from nineaudit.estimate.separation import DETECTION_NATS
from nineaudit.estimate.student import StudentFit, first_fit, refit

FEW_CHANNELS = 24
"""Up to so many channels a fault bends the fit so far that a first look, with the channel still in it, says little:
each channel is left out in turn."""
SUSPECTS, PARTNERS = 4, 4
"""Channels left out of a larger array; channels among which a swap is looked for."""
RIVALS = 3
"""Channels that must look right once the best suspect is out."""
MISFIT = 2.0
"""Mean log(1 + χ²) of a channel over the usual one of its kind at which it is left out in any case."""
WORTH_NATS = 1.0
"""Evidence at the first look below which a channel of a larger array is not left out."""


@dataclass(frozen=True, eq=False)
class Suspect:
    """`channels` (columns) with the claim that explains them best, and the fit without them."""

    channels: tuple[int, ...]
    claim: Claim
    without: StudentFit


def suspects(data: Data, whole: StudentFit, raw_zero: BoolArray) -> tuple[Suspect, ...]:
    """Channels and pairs that may be swapped, with their best claims, best first. `raw_zero` (n,k) where an instrument
    put out exactly 0."""
    used = np.flatnonzero(data.used).tolist()
    if len(used) > FEW_CHANNELS:
        looks = {k: _best(data, k, whole, raw_zero).evidence for k in used}
        likely = [k for k in sorted(looks, key=lambda k: -looks[k])[:SUSPECTS] if looks[k] > WORTH_NATS]
        used = list(dict.fromkeys([*likely, *_misfits(data, whole, used)]))
    found = []
    for k in used:
        without = first_fit(_without(data, k))
        found.append(Suspect((k,), _best(data, k, without, raw_zero), without))
    found.sort(key=lambda x: -x.claim.evidence)
    found += _swaps(data, [x for x in found[:PARTNERS] if x.claim.evidence >= DETECTION_NATS])
    return tuple(sorted(found, key=lambda x: -x.claim.evidence))


def still_suspect(data: Data, best: Suspect, others: Sequence[Suspect], raw_zero: BoolArray) -> tuple[int, ...]:
    """Channels of `others` (the RIVALS best, pairs aside) that a fault still explains with the channels of `best` out
    of the array as well. A record with one fault has none."""
    rivals = [x.channels[0] for x in others if len(x.channels) == 1 and x.channels[0] not in best.channels][:RIVALS]
    out = []
    for k in rivals:
        left = _without(data, *best.channels)
        if _best(left, k, _settled(_without(left, k), best.without), raw_zero).evidence >= DETECTION_NATS:
            out.append(k)
    return tuple(out)


def _settled(data: Data, near: StudentFit) -> StudentFit:
    """The fit from the rate sensors; where that does not converge, the one from where a fit with more channels was."""
    fresh = first_fit(data)
    return fresh if fresh.converged else refit(data, near)


def _without(data: Data, *channels: int) -> Data:
    weight = data.weight.copy()
    weight[:, list(channels)] = 0.0
    return replace(data, weight=weight)


def _best(data: Data, channel: int, fitted: StudentFit, raw_zero: BoolArray) -> Claim:
    p = predict(data, channel, fitted)
    return claims(p, raw_zero[p.rows, channel])[0]


def _misfits(data: Data, whole: StudentFit, used: Sequence[int]) -> list[int]:
    """Channels that leave the fit far more than half of their kind do, whatever their fault is: at most three."""
    left = np.abs(whole.data.weight * (data.readings - whole.at.correction - whole.at.ideal))
    size = np.where(data.used, np.log1p(left**2).sum(axis=0) / np.maximum((data.weight > 0).sum(axis=0), 1), 0.0)
    held = data.array.is_accelerometer
    usual = {
        kind: float(np.median(size[[k for k in used if held[k] == kind]])) for kind in {bool(held[k]) for k in used}
    }
    odd = [k for k in used if size[k] > MISFIT * usual[bool(held[k])]]
    return sorted(odd, key=lambda k: -size[k])[: SUSPECTS - 1]


def _swaps(data: Data, found: Sequence[Suspect]) -> list[Suspect]:
    """Two channels taken for each other, among those that look wrong most."""
    kind, among = data.array.is_accelerometer, [x.channels[0] for x in found]
    out = []
    for i, j in combinations(among, 2):
        if kind[i] == kind[j]:
            without = first_fit(_without(data, i, j))
            a, b = predict(data, i, without), predict(data, j, without)
            total = taken_for(a, b.whole) + taken_for(b, a.whole)
            out.append(Suspect((i, j), Claim("swap", total), without))
    return out
