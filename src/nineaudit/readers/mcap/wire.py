"""The protobuf wire format of many messages at once: all are walked together, one field of each a step.

Source: protobuf encoding, protobuf.dev/programming-guides/encoding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np

from nineaudit.array import BoolArray
from nineaudit.readers.mcap.columns import Column, Numbers, number_at
from nineaudit.readers.mcap.parse import Int64
from nineaudit.readers.mcap.records import Batch

VARINT, I64, LEN, I32 = 0, 1, 2, 5
"""Wire types."""
_LONGEST: Final = 10
"""Bytes of a varint."""
_BEYOND: Final = 2**29
"""Field numbers end below."""


class Scalar(NamedTuple):
    """How a number is written: its wire type and its type in numpy's words; `zigzag`: the sign is the lowest bit."""

    wire: int
    dtype: str
    zigzag: bool = False

    @property
    def size(self) -> int:
        return int(self.dtype[1:])


@dataclass(eq=False)
class Want:
    """What is wanted of a field: of a number (`scalar`) the columns of its items, of a message the wanted fields of its
    items. The item of a field that is not repeated is 0. `present`: a message has the number even where it is not
    written, as 0."""

    scalar: Scalar | None
    repeated: bool = False
    present: bool = False
    columns: dict[int, list[int]] = field(default_factory=dict)
    inner: dict[int, Wants] = field(default_factory=dict)


Wants = dict[int, Want]
"""By field number."""


class Walked(NamedTuple):
    """Columns; (n,) messages that keep to the wire format; those that the walk cannot read, and the library can."""

    columns: tuple[Column, ...]
    good: BoolArray
    odd: BoolArray


def walked(batch: Batch, wants: Wants, dtypes: Sequence[str]) -> Walked:
    """The numbers that are wanted of a batch's messages, in columns of `dtypes`."""
    walk = _Walk(batch, dtypes)
    walk.message(np.arange(len(batch)), batch.starts, batch.ends, wants)
    for values, there in zip(walk.values, walk.there, strict=True):
        there &= np.isfinite(values) & walk.good
    return Walked(tuple(map(Column, walk.values, walk.there)), walk.good, walk.odd)


