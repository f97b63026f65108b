"""The recordings of every unknown in order of time, in runs of equal length; unknowns of the same recordings together.

A crowd is what the same groups of recordings speak of: the errors of a seat, those of sensors that moved together. What
is added up over the recordings of a run is added up once for all of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.campaign.health.model import Marginal, Solution, moves

BINS: Final = 50
LEAST_RECORDINGS: Final = 6
LEAST_INFORMATION: Final = 1e-6


@dataclass(frozen=True, eq=False)
class Track:
    """The recordings of one unknown in order of time: `index`, `when`, `weight` (information), `z` (standardised score)
    and `bin` (J,)."""

    unknown: int
    index: IntArray
    when: FloatArray
    z: FloatArray
    weight: FloatArray
    bin: IntArray


@dataclass(frozen=True, eq=False)
class Source:
    """A group of a crowd: the `number` of its marginal, `chosen` (p,k) the rows of each unknown, `bin` (J',)."""

    number: int
    chosen: FloatArray
    bin: IntArray


@dataclass(frozen=True, eq=False)
class Crowd:
    """`unknowns` (k,) of the same recordings, these in order of time (`order` of those of the `sources`): `index`,
    `when`, `bin` (J,), `shock` and information `weight` (k,J)."""

    unknowns: IntArray
    sources: tuple[Source, ...]
    order: IntArray
    index: IntArray
    when: FloatArray
    bin: IntArray
    shock: FloatArray
    weight: FloatArray

    @property
    def bins(self) -> int:
        return int(self.bin[-1]) + 1

    def scores(self, residuals: Sequence[FloatArray]) -> FloatArray:
        """(k,J) Aᵀ(η' − Λ' θ̂) of each recording."""
        return np.concatenate([residuals[s.number] @ s.chosen for s in self.sources])[self.order].T

    def standardised(self, scores: FloatArray) -> FloatArray:
        """(k,J)"""
        return np.asarray(scores / np.sqrt(np.maximum(self.weight, LEAST_INFORMATION)))


def crowds(marginals: Sequence[Marginal], count: int) -> list[Crowd]:
    """Of the first `count` entries of a solution, those with recordings enough."""
    spoken: list[list[int]] = [[] for _ in range(count)]
    for number, one in enumerate(marginals):
        for unknown in one.group.at:
            spoken[unknown].append(number)
    members: dict[tuple[int, ...], list[int]] = {}
    for unknown, numbers in enumerate(spoken):
        members.setdefault(tuple(numbers), []).append(unknown)
    enough = {k: v for k, v in members.items() if sum(len(marginals[i].group.index) for i in k) >= LEAST_RECORDINGS}
    return [_crowd(np.array(mine, dtype=np.intp), numbers, marginals) for numbers, mine in enough.items()]


def _crowd(unknowns: IntArray, numbers: Sequence[int], marginals: Sequence[Marginal]) -> Crowd:
    groups = [marginals[i].group for i in numbers]
    index = np.concatenate([g.index for g in groups])
    order = np.argsort(index)
    rank = np.empty(len(index), dtype=np.intp)
    rank[order] = np.arange(len(index))
    bins = rank * min(BINS, len(index)) // len(index)
    cuts = np.cumsum([len(g.index) for g in groups])[:-1]
    chosen = [g.design[:, np.searchsorted(g.at, unknowns)] for g in groups]
    sources = tuple(Source(*one) for one in zip(numbers, chosen, np.split(bins, cuts), strict=True))
    when = np.concatenate([g.when for g in groups])
    shock = np.concatenate([g.shock[:, c.argmax(axis=0)] for g, c in zip(groups, chosen, strict=True)])
    weight = np.concatenate([_weight(marginals[s.number], s.chosen) for s in sources])
    return Crowd(unknowns, sources, order, index[order], when[order], bins[order], shock[order].T, weight[order].T)


def _weight(one: Marginal, chosen: FloatArray) -> FloatArray:
    """(J',k) the information of every unknown."""
    rows = [np.flatnonzero(column) for column in chosen.T]
    return np.column_stack([one.matrix[:, r[:, None], r].sum(axis=(1, 2)) for r in rows])


def binned(values: FloatArray, bins: IntArray) -> tuple[IntArray, FloatArray]:
    """The bins that there are, and the sums of `values` over each; `bins` (J,) in order."""
    starts = np.flatnonzero(np.diff(bins, prepend=-1))
    return bins[starts], np.add.reduceat(values, starts, axis=0)


Moved = list[list[tuple[int, FloatArray]]]
"""By marginal: (number of a change, (J,p) Λ' times what it does to θ)."""


def moved(solution: Solution, since: int = 0) -> Moved:
    """Of every change of the solution from the number `since` on."""
    return [
        [(since + k, (one.matrix @ f[:, :, None])[:, :, 0]) for k, f in moves(one.group, solution.changes[since:])]
        for one in solution.marginals
    ]


def coupling(crowd: Crowd, solution: Solution, told: Moved) -> tuple[FloatArray, IntArray]:
    """(k,B,m) by bin, what is told of each unknown together with the entries (m,) of the solution."""
    n = len(solution.part.unknowns)
    touched = [solution.marginals[s.number].group.at for s in crowd.sources]
    at = np.unique(np.concatenate([*touched, [n + k for s in crowd.sources for k, _ in told[s.number]]])).astype(
        np.intp
    )
    out = np.zeros((len(crowd.unknowns), crowd.bins, len(at)))
    for source, places in zip(crowd.sources, touched, strict=True):
        one, rows = solution.marginals[source.number], np.flatnonzero(source.chosen.any(axis=1))
        which, sums = binned(one.matrix if len(rows) == len(source.chosen) else one.matrix[:, rows], source.bin)
        by_bin = source.chosen[rows].T @ sums @ one.group.design
        out[:, which[:, None], np.searchsorted(at, places)] += by_bin.transpose(1, 0, 2)
        for k, effect in told[source.number]:
            which, sums = binned(effect @ source.chosen, source.bin)
            out[:, which, np.searchsorted(at, n + k)] += sums.T
    return out, at


def tracks(solution: Solution) -> Iterator[Track]:
    """Every unknown with recordings enough."""
    residuals = [solution.residual(one) for one in solution.marginals]
    for crowd in crowds(solution.marginals, len(solution.part.unknowns)):
        z = crowd.standardised(crowd.scores(residuals))
        yield from (track(crowd, i, z[i]) for i in range(len(z)))


def track(crowd: Crowd, place: int, z: FloatArray) -> Track:
    """That of one unknown of a crowd."""
    return Track(int(crowd.unknowns[place]), crowd.index, crowd.when, z, crowd.weight[place], crowd.bin)
