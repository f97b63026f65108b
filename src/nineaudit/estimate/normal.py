"""Gauss–Newton normal equations about a point, and the elimination of ω from them.

With J the derivative of the weighted residual by ω, C = w D and P = 1 − GᵀG the elimination of a0:

    Hωω = JᵀPJ + still + bridge    block-tridiagonal
    Hωθ = JᵀPC                     each θ touches one channel: that channel's row of PJ times C
    Hθθ = CᵀPC + 1                 gradients (downhill) JᵀPz, CᵀPz − θ

With Hωω = UᵀU, the Schur complement of θ is Hθθ − WᵀW, W = U⁻ᵀHωθ. Border and W are made a stretch of nodes at a time
and never held whole: time and memory are linear in the length of the record, with a small constant.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.errors import EstimationError
from nineaudit.estimate import block_tridiagonal
from nineaudit.estimate.point import Point

_ROUNDING = 1e-10
"""Part of the information on ω that is rounding where a0 takes all of it."""
STRETCH = 256
"""Nodes at a time: border and factor of a stretch stay in the processor's cache."""


@dataclass(frozen=True, eq=False)
class Normal:
    """The ω block (`diagonal` (n+1,3,3), `upper` (n,3,3)), what couples it to θ (`before`, `after` (k,3,n) PJ by the
    nodes before and after each sample, `weighted` C (q,n) of `channel` (q,)), `dense` (q,q), and the downhill gradients
    by ω (3(n+1),) and θ (q,)."""

    diagonal: FloatArray
    upper: FloatArray
    before: FloatArray
    after: FloatArray
    weighted: FloatArray
    channel: IntArray
    dense: FloatArray
    gradient_omega: FloatArray
    gradient_theta: FloatArray

    def border(self, first: int, last: int) -> FloatArray:
        """(q, last−first, 3) Hθω of the nodes from `first` to before `last`."""
        samples = self.weighted.shape[1]
        out = np.zeros((len(self.channel), last - first, 3))
        for side, early in ((self.before, 0), (self.after, 1)):
            start, stop = max(first - early, 0), min(last - early, samples)
            inner = slice(start + early - first, stop + early - first)
            for rows, k in _runs(self.channel):
                for i in range(3):
                    out[rows, inner, i] += self.weighted[rows, start:stop] * side[k, i, start:stop]
        return out

    def coupled(self, theta: FloatArray) -> FloatArray:
        """Hωθ θ (3(n+1),) without making Hωθ."""
        by_channel = np.zeros((len(self.before), len(theta)))
        by_channel[self.channel, np.arange(len(theta))] = theta
        change = by_channel @ self.weighted
        out = np.zeros((self.weighted.shape[1] + 1, 3))
        out[:-1] += np.einsum("kin,kn->ni", self.before, change)
        out[1:] += np.einsum("kin,kn->ni", self.after, change)
        return out.ravel()


def _runs(channel: IntArray) -> Iterator[tuple[slice, int]]:
    """Stretches of θ that belong to one channel."""
    if not len(channel):
        return
    cuts = [0, *(np.flatnonzero(np.diff(channel)) + 1).tolist(), len(channel)]
    for a, b in pairwise(cuts):
        yield slice(a, b), int(channel[a])


def normal_equations(at: Point) -> Normal:
    """The normal equations about a point, of the instrument that its θ describes."""
    data, g = at.data, at.elimination.g
    weight, channel = data.rows[1], data.channel
    sides = by_nodes(at)
    before, after = (_projected(j, g) for j in sides)
    left = at.z - np.einsum("ikn,in->kn", g, at.explained)
    weighted = weight[channel] * at.columns
    gradient_theta = np.einsum("qn,qn->q", weighted, left[channel]) - at.theta
    diagonal, upper, gradient = _of_omega(at, sides, (before, after))
    dense = _corner(weighted, g, channel)
    return Normal(diagonal, upper, before, after, weighted, channel, dense, gradient.ravel(), gradient_theta)


def by_nodes(at: Point) -> tuple[FloatArray, FloatArray]:
    """J: two (k,3,n), derivative of the weighted prediction by ω at the nodes before and after each sample,
    ½ ∂y/∂ω ∓ (r × n)/h."""
    half = 0.5 * at.instrument.by_omega(at.mean)
    slope = at.instrument.lever[:, :, None] / at.data.step
    weight = at.data.rows[1][:, None, :]
    return weight * (half - slope), weight * (half + slope)


