"""Leave-one-out for a 3-2-2-2 array by the closed forms of METHODS.md 1.1.

Hypothesis k says that channel k may carry anything: it is replaced by its closed form from the other eight, and
the constraints that are left (two after an arm channel or a centre channel, three for the healthy hypothesis)
must hold. Calibration errors θ of the rig's stated size explain a part of every residual, so the statistic is

    cost = min over θ of ‖W (r − D θ)‖² + ‖θ‖²,    θ in units of its prior standard deviation    (METHODS.md 2)

with W the whitening by the noise covariance of the residual and D its response to each calibration error.
Cost over degrees of freedom is near 1 for a hypothesis that holds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.estimate import calibration
from nineaudit.estimate.motion import Motion
from nineaudit.physics import kinematics, nap


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """`channel` (column of the nine; None: healthy) is free: its `cost` and `dof`, with the whitening `whiten`
    (m,3) and the calibration responses `design` (n·m,p) that went into it."""

    channel: int | None
    cost: float
    dof: int
    whiten: FloatArray
    design: FloatArray

    @property
    def statistic(self) -> float:
        """Cost per degree of freedom."""
        return self.cost / self.dof

    @property
    def excess(self) -> float:
        """Cost above its expectation."""
        return self.cost - self.dof


@dataclass(frozen=True, eq=False)
class Problem:
    """Nine columns in the order of nap.CHANNELS: channel `names`, `time` (n,), `readings` (n,9), `sigma` (9,),
    `patterns` (9,n,8) calibration responses of one standard deviation, `arms` (3,); SI."""

    names: tuple[str, ...]
    time: FloatArray
    readings: FloatArray
    sigma: FloatArray
    patterns: FloatArray
    arms: FloatArray


def make_problem(
    nine: SensorArray,
    time: FloatArray,
    readings: FloatArray,
    sigma: FloatArray,
    motion: Motion,
    arms: FloatArray,
) -> Problem:
    """`nine` sensors and their columns in the order of nap.CHANNELS; `readings` without gaps."""
    patterns = calibration.all_columns(nine, readings, time, motion)
    return Problem(nine.channels, time, readings, sigma, patterns, arms)


def replaced(problem: Problem, channel: int | None, readings: FloatArray) -> FloatArray:
    """`readings` (n,9) with one column put as its closed form from the other eight."""
    if channel is None:
        return readings
    out = readings.copy()
    out[:, channel] = nap.rebuild(nap.CHANNELS[channel], readings, problem.arms, problem.time)
    return out


def residual(problem: Problem, channel: int | None, readings: FloatArray) -> FloatArray:
    """Constraint residuals (n,3) rad²/s² of `readings` (n,9) under a hypothesis."""
    return nap.constraint_residuals(replaced(problem, channel, readings), problem.arms, problem.time)


def whitener(problem: Problem, channel: int | None) -> FloatArray:
    """W (m,3) with W S Wᵀ = 1 for the noise covariance S of the residual; m is the number of constraints left.

    The direct, per-sample part of the noise: what goes through ∫ω is a per cent of it (METHODS.md 4).
    """
    rows = nap.product_rows(problem.arms)
    mixing = np.eye(9)
    if channel is not None:
        mixing[channel] = nap.closed_form(nap.CHANNELS[channel], problem.arms).row
    spread = rows @ mixing * problem.sigma
    values, vectors = np.linalg.eigh(spread @ spread.T)
    kept = values > 1e-9 * values.max()
    return np.asarray((vectors[:, kept] / np.sqrt(values[kept])).T)


def response(problem: Problem, channel: int | None, column: int, patterns: FloatArray) -> FloatArray:
    """(n,3,p) derivative of the residual under a hypothesis along `patterns` (n,p) in one channel.

    A fault f in channel i moves the rebuilt channel c by δy_c = row_i f + ω_k (v·δω) + δω_k (v·ω) and the residual
    by δr = P_i f + P_c δy_c − δ(ωyωz, ωzωx, ωxωy), with δω = A_i ∫f + A_c ∫δy_c  (nap.closed_form; eqs 12, 14).
    """
    products, alphas = nap.product_rows(problem.arms), nap.alpha_rows(problem.arms)
    omega = nap.omega(replaced(problem, channel, problem.readings), problem.arms, problem.time)
    turned = kinematics.integrate(patterns, problem.time)
    direct = products[:, column, None] * patterns[:, None, :]
    spin = alphas[:, column, None] * turned[:, None, :]
    if channel is not None:
        form = nap.closed_form(nap.CHANNELS[channel], problem.arms)
        along = form.direction @ alphas[:, column]
        moved = form.row[column] * patterns + turned * (
            omega[:, [form.axis]] * along + (omega @ form.direction)[:, None] * alphas[form.axis, column]
        )
        direct = direct + products[:, channel, None] * moved[:, None, :]
        spin = spin + alphas[:, channel, None] * kinematics.integrate(moved, problem.time)[:, None, :]
    left, right = [1, 2, 0], [2, 0, 1]
    return np.asarray(direct - omega[:, left, None] * spin[:, right] - omega[:, right, None] * spin[:, left])


def fit_hypothesis(problem: Problem, channel: int | None) -> Hypothesis:
    """Cost of one hypothesis, calibration errors fitted within their priors."""
    whiten = whitener(problem, channel)
    observed = residual(problem, channel, problem.readings) @ whiten.T
    design = calibration_design(problem, channel, whiten)
    return Hypothesis(channel, unexplained(design, observed.ravel()), observed.size, whiten, design)


def calibration_design(problem: Problem, channel: int | None, whiten: FloatArray) -> FloatArray:
    """(n·m, p) whitened responses of the residual to one standard deviation of each calibration error."""
    found = []
    for column in range(9):
        patterns = problem.patterns[column][:, problem.patterns[column].any(axis=0)]
        if column != channel and patterns.size:
            seen = np.einsum("mi,nip->nmp", whiten, response(problem, channel, column, patterns))
            found.append(seen.reshape(-1, patterns.shape[1]))
    return np.hstack(found) if found else np.zeros((len(problem.time) * len(whiten), 0))


def constraint_budget(problem: Problem) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Constraint residuals (n,3) rad²/s² with every channel at its word, their noise (3,), and their standard
    deviation (n,3) from noise and calibration."""
    calibration_part = calibration_design(problem, None, np.eye(3)).reshape(len(problem.time), 3, -1)
    noise = np.sqrt(nap.product_rows(problem.arms) ** 2 @ problem.sigma**2)
    budget = np.sqrt((calibration_part**2).sum(axis=2) + noise**2)
    return residual(problem, None, problem.readings), noise, budget


