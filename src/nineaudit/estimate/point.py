"""The cost of one motion and one calibration, with a0 eliminated sample by sample.

With A = w n of the accelerometers, AᵀA = LLᵀ and G = L⁻¹Aᵀ, weighted residuals z (a0 not yet in them) leave

    cost = ‖z‖² − ‖Gz‖² + ‖θ‖² + Σ still |ω|² + Σ bridge |Δω|²,    a0 = L⁻ᵀ G z

A direction that no valid accelerometer senses explains nothing. Time along columns.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.estimate import calibration
from nineaudit.estimate.instrument import Instrument
from nineaudit.estimate.model import Data
from nineaudit.estimate.motion import Motion
from nineaudit.estimate.shared import SharedElimination, shared_elimination
from nineaudit.physics import kinematics

_UNSENSED, _NOTHING = 1e-12, 1e-300
_ZERO, _TIMING = calibration.PARAMETERS.index("zero"), calibration.PARAMETERS.index("timing")
_BY_MOTION = [i for i in range(len(calibration.PARAMETERS)) if i not in (_ZERO, _TIMING)]


@dataclass(frozen=True, eq=False)
class Elimination:
    """`root` L⁻¹, its six elements 00, 10, 11, 20, 21, 22 as (n,), and `g` G (3,k,n)."""

    root: tuple[FloatArray, ...]
    g: FloatArray

    def a0(self, explained: FloatArray) -> FloatArray:
        """(3,n) L⁻ᵀ (G z) of `explained` (3,n) (or 9, shared.py)."""
        (i00, i10, i11, i20, i21, i22), (x, y, z) = self.root, explained
        return np.stack([i00 * x + i10 * y + i20 * z, i11 * y + i21 * z, i22 * z])

    def errors(self, explained: FloatArray) -> FloatArray:
        """(6,n) errors of ω and α that the channels share: none."""
        return np.zeros((6, explained.shape[1]))


def elimination(axes_a: FloatArray, weight: FloatArray) -> Elimination:
    """G of the accelerometers' axes (k,3) and all weights (k,n)."""
    pairs = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)]
    xx, xy, yy, xz, yz, zz = np.stack([axes_a[:, i] * axes_a[:, j] for i, j in pairs]) @ (weight * weight)
    ridge = _UNSENSED * (xx + yy + zz) + _NOTHING
    i00 = 1.0 / np.sqrt(xx + ridge)
    l10, l20 = xy * i00, xz * i00
    i11 = 1.0 / np.sqrt(yy + ridge - l10 * l10)
    l21 = (yz - l20 * l10) * i11
    i22 = 1.0 / np.sqrt(zz + ridge - l20 * l20 - l21 * l21)
    i10, i21 = -l10 * i00 * i11, -l21 * i11 * i22
    i20 = -(l20 * i00 + l21 * i10) * i22
    x, y, z = axes_a.T[:, :, None] * weight
    g = np.stack([i00 * x, i10 * x + i11 * y, i20 * x + i21 * y + i22 * z])
    return Elimination((i00, i10, i11, i20, i21, i22), g)


