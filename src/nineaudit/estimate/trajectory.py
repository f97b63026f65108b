"""The whole-record maximum a posteriori fit of a rigid motion to any set of accelerometers and rate sensors.

Gauss–Newton on the cost of model.py. The ω block of the normal equations is block-tridiagonal, θ a dense border (Schur
complement); each θ touches one channel, so that the border costs a few numbers a sample, and everything is linear in
the length of the record (METHODS.md 2). Readings that are not valid are simply absent.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.estimate import block_tridiagonal
from nineaudit.estimate.model import (
    Data,
    added_of,
    bent,
    columns_at,
    ideal,
    jacobian,
    middle,
    motion_of,
    residual,
    total_cost,
)
from nineaudit.estimate.motion import Motion

ITERATIONS, TOLERANCE, SMALLEST_STEP = 25, 1e-5, 1e-3


@dataclass(frozen=True, eq=False)
class Fit:
    """The maximum a posteriori motion: `omega` (n+1,3) at the nodes, `theta` (q,) in prior standard deviations, the
    `columns` (n,q) it goes with, the `cost` (expectation `data.dof`), whether it `converged`, the `iterations`, and
    `log_det` of the posterior precision of θ, as of the last step."""

    data: Data
    omega: FloatArray
    theta: FloatArray
    columns: FloatArray
    cost: float
    converged: bool
    iterations: int
    log_det: float

    @property
    def statistic(self) -> float:
        """Cost per degree of freedom."""
        return self.cost / max(self.data.dof, 1)

    @cached_property
    def correction(self) -> FloatArray:
        """(n,k) what the fitted calibration errors and fault shapes add to the readings."""
        there = ideal(bent(self.data, self.theta), self.motion)
        return np.asarray(there - self.ideal + added_of(self.data, self.columns, self.theta))

    @cached_property
    def motion(self) -> Motion:
        """ω, α and a0 at the samples."""
        added = added_of(self.data, self.columns, self.theta)
        return motion_of(bent(self.data, self.theta), self.omega, added)

    @cached_property
    def ideal(self) -> FloatArray:
        """(n,k) readings of a perfect instrument in the fitted motion."""
        return ideal(self.data, self.motion)


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations about a point: the ω block (`diagonal`, `upper`), its coupling `border` (3(n+1),q) to θ, their
    block `dense` (q,q) with the prior, and the downhill gradients."""

    diagonal: FloatArray
    upper: FloatArray
    border: FloatArray
    dense: FloatArray
    gradient_omega: FloatArray
    gradient_theta: FloatArray


def normal_equations(data: Data, omega: FloatArray, theta: FloatArray, columns: FloatArray) -> Normal:
    """Gauss–Newton normal equations at ω (n+1,3), θ (q,) with `columns` D (n,q), of the instrument that θ describes.

    With z the weighted residual, J its derivative by ω, C = w D, and P = 1 − GᵀG the elimination of a0:
    JᵀPJ, JᵀPC, CᵀPC + 1, and gradients JᵀPz, CᵀPz − θ.
    """
    z = residual(there := bent(data, theta), omega, added_of(data, columns, theta))
    g, j, channel = there.eliminator, jacobian(there, middle(omega)), data.channel
    gz, gj = g @ z[:, :, None], g @ j
    block = j.transpose(0, 2, 1) @ j - gj.transpose(0, 2, 1) @ gj
    down = (j.transpose(0, 2, 1) @ z[:, :, None] - gj.transpose(0, 2, 1) @ gz)[:, :, 0]
    c = data.weight[:, channel] * columns
    e = g[:, :, channel] * c[:, None, :]
    same = channel[:, None] == channel[None, :]
    flat = e.reshape(3 * len(z), len(channel))
    dense = np.where(same, c.T @ c, 0.0) - flat.T @ flat + np.eye(len(channel))
    gradient_theta = np.einsum("nq,nq->q", c, z[:, channel]) - gz.reshape(-1) @ flat - theta
    border = j[:, channel].transpose(0, 2, 1) * c[:, None, :] - gj.transpose(0, 2, 1) @ e
    diagonal, upper, gradient, coupled = _assemble(block, down, border)
    diagonal += data.still[:, None, None] * np.eye(3)
    gradient -= data.still[:, None] * omega
    upper -= data.bridge[:, None, None] * np.eye(3)
    for side in (slice(None, -1), slice(1, None)):
        diagonal[side] += data.bridge[:, None, None] * np.eye(3)
    change = data.bridge[:, None] * np.diff(omega, axis=0)
    gradient[:-1] += change
    gradient[1:] -= change
    return Normal(diagonal, upper, coupled.reshape(omega.size, len(channel)), dense, gradient.ravel(), gradient_theta)


