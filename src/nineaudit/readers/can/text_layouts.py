"""Lines of a text log that are laid out alike, read as one matrix of characters.

A reader says of one line where its numbers stand (its Layout). Lines of the same length that differ from it nowhere
else, and have digits where it has digits, are frames of the same layout: their times, identifiers and bytes are
columns of a matrix and become numbers all at once. What is left is asked about again, line by line if need be.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.array import BoolArray
from nineaudit.can_bits import ByteMatrix
from nineaudit.readers.can.frames import LONG, SHORT, Frames, Int64, Rows, frames

Span = tuple[int, int]
"""Columns of a field, the last one excluded."""

LONGEST: Final = 1024
"""Characters of a line that can be a frame; the longest of any format here is half as long."""
MOST_SECONDS: Final = 9_000_000_000
"""2^63 ns are a little more."""
MOST_BUSES: Final = 256
_ROWS: Final = 1 << 14
"""Lines of a matrix, which stays in the processor's cache."""
_FEW: Final = 4
"""Once less than one in so many lines is left, the others are dropped."""
_MOST_STANDARD: Final = 0x7FF
_MOST_EXTENDED: Final = 0x1FFFFFFF
_NANO: Final = 9


@dataclass(frozen=True)
class Layout:
    """Where the numbers of a frame stand in its line, and what all lines laid out like it have in common.

    `seconds` and `fraction` decimal; `identifier` hexadecimal (None: error frames and such); `data` columns of the hex
    digits of its bytes, two a byte. `words` are spans in which lines may differ as long as there is no blank, `rest`
    where they may differ in any way. `key` is added to the identifier. A line of decimal bytes is read alone: `octets`
    are its bytes and `key` is all of its key.
    """

    bus: str
    kind: int
    length: int
    seconds: Span
    fraction: Span
    key: int = 0
    identifier: Span | None = None
    data: tuple[int, ...] = ()
    words: tuple[Span, ...] = ()
    rest: Span = (0, 0)
    octets: bytes | None = None


Parse = Callable[[bytes], Layout | None]
"""Layout of a line, None where it is no frame."""


class Columns:
    """Frames of n lines as they are found, layout by layout. `kept` (n,) tells the lines that are frames."""

    def __init__(self, count: int) -> None:
        self.kept = np.zeros(count, dtype=np.bool_)
        self.time = np.zeros(count, dtype=np.int64)
        self._key = np.zeros(count, dtype=np.uint32)
        self._bus = np.zeros(count, dtype=np.uint16)
        self._kind = np.zeros(count, dtype=np.uint8)
        self._length = np.zeros(count, dtype=np.uint8)
        self._data = np.zeros(count, dtype=np.uint64)
        self._long: list[tuple[Rows, ByteMatrix]] = []

    def put(self, rows: Rows, time: Int64, key: Any, bus: int, layout: Layout, data: ByteMatrix) -> None:
        """(m,) lines of one layout with (bytes, m) data."""
        self.kept[rows] = True
        self.time[rows], self._key[rows] = time, key
        self._bus[rows], self._kind[rows], self._length[rows] = bus, layout.kind, layout.length
        size = len(data)
        if size:
            whole = np.zeros((len(rows), SHORT if size <= SHORT else LONG), dtype=np.uint8)
            whole[:, :size] = data.T
            self._data[rows] = whole.view(np.uint64)[:, 0]
        if size > SHORT:
            self._long.append((rows, whole))

    def put_alone(self, row: int, line: bytes, bus: int, layout: Layout, octets: bytes) -> None:
        """A line whose bytes are known already. One with too many seconds is no frame."""
        (start, end), seconds = layout.fraction, int(line[slice(*layout.seconds)])
        if seconds >= MOST_SECONDS:
            return
        self.kept[row] = True
        self.time[row] = seconds * 10**_NANO + int(line[start : min(end, start + _NANO)].ljust(_NANO, b"0"))
        self._key[row], self._bus[row], self._kind[row], self._length[row] = layout.key, bus, layout.kind, layout.length
        self._data[row] = int.from_bytes(octets[:SHORT], "little")
        if len(octets) > SHORT:
            long = np.frombuffer(octets.ljust(LONG, b"\0"), dtype=np.uint8)
            self._long.append((np.array([row]), long[None, :]))

    def frames(self) -> Frames:
        """The frames in the order of the lines."""
        kept = self.kept
        long_rows = np.concatenate([np.empty(0, dtype=np.intp), *(rows for rows, _ in self._long)])
        long = np.concatenate([np.empty((0, LONG), dtype=np.uint8), *(data for _, data in self._long)])
        order = np.argsort(long_rows, kind="stable")
        place = (np.cumsum(kept) - 1)[long_rows[order]]
        columns = (self.time, self._key, self._bus, self._kind, self._length, self._data)
        time, key, bus, kind, length, data = columns if kept.all() else (column[kept] for column in columns)
        return frames(time, key, bus, kind, length, data.view(np.uint8).reshape(-1, SHORT), place, long[order])


