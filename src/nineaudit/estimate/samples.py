"""From the whole-record fit, which works on blocks, back to every sample of the recording.

ω(t) and the calibration errors θ, which only the whole record tells, are taken from the fit; a0 and α from the readings
of each sample, with the instrument (H', q', b', time skews s') that θ describes:

    [a0; α] = P (y − b' + s' dy/dt − q'(ω)),   P = (H'ᵀWH')⁻¹H'ᵀW            [Becker75 eq 5; METHODS.md 1]
    ŷ_k     = h_k·[a0; α] + q_k(ω)             a perfect sensor in the place and along the axis that the rig states

so that nothing of the band is lost. Where the valid accelerometers do not span α it is dω/dt. The uncertainty of ŷ_k is

    u² = Σ ρ_i²σ_i² + f cov(ω, θ) fᵀ,    ρ = h_k P,   f_ω = ∂q_k/∂ω − ρ ∂q'/∂ω,   f_θ = −ρ_i(θ) D_θ

its first part white (as white as the noise is), its second slow: the same error for many samples together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import BoolArray, FloatArray, IntArray
from nineaudit.estimate.motion import Motion
from nineaudit.estimate.posterior import Posterior
from nineaudit.estimate.trajectory import Fit
from nineaudit.physics import kinematics, rigid_body


@dataclass(frozen=True, eq=False)
class Rebuilt:
    """(n,) `values` of a perfect sensor, their white `noise` and `slow` standard uncertainty, and the part of it that
    noise has in ω, calibration held, `noise_of_omega`; NaN where the valid readings do not tell."""

    values: FloatArray
    noise: FloatArray
    slow: FloatArray
    noise_of_omega: FloatArray

    @property
    def u(self) -> FloatArray:
        """(n,) standard uncertainty."""
        return np.hypot(self.noise, self.slow)

    @property
    def white(self) -> FloatArray:
        """(n,) the part of `u` that white noise makes."""
        return np.hypot(self.noise, self.noise_of_omega)


@dataclass(frozen=True, eq=False)
class Samples:
    """`motion` at every sample, and how it follows from the readings there: `solver` (p,6,k) from readings to [a0; α],
    one for each pattern of valid channels, `which` (n,) pattern, `own` (p,) whether the sample itself tells α."""

    fit: Fit
    time: FloatArray
    motion: Motion
    solver: FloatArray
    which: IntArray
    own: BoolArray


def at_samples(fit: Fit, time: FloatArray, readings: FloatArray, sigma: FloatArray, near: Fit | None = None) -> Samples:
    """The motion from `readings` (n,k) SI zeroed (NaN: not used) at `time` (n,), noise `sigma` (k,), ω and θ of `fit`.

    a0 and α are NaN where a sample's valid readings do not tell them. `near`: another fit whose slopes will do.
    """
    data = fit.data
    there = data.bent(fit.theta)
    omega, slope = _omega(fit, time)
    left = (
        readings
        - _offsets(fit, time, fit if near is None else near)
        - rigid_body.centripetal(there.positions, there.axes, omega)
    )
    valid = np.isfinite(left) & there.held
    patterns, which = _patterns(valid)
    solver, own = np.zeros((len(patterns), 6, len(data.array))), np.zeros(len(patterns), dtype=np.bool_)
    state = np.full((len(time), 6), np.nan)
    for p, used in enumerate(patterns):
        found = _solver(there.axes_a, there.lever, np.where(used, 1.0 / sigma, 0.0))
        if found is None:
            continue
        solver[p], own[p] = found
        rows = np.flatnonzero(which == p)
        known = np.zeros((len(rows), 3)) if own[p] else slope[rows]
        seen = np.where(used, left[rows], 0.0) - known @ there.lever.T
        state[rows] = seen @ solver[p].T + np.hstack([np.zeros_like(known), known])
    motion = Motion(omega, state[:, 3:], state[:, :3], "whole-record fit; a0 and α from each sample")
    return Samples(fit, time, motion, solver, np.asarray(which), own)


def rebuild(at: Samples, posterior: Posterior, sigma: FloatArray, column: int) -> Rebuilt:
    """What a perfect sensor in the place of `column` would have read; the readings of `at` should not hold its own."""
    data, sensor = at.fit.data, at.fit.data.array.sensors[column]
    if sensor.kind == "gyroscope":
        rows = np.broadcast_to(0.5 * np.tile(sensor.axis, 2), (len(data.time), 6))
        slow, of_omega = _slow(at, posterior, rows, np.zeros((len(data.time), len(at.fit.theta))))
        return Rebuilt(at.motion.omega @ sensor.axis, np.zeros(len(at.time)), slow, of_omega)
    axis, place = sensor.axis[None], sensor.position[None]
    row = rigid_body.design(place, axis)[0]
    q = rigid_body.centripetal(place, axis, at.motion.omega)[:, 0]
    values = np.hstack([at.motion.a0, at.motion.alpha]) @ row + q
    weights = np.einsum("i,pik->pk", row, at.solver)  # ρ of each pattern
    noise = np.sqrt(weights**2 @ sigma**2)[at.which]
    slow, of_omega = _slow(at, posterior, *_derivatives(at, weights, row, axis, place))
    return Rebuilt(values, noise, slow, of_omega)


def bound(fit: Fit, sigma: FloatArray, column: int) -> float:
    """Least standard deviation of an accelerometer rebuilt from the other accelerometers, ω and calibration known:
    √(h_k (Σ h'h'ᵀ/σ²)⁻¹ h_kᵀ), σ√(h/(1−h)) where all are alike (METHODS.md 4). ∞ where they do not determine it."""
    there, sensor = fit.data.bent(fit.theta), fit.data.array.sensors[column]
    held = [i for i in np.flatnonzero(there.held & fit.data.used).tolist() if i != column]
    design = np.hstack([there.axes_a, there.lever])[held]
    if np.linalg.matrix_rank(design, tol=1e-6) < 6:
        return float("inf")
    row = rigid_body.design(sensor.position[None], sensor.axis[None])[0]
    return float(np.linalg.norm(np.linalg.pinv(design / sigma[held, None]).T @ row))


def _derivatives(
    at: Samples, weights: FloatArray, row: FloatArray, axis: FloatArray, place: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """f by ω at the two nodes of each block (m,6), and by θ (m,q), with ρ `weights` (p,k) and h_k `row` (6,)."""
    point = at.fit.point
    data, there = point.data, point.instrument
    near = at.which[np.clip(np.searchsorted(at.time, data.time), 0, len(at.time) - 1)]
    rho, omega = weights[near], point.mean.T
    felt = rigid_body.centripetal_jacobian(there.positions, there.axes, omega)
    half = 0.5 * (rigid_body.centripetal_jacobian(place, axis, omega)[:, 0] - np.einsum("mk,mkj->mj", rho, felt))
    slope = np.where(at.own[near, None], 0.0, row[3:] - rho @ there.lever) / data.step[:, None]
    return np.hstack([half - slope, half + slope]), -rho[:, data.channel] * point.columns.T


def _slow(
    at: Samples, posterior: Posterior, by_omega: FloatArray, by_theta: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(n,) standard uncertainty through ω and θ, and that through ω alone with θ held, carried from the blocks."""
    whole = posterior.sd(by_omega, by_theta)
    held = np.sqrt(np.maximum(np.einsum("mi,mij,mj->m", by_omega, posterior.pair, by_omega), 0.0))
    return np.interp(at.time, at.fit.data.time, whole), np.interp(at.time, at.fit.data.time, held)


