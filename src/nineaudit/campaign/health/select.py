"""Which changes there are: the most significant first, then the rest about a model that has it.

A sensor that drifts pulls the estimates of its neighbours with it; once its change is in the model, they are cleared. A
sensor may change more than once. What was taken first may be wrong by what is taken later (the third of a triad of
which two drift; one step for one up and one down), so when nothing more is significant, each change is looked for again
about the others: where another explains more, or it is not significant, or made by bad tests, it goes; where two
explain so much more that both are significant, they take its place; and the selection goes on. As Z² is what a change
gains in 2 ln L, each of these steps makes

    2 ln L − threshold² · (number of changes)

larger, or leaves tests out, and the selection ends; ROUNDS is for the rest (the excess of scatter is estimated anew
each time).

Changes that explain nearly as much about the final others, their odds within 1 : 100 of the best, are rivals: none of
them is accused alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log
from typing import Final

import numpy as np

from nineaudit.campaign.health.look import Look, look, look_again, look_without
from nineaudit.campaign.health.model import Change, Part, Scatter, Solution, solve
from nineaudit.campaign.health.scan import ALIKE, Found, change, excess, outlying, scan, threshold
from nineaudit.campaign.health.scatter import estimate_scatter

MARGIN: Final = 2.0 * log(100.0)
"""Of Z²: likelihood odds of 1 : 100."""
MOST_CHANGES, MOST_OUTLYING, MOST_PAIRS, ROUNDS, TIMES = 50, 20, 10, 50, 5
SETTLED: Final = 1.0
"""Of 2 ln L: another date of a change that gains less is as good."""
BETWEEN: Final = 0.5
"""Of a change's |Z|, that of the first of two which are looked at instead."""

Name = tuple[int, str, int]
"""Of a change: its unknown, its shape, its first recording."""


@dataclass(frozen=True, eq=False)
class Selected:
    """A change, and the `rivals` that explain nearly as much."""

    found: Found
    rivals: tuple[Found, ...]


@dataclass(frozen=True, eq=False)
class Selection:
    """`parts` without the recordings left out as `outlying`; by part the `changes` and the `solutions`; `scatter`."""

    parts: tuple[Part, ...]
    solutions: tuple[Solution, ...]
    changes: tuple[tuple[Selected, ...], ...]
    scatter: Scatter
    outlying: tuple[int, ...]


def select(parts: Sequence[Part], size: int) -> Selection:
    """Selection in every part; `size`: recordings of the campaign.

    Parts have nothing in common but the scatter: each goes on until nothing in it is significant, then the scatter is
    estimated anew and all are looked at again.
    """
    kept, out = list(parts), list[int]()
    changes: list[list[Selected]] = [[] for _ in parts]
    scatter: Scatter | None = None
    for _ in range(TIMES):
        scatter = estimate_scatter(kept, [_shapes(mine) for mine in changes], scatter)
        before = [list(map(_name, mine)) for mine in changes], len(out)
        solutions = []
        for i in range(len(kept)):
            kept[i], solution = _selected(kept[i], changes[i], out, scatter, size)
            solutions.append(solution)
        if before == ([list(map(_name, mine)) for mine in changes], len(out)):
            break
    assert scatter is not None
    return Selection(tuple(kept), tuple(solutions), tuple(map(tuple, changes)), scatter, tuple(sorted(out)))


def _selected(
    part: Part, changes: list[Selected], out: list[int], scatter: Scatter, size: int
) -> tuple[Part, Solution]:
    """The part with `changes` as they are to be, without the recordings added to `out`."""
    seen = look(solve(part, scatter, _shapes(changes)))
    tried: set[Name] = set()
    for _ in range(ROUNDS):
        part, seen = _grown(part, seen, changes, out, scatter, size)
        again = _reviewed(seen, changes, out, size) or _paired(seen, changes, tried, size)
        if again is None:
            return part, seen.solution
        seen = again
    part, seen = _grown(part, seen, changes, out, scatter, size)
    return part, seen.solution


def _grown(
    part: Part, seen: Look, changes: list[Selected], out: list[int], scatter: Scatter, size: int
) -> tuple[Part, Look]:
    """With every significant change added to `changes`."""
    while True:
        ranked = scan(seen, size, MARGIN)
        if not ranked or abs(ranked[0].z) < threshold() or len(changes) >= MOST_CHANGES:
            return part, seen
        best = ranked[0]
        if bad := _bad(best, out):
            out.extend(bad)
            part = part.take(_indices(part) - set(out))
            seen = look(solve(part, scatter, _shapes(changes)))
        else:
            changes.append(Selected(best, tuple(ranked[1:])))
            seen = look_again(seen, change(best))


def _reviewed(seen: Look, changes: list[Selected], out: Sequence[int], size: int) -> Look | None:
    """Each change with its rivals about the others, the weakest first; where one is not what it was taken for, the look
    without it."""
    n = len(seen.solution.part.unknowns)
    x, u = seen.solution.x[n:], np.sqrt(np.diag(seen.solution.cov)[n:])
    for k in np.argsort(np.abs(x) / u, kind="stable").tolist():
        rest = look_without(seen, k)
        ranked = scan(rest, size, MARGIN)
        still = _still(ranked[0], changes[k].found, float(x[k]), float(u[k]), out) if ranked else None
        if still is None:
            del changes[k]
            return rest
        changes[k] = Selected(still, tuple(ranked[1:]))
    return None


def _paired(seen: Look, changes: list[Selected], tried: set[Name], size: int) -> Look | None:
    """Where two changes explain so much more than one which is between them that both are significant: the look with
    the first of the two in its place. Of each once: those `tried` are added to."""
    for k, mine in enumerate(changes):
        if _name(mine) in tried:
            continue
        tried.add(_name(mine))
        rest, gain = look_without(seen, k), mine.found.gain
        near = [one for one in scan(rest, size, (1.0 - BETWEEN**2) * gain) if one.unknown != mine.found.unknown]
        for one in near[:MOST_PAIRS]:
            with_one = look_again(rest, change(one))
            other = next(iter(scan(with_one, size, MARGIN)), None)
            if other is not None and one.gain + other.gain > gain + threshold() ** 2:
                changes[k:] = [*changes[k + 1 :], Selected(one, ())]
                return with_one
    return None


def _still(best: Found, taken: Found, x: float, u: float, out: Sequence[int]) -> Found | None:
    """The change that was taken, x ± u, as it is about the others; None where another is better than it (of its own
    shapes, by more than SETTLED), or where the best is not significant or made by bad tests."""
    wider = excess(best.track)
    gain = (x / u) ** 2 / (wider**2 if wider >= ALIKE else 1.0)
    better = best.unknown != taken.unknown or best.gain - gain > SETTLED
    if better or abs(best.z) < threshold() or _bad(best, out):
        return None
    same = np.array_equal(best.amount, taken.amount)
    return best if same else replace(taken, z=x / u / wider, gain=gain, size=x, track=best.track)


def _bad(best: Found, out: Sequence[int]) -> list[int]:
    """Recordings to be left out before a change is taken."""
    return [int(i) for i in outlying(best)] if len(out) < MOST_OUTLYING else []


def _name(one: Selected) -> Name:
    return one.found.unknown, one.found.shape, one.found.first


def _shapes(changes: Sequence[Selected]) -> list[Change]:
    return [change(one.found) for one in changes]


def _indices(part: Part) -> set[int]:
    return {int(i) for group in part.groups for i in group.index}
