"""From the objects of a BLF log to columns of frames; everything that is no frame is counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.readers.blf_chain import HEAD, Records, gather
from nineaudit.readers.blf_columns import Columns, Part, Rows
from nineaudit.readers.blf_objects import TYPES, Found, Group, Words
from nineaudit.readers.blf_stream import Batch
from nineaudit.readers.can_frames import SHORT
from nineaudit.readers.losses import Losses
from nineaudit.signals import can_origin

Codes = NDArray[np.uint8]

_TENS, _NANOSECONDS = 1, 2
_TEN_MICROSECONDS: Final = 10_000
_MARKER: Final = 96
BEYOND: Final = 255
"""Code that stands for all types from 255 on, of which none is a CAN frame."""
UNKNOWN_UNIT: Final = "frames stamped in a unit that is not known, read as ns"
_LEAST: Final = np.array([TYPES[t].least if t in TYPES else 0 for t in range(BEYOND + 1)], dtype=np.uint32)


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
    seen = np.zeros(BEYOND + 1, dtype=np.bool_)
    seen[codes] = True
    present = np.flatnonzero(seen).tolist()
    _take_stock(batch, codes, present, account)
    keep = _keep(batch, codes, account)
    if keep is not None:
        codes, batch = codes[keep], replace(batch, at=batch.at[keep], heads=batch.heads[keep])
    part, long = columns.room(len(codes)), []
    _put_time(part.time, batch.heads, account)
    for code in present:
        if code in TYPES:
            for group, found in _read(batch, codes, code, account):
                long.append(_put(part, group, found))
    columns.add_long([some for some in long if some is not None])


def _take_stock(batch: Batch, codes: Codes, present: list[int], account: Account) -> None:
    for code in present:
        here = codes == code
        account.types[code] += int(np.count_nonzero(here))
        if code == _MARKER and not account.origin:
            account.origin = _origin(batch, np.flatnonzero(here))


def _origin(batch: Batch, rows: Rows) -> int:
    """ns of the first marker that states an origin (nineaudit's own logs do), 0 if none does."""
    for at, size in zip(batch.at[rows].tolist(), batch.heads["size"][rows].tolist(), strict=True):
        seconds = can_origin(batch.buffer[at : at + size].tobytes().decode("latin-1"))
        if seconds and np.isfinite(seconds):
            return round(seconds * 1e9)
    return 0


def _keep(batch: Batch, codes: Codes, account: Account) -> NDArray[np.bool_] | None:
    """(m,) true for the objects that are frames, and fit to be; None if all are."""
    heads, least = batch.heads, _LEAST[codes]
    header = heads["header"]
    frames = least > 0
    small = frames & (heads["size"] < header + least)
    strange = frames & ((heads["version"] > 2) | (header < HEAD.itemsize))
    late = frames & _late(heads, account.start)
    for what, fault in (
        ("a frame's object is smaller than its fields", small),
        ("a frame's object has a header of a kind that is not known", strange & ~small),
        ("a frame is stamped with a time beyond the year 2262", late & ~small & ~strange),
    ):
        if fault.any():
            _book(account, batch, what, fault, int(heads["size"][fault].sum()))
            frames &= ~fault
    return None if frames.all() else frames


def _book(account: Account, batch: Batch, what: str, fault: NDArray[np.bool_], lost: int = 0) -> None:
    account.losses.add(what, batch.place(int(batch.at[fault.argmax()])), int(np.count_nonzero(fault)), lost)


def _late(heads: Records, start: int) -> Any:
    """(m,) true where a time does not fit into int64 ns; False if there is none."""
    most = np.iinfo(np.int64).max - max(start, 0)
    if int(heads["time"].max(initial=0)) <= most // _TEN_MICROSECONDS:
        return False
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


def _read(batch: Batch, codes: Codes, code: int, account: Account) -> Iterator[tuple[Rows, Found]]:
    """Frames of one type, for each size of header that comes with it."""
    rows = np.flatnonzero(codes == code)
    headers = batch.heads["header"][rows]
    while len(rows):
        header = int(headers[0])
        same = headers == headers[0]
        chosen = rows if same.all() else rows[same]
        yield chosen, TYPES[code].read(_group(batch, chosen, header, code, account))
        rows, headers = rows[~same], headers[~same]


def _group(batch: Batch, rows: Rows, header: int, code: int, account: Account) -> Group:
    def damaged(what: str, fault: NDArray[np.bool_]) -> None:
        _book(account, replace(batch, at=batch.at[rows]), what, fault)

    def odd(what: str, count: int) -> None:
        account.odd[what] += count

    record = gather(batch.buffer, batch.at[rows] + header, TYPES[code].record)
    return Group(record, batch.heads["size"][rows].astype(np.int64) - header, header, damaged, odd)


def _put(part: Part, rows: Rows, found: Found) -> tuple[Rows, Words] | None:
    """Fill the rows of a part; rows and data of those frames that have more than eight bytes."""
    part.key[rows], part.channel[rows] = found.key, found.channel
    part.kind[rows], part.length[rows] = found.kind, found.length
    if found.data.ndim == 1:
        part.data[rows] = found.data
        return None
    part.data[rows] = found.data[:, 0]
    long = np.flatnonzero(found.length > SHORT)
    return rows[long], found.data[long]