MODEL_SLACK = 0.15
"""Part of the cost per degree of freedom left to what the linear budget does not describe."""


def limit_per_dof(dof: int, false_alarm: float = 1e-3) -> float:
    """Largest cost per degree of freedom of a hypothesis that holds: χ² by its normal limit, plus MODEL_SLACK."""
    from scipy.special import ndtri

    return 1.0 + MODEL_SLACK - float(ndtri(false_alarm)) * float(np.sqrt(2.0 / dof))


def ridge(design: FloatArray, observed: FloatArray) -> FloatArray:
    """θ (p,) of least ‖observed − Dθ‖² + ‖θ‖²."""
    normal = design.T @ design + np.eye(design.shape[1])
    return np.asarray(np.linalg.solve(normal, design.T @ observed))


def unexplained(design: FloatArray, signature: FloatArray) -> float:
    """λ = ‖(I − Π) s‖², the part of a signature that calibration errors within their priors cannot imitate."""
    theta = ridge(design, signature)
    left = signature - design @ theta
    return float(left @ left + theta @ theta)


def separation(problem: Problem, hypothesis: Hypothesis, fault: int, pattern: FloatArray) -> float:
    """λ = ‖(I − Π_k) S_j e‖²: how far a fault `pattern` (n,) in column `fault` stays visible under a hypothesis.

    0 when the hypothesis leaves that very channel free.
    """
    if fault == hypothesis.channel:
        return 0.0
    seen = response(problem, hypothesis.channel, fault, pattern[:, None])[:, :, 0]
    return unexplained(hypothesis.design, (seen @ hypothesis.whiten.T).ravel())
