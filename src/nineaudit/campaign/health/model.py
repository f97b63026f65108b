"""The hierarchical Gaussian model of a campaign: what lasts is of a sensor or of its seat, the rest is of one test.

Recording j tells its calibration errors θ_j by a likelihood N(Λ_j⁻¹η_j, Λ_j⁻¹) (estimate/information.py). With

    θ_j = A_j x + w_j,    x ~ N(0, P),    w_j ~ N(0, T)

x: of each sensor its gain and two tilts, of each seat (rig and channel) two tilts and three position errors; of a tilt
the rig's variance is half the sensor's, half the seat's. w: mounting and temperature of one test. Without w_j,

    Λ'_j = Λ_j − Λ_j (Λ_j + T⁻¹)⁻¹ Λ_j,    η'_j = η_j − Λ_j (Λ_j + T⁻¹)⁻¹ η_j                    (Woodbury)
    H = P⁻¹ + Σ A_jᵀ Λ'_j A_j,    H x = Σ A_jᵀ η'_j                      (least squares, Lindley & Smith 1972)

Sensors that no chain of rigs connects are solved apart (parts). A recording needs 8 p² bytes, p errors of its channels.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.campaign.health.records import Record, Row, Seat, family

ANY_CHANGE: Final = 1e5
"""Prior standard deviation of a change, in records.UNIT: of one that no recording shows, 0 is as good as any."""

Scatter = dict[tuple[str, str], float]
"""Kind and family of an error -> variance from test to test, in records.UNIT squared."""


@dataclass(frozen=True)
class Unknown:
    """One entry of x: `parameter` of a sensor (its `sensor`) or of a `seat`."""

    parameter: str
    sensor: str | None
    seat: Seat | None
    axis: tuple[float, ...] = ()


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


def parts(records: Sequence[Record]) -> list[Part]:
    """The records by what connects them."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    by_rows: dict[tuple[Row, ...], list[int]] = {}
    keys: dict[tuple[object, ...], list[int]] = {}
    for i, record in enumerate(records):
        key = tuple((r.sensor, r.seat, r.kind, r.parameter, r.axis) for r in record.rows)
        keys.setdefault(key, []).append(i)
    for members in keys.values():
        by_rows[records[members[0]].rows] = members
    number: dict[Unknown, int] = {}
    prior: list[float] = []
    touched = [_touched(rows, number, prior) for rows in by_rows]
    edges = [(t[0][0], a) for t in touched for pair in t for a in pair]
    first, second = np.array(edges, dtype=np.intp).reshape(-1, 2).T
    graph = coo_array((np.ones(len(edges)), (first, second)), shape=(len(number),) * 2)
    count, label = connected_components(graph, directed=False)
    unknowns, sizes = list(number), np.array(prior)
    made = []
    for part in range(count):
        mine = np.flatnonzero(label == part)
        place = {int(u): i for i, u in enumerate(mine)}
        groups = tuple(
            _group(rows, [records[i] for i in members], members, t, place)
            for (rows, members), t in zip(by_rows.items(), touched, strict=True)
            if t[0][0] in place
        )
        made.append(Part(groups, tuple(unknowns[u] for u in mine), sizes[mine]))
    return made


def _touched(rows: tuple[Row, ...], number: dict[Unknown, int], prior: list[float]) -> list[tuple[int, ...]]:
    """The unknowns of each row; new ones are numbered."""
    out = []
    for row in rows:
        of = {"gain": (True, False), "tilt": (True, True), "position": (False, True)}[family(row.parameter)]
        mine = [Unknown(row.parameter, row.sensor, None, row.axis)] if of[0] else []
        mine += [Unknown(row.parameter, None, row.seat)] if of[1] else []
        for unknown in mine:
            if number.setdefault(unknown, len(number)) == len(prior):
                prior.append(row.prior / np.sqrt(len(mine)))
        out.append(tuple(number[u] for u in mine))
    return out


def _group(
    rows: tuple[Row, ...],
    records: Sequence[Record],
    members: Sequence[int],
    touched: Sequence[tuple[int, ...]],
    place: dict[int, int],
) -> Group:
    at = sorted({place[u] for pair in touched for u in pair})
    design = np.zeros((len(rows), len(at)))
    for i, pair in enumerate(touched):
        for u in pair:
            design[i, at.index(place[u])] = 1.0
    return Group(
        rows,
        np.array(members, dtype=np.intp),
        np.array([r.when for r in records]),
        np.stack([r.eta for r in records]),
        np.stack([r.matrix for r in records]),
        np.array(at, dtype=np.intp),
        design,
        np.array([[r.shock.get(row.sensor, 0.0) for row in rows] for r in records]),
    )


def marginal(group: Group, tau: Scatter) -> Marginal:
    """The group with w integrated out; symmetric form, so that Λ may be singular and T may be 0."""
    root = np.sqrt(group.scatter(tau))
    right = root[:, None] * np.concatenate([group.matrix, group.eta[:, :, None]], axis=2)
    inner = np.eye(len(root)) + right[:, :, :-1] * root
    gone = np.linalg.solve(inner, right)
    across = group.matrix * root
    matrix = group.matrix - across @ gone[:, :, :-1]
    eta = group.eta - (across @ gone[:, :, -1:])[:, :, 0]
    return Marginal(group, eta, 0.5 * (matrix + matrix.transpose(0, 2, 1)))


def moves(group: Group, changes: Sequence[Change]) -> list[tuple[int, FloatArray]]:
    """(number, (J,p) what it does to θ in each recording) of every change that touches a group."""
    here = [(k, c, np.flatnonzero(group.at == c.unknown)) for k, c in enumerate(changes)]
    return [(k, c.amount[group.index][:, None] * group.design[:, at[0]]) for k, c, at in here if len(at)]


def solve(part: Part, tau: Scatter, changes: Sequence[Change] = ()) -> Solution:
    """The unknowns and the changes, by the model's equations; a change has hardly a prior."""
    n = len(part.unknowns)
    size = n + len(changes)
    normal, right = np.zeros((size, size)), np.zeros(size)
    normal[np.arange(n), np.arange(n)] = 1.0 / part.prior**2
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
    cov = np.linalg.inv(normal)
    return Solution(part, tuple(changes), marginals, cov @ right, 0.5 * (cov + cov.T))
