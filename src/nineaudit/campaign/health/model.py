"""The hierarchical Gaussian model of a campaign: what lasts is of a sensor or of its seat, the rest is of one test.

Recording j tells its calibration errors θ_j by a likelihood N(Λ_j⁻¹η_j, Λ_j⁻¹) (estimate/information.py). With

    θ_j = A_j x + w_j,    x ~ N(0, P),    w_j ~ N(0, T)

x: of each sensor its gain, and two tilts in each seat that it sat in (rig and channel): a cross-axis error is fixed in
its case, and how that is rolled about its axis is another thing at each mounting. Of each seat two tilts and three
position errors; of a tilt the rig's variance is half the sensor's, half the seat's. w: mounting and temperature of one
test. Without w_j,

    Λ'_j = Λ_j − Λ_j (Λ_j + T⁻¹)⁻¹ Λ_j,    η'_j = η_j − Λ_j (Λ_j + T⁻¹)⁻¹ η_j                    (Woodbury)
    H = P⁻¹ + Σ A_jᵀ Λ'_j A_j,    H x = Σ A_jᵀ η'_j                      (least squares, Lindley & Smith 1972)

The level about which something changes is as good as free, P_i (1 + FREE²): otherwise a constant error beyond the rig's
stated u would make a change larger than it is, and a change of what is constant (scan.py).

Sensors that no chain of rigs connects are solved apart (connect.py). A recording needs 16 p² bytes, p errors of its
channels.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.campaign.health.anchors import Seat
from nineaudit.campaign.health.blocks import blocks, solved
from nineaudit.campaign.health.records import Row, family

ANY_CHANGE: Final = 1e5
"""Prior standard deviation of a change, in records.UNIT: of one that no recording shows, 0 is as good as any."""

FREE: Final = 100.0
"""Standard deviation of the level of an unknown that changes, in that of its prior."""

AT_ONCE: Final = 128
"""Recordings whose w is integrated out together: memory."""

Scatter = dict[tuple[str, str], float]
"""Kind and family of an error -> variance from test to test, in records.UNIT squared."""


@dataclass(frozen=True)
class Unknown:
    """One entry of x: `parameter` of a sensor (its `sensor`) or of a `seat`; `within` is the seat that a sensor with
    this tilt sits in, the setting of a sensor with this gain (anchors.py)."""

    parameter: str
    sensor: str | None
    seat: Seat | None
    within: tuple[str | int, ...] = ()


@dataclass(frozen=True, eq=False)
class Group:
    """Recordings of the same rows: `index` (J,) in time, `when` (J,), `eta` (J,p), `matrix` (J,p,p); `at` (m,) the
    unknowns that they touch and `design` (p,m); `shock` (J,p) m/s² of each row's sensor."""

    rows: tuple[Row, ...]
    index: IntArray
    when: FloatArray
    eta: FloatArray
    matrix: FloatArray
    at: IntArray
    design: FloatArray
    shock: FloatArray

    def take(self, kept: IntArray) -> Group:
        """Some of the recordings."""
        index, when, shock = self.index[kept], self.when[kept], self.shock[kept]
        return Group(self.rows, index, when, self.eta[kept], self.matrix[kept], self.at, self.design, shock)

    def scatter(self, tau: Scatter) -> FloatArray:
        """(p,) variance of w."""
        return np.array([tau[row.kind, family(row.parameter)] for row in self.rows])


@dataclass(frozen=True, eq=False)
class Part:
    """Sensors and seats that recordings connect: `unknowns` (n) with their `prior` standard deviation (n,)."""

    groups: tuple[Group, ...]
    unknowns: tuple[Unknown, ...]
    prior: FloatArray

    def take(self, keep: Iterable[int]) -> Part:
        """Only the recordings of these indices."""
        wanted = np.array(sorted(keep), dtype=np.intp)
        groups = (g.take(np.flatnonzero(np.isin(g.index, wanted))) for g in self.groups)
        return Part(tuple(g for g in groups if len(g.index)), self.unknowns, self.prior)


@dataclass(frozen=True, eq=False)
class Change:
    """A change of an unknown: `amount` (recordings of the campaign,), 0 to 1, in time."""

    unknown: int
    amount: FloatArray


@dataclass(frozen=True, eq=False)
class Marginal:
    """A group without its w: `eta` (J,p), `matrix` (J,p,p)."""

    group: Group
    eta: FloatArray
    matrix: FloatArray


