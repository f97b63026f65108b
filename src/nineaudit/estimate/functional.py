"""Uncertainty of an output through the whole-record fit, by source.

For an output with derivatives f_ω by the nodes and f_θ by the calibration errors (what they do through a0 among them),
v = f_θ − Xᵀf_ω, S the posterior precision of θ (posterior.py):

    variance = f_ω Hωω⁻¹ f_ωᵀ + v S⁻¹ vᵀ + Σ f_a0 (AᵀA)⁻¹ f_a0ᵀ

A calibration error of one prior standard deviation in θ_j moves the estimate away from the truth by the covariance of
the output with θ_j, (v S⁻¹)_j: what the fit has not found out of it. Their squares are the rows; noise has the rest.
An error of a reading y, which the fit does not know of, moves the output by

    c = w P [J(H⁻¹f_ω − X S⁻¹v) + D S⁻¹v] + f_a0 (AᵀA)⁻¹Aᵀ w,    P what a0 does not explain, w = 1/σ     (normal.py)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.estimate import calibration
from nineaudit.estimate.motion import Motion
from nineaudit.estimate.normal import Solved, by_nodes, eliminate, normal_equations
from nineaudit.estimate.outputs import Gradient
from nineaudit.estimate.posterior import Posterior, a0_response, posterior
from nineaudit.estimate.trajectory import Fit
from nineaudit.physics import rigid_body


@dataclass(frozen=True, eq=False)
class Smoothed:
    """A fit with what carries its uncertainty: `known` its posterior, `through` X (3(n+1),q), and the derivatives of
    a0 by ω at the two nodes (n,3,6) and by θ (n,3,q)."""

    known: Posterior
    solved: Solved
    through: FloatArray
    a0_by_omega: FloatArray
    a0_by_theta: FloatArray

    @property
    def motion(self) -> Motion:
        """ω, α and a0 at the samples."""
        return self.known.fit.motion

    def _by_unknowns(self, gradient: Gradient) -> tuple[FloatArray, FloatArray]:
        """f_ω (3(n+1),) and v (q,)."""
        data = self.known.fit.data
        half, slope = 0.5 * gradient.omega, gradient.alpha / data.step[:, None]
        nodes = np.zeros((len(half) + 1, 3))
        by_a0 = np.einsum("ni,nij->nj", gradient.a0, self.a0_by_omega)
        nodes[:-1] += half - slope + by_a0[:, :3]
        nodes[1:] += half + slope + by_a0[:, 3:]
        by_omega, by_theta = nodes.ravel(), np.einsum("ni,niq->q", gradient.a0, self.a0_by_theta)
        return by_omega, by_theta - by_omega @ self.through

    def coefficients(self, gradient: Gradient) -> FloatArray:
        """(n,k) what one unit of each reading adds to an output with this gradient."""
        data, at = self.known.fit.data, self.known.fit.point
        by_omega, v = self._by_unknowns(gradient)
        theta = self.known.theta @ v
        nodes = self.solved.factor.solve(by_omega[:, None])[:, 0] - self.through @ theta
        omega = nodes.reshape(-1, 3)
        before, after = by_nodes(at)
        moved = np.einsum("kcn,nc->kn", before, omega[:-1]) + np.einsum("kcn,nc->kn", after, omega[1:])
        weight, g = data.rows[1], at.elimination.g
        np.add.at(moved, data.channel, theta[:, None] * weight[data.channel] * at.columns)
        moved -= np.einsum("ikn,in->kn", g, np.einsum("ikn,kn->in", g, moved))
        direct = np.einsum("ni,nij,kj->nk", gradient.a0, self.known.a0, at.instrument.axes_a) * data.weight
        return np.asarray((weight * moved).T + direct * data.weight)

    def step_error(self, gradient: Gradient) -> float:
        """What the finite step does to an output, absolute: ω within a block is not the mean of its ends, which the
        readings are held against and which stands for its middle. Simpson's rule over a cubic spline through the nodes.
        """
        from scipy.interpolate import CubicSpline

        fit = self.known.fit
        nodes = np.append(fit.data.time - 0.5 * fit.data.step, fit.data.time[-1] + 0.5 * fit.data.step[-1])
        middle = np.asarray(CubicSpline(nodes, fit.omega)(fit.data.time))
        array, mean_omega = fit.data.array, fit.point.mean.T

        def seen(omega: FloatArray) -> FloatArray:
            q = rigid_body.centripetal(array.positions, array.axes, omega)
            return np.where(array.is_accelerometer, q, omega @ array.axes.T)

        mean = (seen(fit.omega[:-1]) + 4.0 * seen(middle) + seen(fit.omega[1:])) / 6.0
        change = self.coefficients(gradient) * (mean - seen(mean_omega))
        return abs(float(change.sum() + (gradient.omega * (mean_omega - middle)).sum()))

    def by_channel(self, by_reading: FloatArray, gradient: Gradient) -> dict[str, FloatArray]:
        """(k,) standard uncertainty that each channel brings by each source, from the coefficients (n,k).

        The noise of all of them is what the calibration leaves of the variance; each has its part of Σ c²/w².
        """
        by_omega, v = self._by_unknowns(gradient)
        left = self.known.theta @ v
        variance = float(by_omega @ self.solved.factor.solve(by_omega[:, None])[:, 0] + v @ left)
        variance += float(np.einsum("ni,nij,nj->", gradient.a0, self.known.a0, gradient.a0))
        out = self._by_calibration(left)
        noise = max(variance - sum(float((u**2).sum()) for u in out.values()), 0.0)
        weight = self.known.fit.data.weight
        share = np.divide(by_reading, weight, out=np.zeros_like(by_reading), where=weight > 0)
        size = np.linalg.norm(share, axis=0)
        whole = float(np.linalg.norm(size))
        return out | {"noise": size * (np.sqrt(noise) / whole if whole > 0 else 0.0)}

    def _by_calibration(self, left: FloatArray) -> dict[str, FloatArray]:
        channel, parameter = self.known.fit.data.active
        squares = left[: len(parameter)] ** 2
        out = {}
        for source, members in calibration.SOURCES.items():
            mine = np.isin(parameter, [calibration.PARAMETERS.index(m) for m in members])
            out[source] = np.sqrt(np.bincount(channel[mine], squares[mine], len(self.known.fit.data.array)))
        return out


def smoothed(fit: Fit) -> Smoothed:
    """What carries the uncertainty of a fit. EstimationError where the readings do not determine ω."""
    solved = eliminate(normal_equations(fit.point))
    return Smoothed(posterior(fit), solved, solved.through(), *a0_response(fit.point))
