"""Elimination of what all channels of a sample share: a0, and what happens between the samples (model.Between).

With B = w times the change of each reading by a0 and by the standard deviations of six shared errors (in ω and in α),
and C⁻¹ the prior precision of these (0 for a0, 1 for each error), BᵀB + C⁻¹ = LLᵀ and G = L⁻¹Bᵀ, the cost ‖z‖² − ‖Gz‖²
is that of readings with the covariance diag(1/w²) + B₂B₂ᵀ, a0 free.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.estimate.instrument import Instrument
from nineaudit.estimate.model import Between

_UNSENSED, _NOTHING = 1e-12, 1e-300


@dataclass(frozen=True, eq=False)
class SharedElimination:
    """`inverse` L⁻¹ (n,9,9), `g` G (9,k,n), and the standard deviations `sd` (6,n) of the shared errors."""

    inverse: FloatArray
    g: FloatArray
    sd: FloatArray

    def a0(self, explained: FloatArray) -> FloatArray:
        """(3,n) of `explained` (9,n) = Gz."""
        return self._solved(explained)[:3]

    def errors(self, explained: FloatArray) -> FloatArray:
        """(6,n) shared errors of ω and α, rad/s and rad/s²."""
        return np.asarray(self.sd * self._solved(explained)[3:])

    def _solved(self, explained: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("nij,in->jn", self.inverse, explained))


def shared_elimination(there: Instrument, weight: FloatArray, between: Between) -> SharedElimination:
    """For the instrument `there` and all weights (k,n)."""
    sd = np.ascontiguousarray(between.sd.T)
    by_omega = there.by_omega(between.omega.T) * sd[:3]
    by_alpha = there.lever[:, :, None] * sd[3:]
    a0 = np.broadcast_to(there.axes_a[:, :, None], by_omega.shape)
    b = (np.concatenate([a0, by_omega, by_alpha], axis=1) * weight[:, None, :]).transpose(2, 1, 0)
    gram = b @ b.transpose(0, 2, 1)
    prior = np.ones(gram.shape[:2])
    prior[:, :3] = _UNSENSED * np.trace(gram[:, :3, :3], axis1=1, axis2=2)[:, None] + _NOTHING
    inverse = np.linalg.inv(np.linalg.cholesky(gram + prior[:, :, None] * np.eye(9)))
    return SharedElimination(inverse, np.ascontiguousarray((inverse @ b).transpose(1, 2, 0)), sd)
