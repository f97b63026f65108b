"""What the whole-record fit fits: readings, weights, calibration priors, and the prediction of every reading.

ω lives on the nodes between samples, so that with the midpoint rule every sample t has its own, independent noise:

    ω̄_t = (ω_t−½ + ω_t+½)/2,    α_t = (ω_t+½ − ω_t−½)/h_t                                    (dω/dt = α)

    accelerometer i:  y_i = n_i·a0 + (r_i × n_i)·α_t + q_i(ω̄_t) + b_i − s_i dy_i/dt + noise      [Becker75 eq 5]
    rate sensor i:    y_i = n_i·ω̄_t + b_i − s_i dy_i/dt + noise
    n_i = (1 + g)(n + τ_1 u_1 + τ_2 u_2),  r_i = r + e        gain, tilts and place as they are, not as the rig says

a0(t) is free and eliminated sample by sample: what remains of weighted readings z is (1 − GᵀG) z. Unknown are ω (three
a node) and θ, calibration errors and fault amplitudes in units of their prior standard deviations (METHODS.md 2).
D = ∂y/∂θ at the present ω, a0 and θ.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from nineaudit.array import FloatArray, IntArray, SensorArray
from nineaudit.estimate import calibration
from nineaudit.estimate.motion import Motion
from nineaudit.physics import rigid_body

ANY_ALPHA = 1e5
"""rad/s²: where the valid channels do not tell α, it is 0 with this standard deviation, far beyond any impact."""


@dataclass(frozen=True, eq=False)
class Extra:
    """Fault shapes beside the calibration errors: `columns` (n,e) change of a reading by one prior standard
    deviation, `channel` (e,) whose reading."""

    columns: FloatArray
    channel: IntArray


@dataclass(frozen=True, eq=False)
class Data:
    """What is fitted: `time` (n,) s, `readings` (n,k) SI zeroed (any number where the weight is 0), `weight` (n,k)
    1/σ or 0, `prior_sd` (k,8) of calibration.PARAMETERS (0: certain), `still` (n+1,) precision (s²/rad²) with which
    ω = 0 is known at each node, 0 where it is not, and `extra` fault shapes."""

    array: SensorArray
    time: FloatArray
    readings: FloatArray
    weight: FloatArray
    prior_sd: FloatArray
    still: FloatArray
    extra: Extra | None = None

    @cached_property
    def active(self) -> tuple[IntArray, IntArray]:
        """(p,) channel and (p,) parameter of each calibration error that is not certain and whose channel is used."""
        used = np.asarray((self.weight > 0).any(axis=0))
        channel, parameter = np.nonzero((self.prior_sd > 0) & used[:, None])
        return channel, parameter

    @cached_property
    def channel(self) -> IntArray:
        """(q,) channel of each θ: calibration errors, then fault shapes."""
        extra = np.zeros(0, dtype=np.intp) if self.extra is None else self.extra.channel
        return np.concatenate([self.active[0], extra])

    @cached_property
    def by_channel(self) -> FloatArray:
        """(q,k) 1 where a θ belongs to a channel."""
        return np.equal.outer(self.channel, np.arange(len(self.array))).astype(np.float64)

    @cached_property
    def across(self) -> FloatArray:
        """(k,2,3) directions of the tilts."""
        return calibration.perpendiculars(self.array)

    @cached_property
    def step(self) -> FloatArray:
        """(n,) width of each sample's interval, s."""
        return np.asarray(np.gradient(self.time))

    @cached_property
    def bridge(self) -> FloatArray:
        """(n,) precision (s²/rad²) with which ω stays over a sample whose valid channels do not tell α, though those of
        the record do; where they never do, over one without any valid channel."""
        patterns, which = np.unique(self.weight > 0, axis=0, return_inverse=True)
        design = np.hstack([self.axes_a, self.lever])
        rank = [int(np.linalg.matrix_rank(design[p])) if p.any() else 0 for p in (*patterns, patterns.any(axis=0))]
        short = np.array([r < 6 if rank[-1] == 6 else not p.any() for r, p in zip(rank[:-1], patterns, strict=True)])
        return np.where(short[which.ravel()], (ANY_ALPHA * self.step) ** -2, 0.0)

    @cached_property
    def lever(self) -> FloatArray:
        """(k,3) r_i × n_i, zero for rate sensors."""
        crossed = np.cross(self.array.positions, self.array.axes)
        return np.where(self.array.is_accelerometer[:, None], crossed, 0.0)

    @cached_property
    def axes_a(self) -> FloatArray:
        """(k,3) axes of the accelerometers, zero for rate sensors."""
        return np.where(self.array.is_accelerometer[:, None], self.array.axes, 0.0)

    @cached_property
    def gram(self) -> FloatArray:
        """(n,3,3) AᵀA with A = w n of the accelerometers."""
        outer = (self.axes_a[:, :, None] * self.axes_a[:, None, :]).reshape(len(self.array), 9)
        return (self.weight**2 @ outer).reshape(-1, 3, 3)

    @cached_property
    def eliminator(self) -> FloatArray:
        """G (n,3,k) = L⁻¹Aᵀ with LLᵀ = AᵀA. A direction that no valid accelerometer senses explains nothing."""
        scale = np.trace(self.gram, axis1=1, axis2=2)
        regular = self.gram + (1e-12 * scale + 1e-300)[:, None, None] * np.eye(3)
        inverse = np.linalg.inv(np.linalg.cholesky(regular))
        return (inverse @ self.axes_a.T) * self.weight[:, None, :]

    @cached_property
    def dof(self) -> int:
        """Expectation of the cost: valid readings less a0 (as far as it is sensed) and ω, save where ω is known or
        no sample beside a node has a valid reading."""
        patterns, count = np.unique(self.weight > 0, axis=0, return_counts=True)
        sensed = sum(int(np.linalg.matrix_rank(self.axes_a[p])) * int(c) for p, c in zip(patterns, count, strict=True))
        absent = ~(self.weight > 0).any(axis=1)
        lost = np.append(True, absent) & np.append(absent, True)
        return int((self.weight > 0).sum()) - sensed - 3 * int(((self.still == 0) & ~lost).sum())