def read_lines(block: bytes, parse: Parse, buses: dict[str, int]) -> tuple[Columns, list[tuple[int, bytes]]]:
    """Frames of a block of whole lines, and (row, text) of its lines that are none, blank ones left out.

    `buses` are the codes of the names of buses, and grows.
    """
    text = np.frombuffer(block, dtype=np.uint8)
    end = np.flatnonzero(text == ord("\n"))
    begin = np.empty_like(end)
    begin[:1], begin[1:] = 0, end[:-1] + 1
    size = end - begin
    columns = Columns(len(end))
    for rows in _alike(size):
        _read_alike(text, begin[rows], int(size[rows[0]]), rows, parse, buses, columns)
    others = ((row, block[begin[row] : end[row]]) for row in np.flatnonzero(~columns.kept).tolist())
    return columns, [(row, line) for row, line in others if line.strip()]


def _alike(size: Rows) -> Iterator[Rows]:
    """Rows of lines of the same length, a few thousand at a time."""
    short = np.minimum(size, LONGEST + 1).astype(np.uint16)
    order = np.argsort(short, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(short[order])) + 1):
        if len(rows) and 0 < size[rows[0]] <= LONGEST:
            yield from (rows[at : at + _ROWS] for at in range(0, len(rows), _ROWS))


def _read_alike(
    text: NDArray[np.uint8], begin: Rows, size: int, rows: Rows, parse: Parse, buses: dict[str, int], columns: Columns
) -> None:
    """Lines of one length: layout after layout until no frame is left."""
    view = np.ndarray((len(text) - size + 1,), dtype=f"V{size}", buffer=text, strides=(1,))
    chars = np.ascontiguousarray(view[begin].view(np.uint8).reshape(-1, size).T)
    todo = np.arange(len(rows))
    while True:
        passed, layout = _first(chars, rows, todo, parse, buses, columns)
        if layout is None:
            return
        todo = todo[passed:]
        same = _same(chars, todo[0], layout)[todo]
        alike, left = todo[same], todo[~same]
        wrong = _take(chars, alike, rows, layout, buses.setdefault(layout.bus, len(buses)), columns)
        left = np.sort(np.r_[left, wrong]) if len(wrong) else left
        todo = left[left != todo[0]]  # it may be no frame in spite of its layout: its number is too large, say
        if len(todo) < len(rows) // _FEW:
            chars, rows, todo = np.take(chars, todo, axis=1), rows[todo], np.arange(len(todo))


def _first(
    chars: ByteMatrix, rows: Rows, todo: Rows, parse: Parse, buses: dict[str, int], columns: Columns
) -> tuple[int, Layout | None]:
    """How many of the lines `todo` to pass over before the first that has others like it, and its layout. Those passed
    over are no frames, or are read here."""
    for passed, place in enumerate(todo):
        line = chars[:, place].tobytes()
        layout = parse(line)
        if layout is None or (layout.bus not in buses and len(buses) >= MOST_BUSES):
            continue
        if layout.octets is None:
            return passed, layout
        columns.put_alone(int(rows[place]), line, buses.setdefault(layout.bus, len(buses)), layout, layout.octets)
    return len(todo), None


