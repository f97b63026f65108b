"""A second smoother to test the first against: slow, dense, and written from the equations alone (METHODS.md 1, 2).

Unknown are ω on the nodes between samples, a0 at every sample and every calibration error θ, all in one dense vector;
scipy minimises the sum of squares of

    (y_i(t) − [(1 + g) n'·a + b − s dy_i/dt]) / σ_i      a = a0 + α×r' + ω×(ω×r'),  or ω for a rate sensor
    θ / σ_θ,      ω(node) / σ_rest where the body is known to rest

    n' = n + τ₁ u₁ + τ₂ u₂ the true axis, r' = r + e the true place

with ω̄ the mean and α the slope of ω between the nodes about a sample. No a0 is eliminated, no derivative is given, no
structure is used, and calibration errors move with the motion they act on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from nineaudit.array import FloatArray, Sensor


@dataclass(frozen=True, eq=False)
class Answer:
    """`omega` (n+1,3), `a0` (n,3), `theta` (k,8) in prior standard deviations, and the `cost`, a sum of squares."""

    omega: FloatArray
    a0: FloatArray
    theta: FloatArray
    cost: float


@dataclass(frozen=True, eq=False)
class Question:
    """`time` (n,) uniform s, `readings` and `weight` (n,k), `sd` (k,8) of gain, zero, two tilts, three coordinates
    and skew, `rest` (n+1,) precision of ω = 0."""

    sensors: tuple[Sensor, ...]
    time: FloatArray
    readings: FloatArray
    weight: FloatArray
    sd: FloatArray
    rest: FloatArray


def solve(question: Question, omega: FloatArray) -> Answer:
    """The least sum of squares from ω (n+1,3), a0 = 0, θ = 0."""
    count = len(question.time)
    free = question.sd > 0
    a_size = 1.0 / np.median(question.weight[question.weight > 0])
    scale = np.concatenate([np.full(omega.size, 0.1), np.full(3 * count, a_size), np.ones(free.sum())])

    def unpack(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        x = x * scale
        theta = np.zeros_like(question.sd)
        theta[free] = x[omega.size + 3 * count :]
        return x[: omega.size].reshape(-1, 3), x[omega.size :][: 3 * count].reshape(-1, 3), theta

    def misfit(x: FloatArray) -> FloatArray:
        w, a0, theta = unpack(x)
        left = question.weight * (question.readings - predicted(question, w, a0, theta * question.sd))
        at_rest = np.sqrt(question.rest)[:, None] * w
        return np.concatenate([left[question.weight > 0], at_rest[question.rest > 0].ravel(), theta[free]])

    first = np.concatenate([omega.ravel(), np.zeros(3 * count + free.sum())]) / scale
    found = least_squares(misfit, first, jac="3-point", method="lm", xtol=1e-13, ftol=1e-13, gtol=1e-13)
    return Answer(*unpack(found.x), cost=2.0 * float(found.cost))


def predicted(question: Question, omega: FloatArray, a0: FloatArray, error: FloatArray) -> FloatArray:
    """(n,k) readings of the imperfect instrument; `error` (k,8) SI."""
    h = question.time[1] - question.time[0]
    mean, alpha = (0.5 * (omega[:-1] + omega[1:]))[:, None], ((omega[1:] - omega[:-1]) / h)[:, None]
    rate = np.array([s.kind == "gyroscope" for s in question.sensors])
    n, r = np.array([s.axis for s in question.sensors]), np.array([s.position for s in question.sensors])
    first = _cross(n, np.array([0.6, 0.48, 0.64]))
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = _cross(n, first)

    gain, zero, tilt_1, tilt_2, skew = error[:, [0, 1, 2, 3, 7]].T
    true_axis = n + tilt_1[:, None] * first + tilt_2[:, None] * second
    place = r + error[:, 4:7]
    felt = a0[:, None] + _cross(alpha, place) + _cross(mean, _cross(mean, place))
    y = (1 + gain) * (np.where(rate[:, None], mean, felt) * true_axis).sum(axis=2)
    slope = np.empty_like(y)
    slope[1:-1] = (y[2:] - y[:-2]) / (2 * h)
    slope[0], slope[-1] = (-3 * y[0] + 4 * y[1] - y[2]) / (2 * h), (3 * y[-1] - 4 * y[-2] + y[-3]) / (2 * h)
    return y + zero - slope * skew


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    (x, y, z), (u, v, w) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)