def middle(omega: FloatArray) -> FloatArray:
    """(n,3) ω at the samples from ω (n+1,3) at the nodes."""
    return 0.5 * (omega[1:] + omega[:-1])


def known_part(data: Data, mean: FloatArray, alpha: FloatArray) -> FloatArray:
    """(n,k) readings less a0 and calibration: (r × n)·α + q(ω̄), or n·ω̄."""
    array = data.array
    q = rigid_body.centripetal(array.positions, array.axes, mean)
    return np.where(array.is_accelerometer, alpha @ data.lever.T + q, mean @ array.axes.T)


def motion_of(data: Data, omega: FloatArray, correction: FloatArray | float) -> Motion:
    """Motion at the samples for ω at the nodes: a0 is what the readings less `correction` leave, by least squares."""
    mean, alpha = middle(omega), np.diff(omega, axis=0) / data.step[:, None]
    left = data.weight * (data.readings - correction - known_part(data, mean, alpha))
    explained = data.eliminator @ left[:, :, None]
    # a0 = L⁻ᵀ (G z), with L⁻ᵀ read off G of the three axes' directions
    scale = np.trace(data.gram, axis1=1, axis2=2)
    regular = data.gram + (1e-12 * scale + 1e-300)[:, None, None] * np.eye(3)
    root = np.linalg.cholesky(regular)
    a0 = np.linalg.solve(root.transpose(0, 2, 1), explained)[:, :, 0]
    return Motion(mean, np.asarray(alpha), np.asarray(a0), "whole-record maximum a posteriori fit")


def ideal(data: Data, motion: Motion) -> FloatArray:
    """(n,k) readings of a perfect instrument."""
    array = data.array
    return rigid_body.predict(
        array.positions, array.axes, array.is_accelerometer, motion.a0, motion.alpha, motion.omega
    )


def errors(data: Data, theta: FloatArray) -> FloatArray:
    """(k,8) calibration errors, SI, of θ (q,)."""
    out = np.zeros_like(data.prior_sd)
    out[data.active] = theta[: len(data.active[0])] * data.prior_sd[data.active]
    return out


