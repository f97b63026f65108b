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
from functools import cached_property

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
    `patterns` (9,n,p) calibration errors and slow noise of one standard deviation, `arms` (3,); SI."""

    names: tuple[str, ...]
    time: FloatArray
    readings: FloatArray
    sigma: FloatArray
    patterns: FloatArray
    arms: FloatArray

    @cached_property
    def turned(self) -> FloatArray:
        """(9,n,p) ∫patterns dt."""
        flat = np.moveaxis(self.patterns, 0, 1).reshape(len(self.time), -1)
        return np.moveaxis(kinematics.integrate(flat, self.time).reshape(-1, *self.patterns[:, 0].shape), 1, 0)


def make_problem(
    nine: SensorArray,
    time: FloatArray,
    readings: FloatArray,
    sigma: FloatArray,
    motion: Motion,
    arms: FloatArray,
    rest_blocks: int = 0,
) -> Problem:
    """`nine` sensors and their columns in the order of nap.CHANNELS; `readings` without gaps. `rest_blocks`: how
    many of the samples the zero was taken from."""
    patterns = calibration.all_columns(nine, readings, time, motion)
    modes = slow_noise(len(time), rest_blocks)[None] * sigma[:, None, None]
    return Problem(nine.channels, time, readings, sigma, np.concatenate([patterns, modes], axis=2), arms)


def slow_noise(count: int, rest_blocks: int) -> FloatArray:
    """(n,7) what white noise of standard deviation 1 does slowly, which ∫ lets grow: its six lowest cosine modes,
    √(2/n) cos(jπt/T) with a coefficient of sd 1 each, and the error of the zero, 1/√rest_blocks."""
    phase = np.pi * (np.arange(count) + 0.5) / count
    modes = np.sqrt(2.0 / count) * np.cos(phase[:, None] * np.arange(1, 7))
    zero = np.full((count, 1), 1.0 / np.sqrt(rest_blocks) if rest_blocks else 1.0 / np.sqrt(count))
    return np.hstack([zero, modes])


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


def response(problem: Problem, channel: int | None, patterns: FloatArray, turned: FloatArray) -> FloatArray:
    """(9,n,3,p) derivative of the residual under a hypothesis along `patterns` (9,n,p), one set in each channel.

    `turned` (9,n,p) is ∫patterns dt. A fault f in channel i moves the rebuilt channel c by δy_c (rebuilt_response)
    and the residual by δr = P_i f + P_c δy_c − δ(ωyωz, ωzωx, ωxωy), δω = A_i ∫f + A_c ∫δy_c  [Takhounts09 eqs 12, 14].
    The free channel itself has no response.
    """
    products, alphas = nap.product_rows(problem.arms), nap.alpha_rows(problem.arms)
    omega = nap.omega(replaced(problem, channel, problem.readings), problem.arms, problem.time)
    direct = products[:, :, None, None] * patterns
    spin = alphas[:, :, None, None] * turned
    if channel is not None:
        moved = rebuilt_response(problem, channel, omega, patterns, turned)
        flat = np.moveaxis(moved, 0, 1).reshape(len(problem.time), -1)
        swept = np.moveaxis(kinematics.integrate(flat, problem.time).reshape(-1, 9, moved.shape[2]), 1, 0)
        for i in range(3):
            if products[i, channel]:
                direct[i] += products[i, channel] * moved
            if alphas[i, channel]:
                spin[i] += alphas[i, channel] * swept
        direct[:, channel], spin[:, channel] = 0.0, 0.0
    for i, left, right in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        direct[i] -= omega[:, left, None] * spin[right]
        direct[i] -= omega[:, right, None] * spin[left]
    return np.moveaxis(direct, 0, 2)


def rebuilt_response(
    problem: Problem, channel: int, omega: FloatArray, patterns: FloatArray, turned: FloatArray
) -> FloatArray:
    """(9,n,p) change of the rebuilt channel along `patterns`: δy_c = row_i f + ω_k (v·A_i) ∫f + (v·ω) A_ki ∫f
    (nap.closed_form), 0 for the channel itself."""
    form, alphas = nap.closed_form(nap.CHANNELS[channel], problem.arms), nap.alpha_rows(problem.arms)
    along, lead = form.direction @ alphas, alphas[form.axis]
    sweep = along[:, None] * omega[:, form.axis] + lead[:, None] * (omega @ form.direction)
    moved = form.row[:, None, None] * patterns + sweep[:, :, None] * turned
    moved[channel] = 0.0
    return np.asarray(moved)


def fit_hypothesis(problem: Problem, channel: int | None) -> Hypothesis:
    """Cost of one hypothesis, calibration errors fitted within their priors."""
    whiten = whitener(problem, channel)
    observed = residual(problem, channel, problem.readings) @ whiten.T
    design = calibration_design(problem, channel, whiten)
    seen = observed.ravel()
    theta = np.linalg.solve(design.T @ design + np.eye(design.shape[1]), design.T @ seen)
    cost = float(np.sum((seen - design @ theta) ** 2) + theta @ theta)
    return Hypothesis(channel, cost, observed.size, whiten, design)


def calibration_design(problem: Problem, channel: int | None, whiten: FloatArray) -> FloatArray:
    """(n·m, p) whitened responses of the residual to one standard deviation of each calibration error."""
    seen = response(problem, channel, problem.patterns, problem.turned)
    active = np.asarray(problem.patterns.any(axis=1))
    if channel is not None:
        active[channel] = False
    columns = np.moveaxis(seen, 3, 1)[active]
    seen_white = np.einsum("mi,pni->nmp", whiten, columns)
    return np.asarray(seen_white.reshape(len(problem.time) * len(whiten), len(columns)))


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
    """Largest cost per degree of freedom of a hypothesis that holds: χ² by its normal limit, plus MODEL_SLACK; NaN
    where nothing is left to test it by."""
    from statistics import NormalDist

    if dof < 1:
        return float("nan")
    return 1.0 + MODEL_SLACK - NormalDist().inv_cdf(false_alarm) * float(np.sqrt(2.0 / dof))


def unexplained(design: FloatArray, signatures: FloatArray) -> FloatArray:
    """λ = ‖(I − Π) s‖² of each row of `signatures` (q,n): the part that calibration errors within their priors
    cannot imitate, min over θ of ‖s − Dθ‖² + ‖θ‖² = s·s − (Dᵀs)·(DᵀD + 1)⁻¹(Dᵀs), for `design` D (n,p)."""
    normal = design.T @ design + np.eye(design.shape[1])
    seen = signatures @ design
    explained = (seen * np.linalg.solve(normal, seen.T).T).sum(axis=1)
    return np.asarray(np.maximum((signatures**2).sum(axis=1) - explained, 0.0))


def separations(problem: Problem, hypothesis: Hypothesis, pattern: FloatArray) -> FloatArray:
    """(9,) λ = ‖(I − Π_k) S_j e‖²: how far a fault `pattern` (n,) in each channel stays visible under a hypothesis.

    0 for the channel that the hypothesis leaves free.
    """
    patterns = np.broadcast_to(pattern[None, :, None], (9, len(pattern), 1))
    turned = np.broadcast_to(kinematics.integrate(pattern, problem.time)[None, :, None], patterns.shape)
    seen = response(problem, hypothesis.channel, patterns, turned)[:, :, :, 0] @ hypothesis.whiten.T
    return unexplained(hypothesis.design, seen.reshape(9, -1))