@dataclass(frozen=True, eq=False)
class Point:
    """ω (n+1,3) at the nodes and θ (q,), the `instrument` θ describes, `mean` ω̄ and `alpha` (3,n) at the samples, the
    weighted residual `z` (k,n) and what a0 explains of it, `explained` (3,n) (or 9, shared.py), the `columns` D (q,n),
    change of its channel's reading by one prior standard deviation of each θ, and the `cost`."""

    data: Data
    omega: FloatArray
    theta: FloatArray
    instrument: Instrument
    mean: FloatArray
    alpha: FloatArray
    z: FloatArray
    elimination: Elimination | SharedElimination
    explained: FloatArray
    columns: FloatArray

    @cached_property
    def cost(self) -> float:
        """Twice the negative log posterior."""
        data = self.data
        left = float(np.vdot(self.z, self.z) - np.vdot(self.explained, self.explained) + self.theta @ self.theta)
        still = float((data.still[:, None] * self.omega**2).sum())
        return left + still + float((data.bridge[:, None] * np.diff(self.omega, axis=0) ** 2).sum())

    @cached_property
    def motion(self) -> Motion:
        """ω, α and a0 at the samples."""
        a0, alpha, omega = self._at_samples
        return Motion(omega.T, alpha.T, a0.T, "whole-record maximum a posteriori fit")

    @cached_property
    def _at_samples(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(3,n) a0, α and ω, with what happens between the samples."""
        off = self.elimination.errors(self.explained)
        return self.elimination.a0(self.explained), self.alpha + off[3:], self.mean + off[:3]

    @cached_property
    def ideal(self) -> FloatArray:
        """(n,k) readings of a perfect instrument in this motion."""
        perfect = self.data.bent(np.zeros_like(self.theta))
        return np.asarray(perfect.predict(calibration.features(*self._at_samples)).T)

    @cached_property
    def correction(self) -> FloatArray:
        """(n,k) what calibration errors and fault shapes add to the perfect readings."""
        there = self.instrument.predict(calibration.features(*self._at_samples))
        return np.asarray((there + added(self.data, self.theta, self.columns)).T) - self.ideal


def point(data: Data, omega: FloatArray, theta: FloatArray, near: FloatArray | None = None) -> Point:
    """The cost at ω (n+1,3) and θ (q,). Time skews act on the slope of the predicted reading, which needs a0, which
    needs the readings without skews: from the columns `near` by, or else from a first look without skews."""
    if near is None:
        near = point(data, omega, theta, np.zeros((len(theta), 0))).columns
    there = data.bent(theta)
    mean = np.ascontiguousarray(0.5 * (omega[1:] + omega[:-1]).T)
    alpha = np.ascontiguousarray(np.diff(omega, axis=0).T) / data.step
    if data.between is not None:
        mean, alpha = mean + data.between.mean.T[:3], alpha + data.between.mean.T[3:]
    known = calibration.features(np.zeros_like(mean), alpha, mean)
    readings, weight = data.rows
    z = weight * (readings - there.predict(known) - added(data, theta, near))
    free = _elimination(data, there)
    explained = np.einsum("ikn,kn->in", free.g, z)
    if data.between is None:
        known[:3] = free.a0(explained)
    else:
        off = free.errors(explained)
        known = calibration.features(free.a0(explained), alpha + off[3:], mean + off[:3])
    columns = _columns(data, there, known)
    z -= weight * (_skewed(data, theta, columns) - _skewed(data, theta, near))
    explained = np.einsum("ikn,kn->in", free.g, z)
    return Point(data, omega, theta, there, mean, alpha, z, free, explained, columns)


def _elimination(data: Data, there: Instrument) -> Elimination | SharedElimination:
    weight = data.rows[1]
    if data.between is None:
        return elimination(there.axes_a, weight)
    return shared_elimination(there, weight, data.between)


def added(data: Data, theta: FloatArray, columns: FloatArray) -> FloatArray:
    """(k,n) what zeros, time skews (of `columns`) and fault shapes add to the readings of the bent instrument."""
    out = data.errors(theta)[:, [_ZERO]] + _skewed(data, theta, columns)
    if data.extra is None or not theta[len(data.active[1]) :].any():
        return np.asarray(out)
    shapes = np.arange(len(data.active[1]), len(theta))
    return np.asarray(out + _spread(data, theta, shapes) @ data.extra.columns)


def _skewed(data: Data, theta: FloatArray, columns: FloatArray) -> FloatArray | float:
    """(k,n) what time skews add, 0 with `columns` without samples."""
    timed = np.flatnonzero(data.active[1] == _TIMING)
    return _spread(data, theta, timed) @ columns[timed] if columns.shape[1] and len(timed) else 0.0


def _spread(data: Data, theta: FloatArray, some: IntArray) -> FloatArray:
    """(k,s) θ of `some`, each in its channel's row."""
    out = np.zeros((len(data.array), len(some)))
    out[data.channel[some], np.arange(len(some))] = theta[some]
    return out


def _columns(data: Data, there: Instrument, features: FloatArray) -> FloatArray:
    """D (q,n). The gain acts on the reading that the motion predicts, not on the measured one, which may be wrong."""
    channel, parameter = data.active
    sd, count = data.prior_sd[data.active], len(channel)
    out = np.empty((len(data.channel), features.shape[1]))
    by = np.zeros((len(data.array), len(calibration.PARAMETERS), features.shape[0]))
    by[:, _BY_MOTION] = there.sensitivities()
    np.matmul(sd[:, None] * by[channel, parameter], features, out=out[:count])
    zeros, timed = np.flatnonzero(parameter == _ZERO), np.flatnonzero(parameter == _TIMING)
    out[zeros] = sd[zeros, None]
    if len(timed):
        slopes = kinematics.differentiate(there.predict(features).T, data.time).T
        out[timed] = np.where(data.sloped, -sd[timed, None] * slopes[channel[timed]], 0.0)
    if data.extra is not None:
        out[count:] = data.extra.columns
    return out
