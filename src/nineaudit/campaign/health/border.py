"""A solution with one change more or one less, by terms of rank one: no recording is added up anew.

A change borders H by its column h and its own entry h_0. With y = −H⁻¹ h and the Schur complement s = h_0 − hᵀ H⁻¹ h,

    H⁻¹ → [H⁻¹ + y yᵀ/s,  y/s;  yᵀ/s,  1/s]        and back        H⁻¹ → H⁻¹ − c cᵀ/c_0,  x → x − c β/c_0

c the column of the change in H⁻¹, c_0 its own entry, β how far it goes. The prior information of its level is smaller
by d while there is a change of it (model.py). With c the column of the level in H⁻¹ (Sherman & Morrison 1950),

    H → H − d e eᵀ:    H⁻¹ → H⁻¹ + φ c cᵀ,    x → x + φ c x_i,    φ = d/(1 − d c_i)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.campaign.health.model import ANY_CHANGE, AT_ONCE, Change, Solution, moves, precision


@dataclass(frozen=True, eq=False)
class Term:
    """What H⁻¹ gains: `factor` times `column` `column`ᵀ."""

    column: FloatArray
    factor: float


def with_change(solution: Solution, change: Change) -> Solution:
    """The solution with one change more."""
    return levelled(bordered(solution, change), change.unknown, solution.changes)[0]


def levelled(solution: Solution, unknown: int, since: Sequence[Change]) -> tuple[Solution, Term]:
    """With the prior of an unknown that its changes ask for, not that of the changes `since`; what H⁻¹ gained."""
    before, after = (precision(solution.part, changes)[unknown] for changes in (since, solution.changes))
    column = solution.cov[:, unknown].copy()
    term = Term(column, float((before - after) / (1.0 - (before - after) * column[unknown])))
    x = solution.x + term.factor * solution.x[unknown] * column
    return replace(solution, x=x, cov=raised(solution.cov.copy(), column, term.factor)), term


def bordered(solution: Solution, change: Change) -> Solution:
    """With the equation of one change more; the prior of its level as it is."""
    n, size = len(solution.part.unknowns), len(solution.x)
    across, own, right = np.zeros(size), ANY_CHANGE**-2.0, 0.0
    for one in solution.marginals:
        for _, column in moves(one.group, [change]):
            told = (one.matrix @ column[:, :, None])[:, :, 0]
            across[one.group.at] += one.group.design.T @ told.sum(axis=0)
            own += float(np.sum(column * told))
            right += float(np.sum(column * one.eta))
            for k, theirs in moves(one.group, solution.changes):
                across[n + k] += float(np.sum(theirs * told))
    by = np.append(-solution.cov @ across, 1.0)
    left = own + float(across @ by[:-1])
    far = (right - float(across @ solution.x)) / left
    cov = np.zeros((size + 1, size + 1))
    cov[:size, :size] = solution.cov
    raised(cov, by, float(1.0 / left))
    return replace(solution, changes=(*solution.changes, change), x=np.append(solution.x, 0.0) + far * by, cov=cov)


def unbordered(solution: Solution, number: int) -> tuple[Solution, Term]:
    """Without the equation of a change, the prior of its level as it is; and what H⁻¹ of the others gained."""
    at = len(solution.part.unknowns) + number
    column, kept = solution.cov[:, at], np.arange(len(solution.x)) != at
    term = Term(column, -1.0 / float(column[at]))
    x = (solution.x - solution.x[at] / column[at] * column)[kept]
    cov = raised(solution.cov[np.ix_(kept, kept)], column[kept], term.factor)
    changes = tuple(c for k, c in enumerate(solution.changes) if k != number)
    return replace(solution, changes=changes, x=x, cov=cov), term


def raised(cov: FloatArray, column: FloatArray, factor: float) -> FloatArray:
    """`cov` + `factor` `column` `column`ᵀ in its place, some rows at a time: memory."""
    for start in range(0, len(cov), AT_ONCE):
        some = slice(start, start + AT_ONCE)
        cov[some] += np.outer(factor * column[some], column)
    return cov