@dataclass(frozen=True, eq=False)
class Solution:
    """`x` (n + changes,) with its covariance `cov`: the unknowns, then how far each change went."""

    part: Part
    changes: tuple[Change, ...]
    marginals: tuple[Marginal, ...]
    x: FloatArray
    cov: FloatArray

    def residual(self, marginal: Marginal) -> FloatArray:
        """(J,p) η' − Λ' θ̂, θ̂ = A x and what has changed."""
        group, n = marginal.group, len(self.part.unknowns)
        theta = np.broadcast_to(group.design @ self.x[group.at], marginal.eta.shape)
        for k, column in moves(group, self.changes):
            theta = theta + self.x[n + k] * column
        return np.asarray(marginal.eta - (marginal.matrix @ theta[:, :, None])[:, :, 0])


def marginal(group: Group, tau: Scatter) -> Marginal:
    """The group with w integrated out; symmetric form, so that Λ may be singular and T may be 0."""
    root = np.sqrt(group.scatter(tau))
    eta, matrix = np.empty_like(group.eta), np.empty_like(group.matrix)
    for start in range(0, len(eta), AT_ONCE):
        some = slice(start, start + AT_ONCE)
        eta[some], matrix[some] = _without_scatter(group.eta[some], group.matrix[some], root)
    return Marginal(group, eta, matrix)


def _without_scatter(eta: FloatArray, matrix: FloatArray, root: FloatArray) -> tuple[FloatArray, FloatArray]:
    right = root[:, None] * np.concatenate([matrix, eta[:, :, None]], axis=2)
    inner = np.eye(len(root)) + right[:, :, :-1] * root
    gone = np.linalg.solve(inner, right)
    across = matrix * root
    left = matrix - across @ gone[:, :, :-1]
    return eta - (across @ gone[:, :, -1:])[:, :, 0], 0.5 * (left + left.transpose(0, 2, 1))


def moves(group: Group, changes: Sequence[Change]) -> list[tuple[int, FloatArray]]:
    """(number, (J,p) what it does to θ in each recording) of every change that touches a group."""
    here = [(k, c, np.flatnonzero(group.at == c.unknown)) for k, c in enumerate(changes)]
    return [(k, c.amount[group.index][:, None] * group.design[:, at[0]]) for k, c, at in here if len(at)]


def precision(part: Part, changes: Sequence[Change]) -> FloatArray:
    """(n,) prior information of the unknowns: of those that change, next to none."""
    changed = np.isin(np.arange(len(part.unknowns)), [c.unknown for c in changes])
    return np.asarray(part.prior**-2.0 / (1.0 + FREE**2 * changed))


def solve(part: Part, tau: Scatter, changes: Sequence[Change] = (), across: bool = True) -> Solution:
    """The unknowns and the changes, by the model's equations; a change and the level before it have hardly a prior.
    Where not `across`, the covariance is of what recordings tell together only (blocks.py): the rest is 0."""
    n = len(part.unknowns)
    size = n + len(changes)
    normal, right = np.zeros((size, size)), np.zeros(size)
    normal[np.arange(n), np.arange(n)] = precision(part, changes)
    normal[np.arange(n, size), np.arange(n, size)] = ANY_CHANGE**-2.0
    marginals = tuple(marginal(group, tau) for group in part.groups)
    for one in marginals:
        group = one.group
        right[group.at] += group.design.T @ one.eta.sum(axis=0)
        normal[np.ix_(group.at, group.at)] += group.design.T @ one.matrix.sum(axis=0) @ group.design
        columns = moves(group, changes)
        for k, column in columns:
            told = (one.matrix @ column[:, :, None])[:, :, 0]
            coupled = group.design.T @ told.sum(axis=0)
            normal[group.at, n + k] += coupled
            normal[n + k, group.at] += coupled
            right[n + k] += float(np.sum(column * one.eta))
            for other, theirs in columns:
                normal[n + other, n + k] += float(np.sum(theirs * told))
    gains = [i for i, one in enumerate(part.unknowns) if one.parameter == "gain"]
    joint = np.array([*gains, *range(n, size)], dtype=np.intp)
    x, cov = solved(normal, right, blocks(n, [g.at for g in part.groups], joint), joint, across)
    return Solution(part, tuple(changes), marginals, x, cov)
