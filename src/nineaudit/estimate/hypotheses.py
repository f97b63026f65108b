"""Which channel, and what is wrong with it: hypotheses compared by Laplace evidence (METHODS.md 3).

    ln p(y | hypothesis) = −½ min cost − ½ ln det(posterior precision) + ½ ln det(prior precision) + const

Small faults: about the healthy fit, the columns of every kind of fault of every channel are put beside the calibration
errors at once; one factorisation gives the Schur complement from which each kind takes its own rows and columns.
Large faults bend the healthy fit. So each channel is also left out (free waveform) and put back about that fit with the
shapes that do not know the signal, and in the ways of refitted.py.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from nineaudit.array import BoolArray, FloatArray, IntArray
from nineaudit.errors import EstimationError
from nineaudit.estimate.model import Data, Extra
from nineaudit.estimate.motion import has_rates
from nineaudit.estimate.normal import Solved, eliminate, normal_equations
from nineaudit.estimate.point import point
from nineaudit.estimate.shapes import Shape, additive, any_curve, following
from nineaudit.estimate.start import first_omega
from nineaudit.estimate.trajectory import ROUGH, Fit, fit, log_determinant

HOPELESS = 10.0
"""Cost per degree of freedom at which one of two fits that has not fallen below it in three steps need not go on."""
ELSEWHERE = ("gain", "delay", "wrong_filter")
"""Kinds that a large fault has in refitted.py, or whose shape is mostly the noise of the prediction."""
LOOK = 8
"""Iterations of a fit that is only compared."""


@dataclass(frozen=True)
class Hypothesis:
    """`channels` (columns) with a fault of kind `word`: its log `evidence` (nats, relative to no fault), the cost per
    degree of freedom `statistic`, and the fault's `parameters` (SI). `chance`: by how many nats chance may have
    made the evidence too small; a rival has the benefit of it."""

    channels: tuple[int, ...]
    word: str
    evidence: float
    statistic: float
    parameters: Mapping[str, float] = field(default_factory=dict)
    shape: Shape | None = field(default=None, repr=False, compare=False)
    chance: float = 0.0


def healthy_fit(data: Data) -> Fit:
    """The fit of the hypothesis that nothing is wrong. EstimationError where ω cannot be told.

    Products of ω do not tell its sign: with neither rest nor rate sensors the fit starts again from −ω (METHODS.md 2).
    """
    if (data.still > 0).any() or has_rates(data.array):
        return fit(data, first_omega(data))
    found = fit(data, first_omega(data), hopeless=HOPELESS * data.dof)
    other = fit(data, -found.omega, hopeless=HOPELESS * data.dof)
    best = min(found, other, key=lambda f: f.cost)
    return best if best.converged else fit(data, best.omega, best.theta)


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
    """The fit without one channel, from the start whose first step leads lowest. EstimationError where the others do
    not tell ω."""
    alone = masked(data, channel)
    starts = [healthy.omega]
    if data.array.is_accelerometer[channel]:
        starts += _starts_without(alone, healthy)
        certain = replace(alone, prior_sd=np.zeros_like(alone.prior_sd))
        first = [fit(certain, start, iterations=1) for start in starts]
        starts = [min(first, key=lambda f: f.cost).omega]
    return fit(alone, starts[0], tolerance=ROUGH, hopeless=hopeless)


def _starts_without(alone: Data, healthy: Fit) -> list[FloatArray]:
    """ω from the other channels at their word; where they leave a direction of α untold, from rest and near it."""
    try:
        return [first_omega(alone)]
    except EstimationError:
        return [np.zeros_like(healthy.omega), 0.1 * healthy.omega]


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


def curves(data: Data, left: Fit, channel: int, onset: int, reference: float, large: bool = False) -> list[Hypothesis]:
    """Shapes that do not know the signal in one channel, about the fit `left` that did not use it; of a `large` fault,
    beside which the noise of that fit is little, those that follow the signal too."""
    peak = float(np.abs(left.ideal[:, channel]).max())
    off = np.where(data.weight[:, channel] > 0, data.readings[:, channel] - left.ideal[:, channel], 0.0)
    shapes = [*additive(data, channel, peak, onset, off=off), any_curve(data, channel, peak, onset)]
    shapes += [s for s in following(left, channel) if s.word not in ELSEWHERE] if large else []
    return _compare(data, left.omega, theta_for(data, left), [(channel, s) for s in shapes], reference)


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
