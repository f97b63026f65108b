"""How sensors and seats stand against the rig files in force: what a verdict goes by.

A likelihood is moved by c, what its rig file puts right of what was stated first (records.py). With x the level of an
unknown and β_k its changes, as far as they went, what is left of them, and of the level, is

    D = Σ β_k − (c_now − c_before),    e = x + Σ β_k − c_now

**Levels.** Is a gain what its rig file states, N(c, u²)? Its own prior is taken out (Sherman & Morrison 1950),

    H → H − 1 1ᵀ/p²,    m = x̂ p²/(p² − v),    var m = v p²/(p² − v),    z = (m − c)/√(u² + var m)

v the posterior variance: z is standard normal if all are as their rig files state. A gain is beyond where |z| is above
that of one false alarm in 4,000 and |m − c| > tolerance + k √(var m): a tolerance of 2 u alone would accuse one good
sensor in 20. The largest |z| first; its prior stays out, for what it has that its rig does not state pulls the others
the other way. Where the others scatter about their statements more than these say (median |z|), z is smaller by that.
Rivals of the best are within 1 : 100 of it, and without their prior it would not be beyond (of two gains whose
difference is all that is seen).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.campaign.health.border import raised
from nineaudit.campaign.health.model import Solution
from nineaudit.campaign.health.records import UNIT, Record
from nineaudit.campaign.health.scan import FALSE_ALARM
from nineaudit.campaign.health.select import MARGIN
from nineaudit.finding import COVERAGE_FACTOR

LEVEL: Final = NormalDist().inv_cdf(1.0 - FALSE_ALARM / 8.0)
"""|z| above which a gain is not what its rig file states, two-sided: a quarter of all false alarms."""
MEDIAN: Final = NormalDist().inv_cdf(0.75)
"""Of |z|, z standard normal."""
LEAST_LEFT: Final = 1e-9
"""Of a prior variance: what recordings that tell nothing leave of p² − v."""


@dataclass(frozen=True, eq=False)
class Standing:
    """A solution of the part of `records`, and by unknown the last recording that speaks of it with its row there."""

    solution: Solution
    records: Sequence[Record]
    last: Mapping[int, tuple[int, int]]

    def moved(self, unknown: int) -> float:
        """c_now, in records.UNIT."""
        at, row = self.last[unknown]
        return _moved(self.records[at], row)

    def in_force(self, unknown: int) -> bool:
        """Whether its sensor was not stated at another scale since, which nothing compares with this gain."""
        return self.current(unknown) == unknown

    def current(self, unknown: int) -> int:
        """Of a gain, that of the setting of its sensor which was stated last; of another unknown, itself."""
        one = self.solution.part.unknowns[unknown]
        if one.parameter != "gain":
            return unknown
        every = self.solution.part.unknowns
        mine = (i for i in self.last if (every[i].parameter, every[i].sensor) == ("gain", one.sensor))
        return max(mine, key=lambda i: self.last[i])

    def said(self, unknown: int) -> tuple[IntArray, FloatArray]:
        """The recordings that speak of an unknown, in order, and c of each."""
        told = [
            (int(i), _moved(self.records[int(i)], int(row)))
            for group in self.solution.part.groups
            for row in np.flatnonzero(group.design[:, group.at == unknown].any(axis=1))[:1]
            for i in group.index
        ]
        told.sort()
        return np.array([i for i, _ in told], dtype=np.intp), np.array([c for _, c in told])

    def restated(self, unknown: int) -> int | None:
        """The first recording from which c is as it is now; None where it always was."""
        index, c = self.said(unknown)
        other = np.flatnonzero(c != c[-1])
        return int(index[other[-1] + 1]) if len(other) else None

    def put_right(self, unknown: int, since: int) -> float:
        """c_now − c_before: before the recording `since`."""
        index, c = self.said(unknown)
        return float(c[-1] - c[max(int(np.searchsorted(index, since)) - 1, 0)])

    def now(self, unknown: int, level: bool = True) -> tuple[list[int], FloatArray]:
        """Entries of the solution, and how much of each there is now: the level where wanted, and every change."""
        n = len(self.solution.part.unknowns)
        its = {n + k: float(c.amount.max()) for k, c in enumerate(self.solution.changes) if c.unknown == unknown}
        entries = ({unknown: 1.0} if level else {}) | its
        return list(entries), np.array(list(entries.values()))

    def value(self, unknown: int, level: bool = True) -> tuple[float, float]:
        """What it is now, against the first statement, and its standard uncertainty: the posterior, in records.UNIT."""
        at, by = self.now(unknown, level)
        return float(by @ self.solution.x[at]), float(np.sqrt(by @ self.solution.cov[np.ix_(at, at)] @ by))


def standing(solution: Solution, records: Sequence[Record]) -> Standing:
    last: dict[int, tuple[int, int]] = {}
    for group in solution.part.groups:
        at = int(group.index.max())
        for row, column in np.argwhere(group.design):
            unknown = int(group.at[column])
            last[unknown] = max(last.get(unknown, (-1, 0)), (at, int(row)))
    return Standing(solution, records, last)


def _moved(record: Record, row: int) -> float:
    return 0.0 if record.moved is None else float(record.moved[row])


@dataclass(frozen=True, eq=False)
class Level:
    """A gain against its rig file in force, relative: `e` ± `U`, its `z`."""

    unknown: int
    e: float
    U: float
    z: float


def levels_beyond(
    mine: Standing, scattered: Mapping[int, float], tolerance: float
) -> list[tuple[Level, tuple[Level, ...]]]:
    """Gains that are not what their rig files state, each with its rivals; `scattered`: by unknown that has recordings
    enough, by how much its readings scatter more than the model says."""
    unknowns = mine.solution.part.unknowns
    gains = [i for i in scattered if unknowns[i].parameter == "gain" and mine.in_force(i)]
    x, cov = mine.solution.x, mine.solution.cov
    out = []
    judged = [_level(mine, x, cov, i, scattered[i]) for i in gains]
    while beyond := [one for one in judged if abs(one.z) > LEVEL and abs(one.e) > tolerance + one.U]:
        best = max(beyond, key=lambda one: abs(one.z))
        others = [one for one in judged if one is not best]
        freed = _free(mine, x, cov, best.unknown)
        judged = [_level(mine, *freed, one.unknown, scattered[one.unknown]) for one in others]
        wider = max(float(np.median([abs(one.z) for one in judged])) / MEDIAN, 1.0) if judged else 1.0
        if abs(best.z) <= LEVEL * wider:
            break
        near = [one for one in others if best.z**2 - one.z**2 < MARGIN * wider**2]
        without = [_level(mine, *_free(mine, x, cov, r.unknown), best.unknown, scattered[best.unknown]) for r in near]
        rivals = (r for r, one in zip(near, without, strict=True) if abs(one.z) <= LEVEL * wider)
        out.append((best, tuple(rivals)))
        x, cov = freed
    return out


def _level(mine: Standing, x: FloatArray, cov: FloatArray, unknown: int, wider: float) -> Level:
    at, by = mine.now(unknown)
    m, v = float(by @ x[at]), float(by @ cov[np.ix_(at, at)] @ by)
    factor = _without_prior(mine, cov, unknown)
    across = float(by @ cov[at, unknown])
    m, v = m + factor * x[unknown] * across, (v + factor * across**2) * wider**2
    last, row = mine.last[unknown]
    e, u = m - mine.moved(unknown), mine.records[last].rows[row].prior
    return Level(unknown, UNIT["gain"] * e, COVERAGE_FACTOR * UNIT["gain"] * v**0.5, e / float(np.hypot(u, v**0.5)))


def _without_prior(mine: Standing, cov: FloatArray, unknown: int) -> float:
    """The factor of c cᵀ, c its column, which H⁻¹ gains when the prior of an unknown goes; what changes has none."""
    prior = float(mine.solution.part.prior[unknown]) ** 2
    if any(change.unknown == unknown for change in mine.solution.changes):
        return 0.0
    return 1.0 / max(prior - float(cov[unknown, unknown]), LEAST_LEFT * prior)


def _free(mine: Standing, x: FloatArray, cov: FloatArray, unknown: int) -> tuple[FloatArray, FloatArray]:
    """The solution without the prior of an unknown."""
    factor, column = _without_prior(mine, cov, unknown), cov[:, unknown]
    return x + factor * x[unknown] * column, raised(cov.copy(), column, factor)


__all__ = ["LEVEL", "Level", "Standing", "levels_beyond", "standing"]
