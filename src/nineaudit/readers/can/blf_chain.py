"""Where the objects of a BLF stream begin: each must begin where the one before it ends.

A BLF file and the stream inside its containers are made the same way: objects one after the other, each with its
size, and up to three bytes of padding between them (Vector's writers pad by nothing, by size % 4 or to a multiple of
four, as the type of the object has it). The signature alone proves nothing, since a payload may hold it: an object
counts where its end meets the next one's begin. Where that breaks, reading goes on at the next object that does.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Places = NDArray[np.int64]
Records = NDArray[np.void]

# Every object, as Vector BLF by T. Lorenz and python-can's blf.py have it: signature LOBJ, size and version of the
# header, size of the object, its type. In versions 1 and 2 of the header (32 and 40 bytes) follow the unit of time, a
# client's index or a status, the object's version and its time; version 2 has an original time behind that.
# `form` is the header's size and version in one; `behind` what stands behind a header of version 1, which nearly all
# frames have: taken together with the header, it need not be gathered again.
HEAD: Final = np.dtype(
    {
        "names": ["form", "header", "version", "size", "type", "unit", "time", "behind"],
        "formats": ["<u4", "<u2", "<u2", "<u4", "<u4", "<u4", "<u8", "V16"],
        "offsets": [4, 4, 6, 8, 12, 16, 24, 32],
        "itemsize": 48,
    }
)
HEADER: Final = 32
"""Bytes of a header of version 1."""
BASE: Final = 16
"""Bytes of the part that all headers have."""
PADDING: Final = 3
LARGEST: Final = 1 << 25
"""Bytes of the largest object, and of the largest content of a container, that is believed; most have 128 KiB."""
FRAMES: Final = (1, 86, 100, 101, 73, 2, 104, 3)
"""Types of objects that are CAN frames (blf_objects.TYPES)."""
LARGEST_FRAME: Final = 256
"""Bytes of the largest of them that is believed; the largest that is known has 40 + 52 + 64 + 12."""
ROOM: Final = 128
"""Zero bytes behind a buffer, so that a record may be taken from any place in it."""
_SIGNATURE: Final = np.uint32(int.from_bytes(b"LOBJ", "little"))
_LONGEST_HEADER: Final = 1024


@dataclass(frozen=True, eq=False)
class Chain:
    """Whole objects of a buffer: `at` (m,) where they begin, `heads` (m,) HEAD.

    `gaps`: byte ranges that belong to no object. `tail`: from there on the buffer waits for more; `synced`: an object
    must begin there. `cut`: nothing more comes, and an object begins at `tail` that is not whole.
    """

    at: Places
    heads: Records
    tail: int
    gaps: tuple[tuple[int, int], ...] = ()
    synced: bool = True
    cut: bool = False


@dataclass(frozen=True, eq=False)
class _Candidates:
    """(m,) places of the signature, heads and stated ends there, and whether each head can be one; `n` bytes."""

    at: Places
    heads: Records
    end: Places
    plausible: NDArray[np.bool_]
    n: int


def gather(buffer: Bytes, at: Places, record: np.dtype[Any]) -> Records:
    """(m,) records that begin at any bytes `at` of a buffer."""
    raw: Records = np.ndarray((len(buffer) - record.itemsize + 1,), f"V{record.itemsize}", buffer, strides=(1,))
    return raw[at].view(record)


def follow(buffer: Bytes, *, synced: bool = True, last: bool = False, only: int | None = None) -> Chain:
    """The chain of objects in a buffer that ends with ROOM zero bytes.

    `synced`: an object must begin at its first byte (or behind padding). `last`: no more bytes follow. `only`: after
    a break the chain goes on only with an object of that type.
    """
    n = len(buffer) - ROOM
    if synced and n <= PADDING + (0 if last else 3):
        return Chain(np.empty(0, dtype=np.int64), np.empty(0, dtype=HEAD), n if last else 0)
    for step in (4, 1):
        found = _candidates(buffer, n, step)
        chain = _unbroken(found, last) if synced else None
        if chain is not None:
            return chain
    return _Walk(found, synced, last, only).chain()


def _candidates(buffer: Bytes, n: int, step: int) -> _Candidates:
    at = _signatures(buffer, n, 0)
    if step < 4:
        at = np.sort(np.concatenate([at, *(_signatures(buffer, n, phase) for phase in range(1, 4))]))
    heads = gather(buffer, at, HEAD)
    size = np.ascontiguousarray(heads["size"])
    end = at + size
    plausible = _plausible(heads, size)
    headless = at[-(BASE // 4) :] + BASE > n  # no more signatures than these fit into the last bytes
    end[-(BASE // 4) :][headless], plausible[-(BASE // 4) :][headless] = n + 1, True
    return _Candidates(at, heads, end, plausible, n)


def _plausible(heads: Records, size: NDArray[np.uint32]) -> NDArray[np.bool_]:
    """(m,) true where the sizes and the version of a header can be."""
    alike = uniform(heads)
    header, version = (heads[name][:1] if alike else heads[name] for name in ("header", "version"))
    fits = (header >= BASE) & (header <= _LONGEST_HEADER) & (version - np.uint16(1) < 3)
    if alike and fits[0] and size.min() >= header[0] and size.max() <= LARGEST_FRAME:  # which is much faster
        return np.full(len(heads), True)
    room = size - header  # unsigned: where the object is less than its header this is very much
    plausible = np.asarray(fits & (room <= LARGEST))
    large = np.flatnonzero(size > LARGEST_FRAME)
    plausible[large[np.isin(heads["type"][large], FRAMES)]] = False
    return plausible


def uniform(heads: Records) -> bool:
    """Whether there are headers, and all are of one size and version."""
    form = heads["form"]
    return len(form) > 0 and bool((form == form[0]).all())


def _signatures(buffer: Bytes, n: int, phase: int) -> Places:
    words: NDArray[np.uint32] = np.ndarray((max(n - phase, 0) // 4,), "<u4", buffer, offset=phase)
    return np.flatnonzero(words == _SIGNATURE) * 4 + phase


def _unbroken(found: _Candidates, last: bool) -> Chain | None:
    """The chain if every signature belongs to it, which is the rule; None otherwise."""
    at, end, n = found.at, found.end, found.n
    if not len(at) or at[0] > PADDING or not found.plausible.all():
        return None
    gap = at[1:] - end[:-1]
    if len(gap) and not 0 <= gap.min() <= gap.max() <= PADDING:
        return None
    rest = n - int(end[-1])
    if rest > PADDING + (0 if last else 3) or (last and rest < 0):
        return None
    return Chain(at, found.heads, n) if last else Chain(at[:-1], found.heads[:-1], int(at[-1]))


class _Walk:
    """The chain link by link where it is broken, or runs past signatures that belong to payloads."""

    def __init__(self, found: _Candidates, synced: bool, last: bool, only: int | None) -> None:
        self.found, self.synced, self.last = found, synced, last
        at, end, n, m = found.at, found.end, found.n, len(found.at)
        follower = np.searchsorted(at, end)
        near = at[np.minimum(follower, m - 1)] - end if m else end
        followed = found.plausible & (follower < m) & (near <= PADDING)
        whole = found.plausible & (end <= (n if last else n - PADDING - 4))  # else what follows is not there yet
        ended = whole & ~followed & last & (n - end <= PADDING)
        sure = whole & (followed | ended)
        if not last:
            sure |= found.plausible & ~whole
        of_type = np.full(m, True) if only is None else found.heads["type"] == only
        self.bends = np.flatnonzero(~(followed & (follower == np.arange(1, m + 1)))).tolist()
        self.follower: list[int] = np.where(followed, follower, -1).tolist()
        self.whole, self.ended, self.plausible = whole.tolist(), ended.tolist(), found.plausible.tolist()
        self.at, self.end = at.tolist(), end.tolist()
        self.sure = np.flatnonzero(sure & of_type).tolist()
        self.alone = np.flatnonzero(whole & of_type).tolist()
        self.alone_at = at[self.alone].tolist()
        self.runs: list[tuple[int, int]] = []
        self.gaps: list[tuple[int, int]] = []

    def chain(self) -> Chain:
        at: int | None = 0
        if not self.synced or not self.at or self.at[0] > PADDING:
            at = self._first()
            self._gap(0, at)
        tail, synced, cut = self._rest(0), False, False
        while at is not None:
            bend = self.bends[bisect_left(self.bends, at)]
            self.runs.append((at, bend))
            if self.whole[bend] and self.follower[bend] >= 0:
                self.runs.append((bend, bend + 1))
                at = self.follower[bend]
            elif self.ended[bend]:
                self.runs.append((bend, bend + 1))
                tail, synced = self.found.n, True
                break
            elif not self.last and self.plausible[bend] and not self.whole[bend]:
                tail, synced = self.at[bend], True
                break
            else:
                cut = self._is_cut(bend)
                tail = self.at[bend] if cut else self._rest(self.end[bend] if self.whole[bend] else self.at[bend])
                at = None if cut else self._break(bend)
        return self._kept(tail, synced, cut)

    def _first(self) -> int | None:
        return next(iter(self.sure or self.alone), None)

    def _is_cut(self, bend: int) -> bool:
        """Nothing certain follows an object that is not whole: the stream ends in it."""
        return self.plausible[bend] and not self.whole[bend] and bisect_left(self.sure, bend + 1) == len(self.sure)

    def _break(self, bend: int) -> int | None:
        """Where to go on after an object that ends where no other begins; it is kept if nothing begins inside it."""
        begins = self.end[bend] if self.whole[bend] else self.at[bend] + 1
        certain = bisect_left(self.sure, bend + 1)
        lone = bisect_left(self.alone_at, begins) if self.whole[bend] or not self.plausible[bend] else len(self.alone)
        after = min([*self.sure[certain : certain + 1], *self.alone[lone : lone + 1]], default=None)
        kept = self.whole[bend] and (after is None or self.at[after] >= self.end[bend])
        if kept:
            self.runs.append((bend, bend + 1))
        self._gap(self.end[bend] if kept else self.at[bend], after)
        return after

    def _gap(self, begin: int, after: int | None) -> None:
        end = self._rest(begin) if after is None else self.at[after]
        if end > begin:
            self.gaps.append((begin, end))

    def _rest(self, begin: int) -> int:
        """End of a gap that nothing ends: the last three bytes may be the begin of a signature."""
        return self.found.n if self.last else max(begin, self.found.n - 3)

    def _kept(self, tail: int, synced: bool, cut: bool) -> Chain:
        edges = np.zeros(len(self.at) + 1, dtype=np.int64)
        begins, ends = zip(*self.runs, strict=True) if self.runs else ((), ())
        np.add.at(edges, np.array(begins, dtype=np.intp), 1)
        np.subtract.at(edges, np.array(ends, dtype=np.intp), 1)
        kept = np.cumsum(edges[:-1]) > 0
        return Chain(self.found.at[kept], self.found.heads[kept], tail, tuple(self.gaps), synced, cut)
