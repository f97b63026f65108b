"""The outer half of a BLF log: its header, the chain of containers, and what they hold, inflated by threads.

A file of any size is read in windows. Objects that stand outside of containers are handed on as they are.
"""

from __future__ import annotations

import datetime
import struct
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np

from nineaudit.errors import RecordingError
from nineaudit.readers.can.blf_chain import BASE, LARGEST, PADDING, ROOM, follow
from nineaudit.readers.can.blf_inflate import Item, Piece, Window, opened, stated_size
from nineaudit.readers.can.losses import Losses
from nineaudit.units import counted

# signature, header size, (application and versions), file size, inflated size, objects, (objects read), start of the
# measurement as year, month, weekday, day, hour, minute, second, millisecond, (its end), after python-can's blf.py
_FILE: Final = struct.Struct("<4sL8xQQL4x8H16x")
_OBJECT: Final = struct.Struct("<4sHHLL")  # as blf_chain.HEAD, the part that all headers have
CONTAINER_TYPE: Final = 10
WINDOW: Final = 1 << 20
"""Bytes of the file that are read at once, and of inflated objects that are handed on at once (about)."""
_EPOCH: Final = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)


@dataclass(frozen=True)
class Header:
    """What the file's header says: bytes of itself, of the file, of everything inflated; objects; `start` ns since
    1970 of the measurement's start, 0 if there is none, None if what stands there is no date."""

    size: int
    file_size: int
    inflated_size: int
    objects: int
    start: int | None


def read_header(file: BinaryIO, path: Path) -> Header:
    """The header of a BLF log. Raises RecordingError if this is none, or ends inside of it."""
    raw = file.read(_FILE.size)
    if len(raw) < _FILE.size or raw[:4] != b"LOGG":
        raise RecordingError(
            "not a BLF log" if raw[:4] != b"LOGG" else "the header of this BLF log is not whole",
            file=path,
            place="byte 0" if raw[:4] != b"LOGG" else f"byte {len(raw)}",
            found=raw[:4],
            expected=f"LOGG and a header of {_FILE.size} bytes",
        )
    _, size, file_size, inflated, objects, *start = _FILE.unpack(raw)
    return Header(size, file_size, inflated, objects, _start(start))


_YEARS = (1970, 2200)
"""Years that a measurement may have: in 2262 nanoseconds since 1970 no longer fit 64 bits."""


def _start(date: list[int]) -> int | None:
    """ns since 1970 of a SYSTEMTIME, read as UTC as python-can does, so that it is the same wherever it is read."""
    year, month, _, day, hour, minute, second, millisecond = date
    if not any(date):
        return 0
    try:
        moment = datetime.datetime(year, month, day, hour, minute, second, millisecond * 1000, tzinfo=datetime.UTC)
    except ValueError:
        return None
    if not _YEARS[0] <= year <= _YEARS[1]:
        return None
    return (moment - _EPOCH) // datetime.timedelta(microseconds=1) * 1000


def pieces(file: BinaryIO, header: Header, threads: int, losses: Losses) -> Iterator[list[Piece]]:
    """Contents of a BLF file in its order, about WINDOW bytes at once."""
    jobs = (job for window in _windows(file, _begin(file, header, losses)) for job in _jobs(window))
    if threads < 2:
        yield from (opened(*job) for job in jobs)
        return
    with ThreadPoolExecutor(threads - 1) as pool:
        waiting: deque[Future[list[Piece]]] = deque()
        for job in jobs:
            waiting.append(pool.submit(opened, *job))
            if len(waiting) > 2 * threads:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


def _begin(file: BinaryIO, header: Header, losses: Losses) -> int:
    """Where the first object begins: behind the header, or nearest to it if the header's size is wrong."""
    file.seek(header.size)
    ahead = file.read(4 + PADDING)
    if b"LOBJ" in ahead:
        return header.size
    file.seek(_FILE.size)
    first = file.read(WINDOW).find(b"LOBJ")
    if first >= 0 or (ahead and header.size < _FILE.size):
        losses.add(f"the header states {counted(header.size, 'byte')} for itself, and no object begins there", "byte 4")
        return _FILE.size + max(first, 0)
    return header.size


def _windows(file: BinaryIO, at: int) -> Iterator[Window]:
    """Windows of whole objects and of gaps between them."""
    file.seek(at)
    tail, synced, needed, contained = b"", True, WINDOW, False
    while True:
        read = file.read(max(WINDOW, needed))
        data, last = tail + read, not read
        contained = contained or _begins_container(data, 0)
        found = (_linked(data, last) if synced else None) or _searched(data, synced, last, contained)
        items, end, synced = found
        yield Window(at, data, tuple(items))
        if last:
            return
        tail, at = data[end:], at + end
        needed = min(_OBJECT.unpack_from(tail)[3], LARGEST) - len(tail) + BASE if len(tail) >= BASE else WINDOW


def _linked(data: bytes, last: bool) -> tuple[list[Item], int, bool] | None:
    """Items of a window by following their sizes; None where that does not lead from one to the next."""
    items, at = list[Item](), 0
    while True:
        begin = data.find(b"LOBJ", at, at + 4 + PADDING)
        if begin < 0 or begin + BASE > len(data):
            return (items, at, True) if len(data) - at <= (PADDING if last else BASE + PADDING) else None
        _, header, version, size, kind = _OBJECT.unpack_from(data, begin)
        if not BASE <= header <= size <= LARGEST or not 1 <= version <= 3:
            return None
        if begin + size > len(data):
            return None if last else (items, begin, True)
        items.append(Item(begin, begin + size, kind == CONTAINER_TYPE))
        at = begin + size


def _searched(data: bytes, synced: bool, last: bool, contained: bool) -> tuple[list[Item], int, bool]:
    """Items of a window whose chain is broken. A gap that a container begins may be one whose size is wrong."""
    only = CONTAINER_TYPE if contained else None
    chain = follow(np.frombuffer(data + bytes(ROOM), np.uint8), synced=synced, last=last, only=only)
    sizes, kinds = chain.heads["size"].tolist(), chain.heads["type"].tolist()
    items = [Item(a, a + n, k == CONTAINER_TYPE) for a, n, k in zip(chain.at.tolist(), sizes, kinds, strict=True)]
    for a, b in chain.gaps:
        items.append(Item(a, b, _begins_container(data, a), whole=False, again=not (synced or a)))
    end = chain.tail
    if chain.cut:
        end = len(data)
        items.append(Item(chain.tail, end, _begins_container(data, chain.tail), whole=False, cut=True))
    return sorted(items, key=lambda item: item.begin), end, chain.synced


def _begins_container(data: bytes, at: int) -> bool:
    return data[at : at + 4] == b"LOBJ" and data[at + 12 : at + 16] == CONTAINER_TYPE.to_bytes(4, "little")


def _jobs(window: Window) -> Iterator[tuple[Window, list[Item]]]:
    """Parts of a window whose contents, as far as the containers state it, are about WINDOW bytes."""
    part: list[Item] = []
    size = 0
    for item in window.items:
        part.append(item)
        size += stated_size(window.data, item)
        if size >= WINDOW:
            yield window, part
            part, size = [], 0
    if part:
        yield window, part
