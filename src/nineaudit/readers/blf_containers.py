"""The outer half of a BLF log: its header, the chain of containers, and what they hold, inflated by threads.

A file of any size is read in windows. Objects that stand outside of containers are handed on as they are.
"""

from __future__ import annotations

import datetime
import struct
import zlib
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np

from nineaudit.errors import RecordingError
from nineaudit.readers.blf_chain import BASE, LARGEST, PADDING, ROOM, follow
from nineaudit.readers.losses import Losses

# signature, header size, (application and versions), file size, inflated size, objects, (objects read), start of the
# measurement as year, month, weekday, day, hour, minute, second, millisecond, (its end), after python-can's blf.py
_FILE: Final = struct.Struct("<4sL8xQQL4x8H16x")
_OBJECT: Final = struct.Struct("<4sHHLL")  # as blf_chain.HEAD, the part that all headers have
_CONTAINER: Final = struct.Struct("<H6xL4x")  # method of compression, inflated size; then the content
CONTAINER_TYPE: Final = 10
_STORED, _DEFLATED = 0, 2
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


@dataclass(frozen=True)
class Piece:
    """Objects of a container, or objects that stood `bare` in the file, which began at byte `at` of it.

    `fault`: why all of it is lost; `flaw`: what is wrong with it although it could be read; `stored`: bytes of it in
    the file.
    """

    at: int
    content: bytes
    bare: bool = False
    fault: str | None = None
    flaw: str | None = None
    stored: int = 0


@dataclass(frozen=True)
class _Item:
    """Bytes `begin` to `end` of a window: a container or another object, `whole` if the chain says so; else a gap,
    which may begin with a container, or what there is of an object that is `cut` by the end of the file."""

    begin: int
    end: int
    container: bool
    whole: bool = True
    cut: bool = False


@dataclass(frozen=True)
class _Window:
    at: int
    data: bytes
    items: tuple[_Item, ...]


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


def _start(date: list[int]) -> int | None:
    """ns since 1970 of a SYSTEMTIME, read as UTC as python-can does, so that it is the same wherever it is read."""
    year, month, _, day, hour, minute, second, millisecond = date
    if not any(date):
        return 0
    try:
        moment = datetime.datetime(year, month, day, hour, minute, second, millisecond * 1000, tzinfo=datetime.UTC)
    except ValueError:
        return None
    return (moment - _EPOCH) // datetime.timedelta(microseconds=1) * 1000


def pieces(file: BinaryIO, header: Header, size: int, threads: int, losses: Losses) -> Iterator[list[Piece]]:
    """Contents of a BLF file of `size` bytes in its order, about WINDOW bytes at once."""
    jobs = (job for window in _windows(file, _begin(header, size, losses), losses) for job in _jobs(window))
    if threads < 2:
        yield from (_open(*job) for job in jobs)
        return
    with ThreadPoolExecutor(threads - 1) as pool:
        waiting: deque[Future[list[Piece]]] = deque()
        for job in jobs:
            waiting.append(pool.submit(_open, *job))
            if len(waiting) > 2 * threads:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


def _begin(header: Header, size: int, losses: Losses) -> int:
    if _FILE.size <= header.size <= size:
        return header.size
    losses.add(f"the header states {header.size} bytes for itself", "byte 4")
    return _FILE.size


def _windows(file: BinaryIO, at: int, losses: Losses) -> Iterator[_Window]:
    """Windows of whole containers and bare objects; what is neither is booked as lost."""
    file.seek(at)
    tail, synced, needed, contained = b"", True, WINDOW, False
    while True:
        read = file.read(max(WINDOW, needed))
        data, last = tail + read, not read
        found = (_linked(data, last) if synced else None) or _searched(data, synced, last, contained)
        items, end, synced = found
        contained = contained or any(item.container for item in items)
        _book_gaps(at, items, losses)
        yield _Window(at, data, tuple(item for item in items if item.container or item.whole))
        if last:
            return
        tail, at = data[end:], at + end
        needed = min(_OBJECT.unpack_from(tail)[3], LARGEST) - len(tail) + BASE if len(tail) >= BASE else WINDOW


def _linked(data: bytes, last: bool) -> tuple[list[_Item], int, bool] | None:
    """Items of a window by following their sizes; None where that does not lead from one to the next."""
    items, at = [], 0
    while True:
        begin = data.find(b"LOBJ", at, at + 4 + PADDING)
        if begin < 0 or begin + BASE > len(data):
            return (items, at, True) if len(data) - at <= (PADDING if last else BASE + PADDING) else None
        _, header, version, size, kind = _OBJECT.unpack_from(data, begin)
        if not BASE <= header <= size <= LARGEST or not 1 <= version <= 3:
            return None
        if begin + size > len(data):
            return None if last else (items, begin, True)
        items.append(_Item(begin, begin + size, kind == CONTAINER_TYPE))
        at = begin + size


