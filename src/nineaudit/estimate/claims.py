"""Which fault, if any, the readings of one channel follow, given what all others predict of it (prediction.py).

Each hypothesis is a linear model with Student errors, so that knocks prove nothing:

    y = baseline(ŷ) + Xθ + e,    e/s Student with ν degrees of freedom,    θ ~ N(0, 1)

X always holds the calibration errors of the channel. Hypotheses are compared by Laplace evidence (METHODS.md 3); all
other channels are taken to be right. No claim frees single samples, which a knock may hit harder than the budget says.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import lgamma

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.estimate.prediction import Prediction
from nineaudit.estimate.student import FREEDOM

ROUNDS = 8
ANY_GAIN, FINE_GAIN, SHIFT_PART = 1.0, 0.01, 0.3
"""Prior standard deviation of a wrong gain, and how well it can be told; that of a shift, as a part of the peak."""
COARSE_GAIN, KNOWN_GAIN = 0.4, 0.02
"""Range about the median ratio in which a wrong gain is sought, and about 1 that a healthy channel is granted beside
the calibration errors in its columns."""
DELAYS = (-2, -1, 1, 2, 3)
"""Whole samples that are tried."""
STANDS_OUT = 5.0
SAME, MEDIAN_STUDENT = 1e-9, 0.741
"""Readings nearer than this are one; median of |t| with four degrees of freedom."""


@dataclass(frozen=True)
class Claim:
    """A fault `word`, its log `evidence` over a healthy channel (nats), and its `parameters`, SI."""

    word: str
    evidence: float
    parameters: Mapping[str, float] = field(default_factory=dict)


def claims(p: Prediction, raw_zero: BoolArray) -> list[Claim]:
    """Every kind of fault, best first. `raw_zero` (m,) where the instrument put out exactly 0."""
    nothing, theta = evidence(p, p.expected, p.columns)
    left = (p.y - p.expected - p.columns @ theta) / p.s
    found = [_shifted(p, left), *_delayed(p), *_clipped(p), *_dropped(p, left, raw_zero), _anything(p)]
    over = [Claim(x.word, x.evidence - nothing, x.parameters) for x in found]
    return sorted([_scaled(p, left), *over], key=lambda x: -x.evidence)


def taken_for(p: Prediction, other: FloatArray) -> float:
    """Log evidence over a healthy channel that it reads what another should, `other` (n,)."""
    return evidence(p, other[p.rows], p.columns)[0] - evidence(p, p.expected, p.columns)[0]


def evidence(p: Prediction, baseline: FloatArray, columns: FloatArray) -> tuple[float, FloatArray]:
    """Laplace evidence (nats) of y = `baseline` (m,) + `columns` (m,p) θ + Student errors, and θ (p,)."""
    target, scaled = (p.y - baseline) / p.s, columns / p.s[:, None]
    theta, precision = np.zeros(columns.shape[1]), np.eye(columns.shape[1])
    weight = 1.0 / np.maximum(1.0, np.abs(target - np.median(target)))
    for _ in range(ROUNDS):
        weighted = scaled * weight[:, None]
        precision = scaled.T @ weighted + np.eye(len(theta))
        theta = np.asarray(np.linalg.solve(precision, weighted.T @ target), dtype=np.float64)
        weight = (FREEDOM + 1.0) / (FREEDOM + (target - scaled @ theta) ** 2)
    total = float((log_student(target - scaled @ theta) - np.log(p.s)).sum())
    return total - 0.5 * float(theta @ theta) - 0.5 * float(np.linalg.slogdet(precision)[1]), theta


def log_student(x: FloatArray) -> FloatArray:
    """Log density of Student's t with ν = FREEDOM."""
    constant = lgamma(0.5 * (FREEDOM + 1.0)) - lgamma(0.5 * FREEDOM) - 0.5 * np.log(FREEDOM * np.pi)
    return np.asarray(constant - 0.5 * (FREEDOM + 1.0) * np.log1p(x**2 / FREEDOM))


def _scaled(p: Prediction, left: FloatArray) -> Claim:
    """Polarity, wrong unit, wrong sensitivity, over a gain near 1: the best factor near the median ratio.

    ŷ has errors of its own, and a regression that takes it as exact finds gains too small. With errors in both the
    variance of y − c ŷ is σ² + c² u², and its logarithm does not count [Fuller, Measurement Error Models, 1987, 1.3].
    u is an upper bound (between_samples.py) and would find them too large: the claim must stand both ways. What is
    `left` (m,) of the healthy channel, or of that with the median ratio if it is less, scales s to the noise as found.
    """
    near = np.abs(p.expected) > STANDS_OUT * p.s
    about = float(np.median(p.y[near] / p.expected[near])) if near.sum() > 10 else 1.0
    about = about if abs(about) > 1e-3 else 1.0
    scaled = (p.y - about * p.expected) / np.hypot(p.sigma, about * p.u)
    noise = max(min(float(np.median(np.abs(x))) for x in (left, scaled)) / MEDIAN_STUDENT, 1e-3)
    found = []
    for u in (0.0 * p.u, min(noise, 1.0) * p.u) if p.u.any() else (p.u,):
        factor, explained = _best_factor(p, about, COARSE_GAIN * abs(about), noise, u)
        over = explained - _best_factor(p, 1.0, KNOWN_GAIN, noise, u)[1]
        price = min(0.5 * ((factor - 1.0) / ANY_GAIN) ** 2, 10.0) + float(np.log(ANY_GAIN / FINE_GAIN))
        found.append(Claim("gain", over - price, {"factor": factor}))
    return min(found, key=lambda x: x.evidence)


