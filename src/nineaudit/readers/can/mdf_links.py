"""Blocks of an MF4 file and the links between them, followed before asammdf does: it leaves open files behind where it
stumbles over a cut one, and follows links in a circle for ever."""

from __future__ import annotations

import mmap
import struct
from pathlib import Path
from typing import Final

from nineaudit.readers.contents import cut_short

_HEADER_AT: Final = 64
_UNFINISHED: Final = b"UnFinMF "
_BLOCK: Final = struct.Struct("<4s4xQQ")
"""Identification, length, number of links; links follow, 8 bytes each."""
_TREE: Final = {
    b"##HD": (0, 1, 3, 4),
    b"##DG": (0, 1),
    b"##CG": (0, 1),
    b"##CN": (0, 1),
    b"##CA": (0,),
    b"##FH": (0,),
    b"##AT": (0,),
    b"##EV": (0,),
    b"##DL": (0,),
    b"##LD": (0,),
}
"""Links (next of a list, first of a list) by which each block is reached once at most [ASAM MDF 4, block structure]."""


def unfinished(path: Path) -> bool:
    """Whether its logger did not finalise the file."""
    with path.open("rb") as file:
        return file.read(len(_UNFINISHED)) == _UNFINISHED


def require_whole(path: Path) -> None:
    """Follow every link. Raises RecordingError: a block that is not whole, or linked in a circle.

    In a file that its logger did not finalise the last data block is open: it ends with the file.
    """
    if not path.stat().st_size:
        raise cut_short(path, "it is empty", "no frames")
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        _follow(path, data, data[: len(_UNFINISHED)] == _UNFINISHED)


def _follow(path: Path, data: mmap.mmap, unfinished: bool) -> None:
    todo, seen, reached = [_HEADER_AT], set[int](), {_HEADER_AT}
    while todo:
        at = todo.pop()
        if at in seen or at == 0:
            continue
        seen.add(at)
        if at + _BLOCK.size > len(data):
            raise cut_short(path, f"it ends before byte {at}", "no frames", place=f"byte {len(data)}")
        name, length, count = _BLOCK.unpack_from(data, at)
        if unfinished and name == b"##DT":
            continue
        if name[:2] != b"##" or _BLOCK.size + 8 * count > length or at + length > len(data):
            raise cut_short(path, "a block is not whole", "no frames", place=f"byte {at}")
        links = struct.unpack_from(f"<{count}Q", data, at + _BLOCK.size)
        for link in (links[i] for i in _TREE.get(name, ()) if i < count and links[i]):
            if link in reached:
                raise cut_short(path, "blocks are linked in a circle", "no frames", place=f"byte {at}")
            reached.add(link)
        todo += links
