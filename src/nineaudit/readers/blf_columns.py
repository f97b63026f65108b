"""Columns of frames that grow in place while a BLF log is read, so that nothing stands in memory twice."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.readers.blf_frames import Part
from nineaudit.readers.can_frames import LONG, SHORT, Frames, frames

_FIELDS: Final = ("time", "key", "channel", "kind", "length", "data", "long_rows", "long")
_SMALL: Final = 1 << 17
"""Rows up to which a column grows by doubling, since then by a quarter."""


class _Column:
    """Rows of one column. Where they are full, room is made where they stand, if the system can."""

    def __init__(self, like: NDArray[Any], room: int) -> None:
        self._rows, self._count = np.empty((room, *like.shape[1:]), dtype=like.dtype), 0

    def append(self, block: NDArray[Any]) -> None:
        end = self._count + len(block)
        if end > len(self._rows):
            self._resize(max(end, self._count + max(self._count // 4, min(self._count, _SMALL))))
        self._rows[self._count : end] = block
        self._count = end

    def array(self) -> NDArray[Any]:
        self._resize(self._count)
        return self._rows

    def _resize(self, count: int) -> None:
        # No view of the rows is ever handed out before the last time, so none can be left behind.
        self._rows.resize((count, *self._rows.shape[1:]), refcheck=False)


class Columns:
    """Parts of a log, put behind each other. `expected`: about how many frames there will be."""

    def __init__(self, expected: int) -> None:
        self._columns: dict[str, _Column] = {}
        self._count, self._expected = 0, expected
        self._present = np.zeros(1 << 16, dtype=np.bool_)

    def append(self, part: Part) -> None:
        """Frames that follow in the log."""
        for name in _FIELDS:
            block = getattr(part, name)
            if name not in self._columns:
                self._columns[name] = _Column(block, 0 if name.startswith("long") else self._expected)
            self._columns[name].append(block + self._count if name == "long_rows" else block)
        self._present[part.channel] = True
        self._count += len(part.time)

    def frames(self, **rest: Any) -> Frames:
        """All of them; `rest` are the fields of the whole log."""
        if not self._count:
            return frames([], [], [], [], [], np.empty((0, SHORT), dtype=np.uint8), **rest)
        columns = {name: column.array() for name, column in self._columns.items()}
        present = np.flatnonzero(self._present)
        codes = (np.cumsum(self._present) - 1).astype(np.uint16)
        data, long = columns.pop("data"), columns.pop("long")
        return Frames(
            bus=codes[columns.pop("channel")],
            buses=tuple(map(str, present.tolist())),
            data=data.view(np.uint8).reshape(-1, SHORT),
            long=long.view(np.uint8).reshape(-1, LONG),
            **columns,
            **rest,
        )
