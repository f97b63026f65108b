"""What is seen of a change of every unknown about a solution, and about the next with a change more or less.

All that is seen of shapes f, f' of an unknown are the forms f R f' of scan.py, R = diag w − G H⁻¹ Gᵀ by bin: where H⁻¹
gains a term of rank one φ c cᵀ (border.py), each is smaller by φ (f·Gc)(f'·Gc).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.campaign.health.border import Term, bordered, levelled, unbordered
from nineaudit.campaign.health.crowd import Crowd, Moved, binned, coupling, crowds, moved
from nineaudit.campaign.health.model import FREE, Change, Solution
from nineaudit.campaign.health.shapes import Shapes, shapes


@dataclass(frozen=True, eq=False)
class Sight:
    """What is seen of the changes of a crowd, besides the scores: `coupling` (k,B,m) with the entries `at` (m,) of the
    solution; of every shape `plain` (k,S) information if all else were known, `info` (k,S) as it is not but for a free
    level, `level` (k,) that of the level itself, and `shared` (k,S) of both."""

    crowd: Crowd
    shapes: Shapes
    coupling: FloatArray
    at: IntArray
    plain: FloatArray
    info: FloatArray
    shared: FloatArray
    level: FloatArray


@dataclass(frozen=True, eq=False)
class Look:
    """A solution, and what is seen of further changes."""

    solution: Solution
    sights: tuple[Sight, ...]


def look(solution: Solution) -> Look:
    """Every unknown with recordings enough."""
    told = moved(solution)
    found = crowds(solution.marginals, len(solution.part.unknowns))
    return Look(solution, tuple(_sight(crowd, solution, told) for crowd in found))


def _sight(crowd: Crowd, solution: Solution, told: Moved) -> Sight:
    by_bin, at = coupling(crowd, solution, told)
    known = shapes(crowd)
    weight = np.add.reduceat(crowd.weight, np.searchsorted(crowd.bin, np.arange(crowd.bins)), axis=1)
    cov, plain = solution.cov[np.ix_(at, at)], known.squared(weight)
    hidden = [known.quadratic(i, (one @ cov) @ one.T) for i, one in enumerate(by_bin)]
    level = weight - np.einsum("kbm,km->kb", by_bin, by_bin.sum(axis=1) @ cov)
    told_of_level = level.sum(axis=1) + (FREE * solution.part.prior[crowd.unknowns]) ** -2.0
    return Sight(crowd, known, by_bin, at, plain, plain - np.array(hidden), known.applied(level), told_of_level)


def look_again(before: Look, change: Change) -> Look:
    """With one change more."""
    grown = bordered(before.solution, change)
    told, column = moved(grown, len(before.solution.changes)), grown.cov[:, -1]
    gained = Term(column, 1.0 / float(column[-1]))
    solution, term = levelled(grown, change.unknown, before.solution.changes)
    sights = (_less(_with_entry(sight, grown, told), gained) for sight in before.sights)
    return Look(solution, tuple(_less(sight, term) for sight in sights))


def look_without(before: Look, number: int) -> Look:
    """Without one of its changes."""
    left, gained = unbordered(before.solution, number)
    solution, term = levelled(left, before.solution.changes[number].unknown, before.solution.changes)
    entry = len(left.part.unknowns) + number
    sights = (_without_entry(_less(sight, gained), entry) for sight in before.sights)
    return Look(solution, tuple(_less(sight, term) for sight in sights))


def _less(sight: Sight, term: Term) -> Sight:
    """What is seen when the inverse gains a term."""
    by_bin = sight.coupling @ term.column[sight.at]
    shaped, whole = sight.shapes.applied(by_bin), by_bin.sum(axis=1)
    return replace(
        sight,
        info=sight.info - term.factor * shaped**2,
        shared=sight.shared - term.factor * shaped * whole[:, None],
        level=sight.level - term.factor * whole**2,
    )


def _with_entry(sight: Sight, solution: Solution, told: Moved) -> Sight:
    """With what is told of its unknowns together with the last change."""
    crowd, by_bin, at = sight.crowd, sight.coupling, sight.at
    if not any(told[source.number] for source in crowd.sources):
        return sight
    added = np.zeros((*by_bin.shape[:2], 1))
    for source in crowd.sources:
        for _, effect in told[source.number]:
            which, sums = binned(effect @ source.chosen, source.bin)
            added[:, which, 0] += sums.T
    return replace(sight, coupling=np.concatenate([by_bin, added], axis=2), at=np.append(at, len(solution.x) - 1))


def _without_entry(sight: Sight, entry: int) -> Sight:
    """Without an entry of the solution; those behind it move up."""
    kept = sight.at != entry
    at = sight.at[kept]
    return replace(sight, coupling=sight.coupling[:, :, kept], at=at - (at > entry))
