"""What the objects of a BLF log that are CAN frames hold, type by type."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.readers.can.blf_chain import Records
from nineaudit.readers.can.frames import ERROR, ERROR_STATE, FD, LONG, OVERLOAD, RATE_SWITCH, REMOTE, SENT, SHORT

Words = NDArray[np.uint64]
Rows = NDArray[np.intp]

# What follows the header in each object, after python-can's blf.py and Wireshark's blf.h (both after Vector BLF by
# T. Lorenz). CAN_MESSAGE and CAN_MESSAGE2: channel, flags, length code, identifier, data (then, in CAN_MESSAGE2,
# duration and bits). CAN_FD_MESSAGE: the same first fields, duration and bits, FD flags, valid bytes, data.
# CAN_FD_MESSAGE_64: fields of fixed size, then data, up to what stands at the offset `more` from the object's begin
# if that is not 0. Of error and overload frames the channel is all that is read.
_FIRST: Final = [("channel", "<u2"), ("flags", "u1"), ("dlc", "u1"), ("id", "<u4")]
_CLASSIC: Final = np.dtype([*_FIRST, ("data", "<u8")])
_FD: Final = np.dtype(
    [*_FIRST, ("time", "<u4"), ("bits", "u1"), ("fd", "u1"), ("valid", "u1"), ("rest", "V5"), ("data", "<u8", (8,))]
)
_FD64: Final = np.dtype(
    [
        *[("channel", "u1"), ("dlc", "u1"), ("valid", "u1"), ("sendings", "u1"), ("id", "<u4"), ("time", "<u4")],
        *[("flags", "<u4"), ("timing", "<u4", (4,)), ("bits", "<u2"), ("direction", "u1"), ("more", "u1")],
        *[("crc", "<u4"), ("data", "<u8", (8,))],
    ]
)
_WIDE: Final = np.dtype([("channel", "<u2")])
_NARROW: Final = np.dtype([("channel", "u1")])

_KEY: Final = np.uint32(0x9FFFFFFF)
"""Bits of an identifier and of its EXTENDED flag, which are where Frames.key has them."""
_LENGTHS: Final = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64], dtype=np.uint8)
"""Bytes of a CAN FD frame for each length code, ISO 11898-1."""
_KEEP: Final = np.array(
    [[(1 << 8 * min(max(n - w, 0), 8)) - 1 for w in range(0, LONG, 8)] for n in range(LONG + 1)], dtype=np.uint64
)
"""(65,8): of eight little-endian words, the first n bytes."""
_KEEP_FIRST: Final = _KEEP[:, 0].copy()
_REQUEST: Final = 2

ZERO_FILLED: Final = "FD frames with fewer bytes than they state, filled with zeros"
LONG_CODES: Final = "classic frames with a length code above 8, which means 8 bytes"
OTHER_LENGTH: Final = "FD frames whose valid bytes are not those of their length code"
REQUESTS: Final = "requests to send among the frames"


def _table(bits: Mapping[int, int], mask: int = 0) -> NDArray[np.uint8]:
    """Kind of frame for each value of a byte: of the bits that are set in it, and SENT where any of `mask` is."""
    kinds = [sum(kind for bit, kind in bits.items() if value & bit) for value in range(256)]
    return np.array([kind | (SENT if value & mask else 0) for value, kind in enumerate(kinds)], dtype=np.uint8)


_DIRECTION: Final = 0x0F
_FLAGS: Final = _table({0x80: REMOTE}, _DIRECTION)
_FD_FLAGS: Final = _table({1: FD, 2: RATE_SWITCH, 4: ERROR_STATE})


@dataclass(frozen=True, eq=False)
class Group:
    """k objects that begin alike, of types `code` (k,), with headers of one size: `record` (k,), a copy of what is in
    the log, `room` (k,) bytes behind the header. `damaged` books frames (k,) that are, `odd` counts what is worth
    saying; `part` gives some of them with another record."""

    code: NDArray[np.uint8]
    record: Records
    room: NDArray[np.int64]
    header: int
    damaged: Callable[[str, NDArray[np.bool_]], None]
    odd: Callable[[str, int], None]
    part: Callable[[Rows, np.dtype[Any]], Group]


@dataclass(frozen=True, eq=False)
class Found:
    """k frames: channel as the log has it, key and kind as in Frames, length, the first word of data (k,); those that
    have more than eight bytes are `long_rows` (m,) of them, with all their data in `long` (m,8)."""

    channel: Any
    key: Any
    kind: Any
    length: Any
    data: Words
    long_rows: Rows | None = None
    long: Words | None = None


@dataclass(frozen=True)
class Type:
    """`least` bytes behind the header that an object must have; the `record` there; and how it is read."""

    least: int
    record: np.dtype[Any]
    read: Callable[[Group], Found]


def _usual(group: Group) -> Found:
    """Classic frames, and those of CAN_FD_MESSAGE among them, which begin alike."""
    record, flexible = group.record, np.flatnonzero(group.code == _CAN_FD_MESSAGE)
    kind, dlc = _sent(record["flags"], group), np.ascontiguousarray(record["dlc"])
    dlc[flexible] = SHORT  # nothing odd: they are looked at below
    remote = kind & REMOTE != 0
    length = _there(_short(dlc, group), group.room - _HEAD, remote, group)
    data = _cut(record["data"], length * ~remote)
    found = Found(record["channel"], record["id"] & _KEY, kind, length, data)
    return _with_flexible(found, flexible, group.part(flexible, _FD)) if len(flexible) else found


def _with_flexible(found: Found, rows: Rows, group: Group) -> Found:
    """Frames of which some are of CAN_FD_MESSAGE, and that group: what they have otherwise put in place."""
    kind = found.kind[rows] | _FD_FLAGS.take(group.record["fd"])
    remote = kind & REMOTE != 0
    length = _there(_valid(group, kind, remote), group.room - (_FD.itemsize - LONG), remote, group)
    data = group.record["data"] & _KEEP.take(length * ~remote, axis=0)
    found.kind[rows], found.length[rows], found.data[rows] = kind, length, data[:, 0]
    return replace(found, **_long(length, data, rows))


def _long(length: NDArray[np.uint8], data: Words, rows: Rows | None = None) -> dict[str, Any]:
    """Of frames with (k,8) data those that have more than eight bytes; `rows` are theirs if not 0 to k - 1."""
    if length.min(initial=LONG) > SHORT and rows is not None:
        return {"long_rows": rows, "long": data}
    long = np.flatnonzero(length > SHORT)
    return {"long_rows": long if rows is None else rows[long], "long": data[long]}


def _cut(data: Words, length: NDArray[np.uint8]) -> Words:
    """Words of which only so many bytes are data, the rest zero."""
    return data if length.min(initial=SHORT) == SHORT else data & _KEEP_FIRST.take(length)


def _sent(flags: NDArray[np.uint8], group: Group) -> NDArray[np.uint8]:
    """Kinds of frames as far as the flags of older types of objects tell them."""
    if not flags.any():
        return np.zeros(len(flags), dtype=np.uint8)
    group.odd(REQUESTS, _count(flags & _DIRECTION == _REQUEST))
    return _FLAGS.take(flags)


def _there(length: NDArray[np.uint8], there: NDArray[np.int64], remote: Any, group: Group) -> NDArray[np.uint8]:
    """Bytes of data of each frame that its object really holds; of a remote frame, those it asks for."""
    if there.min(initial=LONG) >= length.max(initial=0):
        return length
    missing = (there < length) & ~remote
    if missing.any():
        group.damaged("a frame's object ends before its data", missing)
    return np.where(missing, there, length).astype(np.uint8)


def _short(dlc: NDArray[np.uint8], group: Group) -> NDArray[np.uint8]:
    """Bytes of classic frames: codes 9 to 15 mean 8 (ISO 11898-1), more is no code."""
    if not (dlc > SHORT).any():
        return dlc
    if (dlc >= len(_LENGTHS)).any():
        group.damaged("a classic frame states a length code above 15, read as 8 bytes", dlc >= len(_LENGTHS))
    group.odd(LONG_CODES, _count((dlc > SHORT) & (dlc < len(_LENGTHS))))
    return np.minimum(dlc, np.uint8(SHORT))


def _fd64(group: Group) -> Found:
    """The bytes of data that an object states and does not hold are zero: CANoe and Vector's library read it so
    (python-can's issue 1905), since some loggers leave them out."""
    record = group.record
    group.odd(REQUESTS, _count(record["direction"] == _REQUEST))
    kind = _FD_FLAGS[(record["flags"] >> np.uint32(12) & np.uint32(7))]
    kind[record["flags"] & 0x10 != 0] |= REMOTE
    kind[record["direction"] != 0] |= SENT
    remote = kind & REMOTE != 0
    length = _valid(group, kind, remote)
    more = record["more"].astype(np.int64)
    there = np.where(more > 0, np.minimum(more - group.header, group.room), group.room) - (_FD64.itemsize - LONG)
    group.odd(ZERO_FILLED, _count(~remote & (there < length)))
    data = record["data"] & _KEEP.take(np.clip(there, 0, length) * ~remote, axis=0)
    return Found(record["channel"], record["id"] & _KEY, kind, length, data[:, 0], **_long(length, data))


def _valid(group: Group, kind: NDArray[np.uint8], remote: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Bytes of frames whose objects state those that are valid; of remote frames, those of their length code."""
    valid, dlc, flexible = group.record["valid"], group.record["dlc"], kind & FD != 0
    coded = _LENGTHS[np.minimum(dlc, np.uint8(15))]
    length = np.where(remote, coded, valid)
    if (length > LONG).any():
        group.damaged("an FD frame states more than 64 bytes", length > LONG)
    group.odd(LONG_CODES, _count(~flexible & (dlc > SHORT)))
    group.odd(OTHER_LENGTH, _count(flexible & ~remote & (valid != coded)))
    return np.minimum(length, np.where(flexible, np.uint8(LONG), np.uint8(SHORT)))


def _no_data(kind: int) -> Callable[[Group], Found]:
    def read(group: Group) -> Found:
        return Found(group.record["channel"], 0, kind, 0, np.zeros(len(group.record), dtype=np.uint64))

    return read


def _count(mask: Any) -> int:
    return int(np.count_nonzero(mask))


_HEAD: Final = _CLASSIC.itemsize - SHORT
_CAN_FD_MESSAGE: Final = 100
TYPES: Final[Mapping[int, Type]] = {
    1: Type(_HEAD, _CLASSIC, _usual),  # CAN_MESSAGE
    86: Type(_HEAD, _CLASSIC, _usual),  # CAN_MESSAGE2
    _CAN_FD_MESSAGE: Type(_FD.itemsize - LONG, _CLASSIC, _usual),
    101: Type(_FD64.itemsize - LONG, _FD64, _fd64),  # CAN_FD_MESSAGE_64
    73: Type(_WIDE.itemsize, _WIDE, _no_data(ERROR)),  # CAN_ERROR_EXT
    2: Type(_WIDE.itemsize, _WIDE, _no_data(ERROR)),  # CAN_ERROR
    104: Type(_NARROW.itemsize, _NARROW, _no_data(ERROR)),  # CAN_FD_ERROR_64
    3: Type(_WIDE.itemsize, _WIDE, _no_data(OVERLOAD)),  # CAN_OVERLOAD
}
"""The types of objects that are CAN frames, the usual first."""
USUAL: Final = frozenset(code for code, kind in TYPES.items() if kind.read is _usual)
"""Those that are read together."""
