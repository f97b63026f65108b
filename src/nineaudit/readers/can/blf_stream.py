"""From the contents of BLF containers to whole objects, wherever the containers cut them."""

from __future__ import annotations

import struct
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import groupby
from typing import Final

import numpy as np

from nineaudit.readers.can.blf_chain import BASE, LARGEST, PADDING, ROOM, Bytes, Places, Records, follow
from nineaudit.readers.can.blf_inflate import NOTHING_BEGINS, Piece
from nineaudit.readers.can.losses import Losses

_SIZE: Final = struct.Struct("<8xL4x")  # of an object, as blf_chain.HEAD has it


@dataclass(frozen=True, eq=False)
class Batch:
    """Whole objects: `at` (m,) where they begin in `buffer`, `heads` (m,) HEAD; `begins` and `files` say which part
    of the buffer is of which piece of the file."""

    buffer: Bytes
    at: Places
    heads: Records
    begins: tuple[int, ...]
    files: tuple[tuple[int, bool], ...]

    def place(self, at: int) -> str:
        """Where in the file a byte of the buffer is: of a container its begin, and the byte of its content."""
        part = max(bisect_right(self.begins, at) - 1, 0)
        file, bare = self.files[part]
        within = at - self.begins[part]
        return f"byte {file + within}" if bare else f"byte {file}, inflated byte {within}"


@dataclass
class _Rest:
    """Bytes that wait for more, until they are `needed` many, and where they came from. `lost`: a container before
    them is lost, so that what does not fit is no fault of its own."""

    content: bytes = b""
    begins: tuple[int, ...] = ()
    files: tuple[tuple[int, bool], ...] = ()
    synced: bool = True
    lost: bool = False
    needed: int = 0


@dataclass
class Stream:
    """Objects of a log, piece by piece; what belongs to none is booked in `losses`."""

    losses: Losses
    rest: _Rest = field(default_factory=_Rest)
    space: Bytes = field(default_factory=lambda: np.empty(0, dtype=np.uint8))

    def batches(self, contents: Iterable[list[Piece]]) -> Iterator[Batch]:
        """Whole objects of all contents, in the order of the file. A batch holds until the next is asked for."""
        for pieces in contents:
            for (bare, lost), group in groupby(pieces, key=lambda piece: (piece.bare, piece.fault is not None)):
                part = list(group)
                self._book(part)
                if lost:
                    yield self._objects([], last=True)
                    self.rest = _Rest(synced=False, lost=True)
                elif bare:
                    if self._is_one_object():
                        yield self._objects([], last=True)
                    yield from self._bare(part)
                elif not self._waits(part):
                    yield self._objects(part)
        yield self._objects([], last=True)

    def _book(self, pieces: list[Piece]) -> None:
        for piece in pieces:
            what = piece.fault or piece.flaw
            if what:
                lost = 0 if piece.content else piece.stored
                self.losses.add(what, f"byte {piece.at}", count=not piece.again, lost=lost)

    def _is_one_object(self) -> bool:
        """Whether all that waits is an object, which only waits for the next to begin at its end."""
        content = self.rest.content
        whole = self.rest.synced and len(content) >= BASE
        return whole and 0 <= len(content) - _SIZE.unpack_from(content)[0] <= PADDING

    def _waits(self, pieces: list[Piece]) -> bool:
        """Whether the object that waits for more still does: a stream is not searched again for every part of it."""
        rest = self.rest
        begins = np.cumsum([len(rest.content), *(len(piece.content) for piece in pieces)]).tolist()
        if begins[-1] >= rest.needed:
            return False
        rest.content = b"".join([rest.content, *(piece.content for piece in pieces)])
        rest.begins = (*rest.begins, *begins[:-1])
        rest.files = (*rest.files, *((piece.at, False) for piece in pieces))
        return True

    def _bare(self, pieces: list[Piece]) -> Iterator[Batch]:
        """Objects outside of containers, which are no part of the stream inside."""
        inside, self.rest = self.rest, _Rest()
        yield self._objects(pieces, last=True)
        self.rest = inside

    def _objects(self, pieces: list[Piece], last: bool = False) -> Batch:
        before = self.rest
        contents = [before.content, *(piece.content for piece in pieces)]
        ends = np.cumsum([len(content) for content in contents]).tolist()
        begins = (*before.begins, *ends[:-1])
        files = (*before.files, *((piece.at, piece.bare) for piece in pieces))
        buffer = self._buffer(contents, ends)
        chain = follow(buffer, synced=before.synced, last=last)
        batch = Batch(buffer, chain.at, chain.heads, begins, files)
        self._book_gaps(batch, chain.gaps, before)
        if chain.cut:
            what = "an object is cut off"
            self.losses.add(what, batch.place(chain.tail), lost=ends[-1] - chain.tail)
        self.rest = self._after(batch, buffer[chain.tail : ends[-1]].tobytes(), chain.tail, chain.synced)
        self.rest.lost = before.lost and not len(chain.at)
        return batch

    def _buffer(self, contents: list[bytes], ends: list[int]) -> Bytes:
        """The contents behind each other and ROOM zeros, always in the same place: new memory costs more than them."""
        size = ends[-1] + ROOM
        if size > len(self.space):
            self.space = np.empty(size + size // 4, dtype=np.uint8)
        for content, end in zip(contents, ends, strict=True):
            self.space[end - len(content) : end] = np.frombuffer(content, dtype=np.uint8)
        self.space[ends[-1] : size] = 0
        return self.space[:size]

    def _after(self, batch: Batch, content: bytes, tail: int, synced: bool) -> _Rest:
        first = max(bisect_right(batch.begins, tail) - 1, 0)
        begins = tuple(begin - tail for begin in batch.begins[first:])
        needed = min(_SIZE.unpack_from(content)[0], LARGEST) + BASE if synced and len(content) >= BASE else 0
        return _Rest(content, begins, batch.files[first:], synced, needed=needed)

    def _book_gaps(self, batch: Batch, gaps: tuple[tuple[int, int], ...], before: _Rest) -> None:
        for begin, end in gaps:
            first = begin == 0 and not before.synced
            what = "rest of an object whose begin is lost" if first and before.lost else NOTHING_BEGINS
            self.losses.add(what, batch.place(begin), count=not (first and what in self.losses), lost=end - begin)