def _placed(data: Data, error: FloatArray) -> Data:
    """The problem with the axes tilted and the sensors moved by `error` (k,8), gains as stated."""
    if not error[:, 2:7].any():
        return data
    axes = data.array.axes + np.einsum("kj,kji->ki", error[:, 2:4], data.across)
    places = data.array.positions + error[:, 4:7]
    sensors = (replace(s, axis=n, position=r) for s, n, r in zip(data.array.sensors, axes, places, strict=True))
    return replace(data, array=SensorArray(tuple(sensors)))


def bent(data: Data, theta: FloatArray) -> Data:
    """The problem with the instrument that θ describes: axes (1+g)(n + τ_1 u_1 + τ_2 u_2), positions r + e."""
    error = errors(data, theta)
    placed = _placed(data, error)
    if not error[:, 0].any():
        return placed
    axes = (1.0 + error[:, :1]) * placed.array.axes
    sensors = (replace(s, axis=n) for s, n in zip(placed.array.sensors, axes, strict=True))
    return replace(placed, array=SensorArray(tuple(sensors)))


def columns_of(data: Data, motion: Motion, theta: FloatArray) -> FloatArray:
    """D (n,q): change of its channel's reading by one prior standard deviation of each θ, about θ.

    The gain acts on the reading that the motion predicts, not on the measured one, which may be the faulty one.
    """
    channel, parameter = data.active
    error = errors(data, theta)
    placed = _placed(data, error)
    every = calibration.columns(placed.array, ideal(placed, motion), data.time, motion, data.across)
    every[:, :, 2:] *= 1.0 + error[:, :1]
    active = every[:, channel, parameter] * data.prior_sd[channel, parameter]
    return active if data.extra is None else np.hstack([active, data.extra.columns])


def added_of(data: Data, columns: FloatArray, theta: FloatArray) -> FloatArray:
    """(n,k) what zeros, time skews and fault shapes add to the readings of the bent instrument."""
    parameter = data.active[1]
    adds = np.concatenate([(parameter == 1) | (parameter == 7), np.ones(len(theta) - len(parameter), dtype=np.bool_)])
    return np.asarray((columns[:, adds] * theta[adds]) @ data.by_channel[adds])


def columns_at(data: Data, omega: FloatArray, theta: FloatArray, columns: FloatArray | None = None) -> FloatArray:
    """Columns D at ω and θ, with a0 by least squares; `columns` (if known) near by, for the skews."""
    columns = columns_of(data, motion_of(bent(data, theta), omega, 0.0), theta) if columns is None else columns
    return columns_of(data, motion_of(bent(data, theta), omega, added_of(data, columns, theta)), theta)


def total_cost(data: Data, omega: FloatArray, theta: FloatArray, columns: FloatArray) -> float:
    """The cost of ω and θ, with the prior of α in gaps: twice the negative log posterior."""
    there = bent(data, theta)
    bridged = float((data.bridge[:, None] * np.diff(omega, axis=0) ** 2).sum())
    return cost_of(there, residual(there, omega, added_of(data, columns, theta)), omega, theta) + bridged


def residual(data: Data, omega: FloatArray, correction: FloatArray) -> FloatArray:
    """z (n,k): weighted readings less prediction, a0 not yet eliminated."""
    mean, alpha = middle(omega), np.diff(omega, axis=0) / data.step[:, None]
    return np.asarray(data.weight * (data.readings - correction - known_part(data, mean, alpha)))


def cost_of(data: Data, z: FloatArray, omega: FloatArray, theta: FloatArray) -> float:
    """‖z‖² less what a0 explains, plus the priors of θ and of rest."""
    explained = data.eliminator @ z[:, :, None]
    still = float((data.still[:, None] * omega**2).sum())
    return float((z**2).sum() - (explained**2).sum() + (theta**2).sum() + still)


def jacobian(data: Data, mean: FloatArray) -> FloatArray:
    """(n,k,6) derivative of the weighted prediction with respect to ω at the nodes before and after each sample.

    accelerometers ½ ∂q/∂ω ∓ (r × n)/h, rate sensors ½ n.
    """
    array = data.array
    half = 0.5 * rigid_body.centripetal_jacobian(array.positions, array.axes, mean)
    half = np.where(array.is_accelerometer[:, None], half, 0.5 * array.axes)
    slope = data.lever / data.step[:, None, None]
    return np.asarray(data.weight[:, :, None] * np.concatenate([half - slope, half + slope], axis=2))
