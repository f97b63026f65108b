"""From n samples to what a plot can show: min and max of every pixel column, exactly (never LTTB).

A path through the lowest and the highest sample of each column, in the order in which they were taken, covers
the same pixels as the path through all samples. Flagged samples are kept whatever their number.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nineaudit.array import BoolArray, FloatArray

IntArray = NDArray[np.int64]

GAP = 1.5
"""A step longer than this many median steps is a gap (as in recording.Clock)."""


def columns_of(time: FloatArray, span: tuple[float, float], columns: int) -> IntArray:
    """(n,) pixel column of each sample of `time` (n,) s; the end of `span` belongs to the last column."""
    width = span[1] - span[0]
    position = (time - span[0]) / width * columns if width > 0 else np.zeros_like(time)
    return np.clip(np.floor(position), 0, columns - 1).astype(np.int64)


def strokes(time: FloatArray, values: FloatArray, column: IntArray) -> list[IntArray]:
    """Indices of the samples to draw, one array per unbroken stroke.

    `time` (n,) s increasing, `values` (n,) with NaN where there is none, `column` (n,) from `columns_of`. A
    stroke ends where samples are missing: at NaN and at gaps of the clock. A gap inside one column is too small
    to draw.
    """
    finite = np.isfinite(values)
    kept = np.flatnonzero(finite)
    if kept.size == 0:
        return []
    if kept.size > 2 * np.unique(column[kept]).size:
        kept = _extremes(values, column, kept)
    broken = np.cumsum(~finite | _after_gap(time))
    separate = (np.diff(broken[kept]) > 0) & (np.diff(column[kept]) > 0)
    return np.split(kept, np.flatnonzero(separate) + 1)


def _extremes(values: FloatArray, column: IntArray, kept: IntArray) -> IntArray:
    """Indices of the smallest and the largest of the `kept` samples of each column, in order of time."""
    order = kept[np.lexsort((values[kept], column[kept]))]
    last = np.flatnonzero(np.diff(column[order], append=-1))
    first = np.concatenate(([0], last[:-1] + 1))
    return np.unique(np.concatenate((order[first], order[last])))


def _after_gap(time: FloatArray) -> BoolArray:
    """(n,) true for a sample that comes after a gap of the clock."""
    after = np.zeros(time.shape, dtype=np.bool_)
    if time.size > 2:
        step = np.diff(time)
        after[1:] = step > GAP * np.median(step)
    return after


def envelope(lower: FloatArray, upper: FloatArray, column: IntArray) -> list[tuple[IntArray, FloatArray, FloatArray]]:
    """(column, least of `lower`, greatest of `upper`) per unbroken run of columns that have a finite band."""
    kept = np.flatnonzero(np.isfinite(lower) & np.isfinite(upper))
    if kept.size == 0:
        return []
    first = np.flatnonzero(np.diff(column[kept], prepend=-1))
    at = column[kept][first]
    low, high = np.minimum.reduceat(lower[kept], first), np.maximum.reduceat(upper[kept], first)
    spacing = max(int(np.median(np.diff(at))) if at.size > 1 else 1, 1)
    cuts = np.flatnonzero(np.diff(at) > 2 * spacing) + 1
    return list(zip(np.split(at, cuts), np.split(low, cuts), np.split(high, cuts), strict=True))


def runs(mask: BoolArray) -> list[tuple[int, int]]:
    """(first, last) of every run of true values of `mask` (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]
