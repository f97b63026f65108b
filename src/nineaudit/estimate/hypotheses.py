"""Which channel, and what is wrong with it: hypotheses compared by Laplace evidence (METHODS.md 3).

    ln p(y | hypothesis) = −½ min cost − ½ ln det(posterior precision) + ½ ln det(prior precision) + const

Small faults: about the healthy fit, the columns of every kind of fault of every channel are put beside the calibration
errors at once; one factorisation gives the Schur complement from which each kind takes its own rows and columns.
Large faults bend the healthy fit. So each channel is also left out (free waveform) and put back about that fit with the
shapes that do not know the signal; with its gain set free; and, where its own trace shows samples to be wrong, without
those samples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from nineaudit.array import BoolArray, FloatArray, IntArray
from nineaudit.estimate.model import Data, Extra
from nineaudit.estimate.normal import Solved, eliminate, normal_equations
from nineaudit.estimate.point import point
from nineaudit.estimate.shapes import GAIN_SD, Shape, additive, any_curve, following
from nineaudit.estimate.start import first_omega
from nineaudit.estimate.trajectory import ROUGH, Fit, fit, log_determinant

HOPELESS = 10.0
"""Cost per degree of freedom at which a fit that has not fallen below it in three steps need not go on: all evidence is
relative, and a record that costs so much is not that of a healthy instrument."""
LOOK = 8
"""Iterations of a fit that is only compared."""
STRETCH_NATS = 8.0
"""What one stretch of wrong samples costs: its place and its length, out of some thousands."""


@dataclass(frozen=True)
class Hypothesis:
    """`channels` (columns) with a fault of kind `word`: its log `evidence` (nats, relative to no fault), the cost per
    degree of freedom `statistic`, and the fault's `parameters` (SI)."""

    channels: tuple[int, ...]
    word: str
    evidence: float
    statistic: float
    parameters: Mapping[str, float] = field(default_factory=dict)
    shape: Shape | None = field(default=None, repr=False, compare=False)


def healthy_fit(data: Data) -> Fit:
    """The fit of the hypothesis that nothing is wrong. EstimationError where ω cannot be told."""
    return fit(data, first_omega(data), hopeless=HOPELESS * data.dof)


def log_evidence(found: Fit) -> float:
    """ln p(y, ω̂ | the fit's hypothesis), θ integrated out, up to the constant that all hypotheses share.

    ω is profiled, not integrated: its flat prior would reward every hypothesis that makes a channel tell less of it.
    """
    return -0.5 * (found.cost + found.log_det)


def masked(data: Data, channel: int, samples: BoolArray | None = None) -> Data:
    """`data` without one channel, or without some of its samples."""
    weight = data.weight.copy()
    weight[slice(None) if samples is None else samples, channel] = 0.0
    return replace(data, weight=weight)


def without(data: Data, healthy: Fit, channel: int, hopeless: float = np.inf) -> Fit:
    """The fit without one channel, from the better of two starts. EstimationError where the others do not tell ω."""
    alone = masked(data, channel)
    starts = [healthy.omega]
    if data.array.is_accelerometer[channel]:
        starts.append(first_omega(alone))
    theta = np.zeros(len(alone.channel))
    costs = [point(alone, w, theta).cost for w in starts] if len(starts) > 1 else [0.0]
    return fit(alone, starts[int(np.argmin(costs))], iterations=LOOK, tolerance=ROUGH, hopeless=hopeless)


def confirm(data: Data, near: Fit, claim: Hypothesis, reference: float) -> Hypothesis:
    """The evidence of a shape by a fit of its own, where `claim` had it linear about another fit."""
    if claim.shape is None:
        return claim
    width = len(claim.shape.columns)
    extra = Extra(claim.shape.columns, np.full(width, claim.channels[0]))
    whole = replace(data, extra=extra)
    found = fit(whole, near.omega, theta_for(whole, near))
    evidence = log_evidence(found) - reference - float(np.log(claim.shape.choices))
    parameters = _parameters(claim.shape, found.theta[-width:])
    return replace(claim, evidence=evidence, statistic=found.statistic, parameters=parameters)