class _Walk:
    """One batch while it is walked. Places are bytes of its data; −1 is behind a field that cannot be."""

    def __init__(self, batch: Batch, dtypes: Sequence[str]) -> None:
        self.data, self.count = batch.data, len(batch)
        self.bytes = number_at(batch.data, "u1")
        self.good = np.ones(self.count, dtype=bool)
        self.odd = np.zeros(self.count, dtype=bool)
        self.values = [np.zeros(self.count, dtype=dtype) for dtype in dtypes]
        self.there = [np.zeros(self.count, dtype=bool) for _ in dtypes]

    def message(self, rows: Int64, at: Int64, end: Int64, wants: Wants) -> None:
        """The fields of (m,) messages, whole or nested, of the batch's `rows`: from `at` to `end`."""
        for want in wants.values():
            for column in want.columns.get(0, ()) if want.present else ():
                self.there[column][rows] = True
        seen = {number: np.zeros(self.count, dtype=np.int64) for number in wants}
        while True:
            live = at < end
            if not live.all():
                rows, at, end = rows[live], at[live], end[live]
            if not len(rows):
                return
            tags, at = self.varint(at, end)
            at = self.fields(tags, rows, at, end, wants, seen)
            if at.min(initial=0) < 0:
                self.good[rows[at < 0]] = False
                rows, at, end = rows[at >= 0], at[at >= 0], end[at >= 0]

    def fields(
        self, tags: Numbers, rows: Int64, at: Int64, end: Int64, wants: Wants, seen: Mapping[int, Int64]
    ) -> Int64:
        """One field of each message, by its tag: (m,) where the next begins."""
        if (tags == tags[0]).all() and at.min() >= 0:
            return self.field(int(tags[0]), rows, at, end, wants, seen)
        following = np.full(len(rows), -1)
        for tag in np.unique(tags[at >= 0]).tolist():
            of = np.flatnonzero((tags == tag) & (at >= 0))
            following[of] = self.field(tag, rows[of], at[of], end[of], wants, seen)
        return following

    def field(self, tag: int, rows: Int64, at: Int64, end: Int64, wants: Wants, seen: Mapping[int, Int64]) -> Int64:
        number, wire = tag >> 3, tag & 7
        if not 0 < number < _BEYOND or wire in (6, 7):
            return np.full(len(rows), -1)
        want, before = wants.get(number), seen.get(number, _NONE)
        if wire == LEN:
            return self.stretch(want, rows, at, end, before)
        if wire not in (VARINT, I64, I32):  # groups
            self.odd[rows] = True
            return end
        values = None
        if wire == VARINT:
            values, following = self.varint(at, end)
        else:
            following = _behind(at, end, 8 if wire == I64 else 4)
        if want is not None and want.scalar is not None and want.scalar.wire == wire:
            ok = following >= 0
            if not ok.all():
                rows, at, values = rows[ok], at[ok], None if values is None else values[ok]
            read = number_at(self.data, "<" + want.scalar.dtype)[at] if values is None else _signed(values, want.scalar)
            self.keep(want, rows, read, before)
        return following

    def keep(self, want: Want, rows: Int64, values: Numbers, seen: Int64) -> None:
        """Numbers of a field: the last where it is not repeated, else that of the item."""
        if not want.repeated:
            self.put(want.columns.get(0, ()), rows, values)
            return
        for item, columns in want.columns.items():
            of = seen[rows] == item
            self.put(columns, rows[of], values[of])
        seen[rows] += 1

    def put(self, columns: Sequence[int], rows: Int64, values: Numbers) -> None:
        where = slice(None) if len(rows) == self.count else rows  # which is much faster
        for column in columns:
            self.values[column][where] = values
            self.there[column][where] = True

    def stretch(self, want: Want | None, rows: Int64, at: Int64, end: Int64, seen: Int64) -> Int64:
        """A field of stated length: text, a nested message, packed numbers."""
        length, at = self.varint(at, end)
        fits = (at >= 0) & (length <= (end - at).view(np.uint64))
        following = at + length.view(np.int64)
        until = following
        if not fits.all():
            following[~fits] = -1
            rows, at, until = rows[fits], at[fits], following[fits]
        if want is None:
            return following
        if want.scalar is None:
            self.nested(want, rows, at, until, seen)
        elif want.repeated:
            self.packed(want.scalar, want, rows, at, until, seen)
        return following

    def nested(self, want: Want, rows: Int64, at: Int64, end: Int64, seen: Int64) -> None:
        before = seen[rows]
        if not want.repeated:
            self.odd[rows[before > 0]] = True  # parts of one message, to be merged
        for item, inner in want.inner.items():
            of = before == item
            if of.all():
                self.message(rows, at, end, inner)
            else:
                self.message(rows[of], at[of], end[of], inner)
        seen[rows] += 1

    def packed(self, scalar: Scalar, want: Want, rows: Int64, at: Int64, end: Int64, seen: Int64) -> None:
        if scalar.wire == VARINT:
            self.odd[rows] = True
            return
        self.good[rows[(end - at) % scalar.size != 0]] = False
        for item, columns in want.columns.items():
            place = at + (item - seen[rows]) * scalar.size
            of = (place >= at) & (place + scalar.size <= end)
            self.put(columns, rows[of], number_at(self.data, "<" + scalar.dtype)[place[of]])
        seen[rows] += (end - at) // scalar.size

    def varint(self, at: Int64, end: Int64) -> tuple[Numbers, Int64]:
        """(m,) integers at `at`, and where what follows begins."""
        inside = at < end
        if not inside.all():
            at = np.where(inside, at, 0)
        byte = self.bytes[at]
        value = byte.astype(np.uint64)
        following = at + 1
        more = np.flatnonzero(byte >= 0x80)
        if len(more):
            self.longer(value, following, end, more)
        if not inside.all():
            following[~inside] = -1
        return value, following

    def longer(self, value: Numbers, following: Int64, end: Int64, more: Int64) -> None:
        """The further bytes of varints `more`, in place."""
        value[more] &= _SEVEN
        for k in range(1, _LONGEST):
            inside = following[more] < end[more]
            following[more[~inside]] = -1
            more = more[inside]
            if not len(more):
                return
            byte = self.bytes[following[more]]
            value[more] |= (byte.astype(np.uint64) & _SEVEN) << np.uint64(7 * k)
            following[more] += 1
            more = more[byte >= 0x80]
        following[more] = -1


_SEVEN: Final = np.uint64(0x7F)
_NONE: Final = np.zeros(0, dtype=np.int64)


def _behind(at: Int64, end: Int64, size: int) -> Int64:
    """(m,) where what follows a number of so many bytes begins."""
    following = at + size
    if (following > end).any():
        following[following > end] = -1
    return following


def _signed(values: Numbers, scalar: Scalar) -> Numbers:
    """Varints as the numbers that they stand for."""
    kind = np.dtype(f"u{scalar.size}").type
    values = values.astype(kind)
    if scalar.zigzag:
        values = (values >> kind(1)) ^ (kind(0) - (values & kind(1)))
    return values.view(scalar.dtype)
