"""Frames of several parts of a log that were recorded at the same time, put in the order of their stamps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nineaudit.array import BoolArray
from nineaudit.readers.can.frames import SHORT, Frames, Int64, Rows

_COLUMNS = ("time", "key", "bus", "kind", "length")


def merged(parts: Sequence[Frames]) -> Frames:
    """All frames by their stamps, of equal ones those of the first part first. Each part keeps its own order, also
    where its time goes back: a log that restarts must show. What is not a column is that of the first part."""
    todo = [part for part in parts if len(part)] or list(parts[:1])
    while len(todo) > 1:
        pairs = [todo[i : i + 2] for i in range(0, len(todo), 2)]
        todo = [_of_two(*pair) if len(pair) == 2 else pair[0] for pair in pairs]
    return todo[0]


def _of_two(one: Frames, two: Frames) -> Frames:
    """The rows of the shorter are looked up in the longer; those of the longer take the places that are left."""
    swapped = len(one) < len(two)
    most, few = (two, one) if swapped else (one, two)
    side = np.searchsorted(_rising(most.time), _rising(few.time), side="left" if swapped else "right")
    at = side + np.arange(len(few))
    rest = np.ones(len(one) + len(two), dtype=np.bool_)
    rest[at] = False
    before = np.cumsum(rest) - 1  # row of the longer; at `at` any
    columns: dict[str, Any] = {name: _put(getattr(most, name), getattr(few, name), at, before) for name in _COLUMNS}
    columns["data"] = _put(_words(most), _words(few), at, before).view(np.uint8).reshape(-1, SHORT)
    return replace(one, **columns, **_long(most, few, at, rest))


def _rising(time: Int64) -> Int64:
    return time if (time[1:] >= time[:-1]).all() else np.asarray(np.maximum.accumulate(time))


def _words(part: Frames) -> NDArray[np.uint64]:
    return np.ascontiguousarray(part.data).view(np.uint64).reshape(-1)


def _put(most: NDArray[Any], few: NDArray[Any], at: Rows, before: Rows) -> NDArray[Any]:
    out = most.take(before)
    out[at] = few
    return out


def _long(most: Frames, few: Frames, at: Rows, rest: BoolArray) -> dict[str, Any]:
    """Where the frames of more than eight bytes are now; their bytes are copied only where both parts have some."""
    if not len(most.long_rows):
        return {"long_rows": at[few.long_rows], "long": few.long}
    places = np.flatnonzero(rest)[most.long_rows]
    if not len(few.long_rows):
        return {"long_rows": places, "long": most.long}
    rows = np.concatenate([places, at[few.long_rows]])
    order = np.argsort(rows, kind="stable")
    return {"long_rows": rows[order], "long": np.concatenate([most.long, few.long])[order]}
