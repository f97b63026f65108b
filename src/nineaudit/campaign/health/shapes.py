"""Ways in which an unknown may change, by the runs of its recordings: steps, ramps, shock history (scan.py)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.campaign.health.crowd import Crowd

LEAST_SIDE: Final = 3
"""Recordings on each side of a step."""


@dataclass(frozen=True, eq=False)
class Shapes:
    """Name and first bin of every shape (S), the last being the hardest shock before, which is of each unknown: (S-1,B)
    `common` to all of a crowd and (k,B) `worst`, 0 to 1; all 0, none."""

    names: tuple[tuple[str, int], ...]
    common: FloatArray
    worst: FloatArray

    def applied(self, by_bin: FloatArray) -> FloatArray:
        """(k,S) Σ f v of (k,B)."""
        return np.column_stack([by_bin @ self.common.T, (by_bin * self.worst).sum(axis=1)])

    def squared(self, by_bin: FloatArray) -> FloatArray:
        """(k,S) Σ f² v of (k,B)."""
        return np.column_stack([by_bin @ (self.common**2).T, (by_bin * self.worst**2).sum(axis=1)])

    def quadratic(self, place: int, matrix: FloatArray) -> FloatArray:
        """(S,) Σ f f' v of (B,B), for one unknown of the crowd."""
        values = np.vstack([self.common, self.worst[place]])
        return np.asarray(((values @ matrix) * values).sum(axis=1))

    def values(self, place: int, shape: int) -> FloatArray:
        """(B,) of one unknown."""
        return np.asarray(self.worst[place] if shape == len(self.common) else self.common[shape])


def shapes(crowd: Crowd) -> Shapes:
    """Those of the unknowns of a crowd."""
    count, size = crowd.bins, len(crowd.bin)
    sizes, bins = np.bincount(crowd.bin, minlength=count), np.arange(count)
    when = np.bincount(crowd.bin, crowd.when, count) / sizes
    before = np.cumsum(sizes) - sizes
    steps = np.flatnonzero(np.minimum(before, size - before) >= LEAST_SIDE)
    ramps = np.flatnonzero((bins < count - 2) & (size - before >= 2 * LEAST_SIDE) & (when < when[-1]))
    names = [*(("step", int(k)) for k in steps), *(("ramp", int(k)) for k in ramps), ("count", 0), ("worst", 0)]
    rising = (when - when[ramps, None]) / (when[-1] - when[ramps, None])
    counted = np.bincount(crowd.bin, np.arange(size) / (size - 1.0), count) / sizes
    common = np.vstack([(bins >= steps[:, None]).astype(np.float64), np.clip(rising, 0.0, 1.0), counted])
    starts = np.cumsum(sizes) - sizes
    hardest = np.maximum.accumulate(crowd.shock, axis=1)[:, :-1]
    history = np.column_stack([np.zeros(len(hardest)), hardest / np.maximum(hardest[:, -1:], 1e-300)])
    return Shapes(tuple(names), common, np.add.reduceat(history, starts, axis=1) / sizes)