def _assemble(
    block: FloatArray, down: FloatArray, border: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Per-sample 6×6 blocks, gradients (n,6) and borders (n,6,q) added up at the nodes."""
    n, _, q = border.shape
    diagonal, gradient, coupled = np.zeros((n + 1, 3, 3)), np.zeros((n + 1, 3)), np.zeros((n + 1, 3, q))
    for side, nodes in ((slice(0, 3), slice(0, n)), (slice(3, 6), slice(1, n + 1))):
        diagonal[nodes] += block[:, side, side]
        gradient[nodes] += down[:, side]
        coupled[nodes] += border[:, side]
    return diagonal, block[:, :3, 3:].copy(), gradient, coupled


@dataclass(frozen=True, eq=False)
class Solved:
    """Factored normal equations: `factor` of the ω block, `through` = Hωω⁻¹ Hωθ (3(n+1),q), `alone` = Hωω⁻¹ gω, the
    Schur complement `schur` (q,q), which is the posterior precision of θ, and what drives θ, `pull` (q,)."""

    normal: Normal
    factor: block_tridiagonal.Factor
    through: FloatArray
    alone: FloatArray
    schur: FloatArray
    pull: FloatArray


def eliminate(normal: Normal) -> Solved:
    """Eliminate ω: Schur complement and pull of θ. EstimationError where the readings do not determine ω."""
    factored = block_tridiagonal.factor(normal.diagonal, normal.upper)
    solved = factored.solve(np.column_stack([normal.gradient_omega, normal.border]))
    alone, through = solved[:, 0], solved[:, 1:]
    schur = normal.dense - normal.border.T @ through
    return Solved(normal, factored, through, alone, schur, normal.gradient_theta - normal.border.T @ alone)


def fit(
    data: Data,
    start: FloatArray,
    theta: FloatArray | None = None,
    iterations: int = ITERATIONS,
    tolerance: float = TOLERANCE,
    hopeless: float = np.inf,
) -> Fit:
    """Minimise the cost from ω `start` (n+1,3) until a step gains less than `tolerance` of it.

    A fit that has not settled within `iterations`, or still costs more than `hopeless` after three, says so:
    `converged`. EstimationError where ω is not determined.
    """
    omega, theta = start, np.zeros(len(data.channel)) if theta is None else theta
    columns = columns_at(data, omega, theta)
    cost = total_cost(data, omega, theta, columns)
    for iteration in range(1, iterations + 1):
        solved = eliminate(normal_equations(data, omega, theta, columns))
        step_theta = np.linalg.solve(solved.schur, solved.pull)
        step_omega = (solved.alone - solved.through @ step_theta).reshape(-1, 3)
        scale, previous = 1.0, cost
        while True:
            trial, moved = omega + scale * step_omega, theta + scale * step_theta
            trial_columns = columns_at(data, trial, moved, columns)
            trial_cost = total_cost(data, trial, moved, trial_columns)
            if trial_cost <= cost or scale < SMALLEST_STEP:
                break
            scale *= 0.25
        omega, theta, columns, cost = trial, moved, trial_columns, trial_cost
        if abs(previous - cost) <= tolerance * (cost + data.dof):
            return Fit(data, omega, theta, columns, cost, True, iteration, log_determinant(solved.schur))
        if iteration >= 3 and cost > hopeless:
            break
    return Fit(data, omega, theta, columns, cost, False, iteration, log_determinant(solved.schur))


def log_determinant(matrix: FloatArray) -> float:
    """ln |det| of a symmetric positive definite matrix."""
    return float(np.linalg.slogdet(matrix)[1])
