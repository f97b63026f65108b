"""Columns of frames that grow in place while a BLF log is read, so that nothing stands in memory twice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.readers.can.frames import LONG, SHORT, Frames

Rows = NDArray[np.intp]
Words = NDArray[np.uint64]

_WORD: Final = np.dtype("<u8")
_DTYPES: Final = {"time": "i8", "key": "u4", "channel": "u2", "kind": "u1", "length": "u1", "data": _WORD}
_SMALL: Final = 1 << 17
"""Rows up to which a column grows by doubling, since then by a quarter."""
_FEW: Final = 8
"""Channels of a part that are looked for one by one."""
_BLOCK: Final = 1 << 16
"""Rows at a time, so that their places need little memory."""


@dataclass(frozen=True, eq=False)
class Part:
    """Room for n frames that follow each other, to be filled: columns as in Frames, but `channel` (n,) as the log has
    it, and `data` (n,) the first eight bytes as a word."""

    time: NDArray[np.int64]
    key: NDArray[np.uint32]
    channel: NDArray[np.uint16]
    kind: NDArray[np.uint8]
    length: NDArray[np.uint8]
    data: Words


class _Column:
    """Rows of one column. Where they are full, room is made where they stand, if the system can."""

    def __init__(self, expected: int, dtype: Any, *width: int) -> None:
        self._rows, self._count = np.empty((expected, *width), dtype=dtype), 0

    def room(self, count: int) -> NDArray[Any]:
        """The next rows, to be filled before more are asked for."""
        begin, self._count = self._count, self._count + count
        if self._count > len(self._rows):
            self._resize(max(self._count, begin + max(begin // 4, min(begin, _SMALL))))
        return self._rows[begin : self._count]

    def array(self) -> NDArray[Any]:
        self._resize(self._count)
        return self._rows

    def _resize(self, count: int) -> None:
        # No room that was given out is in use any more, and the whole is given out once, at the end.
        self._rows.resize((count, *self._rows.shape[1:]), refcheck=False)


class Columns:
    """Frames of a log, part by part. `expected`: about how many there will be."""

    def __init__(self, expected: int) -> None:
        self._columns = {name: _Column(expected, dtype) for name, dtype in _DTYPES.items()}
        self._long: tuple[_Column, _Column] | None = None
        self._expected = expected
        self._present = np.zeros(1 << 16, dtype=np.bool_)
        self._part: Part | None = None
        self._begin = self._count = 0

    def room(self, count: int) -> Part:
        """Room for the frames that follow, which must be filled before more is asked for."""
        self._note_channels()
        self._begin, self._count = self._count, self._count + count
        self._part = Part(**{name: column.room(count) for name, column in self._columns.items()})
        return self._part

    def add_long(self, some: list[tuple[Rows, Words]]) -> None:
        """Those frames of the last part that have more than eight bytes: rows of the part, and (m,8) words."""
        if not some:
            return
        rows, words = (np.concatenate([one[i] for one in some]) if len(some) > 1 else some[0][i] for i in (0, 1))
        if len(some) > 1:
            order = np.argsort(rows, kind="stable")
            rows, words = rows[order], words[order]
        long_rows, long = self._long = self._long or self._columns_of_long(len(rows))
        np.add(rows, self._begin, out=long_rows.room(len(rows)))
        long.room(len(rows))[:] = words

    def _columns_of_long(self, first: int) -> tuple[_Column, _Column]:
        """With room for as many, of all frames expected, as the `first` are of those there are, and some more."""
        expected = self._expected * first // max(self._count, 1) * 9 // 8
        return _Column(expected, np.intp), _Column(expected, _WORD, LONG // 8)

    def _note_channels(self) -> None:
        if self._part is None or not len(self._part.channel):
            return
        channels, self._part = self._part.channel, None
        low, high = int(channels.min()), int(channels.max())
        if high - low < _FEW:  # which is much faster
            self._present[[c for c in range(low, high + 1) if (channels == c).any()]] = True
        else:
            self._present[channels] = True

    def frames(self, **rest: Any) -> Frames:
        """All of them, once; `rest` are the fields of the whole log."""
        self._note_channels()
        columns: dict[str, Any] = {name: column.array() for name, column in self._columns.items()}
        long_rows, long = self._long or self._columns_of_long(0)
        present = np.flatnonzero(self._present)
        return Frames(
            bus=_coded(columns.pop("channel"), self._present),
            buses=tuple(map(str, present.tolist())),
            data=columns.pop("data").view(np.uint8).reshape(-1, SHORT),
            long_rows=long_rows.array(),
            long=long.array().view(np.uint8).reshape(-1, LONG),
            **columns,
            **rest,
        )


def _coded(channel: NDArray[np.uint16], present: NDArray[np.bool_]) -> NDArray[np.uint16]:
    """(n,) which of the channels that are `present` each is, in place."""
    codes = (np.cumsum(present) - 1).astype(np.uint16)
    for start in range(0, len(channel), _BLOCK):
        channel[start : start + _BLOCK] = codes.take(channel[start : start + _BLOCK])
    return channel
