"""Numbers out of many ROS messages at once: ROS 2 (CDR, both byte orders) and ROS 1.

All messages of a batch are walked together through their type, one cursor a message; messages part where their
sequences have different lengths, and meet again behind them. Nothing is assumed: every length is read from its message
and held against its end.

Sources: CDR, DDS-XTypes 1.3 section 7.4.3 (alignment counts from behind the encapsulation header; XCDR2 aligns to 4
bytes at most), encapsulation identifiers DDSI-RTPS 2.5 section 10; ROS 1 serialization as in roscpp (no alignment).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any, Final

import numpy as np

from nineaudit.array import BoolArray
from nineaudit.readers.mcap.columns import Column, Decoded, number_at
from nineaudit.readers.mcap.layout import alignment, is_number, items_span, least, leaves
from nineaudit.readers.mcap.parse import Int64
from nineaudit.readers.mcap.records import Batch
from nineaudit.readers.mcap.ros import Array, Number, Struct, Text, Type

Wants = dict[str, Any]
"""Fields that are wanted, by name: those of their fields, or under "" the number of a column."""
_KINDS: Final = {0: (">", 8), 1: ("<", 8), 6: (">", 4), 7: ("<", 4)}
"""Encapsulation identifier: byte order and largest alignment."""
_HEADER: Final = 4
_SPARE: Final = 7
"""Bytes behind a message that are padding."""


@dataclass(frozen=True, eq=False)
class Ros:
    """Decoder of messages of one type; `encapsulated`: CDR, else ROS 1."""

    type: Struct
    encapsulated: bool

    def has(self, path: str, batch: Batch) -> bool:  # noqa: ARG002
        """Whether the type has a number at a path."""
        return is_number(self.type, path)

    def leaves(self, batch: Batch) -> list[str]:  # noqa: ARG002
        """Paths of the type's numbers, of arrays the first."""
        return list(islice(leaves(self.type), 1000))

    def read(self, batch: Batch, paths: Sequence[str]) -> Decoded:
        """The numbers at paths. A message that ends too early, or of another encapsulation, is not good."""
        return _Reading(self, batch, [p if is_number(self.type, p) else None for p in paths]).result()


@dataclass(eq=False)
class _Cursor:
    """m messages that are read in step: `rows` of the batch; `body` (m,) where alignment counts from; `place` (m,)
    a byte whose distance from there is a multiple of `known`; all stand `offset` bytes behind it; `end` (m,)."""

    rows: Int64
    body: Int64
    place: Int64
    end: Int64
    offset: int = 0
    known: int = 8

    def only(self, keep: BoolArray) -> _Cursor:
        return replace(self, rows=self.rows[keep], body=self.body[keep], place=self.place[keep], end=self.end[keep])

    def take(self, other: _Cursor) -> None:
        self.__dict__.update(other.__dict__)

    def move(self, by: Int64, known: int) -> None:
        """On by (m,) bytes, to places that are multiples of `known`."""
        self.place, self.offset, self.known = self.place + (self.offset + by), 0, known


