"""What is seen of a change of every unknown about a solution, and of the next after one was found.

The information of a shape f is Σ f² AᵀΛ'A − gᵀ H⁻¹ g (scan.py). With a change more, H⁻¹ grows by a term of rank one, so
the information of every shape is smaller by (gᵀ c)²/c_0: c the new column of the inverse and c_0 its own entry.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.campaign.health.crowd import Crowd, Moved, binned, coupling, crowds, moved
from nineaudit.campaign.health.model import Change, Solution, with_change
from nineaudit.campaign.health.shapes import Shapes, shapes


@dataclass(frozen=True, eq=False)
class Sight:
    """What is seen of the changes of a crowd, besides the scores: `coupling` (k,B,m) with the entries `at` (m,) of the
    solution, `plain` (k,S) information of every shape if all else were known, `info` as it is not."""

    crowd: Crowd
    shapes: Shapes
    coupling: FloatArray
    at: IntArray
    plain: FloatArray
    info: FloatArray


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
    starts = np.searchsorted(crowd.bin, np.arange(crowd.bins))
    plain = known.squared(np.add.reduceat(crowd.weight, starts, axis=1))
    through = by_bin @ solution.cov[np.ix_(at, at)]
    hidden = [known.quadratic(i, a @ b.T) for i, (a, b) in enumerate(zip(through, by_bin, strict=True))]
    return Sight(crowd, known, by_bin, at, plain, plain - np.array(hidden))


def look_again(before: Look, change: Change) -> Look:
    """With one change more."""
    solution = with_change(before.solution, change)
    told = moved(solution, len(before.solution.changes))
    return Look(solution, tuple(_again(sight, solution, told) for sight in before.sights))


def _again(sight: Sight, solution: Solution, told: Moved) -> Sight:
    crowd, column = sight.crowd, solution.cov[:, -1]
    by_bin, at = sight.coupling, sight.at
    if any(told[source.number] for source in crowd.sources):
        added = np.zeros((*by_bin.shape[:2], 1))
        for source in crowd.sources:
            for _, effect in told[source.number]:
                which, sums = binned(effect @ source.chosen, source.bin)
                added[:, which, 0] += sums.T
        by_bin, at = np.concatenate([by_bin, added], axis=2), np.append(at, len(column) - 1)
    hidden = sight.shapes.applied(by_bin @ column[at]) ** 2 / column[-1]
    return Sight(crowd, sight.shapes, by_bin, at, sight.plain, sight.info - hidden)