def _projected(j: FloatArray, g: FloatArray) -> FloatArray:
    """PJ = J − Gᵀ(GJ), (k,3,n)."""
    return np.asarray(j - np.einsum("ikn,icn->kcn", g, np.einsum("ikn,kcn->icn", g, j)))


def _of_omega(
    at: Point, sides: tuple[FloatArray, FloatArray], projected: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Blocks (n+1,3,3), (n,3,3) of ω and its gradient (n+1,3), with rest and the bridges over gaps."""
    data, n, one = at.data, len(at.data.time), np.eye(3)
    diagonal, gradient, whole = np.zeros((n + 1, 3, 3)), np.zeros((n + 1, 3)), np.zeros(n + 1)
    for j, pj, nodes in zip(sides, projected, (slice(0, n), slice(1, n + 1)), strict=True):
        whole[nodes] += np.einsum("kan,kan->n", j, j)
        diagonal[nodes] += np.einsum("kan,kbn->nab", j, pj)
        gradient[nodes] += np.einsum("kan,kn->na", pj, at.z)
    lost = (np.trace(diagonal, axis1=1, axis2=2) <= _ROUNDING * whole) & (data.still == 0)
    if (lost & ~np.append(data.bridge > 0, True) & ~np.append(True, data.bridge > 0)).any():
        raise EstimationError("the trajectory is not determined by the readings: a0 explains all of them")
    upper = np.einsum("kan,kbn->nab", sides[0], projected[1]) - data.bridge[:, None, None] * one
    diagonal += data.still[:, None, None] * one
    gradient -= data.still[:, None] * at.omega
    change = data.bridge[:, None] * np.diff(at.omega, axis=0)
    diagonal[:-1] += data.bridge[:, None, None] * one
    diagonal[1:] += data.bridge[:, None, None] * one
    gradient[:-1] += change
    gradient[1:] -= change
    return diagonal, upper, gradient


def _corner(weighted: FloatArray, g: FloatArray, channel: IntArray) -> FloatArray:
    """CᵀPC + 1 (q,q), a stretch of samples at a time."""
    count, samples = weighted.shape
    out = np.eye(count)
    for start in range(0, samples, STRETCH):
        here = slice(start, min(start + STRETCH, samples))
        c = np.ascontiguousarray(weighted[:, here])
        explained = np.empty((count, len(g), c.shape[1]))
        for rows, k in _runs(channel):
            np.multiply(c[rows, None, :], g[None, :, k, here], out=explained[rows])
        flat = explained.reshape(count, len(g) * c.shape[1])
        out += np.where(channel[:, None] == channel, c @ c.T, 0.0) - flat @ flat.T
    return out


@dataclass(frozen=True, eq=False)
class Solved:
    """Eliminated ω: `factor` of its block, the Schur complement `schur` (q,q), which is the posterior precision of θ,
    what drives θ, `pull` (q,), and how far the cost falls with θ held, `fall`."""

    normal: Normal
    factor: block_tridiagonal.Factor
    schur: FloatArray
    pull: FloatArray
    fall: float

    def step(self, theta: FloatArray) -> FloatArray:
        """(n+1,3) change of ω that goes with a change of θ (q,)."""
        right = self.normal.gradient_omega - self.normal.coupled(theta)
        return self.factor.solve(right[:, None]).reshape(-1, 3)

    def through(self) -> FloatArray:
        """X = Hωω⁻¹ Hωθ (3(n+1),q), held whole."""
        nodes, count = len(self.normal.diagonal), len(self.normal.channel)
        return self.factor.solve(self.normal.border(0, nodes).reshape(count, 3 * nodes).T)


def eliminate(normal: Normal) -> Solved:
    """Eliminate ω: Schur complement and pull of θ. EstimationError where the readings do not determine ω."""
    factored = block_tridiagonal.factor(normal.diagonal, normal.upper)
    nodes, count = factored.nodes, len(normal.channel)
    schur, pull, fall = normal.dense.copy(), normal.gradient_theta.copy(), 0.0
    gradient, last = normal.gradient_omega.reshape(nodes, 3), np.zeros((count + 1, 3))
    for first in range(0, nodes, STRETCH):
        stop = min(first + STRETCH, nodes)
        right = np.concatenate([normal.border(first, stop), gradient[None, first:stop]])
        solved = factored.forward(right, first, last)
        w, alone = solved[:-1], solved[-1]
        schur -= w @ w.T
        pull -= w @ alone
        fall += float(alone @ alone)
        last = solved[:, -3:]
    return Solved(normal, factored, schur, pull, fall)