def _omega(fit: Fit, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """ω and dω/dt (n,3) by a cubic spline through the nodes."""
    from scipy.interpolate import CubicSpline

    blocks, step = fit.data.time, fit.data.step
    nodes = np.append(blocks - 0.5 * step, blocks[-1] + 0.5 * step[-1])
    curve = CubicSpline(nodes, fit.omega)
    return np.asarray(curve(time)), np.asarray(curve(time, 1))


def _offsets(fit: Fit, time: FloatArray, near: Fit) -> FloatArray:
    """(n,k) what zeros and time skews add: b − s dy/dt, y of a perfect instrument in the motion of `near`."""
    error = fit.data.errors(fit.theta)
    out = np.broadcast_to(error[:, 1], (len(time), len(error))).copy()
    late = np.flatnonzero(error[:, 7])
    if len(late):
        slopes = kinematics.differentiate(near.ideal[:, late], fit.data.time)
        for i, k in enumerate(late):
            out[:, k] -= error[k, 7] * np.interp(time, fit.data.time, slopes[:, i])
    return out


def _patterns(valid: BoolArray) -> tuple[BoolArray, IntArray]:
    """(p,k) patterns of valid channels, and (n,) whose is whose. Most samples are like the first."""
    odd = np.flatnonzero((valid != valid[0]).any(axis=1))
    patterns, which = np.unique(valid[odd], axis=0, return_inverse=True)
    place = np.zeros(len(valid), dtype=np.intp)
    place[odd] = 1 + which.ravel()
    return np.vstack([valid[:1], patterns]), place


def _solver(axes: FloatArray, lever: FloatArray, weight: FloatArray) -> tuple[FloatArray, bool] | None:
    """P (6,k), and whether it tells α; None where not even a0 is determined."""
    used = weight > 0
    if not used.any() or np.linalg.matrix_rank(axes[used], tol=1e-3) < 3:
        return None
    design = np.hstack([axes, lever])
    if np.linalg.matrix_rank(design[used], tol=1e-6) == 6:
        return np.linalg.pinv(weight[:, None] * design) * weight, True
    out = np.zeros((6, len(weight)))
    out[:3] = np.linalg.pinv(weight[:, None] * axes) * weight
    return out, False
