"""Frames of a CAN log as columns, in the order of the log: what every CAN reader makes and every bus rule reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.can_bits import ByteMatrix
from nineaudit.can_database import EXTENDED
from nineaudit.recording import Damage

Int64 = NDArray[np.int64]
Rows = NDArray[np.intp]

REMOTE: Final = 1
ERROR: Final = 2
OVERLOAD: Final = 4
FD: Final = 8
RATE_SWITCH: Final = 16
ERROR_STATE: Final = 32
SENT: Final = 64
"""Bits of `kind`; SENT: by the logger itself (Tx)."""
NOT_DATA: Final = REMOTE | ERROR | OVERLOAD
IDENTIFIER: Final = EXTENDED - 1
SHORT: Final = 8
"""Bytes of a classic frame."""
LONG: Final = 64
"""Bytes of the longest FD frame."""


@dataclass(frozen=True, eq=False)
class Frames:
    """n frames of a log: data, remote, error and overload frames.

    `time` (n,) int64 ns, as the log has it: since its start, or since 1970 where its stamps are dates.
    `key` (n,) uint32 identifier with the EXTENDED flag, 0 for error and overload frames. `bus` (n,) uint16 index into
    `buses`. `kind` (n,) uint8 flags. `length` (n,) uint8 bytes of data that are there (of a remote frame: asked for).
    `data` (n,8) uint8 first eight bytes, zero-filled; frames of more are row `long_rows` (m,) of the log and have all
    their bytes in `long` (m,64).
    `counts`: what the container held besides; `damage`: what could not be read; `origin`: ns to add to every stamp for
    the time the log's signals were written with (nineaudit's own logs), 0 if none; `started`: when the log says that
    the measurement began (ISO 8601), "" where it does not or the stamps say so.
    """

    time: Int64
    key: NDArray[np.uint32]
    bus: NDArray[np.uint16]
    kind: NDArray[np.uint8]
    length: NDArray[np.uint8]
    data: ByteMatrix
    long_rows: Rows
    long: ByteMatrix
    buses: tuple[str, ...] = ()
    counts: dict[str, float] = field(default_factory=dict)
    damage: tuple[Damage, ...] = ()
    notes: tuple[str, ...] = ()
    origin: int = 0
    started: str = ""

    def __len__(self) -> int:
        return len(self.time)

    @property
    def is_data(self) -> NDArray[np.bool_]:
        """(n,) true for data frames."""
        return np.asarray((self.kind & NOT_DATA) == 0)

    def rows_of(self, key: int) -> Rows:
        """Rows of the data frames of an identifier, in the order of the log."""
        rows = np.flatnonzero(self.key == np.uint32(key))
        data = (self.kind.take(rows) & NOT_DATA) == 0
        return rows if data.all() else rows[data]

    def payload(self, rows: Rows) -> ByteMatrix:
        """(len(rows), 8 or 64) bytes of frames, zero-filled: 64 only where one of them has more than 8."""
        short = _words(self.data).take(rows).view(np.uint8).reshape(-1, SHORT)
        if not len(self.long_rows) or not (self.length.take(rows) > SHORT).any():
            return short
        place = np.minimum(np.searchsorted(self.long_rows, rows), len(self.long_rows) - 1)
        held = self.long_rows[place] == rows
        if held.all():
            return self.long.take(place, axis=0)
        out = np.zeros((len(rows), LONG), dtype=np.uint8)
        out[:, :SHORT] = short
        out[held] = self.long[place[held]]
        return out

    def take(self, rows: Rows) -> Frames:
        """Some of the frames, or all in another order; a row may come twice."""
        columns: dict[str, Any] = {name: getattr(self, name)[rows] for name in _COLUMNS[:-1]}
        place = np.full(len(self), -1)
        place[self.long_rows] = np.arange(len(self.long_rows))
        long_rows = np.flatnonzero(place[rows] >= 0)
        return replace(self, **columns, long_rows=long_rows, long=self.long[place[rows[long_rows]]])


def _words(data: ByteMatrix) -> NDArray[np.uint64]:
    """(n,) what (n,8) bytes are as words, of which many are taken much faster."""
    return np.ascontiguousarray(data).view(np.uint64).reshape(-1)


def frames(
    time: Any,
    key: Any,
    bus: Any,
    kind: Any,
    length: Any,
    data: ByteMatrix,
    long_rows: Any = (),
    long: ByteMatrix | None = None,
    **rest: Any,
) -> Frames:
    """Frames from columns of any integer type."""
    return Frames(
        np.asarray(time, dtype=np.int64),
        np.asarray(key, dtype=np.uint32),
        np.asarray(bus, dtype=np.uint16),
        np.asarray(kind, dtype=np.uint8),
        np.asarray(length, dtype=np.uint8),
        data,
        np.asarray(long_rows, dtype=np.intp),
        np.empty((0, LONG), dtype=np.uint8) if long is None else long,
        **rest,
    )


def joined(parts: Sequence[Frames], **rest: Any) -> Frames:
    """Parts of one log in order, their `bus` codes of one table; `rest` are the fields of the whole log."""
    if not parts:
        return frames([], [], [], [], [], np.empty((0, SHORT), dtype=np.uint8), **rest)
    if len(parts) == 1:
        return replace(parts[0], **rest)
    start = np.cumsum([0, *(len(p) for p in parts)])
    columns: dict[str, Any] = {name: np.concatenate([getattr(p, name) for p in parts]) for name in _COLUMNS}
    columns["long_rows"] = np.concatenate([p.long_rows + at for p, at in zip(parts, start, strict=False)])
    return Frames(**columns, **rest)


_COLUMNS: Final = ("time", "key", "bus", "kind", "length", "data", "long")


def key_counts(log: Frames) -> dict[int, int]:
    """Number of data frames of each key."""
    keys = log.key if log.is_data.all() else log.key[log.is_data]
    few = keys < _STANDARD
    counts = np.bincount(keys[few], minlength=0)
    standard = {key: int(counts[key]) for key in np.flatnonzero(counts).tolist()}
    extended = np.unique(keys[~few], return_counts=True)
    return standard | dict(zip(*(part.tolist() for part in extended), strict=True))


_STANDARD: Final = 1 << 11
