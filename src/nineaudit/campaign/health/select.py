"""Which changes there are: the most significant first, then the rest about a model that has it.

A sensor that drifts pulls the estimates of its neighbours with it; once its change is in the model, they are cleared.
Changes that explain nearly as much, their odds within 1 : 100 of the best, are rivals: none of them is accused alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log
from typing import Final

from nineaudit.campaign.health.look import look, look_again
from nineaudit.campaign.health.model import Change, Part, Scatter, Solution, solve
from nineaudit.campaign.health.scan import Found, change, outlying, scan, threshold
from nineaudit.campaign.health.scatter import estimate_scatter

MARGIN: Final = 2.0 * log(100.0)
"""Of Z²: likelihood odds of 1 : 100."""
MOST_CHANGES, MOST_OUTLYING = 50, 20


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
    """Forward selection in every part; `size`: recordings of the campaign.

    Parts have nothing in common but the scatter: each goes on until nothing in it is significant, then the scatter is
    estimated anew and all are looked at again.
    """
    kept, out = list(parts), list[int]()
    changes: list[list[Selected]] = [[] for _ in parts]
    scatter: Scatter | None = None
    while True:
        shapes = [_shapes(mine) for mine in changes]
        scatter = estimate_scatter(kept, shapes, scatter)
        before = sum(map(len, changes)), len(out)
        solutions = []
        for i in range(len(kept)):
            kept[i], solution = _grown(kept[i], changes[i], out, scatter, size)
            solutions.append(solution)
        if before == (sum(map(len, changes)), len(out)):
            final = tuple(map(tuple, changes))
            return Selection(tuple(kept), tuple(solutions), final, scatter, tuple(sorted(out)))


def _grown(part: Part, changes: list[Selected], out: list[int], scatter: Scatter, size: int) -> tuple[Part, Solution]:
    """The part with every significant change added to `changes`, without the recordings added to `out`."""
    seen = look(solve(part, scatter, _shapes(changes)))
    while True:
        known = {one.unknown for one in seen.solution.changes}
        ranked = scan(seen, size, known, MARGIN)
        if not ranked or abs(ranked[0].z) < threshold() or len(changes) >= MOST_CHANGES:
            return part, seen.solution
        best = ranked[0]
        bad = outlying(best) if len(out) < MOST_OUTLYING else ()
        if len(bad):
            out.extend(int(b) for b in bad)
            part = part.take(_indices(part) - set(out))
            seen = look(solve(part, scatter, _shapes(changes)))
        else:
            changes.append(Selected(best, tuple(ranked[1:])))
            seen = look_again(seen, change(best))


def _shapes(changes: Sequence[Selected]) -> list[Change]:
    return [change(one.found) for one in changes]


def _indices(part: Part) -> set[int]:
    return {int(i) for group in part.groups for i in group.index}