def small_faults(healthy: Fit, onset: int, reference: float) -> list[Hypothesis]:
    """Every kind of small fault of every channel, about the healthy fit, from one factorisation."""
    data = healthy.data
    used = np.flatnonzero((data.weight > 0).any(axis=0)).tolist()
    shapes = []
    for k in used:
        peak = float(np.abs(healthy.ideal[:, k]).max())
        shapes += [(k, s) for s in (*following(healthy, k), *additive(data, k, peak, onset, 4))]
    return _compare(data, healthy.omega, healthy.theta, shapes, reference)


def curves(data: Data, left: Fit, channel: int, onset: int, reference: float) -> list[Hypothesis]:
    """Shapes that do not know the signal in one channel, about the fit `left` that did not use it."""
    peak = float(np.abs(left.ideal[:, channel]).max())
    shapes = [*additive(data, channel, peak, onset), any_curve(data, channel, peak, onset)]
    return _compare(data, left.omega, theta_for(data, left), [(channel, s) for s in shapes], reference)


def scaled(data: Data, left: Fit, channel: int, reference: float) -> Hypothesis | None:
    """The channel with another gain, y = (1 + g) ŷ: polarity, wrong unit, wrong sensitivity; None where ŷ is lost in
    noise. g from the regression on ŷ without the channel, the readings divided by it (and their weight multiplied), and
    the rest left to a fit with a prior of a tenth; repeated until it settles.
    """
    truth, weight = left.ideal[:, channel], data.weight[:, channel]
    noise = 4.0 * float((weight > 0).sum())  # twice the noise of a reading, squared, in units of it
    signal = float(((weight * truth) ** 2).sum())
    if signal < 10.0 * noise:
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


def without_samples(data: Data, left: Fit, channel: int, wrong: BoolArray, reference: float) -> Hypothesis:
    """The channel without the samples that its own trace shows to be wrong, and as measured elsewhere.

    A flat top or a dropout is predicted by its level: those samples cost what healthy ones are expected to.
    """
    part = masked(data, channel, wrong)
    found = fit(part, left.omega, theta_for(part, left), LOOK, ROUGH)
    stretches = int((np.diff(wrong.astype(int), prepend=0) == 1).sum())
    evidence = log_evidence(found) - 0.5 * float(wrong.sum()) - reference - STRETCH_NATS * stretches
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
    """Two channels free, `left` the fit without both."""
    price = sum(_price(data, left, channel) for channel in pair)
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


def swapped(data: Data, pair: tuple[int, int], reference: float, hopeless: float) -> Hypothesis:
    """Two channels taken for each other: the readings, with their weights, change places."""
    order = np.arange(len(data.array))
    order[list(pair)] = order[list(pair[::-1])]
    changed = replace(data, readings=data.readings[:, order], weight=data.weight[:, order])
    found = fit(changed, first_omega(changed), None, LOOK, ROUGH, hopeless)
    return Hypothesis(pair, "swap", log_evidence(found) - reference, found.statistic)


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