def _same(chars: ByteMatrix, place: int, layout: Layout) -> BoolArray:
    """(n,) which lines, columns of (size, n) characters, differ from one only where its layout lets them."""
    fixed = np.ones(len(chars), dtype=np.bool_)
    for start, end in (layout.seconds, layout.fraction, layout.identifier or (0, 0), layout.rest, *layout.words):
        fixed[start:end] = False
    fixed[list(layout.data)] = False
    same = (chars[fixed] == chars[fixed, place][:, None]).all(axis=0)
    for start, end in layout.words:
        same &= (chars[start:end] > ord(" ")).all(axis=0)
    return np.asarray(same)


def _take(chars: ByteMatrix, alike: Rows, rows: Rows, layout: Layout, bus: int, columns: Columns) -> Rows:
    """Put lines of one layout into the columns, and give back which have no digits where they belong."""
    whole = len(alike) == chars.shape[1]

    def pick(place: Any) -> ByteMatrix:
        return chars[place] if whole else np.take(chars[place], alike, axis=1)

    fine = np.ones(len(alike), dtype=np.bool_)
    time, key, data = _numbers(pick, layout, fine)
    if fine.all():
        columns.put(rows[alike], time, key, bus, layout, data)
        return alike[:0]
    columns.put(rows[alike[fine]], time[fine], key[fine], bus, layout, data[:, fine])
    return alike[~fine]


def _numbers(pick: Callable[[Any], ByteMatrix], layout: Layout, fine: BoolArray) -> tuple[Int64, Any, ByteMatrix]:
    """(n,) ns, (n,) keys, (bytes, n) data; `fine` (n,) loses the lines that have no digits where they belong."""
    start, end = layout.fraction
    parts = _decimal(pick(slice(start, min(end, start + _NANO))), fine)
    seconds = _decimal(pick(slice(*layout.seconds)), fine)
    fine &= seconds < MOST_SECONDS
    time = seconds * 10**_NANO + parts * 10 ** max(_NANO - (end - start), 0)
    key = np.full(len(time), layout.key, dtype=np.int64)
    if layout.identifier is not None:
        number = _number(_hexadecimal(pick(slice(*layout.identifier)), fine), 16.0)
        fine &= number <= (_MOST_EXTENDED if layout.key else _MOST_STANDARD)
        key += number
    digits = _hexadecimal(pick(list(layout.data)), fine)
    return time, key, np.asarray(digits[0::2] << 4 | digits[1::2], dtype=np.uint8)


def _decimal(chars: ByteMatrix, fine: BoolArray) -> Int64:
    """(n,) numbers of (k, n) decimal digits; `fine` (n,) loses what is none."""
    digits = chars - np.uint8(ord("0"))
    fine &= (digits <= 9).all(axis=0)
    return _number(digits, 10.0)


def _number(digits: ByteMatrix, base: float) -> Int64:
    """(n,) numbers of (k, n) digits, the first the highest; exact up to 2^53."""
    value = base ** np.arange(len(digits) - 1, -1, -1) @ digits.astype(np.float64)
    return np.asarray(value.astype(np.int64))


def _hexadecimal(chars: ByteMatrix, fine: BoolArray) -> ByteMatrix:
    """(k, n) values of hex digits; `fine` (n,) loses the lines that have anything else."""
    letter = (chars | np.uint8(0x20)) - np.uint8(ord("a"))
    fine &= ((chars - np.uint8(ord("0")) <= 9) | (letter <= 5)).all(axis=0)
    return (chars & np.uint8(0xF)) + np.uint8(9) * (chars >> np.uint8(6))