class _Reading:
    """One batch while it is read."""

    def __init__(self, decoder: Ros, batch: Batch, paths: Sequence[str | None]) -> None:
        self.data, self.batch, self.decoder = batch.data, batch, decoder
        self.wants = _tree(paths)
        self.values: list[Any] = [None] * len(paths)
        self.there = np.zeros((len(paths), len(batch)), dtype=bool)
        self.good = np.zeros(len(batch), dtype=bool)
        self.longer = 0
        self.order, self.most = "<", 1

    def result(self) -> Decoded:
        for cursor in self.cursors():
            self.walk(self.decoder.type, cursor, self.wants)
            self.require(cursor, cursor.place + cursor.offset <= cursor.end)
            self.good[cursor.rows] = True
            spare = _SPARE if self.decoder.encapsulated else 0
            self.longer += int(np.count_nonzero(cursor.end - cursor.place - cursor.offset > spare))
        zeros = np.zeros(len(self.batch))
        columns = zip(self.values, self.there & self.good, strict=True)
        return Decoded(tuple(Column(zeros if v is None else v, t) for v, t in columns), self.good, self.longer)

    def cursors(self) -> Iterator[_Cursor]:
        """A cursor for the messages of each encapsulation."""
        rows, starts, ends = np.arange(len(self.batch)), self.batch.starts, self.batch.ends
        if not self.decoder.encapsulated:
            yield _Cursor(rows, starts, starts, ends)
            return
        rows = rows[ends - starts >= _HEADER]
        kinds = number_at(self.data, ">u2")[starts[rows]]
        for kind, (order, most) in _KINDS.items():
            of = rows[kinds == kind]
            if len(of):
                self.order, self.most = order, most
                yield _Cursor(of, starts[of] + _HEADER, starts[of] + _HEADER, ends[of])

    def require(self, cursor: _Cursor, ok: BoolArray) -> None:
        """Messages that are not as they must be are left behind."""
        if not ok.all():
            cursor.take(cursor.only(ok))

    def align(self, cursor: _Cursor, size: int) -> None:
        size = min(size, self.most)
        if size <= cursor.known:
            cursor.offset += -cursor.offset % size
        else:
            pad = (cursor.body - cursor.place - cursor.offset) & (size - 1)
            cursor.move(pad, size)

    def counts(self, cursor: _Cursor) -> Int64:
        """(m,) lengths that stand next, as int64."""
        self.align(cursor, 4)
        self.require(cursor, cursor.place + (cursor.offset + 4) <= cursor.end)
        found: Int64 = self.number(cursor, "u4").astype(np.int64)
        cursor.offset += 4
        return found

    def number(self, cursor: _Cursor, dtype: str, further: int = 0) -> Any:
        return number_at(self.data, self.order + dtype)[cursor.place + (cursor.offset + further)]

    def keep(self, column: int, kind: Number, cursor: _Cursor, further: int = 0) -> None:
        """The numbers at the cursors are a column's."""
        if kind.dtype == "b1":
            return
        got = self.number(cursor, kind.dtype, further)
        if self.values[column] is None:
            self.values[column] = np.zeros(len(self.batch), dtype=kind.dtype)
        self.values[column][cursor.rows] = got
        self.there[column, cursor.rows] = np.isfinite(got) if kind.dtype[0] == "f" else True

    def walk(self, kind: Type, cursor: _Cursor, wants: Wants) -> None:
        """Past a value, keeping what is wanted of it."""
        if not len(cursor.rows):
            return
        if not wants and self.skipped(kind, cursor):
            return
        if isinstance(kind, Number):
            self.align(cursor, kind.size)
            self.require(cursor, cursor.place + (cursor.offset + kind.size) <= cursor.end)
            for column in wants.get("", ()):
                self.keep(column, kind, cursor)
            cursor.offset += kind.size
        elif isinstance(kind, Text):
            self.bytes(cursor, 1)
        elif isinstance(kind, Struct):
            for name, part in kind.fields:
                self.walk(part, cursor, wants.get(name, {}))
        else:
            self.array(kind, cursor, wants)

    def skipped(self, kind: Type, cursor: _Cursor, count: int = 1) -> bool:
        """Past values of fixed layout at once, where the alignment is known."""
        if min(alignment(kind), self.most) > cursor.known:
            return False
        size = items_span(kind, count, cursor.offset % 8, self.most)
        cursor.offset += size or 0
        return size is not None

    def bytes(self, cursor: _Cursor, size: int) -> None:
        """Past a length and as many items of `size` bytes, none of which is wanted."""
        counts = self.counts(cursor)
        if not len(counts):
            return
        if (counts == counts[0]).all():
            if counts[0]:
                self.align(cursor, size)
            cursor.offset += int(counts[0]) * size
        else:
            at = cursor.place + cursor.offset
            pad = (cursor.body - at) & (min(size, self.most) - 1)
            cursor.move(np.where(counts > 0, pad + counts * size, 0), 1)
        self.require(cursor, cursor.place + cursor.offset <= cursor.end)

    def array(self, kind: Array, cursor: _Cursor, wants: Wants) -> None:
        if kind.count is None and not wants and isinstance(kind.item, Number):
            self.bytes(cursor, kind.item.size)
        elif kind.count is not None:
            self.items(kind, kind.count, cursor, wants)
        else:
            counts = self.counts(cursor)
            parts = []
            for count in np.unique(counts).tolist():
                part = cursor.only(counts == count) if (counts != count).any() else replace(cursor)
                self.items(kind, count, part, wants)
                parts.append(part)
            cursor.take(_together(parts, cursor))

    def items(self, kind: Array, count: int, cursor: _Cursor, wants: Wants) -> None:
        """Past `count` items of an array."""
        self.require(cursor, cursor.end - cursor.place - cursor.offset >= count * least(kind.item))
        if not count or not len(cursor.rows):
            return
        if isinstance(kind.item, Number):
            self.align(cursor, kind.item.size)
            self.require(cursor, cursor.place + (cursor.offset + count * kind.item.size) <= cursor.end)
            for name, want in wants.items():
                for column in want.get("", ()) if int(name) < count else ():
                    self.keep(column, kind.item, cursor, int(name) * kind.item.size)
            cursor.offset += count * kind.item.size
            return
        if least(kind.item) == 0:
            return
        last = max((int(name) for name in wants), default=-1)
        for k in range(count):
            if k > last and self.skipped(kind.item, cursor, count - k):
                return
            self.walk(kind.item, cursor, wants.get(str(k), {}))


def _together(parts: Sequence[_Cursor], before: _Cursor) -> _Cursor:
    """Cursors that parted, as one."""
    if len(parts) < 2:
        return parts[0] if parts else before
    columns = zip(*((p.rows, p.body, p.place + p.offset, p.end) for p in parts), strict=True)
    rows, body, place, end = (np.concatenate(c) for c in columns)
    return _Cursor(rows, body, place, end, offset=0, known=1)


def _tree(paths: Sequence[str | None]) -> Wants:
    """Paths as a tree of names; under "" the columns of a path that ends there."""
    tree: Wants = {}
    for column, path in enumerate(paths):
        place = tree
        for name in path.split(".") if path is not None else ():
            place = place.setdefault(str(int(name)) if name.isdecimal() else name, {})
        if path is not None:
            place.setdefault("", []).append(column)
    return tree
