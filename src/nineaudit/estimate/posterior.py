"""Posterior covariance of the whole-record fit: ω, α, a0, every channel, every calibration error.

With S the Schur complement of θ and X = Hωω⁻¹ Hωθ, the covariance of (ω, θ) is

    cov θ = S⁻¹,    cov ω = Hωω⁻¹ + X S⁻¹ Xᵀ,    cov(ω, θ) = −X S⁻¹

and a quantity with derivatives f_ω by the two nodes of its sample and f_θ has the variance
f_ω Hωω⁻¹ f_ωᵀ + v S⁻¹ vᵀ, v = f_θ − f_ω X, plus what a0 adds, n (AᵀA)⁻¹ nᵀ. Only the tridiagonal blocks of Hωω⁻¹ are
needed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.estimate import block_tridiagonal
from nineaudit.estimate.normal import by_nodes, eliminate, normal_equations
from nineaudit.estimate.point import Point
from nineaudit.estimate.trajectory import Fit
from nineaudit.physics import rigid_body


@dataclass(frozen=True, eq=False)
class Posterior:
    """`pair` (n,6,6) covariance of ω at the two nodes of each sample with θ held, `through` (n,6,q), and the
    covariance `theta` (q,q); `a0` (n,3,3) that of a0 with ω and θ held. SI, θ in prior standard deviations."""

    fit: Fit
    pair: FloatArray
    through: FloatArray
    theta: FloatArray
    a0: FloatArray

    @property
    def theta_sd(self) -> FloatArray:
        """(q,) posterior over prior standard deviation of each θ."""
        return np.asarray(np.sqrt(np.diag(self.theta)))

    def omega_sd(self) -> FloatArray:
        """(n,3) standard uncertainty of ω at the samples, rad/s."""
        return self._of_omega(np.hstack([0.5 * np.eye(3), 0.5 * np.eye(3)]))

    def alpha_sd(self) -> FloatArray:
        """(n,3) standard uncertainty of α, rad/s²."""
        slope = np.hstack([-np.eye(3), np.eye(3)])
        return self._of_omega(slope) / self.fit.data.step[:, None]

    def _of_omega(self, rows: FloatArray) -> FloatArray:
        return np.stack(
            [self.sd(np.broadcast_to(row, (len(self.pair), 6)), np.zeros(self.through.shape[::2])) for row in rows],
            axis=1,
        )

    def sd(self, by_omega: FloatArray, by_theta: FloatArray, by_a0: FloatArray | None = None) -> FloatArray:
        """(n,) standard uncertainty of a quantity with derivatives (n,6), (n,q) and, by what noise leaves of a0, (n,3).

        The first two are total: they include what ω and θ do through a0.
        """
        variance = np.einsum("ni,nij,nj->n", by_omega, self.pair, by_omega)
        v = by_theta - np.einsum("ni,niq->nq", by_omega, self.through)
        variance = variance + np.einsum("nq,qr,nr->n", v, self.theta, v)
        if by_a0 is not None:
            variance = variance + np.einsum("ni,nij,nj->n", by_a0, self.a0, by_a0)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))

    def acceleration_sd(self, point: FloatArray, axis: FloatArray) -> FloatArray:
        """(n,) standard uncertainty of the specific force at `point` (3,) m along `axis` (3,)."""
        data, omega = self.fit.data, self.fit.motion.omega
        half = 0.5 * rigid_body.centripetal_jacobian(point[None], axis[None], omega)[:, 0]
        slope = np.cross(point, axis) / data.step[:, None]
        through_omega, through_theta = a0_response(self.fit.point)
        by_omega = np.hstack([half - slope, half + slope]) + np.einsum("i,nij->nj", axis, through_omega)
        by_theta = np.einsum("i,niq->nq", axis, through_theta)
        return self.sd(by_omega, by_theta, np.broadcast_to(axis, (len(half), 3)))

    def channel_sd(self, channel: int) -> FloatArray:
        """(n,) standard uncertainty of what a perfect sensor in the place of `channel` would read."""
        sensor = self.fit.data.array.sensors[channel]
        if sensor.kind == "accelerometer":
            return self.acceleration_sd(sensor.position, sensor.axis)
        rows = np.broadcast_to(0.5 * np.tile(sensor.axis, 2), (len(self.pair), 6))
        return self.sd(rows, np.zeros(self.through.shape[::2]))


def a0_response(at: Point) -> tuple[FloatArray, FloatArray]:
    """Derivatives of a0 = (AᵀA)⁻¹ Aᵀ w(y − known(ω) − Dθ) by ω at the two nodes (n,3,6) and by θ (n,3,q)."""
    data = at.data
    weighted = at.instrument.axes_a * data.weight[:, :, None]
    solver = _inverse_gram(at) @ weighted.transpose(0, 2, 1)
    by_omega = -solver @ np.concatenate(by_nodes(at), axis=1).transpose(2, 0, 1)
    by_theta = -solver[:, :, data.channel] * (data.weight[:, data.channel] * at.columns.T)[:, None, :]
    return np.asarray(by_omega), np.asarray(by_theta)


def _inverse_gram(at: Point) -> FloatArray:
    """(n,3,3) (AᵀA)⁻¹, A = w n of the accelerometers."""
    axes = at.instrument.axes_a
    gram = (at.data.weight**2 @ (axes[:, :, None] * axes[:, None, :]).reshape(-1, 9)).reshape(-1, 3, 3)
    return np.asarray(np.linalg.pinv(gram, rcond=1e-9, hermitian=True))


def posterior(fit: Fit) -> Posterior:
    """Covariances at the fitted point. EstimationError where the readings do not determine ω."""
    at = fit.point
    normal = normal_equations(at)
    solved = eliminate(normal)
    diagonal, upper = block_tridiagonal.inverse_blocks(normal.diagonal, normal.upper)
    n = len(fit.data.time)
    pair = np.empty((n, 6, 6))
    pair[:, :3, :3], pair[:, 3:, 3:] = diagonal[:-1], diagonal[1:]
    pair[:, :3, 3:], pair[:, 3:, :3] = upper, upper.transpose(0, 2, 1)
    through = solved.through().reshape(n + 1, 3, len(fit.theta))
    return Posterior(
        fit=fit,
        pair=pair,
        through=np.concatenate([through[:-1], through[1:]], axis=1),
        theta=np.asarray(np.linalg.inv(solved.schur)),
        a0=_inverse_gram(at),
    )