def _searched(data: bytes, synced: bool, last: bool, contained: bool) -> tuple[list[_Item], int, bool]:
    """Items of a window whose chain is broken. A gap that a container begins may be one whose size is wrong."""
    only = CONTAINER_TYPE if contained else None
    chain = follow(np.frombuffer(data + bytes(ROOM), np.uint8), synced=synced, last=last, only=only)
    sizes, kinds = chain.heads["size"].tolist(), chain.heads["type"].tolist()
    items = [_Item(a, a + n, k == CONTAINER_TYPE) for a, n, k in zip(chain.at.tolist(), sizes, kinds, strict=True)]
    items += [_Item(a, b, _begins_container(data, a), whole=False) for a, b in chain.gaps]
    end = chain.tail
    if chain.cut:
        end = len(data)
        items.append(_Item(chain.tail, end, _begins_container(data, chain.tail), whole=False, cut=True))
    return sorted(items, key=lambda item: item.begin), end, chain.synced


def _begins_container(data: bytes, at: int) -> bool:
    return data[at : at + 4] == b"LOBJ" and data[at + 12 : at + 16] == CONTAINER_TYPE.to_bytes(4, "little")


def _book_gaps(at: int, items: list[_Item], losses: Losses) -> None:
    for item in items:
        if not item.whole and not item.container:
            what = "the file ends inside of an object" if item.cut else "no object where one must begin"
            losses.add(what, f"byte {at + item.begin}", lost=item.end - item.begin)


def _jobs(window: _Window) -> Iterator[tuple[_Window, list[_Item]]]:
    """Parts of a window whose contents, as far as the containers state it, are about WINDOW bytes."""
    part: list[_Item] = []
    size = 0
    for item in window.items:
        part.append(item)
        size += _stated(window.data, item)
        if size >= WINDOW:
            yield window, part
            part, size = [], 0
    if part:
        yield window, part


def _stated(data: bytes, item: _Item) -> int:
    place = item.begin + BASE
    whole = item.container and place + _CONTAINER.size <= item.end
    return int(_CONTAINER.unpack_from(data, place)[1]) if whole else item.end - item.begin


def _open(window: _Window, items: Iterable[_Item]) -> list[Piece]:
    """Contents of containers, and stretches of bare objects."""
    out: list[Piece] = []
    view = memoryview(window.data)
    for item in _stretches(items):
        raw, at = view[item.begin : item.end], window.at + item.begin
        out.append(_opened(at, raw, item) if item.container else Piece(at, bytes(raw), bare=True))
    return out


def _stretches(items: Iterable[_Item]) -> Iterator[_Item]:
    """Items, where bare objects that follow each other are one."""
    held: _Item | None = None
    for item in items:
        if held and not item.container and item.begin - held.end <= PADDING:
            held = replace(held, end=item.end)
            continue
        if held:
            yield held
        held = None if item.container else item
        if item.container:
            yield item
    if held:
        yield held


def _opened(at: int, raw: memoryview, item: _Item) -> Piece:
    header = _OBJECT.unpack_from(raw)[1] if len(raw) >= BASE else BASE
    if len(raw) < header + _CONTAINER.size:
        return Piece(at, b"", fault="a container without content", stored=len(raw))
    method, stated = _CONTAINER.unpack_from(raw, header)
    body = raw[header + _CONTAINER.size :]
    if method not in (_STORED, _DEFLATED):
        return Piece(at, b"", fault="a container is compressed by a method that is not known", stored=len(raw))
    content, fault, ended = _inflated(body, stated) if method == _DEFLATED else (bytes(body), None, item.whole)
    if fault is None and not ended and not item.cut:
        fault = "a container ends before its data"
    if fault is not None:
        return Piece(at, b"", fault=fault, stored=len(raw))
    return Piece(at, content, flaw=_flaw(len(content), stated, ended, item), stored=len(raw))


def _flaw(size: int, stated: int, ended: bool, item: _Item) -> str | None:
    if not ended:
        return "the file ends inside of a container"
    if size != stated:
        return "a container holds other than the bytes it states"
    return None if item.whole else "the size of a container is wrong"


def _inflated(body: memoryview, stated: int) -> tuple[bytes, str | None, bool]:
    """Content, why there is none, and whether it is all; never more than LARGEST bytes, whatever is stated."""
    stream = zlib.decompressobj()
    try:
        content = stream.decompress(body, min(stated, LARGEST) + 1)
        while not stream.eof and len(content) <= LARGEST:
            more = stream.decompress(stream.unconsumed_tail, LARGEST + 1 - len(content))
            if not more:
                break
            content += more
    except zlib.error:
        return b"", "the deflated data of a container is damaged", True
    if len(content) > LARGEST:
        return b"", f"a container inflates to more than {LARGEST} bytes", True
    return content, None, stream.eof
