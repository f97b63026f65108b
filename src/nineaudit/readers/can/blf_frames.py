"""From the objects of a BLF log to columns of frames; everything that is no frame is counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.readers.can.blf_chain import HEAD, Records, gather
from nineaudit.readers.can.blf_columns import Columns, Part, Rows
from nineaudit.readers.can.blf_objects import TYPES, Found, Group, Words
from nineaudit.readers.can.blf_stream import Batch
from nineaudit.readers.can.frames import SHORT
from nineaudit.readers.can.losses import Losses
from nineaudit.signals import can_origin

Codes = NDArray[np.uint8]
Sizes = NDArray[np.int64]

_TENS, _NANOSECONDS = 1, 2
_TEN_MICROSECONDS: Final = 10_000
_MARKER: Final = 96
_FARTHEST: Final = 4e9
"""s that an origin can be from the stamps: they stay within int64 ns."""
BEYOND: Final = 255
"""Code that stands for all types from 255 on, of which none is a CAN frame."""
UNKNOWN_UNIT: Final = "frames stamped in a unit that is not known, read as ns"
_LEAST: Final = np.array([TYPES[t].least if t in TYPES else 0 for t in range(BEYOND + 1)], dtype=np.int64)


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
    for code in present:
        if code in TYPES:
            rows = np.flatnonzero(codes == code)
            for some, size in [(rows, header)] if header else _by_header(batch, rows):
                group = _group(batch, some, room, size, code, account)
                long += _put(part, some, TYPES[code].read(group))
    columns.add_long(long)


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
    form = heads["form"]
    if not len(heads) or form.min() != form.max() or _strange(heads[:1]).any():
        return 0
    return int(heads["header"][0])


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
    return np.asarray((heads["version"] > 2) | (heads["header"] < HEAD.itemsize))


def _book(account: Account, batch: Batch, what: str, fault: NDArray[np.bool_], lost: int = 0) -> None:
    account.losses.add(what, batch.place(int(batch.at[fault.argmax()])), int(np.count_nonzero(fault)), lost)


def _late(heads: Records, start: int) -> Any:
    """(m,) true where a time does not fit into int64 ns; (1,) false if there is none."""
    most = np.iinfo(np.int64).max - max(start, 0)
    if int(heads["time"].max(initial=0)) <= most // _TEN_MICROSECONDS:
        return np.zeros(1, dtype=np.bool_)
    limit = np.where(heads["flags"] == _TENS, most // _TEN_MICROSECONDS, most)
    return heads["time"] > limit.astype(np.uint64)


def _put_time(time: NDArray[np.int64], heads: Records, account: Account) -> None:
    """Fill (m,) ns: since 1970 where the log's header has a date, else since the log's start."""
    time[:] = heads["time"]
    other = heads["flags"] != _NANOSECONDS
    if other.any():
        tens = heads["flags"] == _TENS
        time[tens] *= _TEN_MICROSECONDS
        account.odd[UNKNOWN_UNIT] += int(np.count_nonzero(other & ~tens))
    time += account.start


def _by_header(batch: Batch, rows: Rows) -> Iterator[tuple[Rows, int]]:
    """Rows of each size of header that comes with them, and that size."""
    headers = batch.heads["header"].take(rows)
    for header in np.unique(headers).tolist():
        yield rows[headers == header], header


def _group(batch: Batch, rows: Rows, room: Sizes, header: int, code: int, account: Account) -> Group:
    at = batch.at.take(rows)

    def damaged(what: str, fault: NDArray[np.bool_]) -> None:
        _book(account, replace(batch, at=at), what, fault)

    def odd(what: str, count: int) -> None:
        account.odd[what] += count

    return Group(gather(batch.buffer, at + header, TYPES[code].record), room.take(rows), header, damaged, odd)


def _put(part: Part, rows: Rows, found: Found) -> list[tuple[Rows, Words]]:
    """Fill the rows of a part; rows and data of those frames that have more than eight bytes."""
    where = slice(None) if len(rows) == len(part.time) else rows
    part.key[where], part.channel[where] = found.key, found.channel
    part.kind[where], part.length[where] = found.kind, found.length
    if found.data.ndim == 1:
        part.data[where] = found.data
        return []
    part.data[where] = found.data[:, 0]
    long = np.flatnonzero(found.length > SHORT)
    return [(rows[long], found.data[long])] if len(long) else []
