"""Which changes there are: the most significant first, then the rest about a model that has it.

A sensor that drifts pulls the estimates of its neighbours with it; once its change is in the model, they are cleared.
Changes that explain nearly as much, their odds within 1 : 100 of the best, are rivals: none of them is accused alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log
from typing import Final

from nineaudit.campaign.health.model import Part, Scatter, Solution, solve
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
    """Forward selection over all parts; `size`: recordings of the campaign."""
    kept, out = list(parts), list[int]()
    changes: list[list[Selected]] = [[] for _ in parts]
    while True:
        scatter, solutions = _solved(kept, changes)
        found = [(abs(f.z), i, f, ranked) for i, ranked in enumerate(_scans(solutions, size)) for f in ranked[:1]]
        top = max(found, key=lambda item: item[0], default=None)
        if top is None or top[0] < threshold() or sum(map(len, changes)) >= MOST_CHANGES:
            return Selection(tuple(kept), tuple(solutions), tuple(map(tuple, changes)), scatter, tuple(sorted(out)))
        _, i, best, ranked = top
        bad = outlying(best)
        if len(bad) and len(out) < MOST_OUTLYING:
            out.extend(int(b) for b in bad)
            kept[i] = kept[i].take(_indices(kept[i]) - set(out))
        else:
            changes[i].append(Selected(best, tuple(f for f in ranked[1:] if best.z**2 - f.z**2 < MARGIN)))


def _solved(parts: Sequence[Part], changes: Sequence[Sequence[Selected]]) -> tuple[Scatter, list[Solution]]:
    shapes = [[change(one.found) for one in mine] for mine in changes]
    scatter = estimate_scatter(parts, shapes)
    return scatter, [solve(part, scatter, some) for part, some in zip(parts, shapes, strict=True)]


def _scans(solutions: Sequence[Solution], size: int) -> list[list[Found]]:
    """Significance of what is not changed yet, by part; an unknown changes once."""
    out = []
    for solution in solutions:
        known = {one.unknown for one in solution.changes}
        out.append([f for f in scan(solution, size) if f.unknown not in known])
    return out


def _indices(part: Part) -> set[int]:
    return {int(i) for group in part.groups for i in group.index}
