"""What all other channels say that one channel should read, and how well they know it.

From the fit without the channel: ŷ, and its variance u² = dᵀ P d + bᵀ C b. P is the posterior covariance of ω at the
two nodes of the sample; C = L⁻ᵀL⁻¹ that of a0 and the errors between samples with ω held (shared.py); b (9) what these
do to the channel; d = ∂y/∂ω − Jᵀ Gᵀ L⁻¹ b what ω does, directly and through them. Calibration errors of the others are
held, the channel's own are left to the claims.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.estimate import block_tridiagonal, calibration
from nineaudit.estimate.between_samples import coarse
from nineaudit.estimate.model import Data
from nineaudit.estimate.normal import by_nodes, normal_equations
from nineaudit.estimate.shared import SharedElimination
from nineaudit.estimate.student import FREEDOM, SPENT, StudentFit
from nineaudit.physics import kinematics


@dataclass(frozen=True, eq=False)
class Prediction:
    """Of one channel at the samples `rows` (m,) at which it is valid: readings `y` (m,), `expected` ŷ (m,), standard
    deviations `sigma` (m,) of the channel by noise and knocks and `u` (m,) of ŷ, and the calibration `columns` (m,p) in
    prior standard deviations; `whole` (n,) ŷ at every sample."""

    y: FloatArray
    expected: FloatArray
    sigma: FloatArray
    u: FloatArray
    rows: IntArray
    columns: FloatArray
    whole: FloatArray

    @cached_property
    def s(self) -> FloatArray:
        """(m,) standard deviation of y − ŷ."""
        return np.sqrt(self.sigma**2 + self.u**2)

    def only(self, some: IntArray) -> Prediction:
        """At some of the samples."""
        y, expected, sigma, u = (x[some] for x in (self.y, self.expected, self.sigma, self.u))
        return Prediction(y, expected, sigma, u, self.rows[some], self.columns[some], self.whole)


def predict(data: Data, channel: int, without: StudentFit) -> Prediction:
    """Prediction of a channel of `data`; with a fit that did use it, a first look that is too favourable."""
    motion, perfect = without.at.motion, data.bent(np.zeros(len(data.channel)))
    features = calibration.features(motion.a0.T, motion.alpha.T, motion.omega.T)
    whole = perfect.predict(features)[channel]
    rows = np.flatnonzero(data.weight[:, channel] > 0)
    left_out = not (without.data.weight[:, channel] > 0).any()
    sigma = _knock(without, channel)[rows] / coarse(data, motion).weight[rows, channel]
    known = _variance(without, channel)[rows] if left_out else np.zeros(len(rows))
    by, prior = perfect.sensitivities()[channel] @ features, data.prior_sd[channel]
    slope = kinematics.differentiate(whole[:, None], data.time)[:, 0]
    every = np.vstack([by[0], np.ones(len(whole)), by[1:], -slope]) * prior[:, None]
    columns = every[prior > 0].T[rows]
    return Prediction(data.readings[rows, channel], whole[rows], sigma, np.sqrt(known), rows, columns, whole)


def _knock(without: StudentFit, channel: int) -> FloatArray:
    """(n,) factor on σ that the others of its kind felt: λ² = (ν + χ²)/(ν + m) without the channel's own share."""
    data, held = without.data, without.data.array.is_accelerometer
    kind = held == held[channel]
    others = kind & (np.arange(len(kind)) != channel)
    shared = np.asarray(without.knock[:, others].max(axis=1))
    if not (data.weight[:, channel] > 0).any():
        return shared
    left = (data.readings - without.at.correction - without.at.ideal)[:, channel]
    own = np.square(data.weight[:, channel] * without.knock[:, channel] * left)
    spare = np.maximum((data.weight[:, kind] > 0).sum(axis=1) - SPENT[0 if held[channel] else 1], 1)
    whole = shared**2 * (FREEDOM + spare)
    return np.asarray(np.sqrt(np.maximum(whole - own, FREEDOM) / (FREEDOM + spare - 1)))


def _variance(without: StudentFit, channel: int) -> FloatArray:
    """(n,) u² of the channel's reading."""
    at = without.at
    free, between = at.elimination, at.data.between
    if between is None or not isinstance(free, SharedElimination):
        raise TypeError("a prediction needs a fit that knows what happens between samples")
    there = at.data.bent(np.zeros(len(at.theta)))
    a0 = np.broadcast_to(there.axes_a[channel][:, None], (3, len(at.data.time)))
    by_errors = free.sd * np.vstack([there.by_omega(between.omega.T)[channel], a0 * 0 + there.lever[channel][:, None]])
    through = np.einsum("nij,jn->in", free.inverse, np.vstack([a0, by_errors]))
    along = np.einsum("in,ikn->kn", through, free.g)
    half, lean = 0.5 * there.by_omega(at.mean)[channel], there.lever[channel][:, None] / at.data.step
    early, late = (
        own - np.einsum("kn,kin->in", along, j) for own, j in zip((half - lean, half + lean), by_nodes(at), strict=True)
    )
    normal = normal_equations(at)
    diagonal, upper = block_tridiagonal.inverse_blocks(normal.diagonal, normal.upper)
    variance = _quadratic(early, diagonal[:-1], early) + _quadratic(late, diagonal[1:], late)
    variance = np.maximum(variance + 2.0 * _quadratic(early, upper, late), 0.0)
    return np.asarray(variance + (through**2).sum(axis=0))


def _quadratic(left: FloatArray, middle: FloatArray, right: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("in,nij,jn->n", left, middle, right))
