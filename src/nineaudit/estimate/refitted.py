"""Hypotheses that need a fit of their own: another gain, noise, samples left out, a free waveform, channels swapped.

Each is compared by its log evidence (hypotheses.py), in nats over the `reference` of no fault.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from nineaudit.array import BoolArray
from nineaudit.estimate.calibration import PARAMETERS
from nineaudit.estimate.hypotheses import LOOK, Hypothesis, log_evidence, masked, theta_for
from nineaudit.estimate.model import Data
from nineaudit.estimate.separation import coarser
from nineaudit.estimate.shapes import DELAY_SD, GAIN_SD
from nineaudit.estimate.start import first_omega
from nineaudit.estimate.trajectory import ROUGH, Fit, fit

LONGEST_DELAY = 5e-3
"""s, looked for."""
_TIMING = PARAMETERS.index("timing")
SECOND_NATS = 10.0
"""Prior odds of a second fault, 1 to 1000, and in which of some tens of pairs."""
TRACE_NATS = 8.0
"""What it costs that a trace may show samples as wrong that are not."""


def scaled(data: Data, left: Fit, channel: int, reference: float) -> Hypothesis | None:
    """The channel with another gain, y = (1 + g) ŷ: polarity, wrong unit, wrong sensitivity; None where ŷ is lost in
    noise. g from the regression on ŷ without the channel, the readings divided by it (and their weight multiplied), and
    the rest left to a fit with a prior of a tenth; repeated until it settles.
    """
    truth, weight = left.ideal[:, channel], data.weight[:, channel]
    if _lost_in_noise(data, left, channel):
        return None
    factor = float((weight**2 * truth) @ data.readings[:, channel]) / float((weight**2 * truth) @ truth)
    prior = data.prior_sd.copy()
    prior[channel, 0] = 0.1
    omega = left.omega
    for _ in range(3):
        if abs(factor) < 1e-3:
            return None
        readings, weights = data.readings.copy(), data.weight.copy()
        readings[:, channel] /= factor
        weights[:, channel] *= abs(factor)
        found = fit(replace(data, readings=readings, weight=weights, prior_sd=prior), omega, None, LOOK, ROUGH)
        place = np.flatnonzero((found.data.active[0] == channel) & (found.data.active[1] == 0))
        more = float(found.theta[place[0]]) * 0.1
        omega, factor = found.omega, factor * (1.0 + more)
        if abs(more) < 0.01:
            break
    occam = 0.5 * ((factor - 1.0) / GAIN_SD) ** 2 if abs(factor) < 3 else 10.0
    evidence = log_evidence(found) - reference - min(occam, 10.0) - float(np.log(GAIN_SD / 0.1))
    return Hypothesis((channel,), "gain", evidence, found.statistic, {"factor": factor})


def _lost_in_noise(data: Data, left: Fit, channel: int) -> bool:
    """Whether what the others predict of a channel is hardly more than its own noise, twice that of a reading."""
    weight = data.weight[:, channel]
    return float(((weight * left.ideal[:, channel]) ** 2).sum()) < 40.0 * float((weight > 0).sum())


def delayed(data: Data, left: Fit, channel: int, reference: float) -> Hypothesis | None:
    """The channel late by many samples: moved by the whole number of them that correlates best with what the others
    predict, the rest of the delay left to its time skew with a prior of 1 ms. None where that is none, or where the
    prediction is lost in noise.

    Its noise then meets another stretch of the others': costs differ by chance with variance 4 × 0.6 a sample (0.6 of
    it left by the fit), of which two standard deviations are taken off.
    """
    if _lost_in_noise(data, left, channel):
        return None
    weight, count = data.weight[:, channel], len(data.time)
    truth, step = left.ideal[:, channel], float(np.median(data.step))
    most = min(int(LONGEST_DELAY / step), count // 4)
    seen = np.where(weight > 0, data.readings[:, channel], truth)
    lags = np.arange(-most, most + 1)
    inner = truth[most : count - most]
    misses = [float(((seen[most + lag : count - most + lag] - inner) ** 2).sum()) for lag in lags]
    lag = int(lags[int(np.argmin(misses))])
    if lag == 0:
        return None
    readings, weights, prior = data.readings.copy(), data.weight.copy(), data.prior_sd.copy()
    readings[:, channel], weights[:, channel] = np.roll(seen, -lag), np.roll(weight, -lag)
    weights[count - lag if lag > 0 else 0 : count if lag > 0 else -lag, channel] = 0.0
    prior[channel, _TIMING] = DELAY_SD
    part = replace(data, readings=readings, weight=weights, prior_sd=prior)
    found = fit(part, left.omega, theta_for(part, left), LOOK, ROUGH)
    place = np.flatnonzero((part.active[0] == channel) & (part.active[1] == _TIMING))
    rest = float(found.theta[place[0]]) * DELAY_SD if len(place) else 0.0
    used = float((weights[:, channel] > 0).sum())
    chance = float(np.sqrt(2.4 * used))
    price = 0.5 * (float((weight > 0).sum()) - used) + chance + float(np.log(len(lags)))
    evidence = log_evidence(found) - price - reference
    return Hypothesis((channel,), "delay", evidence, found.statistic, {"size": lag * step + rest}, chance=chance)


def without_samples(data: Data, left: Fit, channel: int, wrong: BoolArray, reference: float) -> Hypothesis:
    """The channel without the samples that its own trace shows to be wrong, and as measured elsewhere.

    A flat top or a dropout is predicted by its level: those samples cost what healthy ones are expected to. One fault
    makes many spikes, and the trace alone tells their places.
    """
    part = masked(data, channel, wrong)
    found = fit(part, left.omega, theta_for(part, left), LOOK, ROUGH)
    evidence = log_evidence(found) - 0.5 * float(wrong.sum()) - reference - TRACE_NATS
    return Hypothesis((channel,), "samples", evidence, found.statistic)


def any_waveform(data: Data, left: Fit, channel: int, reference: float) -> Hypothesis:
    """The channel free wherever it leaves what the others predict (by six times its noise), measured elsewhere.

    A free sample costs the logarithm of how much wider than the noise it may lie.
    """
    free = _free(data, left, channel)
    if free.mean() > 0.9:
        price = _price(data, left, channel)
        return Hypothesis((channel,), "unknown", log_evidence(left) - price - reference, left.statistic)
    part = masked(data, channel, free)
    found = fit(part, left.omega, theta_for(part, left), LOOK, ROUGH)
    kept = 0.5 * float((~free & (data.weight[:, channel] > 0)).sum())
    price = _price(data, left, channel) - kept
    return Hypothesis((channel,), "unknown", log_evidence(found) - price - reference, found.statistic)


def left_out(data: Data, left: Fit, channel: int, reference: float) -> Hypothesis:
    """The channel free throughout, each sample at its price."""
    weight = data.weight[:, channel]
    price = float((weight > 0).sum()) * (0.5 + _freedom(data, channel))
    return Hypothesis((channel,), "unknown", log_evidence(left) - price - reference, left.statistic)


def two_waveforms(data: Data, left: Fit, pair: tuple[int, int], reference: float) -> Hypothesis:
    """Two channels free, `left` the fit without both. Two independent faults are as rare again as one."""
    price = sum(_price(data, left, channel) for channel in pair) + SECOND_NATS
    return Hypothesis(pair, "unknown", log_evidence(left) - price - reference, left.statistic)


def _free(data: Data, left: Fit, channel: int) -> BoolArray:
    off = data.weight[:, channel] * np.abs(data.readings[:, channel] - left.ideal[:, channel])
    return np.asarray(off > 6.0)


def _price(data: Data, left: Fit, channel: int) -> float:
    """Nats of a channel that was left out: what a healthy sample is expected to cost, and each free one its freedom."""
    healthy = 0.5 * float((data.weight[:, channel] > 0).sum())
    return healthy + float(_free(data, left, channel).sum()) * _freedom(data, channel)


def _freedom(data: Data, channel: int) -> float:
    """Nats of one free sample: the logarithm of how much wider than the noise it may lie."""
    weight = data.weight[:, channel]
    return float(np.log(max(float(np.abs(data.readings[:, channel]).max() * weight.max()), 10.0)))


def noisy(data: Data, left: Fit, channel: int, reference: float) -> Hypothesis | None:
    """The channel with more noise than stated, the factor from what it leaves of the others' prediction; None where
    that does not change sign from sample to sample like noise."""
    weight = data.weight[:, channel]
    off = (weight * (data.readings[:, channel] - left.ideal[:, channel]))[weight > 0]
    levels, changes = (float(np.median(x**2)) / 0.455 for x in (off, np.diff(off) / np.sqrt(2.0)))
    factor = float(np.sqrt(max(min(levels, 2.0 * changes) - 1.6, 0.0)))
    if factor < 1.5:
        return None
    weights = data.weight.copy()
    weights[:, channel] /= factor
    part = replace(data, weight=weights)
    found = fit(part, left.omega, theta_for(part, left), LOOK, ROUGH)
    price = float((weight > 0).sum()) * float(np.log(factor))
    return Hypothesis((channel,), "noise", log_evidence(found) - price - reference, found.statistic, {"factor": factor})


def swapped(data: Data, pair: tuple[int, int], reference: float, hopeless: float, choices: int) -> Hypothesis:
    """Two channels taken for each other, of so many pairs: the readings, with their weights, change places. By chance
    costs then differ as for delayed(), of two channels."""
    order = np.arange(len(data.array))
    order[list(pair)] = order[list(pair[::-1])]
    changed = replace(data, readings=data.readings[:, order], weight=data.weight[:, order])
    found = fit(changed, first_omega(changed), None, LOOK, ROUGH, hopeless)
    price = float(np.sqrt(2.4 * (data.weight[:, list(pair)] > 0).sum())) + float(np.log(choices))
    return Hypothesis(pair, "swap", log_evidence(found) - price - reference, found.statistic)


def swap_costs(healthy: Fit, pairs: Sequence[tuple[int, int]], most: int) -> list[tuple[float, tuple[int, int]]]:
    """Cost per degree of freedom of each swap after two steps without calibration over `most` samples, best first."""
    data = coarser(healthy, most).data
    certain, out = replace(data, prior_sd=np.zeros_like(data.prior_sd)), []
    for pair in pairs:
        order = np.arange(len(data.array))
        order[list(pair)] = order[list(pair[::-1])]
        changed = replace(certain, readings=data.readings[:, order], weight=data.weight[:, order])
        out.append((fit(changed, first_omega(changed), iterations=2).statistic, pair))
    return sorted(out)