def _best_factor(p: Prediction, about: float, width: float, noise: float, u: FloatArray) -> tuple[float, float]:
    """The factor within `width` of `about` that explains y = c ŷ best with u (m,) of ŷ, and the evidence."""
    from scipy.optimize import minimize_scalar

    def lost(factor: float) -> float:
        variance = (noise * p.s) ** 2 + (factor**2 - 1.0) * u**2
        s = np.sqrt(np.maximum(variance, (noise * p.sigma) ** 2))
        there = replace(p, sigma=s, u=np.zeros_like(s))
        return -float(np.log(s).sum()) - evidence(there, factor * p.expected, p.columns)[0]

    bounds = (about - width, about + width)
    best = minimize_scalar(lost, bounds=bounds, method="bounded", options={"xatol": 0.02 * width, "maxiter": 12})
    return float(best.x), -float(best.fun)


def _shifted(p: Prediction, left: FloatArray) -> Claim:
    """A step, from the sample after which what is `left` (m,) of the healthy channel speaks most for one."""
    weight = (FREEDOM + 1.0) / (FREEDOM + left**2) / p.s**2
    drive, known = (np.cumsum(x[::-1])[::-1] for x in (weight * left * p.s, weight))
    start = int(np.argmax(drive**2 / np.maximum(known, 1e-300)))
    size = SHIFT_PART * max(float(np.abs(p.expected).max()), STANDS_OUT * float(np.median(p.s)))
    step = size * (np.arange(len(p.y)) >= start)
    found, theta = evidence(p, p.expected, np.column_stack([p.columns, step]))
    return Claim("zero_shift", found - _place(p), {"size": size * float(theta[-1]), "sample": float(p.rows[start])})


def _delayed(p: Prediction) -> Iterator[Claim]:
    for lag in DELAYS:
        moved = np.interp(p.rows - lag, np.arange(len(p.whole)), p.whole)
        found = evidence(p, moved, p.columns)[0] - float(np.log(len(DELAYS)))
        yield Claim("delay", found, {"samples": float(lag)})


def _clipped(p: Prediction) -> Iterator[Claim]:
    """Held at its own largest reading where the others expect more. Every further reading that is exactly the same has
    the density of one step of the readings, and was there at even odds."""
    level = float(np.abs(p.y).max())
    if not (np.abs(p.expected) > level).any():
        return
    held = np.flatnonzero(np.abs(p.y) == level)
    kept = p.only(np.setdiff1d(np.arange(len(p.y)), held[1:]))
    found, _ = evidence(kept, np.clip(kept.expected, -level, level), kept.columns)
    step = _resolution(p)
    if len(held) == 1 or step > 0.0:
        exact = (len(held) - 1) * (float(np.log(2.0 * step)) if step > 0.0 else 0.0)
        yield Claim("clipping", found - exact - _place(p), {"level": level})


def _dropped(p: Prediction, left: FloatArray, raw_zero: BoolArray) -> Iterator[Claim]:
    """Exactly zero where the others expect something else: there the density is one over the step of the readings, and
    each such sample costs its place."""
    step = _resolution(p)
    if not raw_zero.any() or step <= 0.0:
        return
    price = float(np.log(step)) + _place(p)
    out = raw_zero & (-price > log_student(left) - np.log(p.s))
    if out.any() and not out.all():
        kept = p.only(np.flatnonzero(~out))
        found, _ = evidence(kept, kept.expected, kept.columns)
        yield Claim("dropout", found - price * float(out.sum()), {"samples": float(out.sum())})


def _anything(p: Prediction) -> Claim:
    """A waveform of its own, as large as the channel reads."""
    size = max(float(np.sqrt(np.mean(p.y**2))), 1e-9)
    return Claim("unknown", float((log_student(p.y / size) - np.log(size)).sum()))


def _resolution(p: Prediction) -> float:
    """Smallest step between the readings; 0 where all are the same."""
    steps = np.diff(np.unique(p.y))
    steps = steps[steps > SAME]
    return float(steps.min()) if len(steps) else 0.0


def _place(p: Prediction) -> float:
    """Nats of one sample out of all."""
    return float(np.log(len(p.y)))
