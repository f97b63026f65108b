"""From the objects of a BLF log to columns of frames; everything that is no frame is counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.readers.can.blf_chain import HEADER, Records, gather, uniform
from nineaudit.readers.can.blf_columns import Columns, Part, Rows
from nineaudit.readers.can.blf_objects import TYPES, USUAL, Found, Group, Words
from nineaudit.readers.can.blf_stream import Batch
from nineaudit.readers.can.losses import Losses
from nineaudit.signals import can_origin

Codes = NDArray[np.uint8]
Sizes = NDArray[np.int64]

_TENS, _NANOSECONDS = 1, 2
_TEN_MICROSECONDS: Final = 10_000
_MOST: Final = int(np.iinfo(np.int64).max)
_MARKER: Final = 96
_FARTHEST: Final = 4e9
"""s that an origin can be from the stamps: they stay within int64 ns."""
BEYOND: Final = 255
"""Code that stands for all types from 255 on, of which none is a CAN frame."""
UNKNOWN_UNIT: Final = "frames stamped in a unit that is not known, read as ns"
_LEAST: Final = np.array([TYPES[t].least if t in TYPES else 0 for t in range(BEYOND + 1)], dtype=np.int64)
_IS_USUAL: Final = np.isin(np.arange(BEYOND + 1), list(USUAL))


@dataclass
class Account:
    """What a log holds besides frames: objects of each type, oddities of frames, the first origin that a marker
    states (ns), and what could not be read. `start` ns of its measurement. `types` counts all from BEYOND on as one."""

    losses: Losses
    start: int
    types: Counter[int] = field(default_factory=Counter)
    odd: Counter[str] = field(default_factory=Counter)
    origin: int = 0


def add_frames(columns: Columns, batch: Batch, account: Account) -> None:
    """Put the frames of a batch of objects behind those there are, in order."""
    codes = np.minimum(batch.heads["type"], np.uint32(BEYOND)).astype(np.uint8)
    present = _counted(codes)
    account.types.update(present)
    if _MARKER in present and not account.origin:
        account.origin = _origin(batch, np.flatnonzero(codes == _MARKER))
    header = _common_header(batch.heads)
    room = batch.heads["size"].astype(np.int64) - (header or batch.heads["header"])
    keep = _keep(batch, codes, room, header, account)
    if keep is not None:
        batch = replace(batch, at=batch.at[keep], heads=batch.heads[keep])
        codes, room = codes[keep], room[keep]
    part = columns.room(len(codes))
    _put_time(part.time, batch.heads, account)
    long: list[tuple[Rows, Words]] = []
    for code, rows in _by_type(codes, present):
        for some, size in [(rows, header)] if header else _by_header(batch, rows):
            group = _group(_Objects(batch, codes, room, account), some, size, TYPES[code].record)
            long += _put(part, some, TYPES[code].read(group))
    columns.add_long(long)


def _by_type(codes: Codes, present: Collection[int]) -> Iterator[tuple[int, Rows]]:
    """Rows of each type of frames, those that are read together under one code."""
    frames = [code for code in present if code in TYPES]
    usual = [code for code in frames if code in USUAL]
    if usual:
        yield usual[0], np.arange(len(codes)) if frames == usual else np.flatnonzero(_IS_USUAL.take(codes))
    for code in frames:
        if code not in USUAL:
            yield code, np.flatnonzero(codes == code)


def _counted(codes: Codes) -> dict[int, int]:
    """How many there are of each code: most logs hold few, which are looked for one by one."""
    counts: dict[int, int] = {}
    left = len(codes)
    for code in TYPES:
        if left:
            counts[code] = int(np.count_nonzero(codes == code))
            left -= counts[code]
    if left:
        counts = dict(enumerate(np.bincount(codes).tolist()))
    return {code: count for code, count in counts.items() if count}


def _common_header(heads: Records) -> int:
    """Bytes of the headers if they are all of one kind and that one is of frames, else 0."""
    return int(heads["header"][0]) if uniform(heads) and not _strange(heads[:1]).any() else 0


def _origin(batch: Batch, rows: Rows) -> int:
    """ns of the first marker that states an origin (nineaudit's own logs do), 0 if none does."""
    for at, size in zip(batch.at[rows].tolist(), batch.heads["size"][rows].tolist(), strict=True):
        seconds = can_origin(batch.buffer[at : at + size].tobytes().decode("latin-1"))
        if seconds and abs(seconds) < _FARTHEST:
            return round(seconds * 1e9)
    return 0


def _keep(batch: Batch, codes: Codes, room: Sizes, header: int, account: Account) -> NDArray[np.bool_] | None:
    """(m,) true for the objects that are frames, and fit to be; None if all are."""
    heads, least = batch.heads, _LEAST.take(codes)
    frames = least > 0
    for what, fault in (
        ("a frame's object is smaller than its fields", room < least),
        ("a frame's object has a header of a kind that is not known", _strange(heads[:1] if header else heads)),
        ("a frame is stamped with a time beyond the year 2262", _late(heads, account.start)),
    ):
        if fault.any() and (fault := fault & frames).any():
            _book(account, batch, what, fault, int(heads["size"][fault].sum()))
            frames &= ~fault
    return None if frames.all() else frames


def _strange(heads: Records) -> NDArray[np.bool_]:
    """(m,) true where a header is not of a kind that frames have."""
    return np.asarray((heads["version"] > 2) | (heads["header"] < HEADER))


def _book(account: Account, batch: Batch, what: str, fault: NDArray[np.bool_], lost: int = 0) -> None:
    account.losses.add(what, batch.place(int(batch.at[fault.argmax()])), int(np.count_nonzero(fault)), lost)


def _late(heads: Records, start: int) -> Any:
    """(m,) true where a time does not fit into int64 ns; (1,) false if there is none."""
    most = _MOST - max(start, 0)
    if int(heads["time"].max(initial=0)) <= most // _TEN_MICROSECONDS:
        return np.zeros(1, dtype=np.bool_)
    limit = np.where(heads["unit"] == _TENS, most // _TEN_MICROSECONDS, most)
    return heads["time"] > limit.astype(np.uint64)


def _put_time(time: NDArray[np.int64], heads: Records, account: Account) -> None:
    """Fill (m,) ns: since 1970 where the log's header has a date, else since the log's start."""
    time[:] = heads["time"]
    other = heads["unit"] != _NANOSECONDS
    if other.any():
        tens = heads["unit"] == _TENS
        time[tens] *= _TEN_MICROSECONDS
        account.odd[UNKNOWN_UNIT] += int(np.count_nonzero(other & ~tens))
    time += account.start


def _by_header(batch: Batch, rows: Rows) -> Iterator[tuple[Rows, int]]:
    """Rows of each size of header that comes with them, and that size."""
    headers = batch.heads["header"].take(rows)
    for header in np.unique(headers).tolist():
        yield rows[headers == header], header


@dataclass(frozen=True, eq=False)
class _Objects:
    """Objects of a batch with their types and the bytes behind their headers."""

    batch: Batch
    codes: Codes
    room: Sizes
    account: Account


def _group(objects: _Objects, rows: Rows, header: int, record: np.dtype[Any]) -> Group:
    """Some of the objects, all with such a header, with their records behind it."""
    batch, account = objects.batch, objects.account
    every = len(rows) == len(objects.codes)
    at = batch.at if every else batch.at.take(rows)
    code = objects.codes if every else objects.codes.take(rows)
    room = objects.room if every else objects.room.take(rows)

    def damaged(what: str, fault: NDArray[np.bool_]) -> None:
        _book(account, replace(batch, at=at), what, fault)

    def odd(what: str, count: int) -> None:
        account.odd[what] += count

    def part(some: Rows, other: np.dtype[Any]) -> Group:
        return _group(objects, rows[some], header, other)

    if every and header == HEADER and record.itemsize == batch.heads.dtype["behind"].itemsize:
        found = batch.heads["behind"].view(record)
    else:
        found = gather(batch.buffer, at + header, record)
    return Group(code, found, room, header, damaged, odd, part)


def _put(part: Part, rows: Rows, found: Found) -> list[tuple[Rows, Words]]:
    """Fill the rows of a part; rows and data of those frames that have more than eight bytes."""
    every = len(rows) == len(part.time)
    where = slice(None) if every else rows
    part.key[where], part.channel[where] = found.key, found.channel
    part.kind[where], part.length[where] = found.kind, found.length
    part.data[where] = found.data
    if found.long is None or found.long_rows is None or not len(found.long):
        return []
    return [(found.long_rows if every else rows[found.long_rows], found.long)]