def coarser(at: Fit, most: int) -> Fit:
    """The fit at every so many nodes, with means of the readings between them, at most about `most`: what the record
    tells of slow faults is the same."""
    data, length = at.data, -(-len(at.data.time) // most)
    if length == 1:
        return at
    whole = len(data.time) // length
    squares, readings, time = (
        values[: whole * length].reshape(whole, length, *values.shape[1:])
        for values in (data.weight**2, data.readings, data.time)
    )
    total = squares.sum(axis=1)
    mean = (squares * readings).sum(axis=1) / np.where(total > 0, total, 1.0)
    still = data.still[: whole * length + 1 : length]
    part = replace(data, time=time.mean(axis=1), readings=mean, weight=np.sqrt(total), still=still, extra=None)
    return replace(at, data=part, omega=at.omega[: whole * length + 1 : length], theta=theta_for(part, at))


def step_sds(at: Fit, onset: float, free: int | None = None) -> FloatArray:
    """(k,) standard deviation (SI) with which a step at the `onset` (s) in each channel would be known, beside
    everything else; `free`: with that channel's waveform free (infinite for itself). ∞ where it could not be told at
    all."""
    data = at.data if free is None else masked(at.data, free)
    count = len(data.array)
    step = (data.time >= onset).astype(float)
    whole = replace(data, extra=Extra(np.repeat(step[None], count, axis=0), np.arange(count)))
    theta = theta_for(whole, at)
    solved = eliminate(normal_equations(point(whole, at.omega, theta)))
    base = len(theta) - count
    out = np.full(count, np.inf)
    for k in range(count):
        # the prior 1 of a shape in the normal equations is taken off: the step is wholly unknown
        rows = np.r_[np.arange(base), base + k]
        schur = solved.schur[np.ix_(rows, rows)]
        schur[-1, -1] -= 1.0
        left = schur[-1, -1] - schur[-1, :-1] @ np.linalg.solve(schur[:-1, :-1], schur[:-1, -1])
        if left > 1e-9 * max(solved.normal.dense[base + k, base + k], 1e-300):
            out[k] = 1.0 / np.sqrt(left)
    return out


def theta_for(data: Data, other: Fit) -> FloatArray:
    """θ of another fit for the θ of `data`; zero where the other fit has none."""
    known = zip(*(a.tolist() for a in other.data.active), strict=True)
    place = {pair: float(other.theta[i]) for i, pair in enumerate(known)}
    found = [place.get(pair, 0.0) for pair in zip(*(a.tolist() for a in data.active), strict=True)]
    return np.array([*found, *np.zeros(len(data.channel) - len(found))])


def _compare(
    data: Data, omega: FloatArray, theta: FloatArray, shapes: Sequence[tuple[int, Shape]], reference: float
) -> list[Hypothesis]:
    """Evidence of each shape beside the calibration errors, linear about ω and θ."""
    widths = [len(s.columns) for _, s in shapes]
    channel = np.repeat([k for k, _ in shapes], widths)
    whole = replace(data, extra=Extra(np.vstack([s.columns for _, s in shapes]), channel))
    base = len(theta)
    theta = np.concatenate([theta, np.zeros(len(channel))])
    here = point(whole, omega, theta)
    solved = eliminate(normal_equations(here))
    settled = here.cost - solved.fall
    found, first = [], base
    for (k, shape), width in zip(shapes, widths, strict=True):
        rows = np.r_[np.arange(base), np.arange(first, first + width)]
        first += width
        fallen, amplitude, log_det = _settle(solved, rows, base)
        total = settled - fallen
        evidence = -0.5 * (total + log_det) - reference - float(np.log(shape.choices))
        statistic = total / max(data.dof, 1)
        found.append(Hypothesis((k,), shape.word, evidence, statistic, _parameters(shape, amplitude), shape))
    return found


def _settle(solved: Solved, rows: IntArray, base: int) -> tuple[float, FloatArray, float]:
    """How far the cost falls with these θ free, the amplitudes of the shapes among them, and ln det of their Schur."""
    schur, pull = solved.schur[np.ix_(rows, rows)], solved.pull[rows]
    step = np.linalg.solve(schur, pull)
    return float(pull @ step), np.asarray(step[base:]), log_determinant(schur)


def _parameters(shape: Shape, amplitude: FloatArray) -> dict[str, float]:
    values = amplitude * shape.scale
    out = {"size": float(values[0]) if len(values) == 1 else float(np.sqrt(np.sum(values**2)))}
    if shape.note is not None:
        out["at"] = shape.note
    return out
