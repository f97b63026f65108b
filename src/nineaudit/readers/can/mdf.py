"""Frames of a CAN log in ASAM MDF 4 (.mf4), through asammdf (extra ``mdf``).

The raw frames are in channel groups whose channel ``CAN_DataFrame`` (``CAN_ErrorFrame``, ``CAN_RemoteFrame``) is a
record (ASAM MDF bus logging). Time counts from the start of the measurement, as the file has it.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from nineaudit.errors import ConfigurationError, RecordingError
from nineaudit.readers.can.frames import ERROR, REMOTE, Frames, Int64, Rows, joined
from nineaudit.readers.can.losses import Losses
from nineaudit.readers.can.mdf_by_asammdf import by_asammdf
from nineaudit.readers.can.mdf_layout import layout
from nineaudit.readers.can.mdf_records import read_group
from nineaudit.readers.contents import cut_short

_HEADER_AT = 64
_UNFINISHED = b"UnFinMF "
_KINDS = (("CAN_DataFrame", 0), ("CAN_RemoteFrame", REMOTE), ("CAN_ErrorFrame", ERROR))
_BLOCK = struct.Struct("<4s4xQQ")  # id, length, number of links; links follow, 8 bytes each


def read_mdf(path: Path) -> Frames:
    """Frames of an MF4 log.

    Raises ConfigurationError where asammdf is not installed; RecordingError where the file is truncated or holds no
    CAN frames.
    """
    with opened(path) as log:
        found = _frames(log, path)
    note = ("the logger did not finalise this file: frames after its end may be lost",) if unfinished(path) else ()
    return replace(found, notes=(*found.notes, *note))


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """asammdf's view of a whole file; what asammdf stumbles over is a RecordingError."""
    try:
        from asammdf import MDF
        from asammdf.blocks.utils import MdfException
    except ImportError as error:
        raise ConfigurationError(
            "reading .mf4 needs asammdf", file=path, advice='pip install "nineaudit[mdf]"'
        ) from error
    _require_whole(path)
    try:
        with MDF(path, process_bus_logging=False) as log:  # type: ignore[call-arg]  # passed on by **kwargs
            yield log
    except (MdfException, ValueError, KeyError, IndexError, struct.error) as error:
        raise cut_short(path, " ".join(str(error).split())[:120], "no frames") from error


def unfinished(path: Path) -> bool:
    """Whether its logger did not finalise the file."""
    with path.open("rb") as file:
        return file.read(len(_UNFINISHED)) == _UNFINISHED


def _require_whole(path: Path) -> None:
    """Follow every link between blocks: asammdf leaves open files behind where it stumbles over a cut one.

    In a file that its logger did not finalise the last data block is open: it ends with the file.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        _follow(path, data, data[: len(_UNFINISHED)] == _UNFINISHED)


def _follow(path: Path, data: mmap.mmap, unfinished: bool) -> None:
    todo, seen = [_HEADER_AT], set[int]()
    while todo:
        at = todo.pop()
        if at in seen or at == 0:
            continue
        seen.add(at)
        if at + _BLOCK.size > len(data):
            raise cut_short(path, f"it ends before byte {at}", "no frames", place=f"byte {len(data)}")
        name, length, links = _BLOCK.unpack_from(data, at)
        if unfinished and name == b"##DT":
            continue
        if name[:2] != b"##" or _BLOCK.size + 8 * links > length or at + length > len(data):
            raise cut_short(path, "a block is not whole", "no frames", place=f"byte {at}")
        todo += struct.unpack_from(f"<{links}Q", data, at + _BLOCK.size)


def holds_frames(log: Any) -> bool:
    """Whether an open file has frames of a CAN bus."""
    return any(True for name, _ in _KINDS for _ in _indices(log, name))


def _indices(log: Any, name: str) -> Iterator[int]:
    for index, group in enumerate(log.groups):
        if group.channel_group.cycles_nr and any(channel.name == name for channel in group.channels):
            yield index


def _frames(log: Any, path: Path) -> Frames:
    """All bus events in the order of their stamps: data, remote and error frames are in groups of their own."""
    losses = Losses("frames")
    parts = [_part(log, index, name, kind, losses) for name, kind in _KINDS for index in _indices(log, name)]
    if not any(len(part) for part in parts):
        raise RecordingError(
            "no CAN frames in this MF4 file",
            file=path,
            found="; ".join(map(str, losses.damage())) or None,
            expected="raw frames (channels CAN_DataFrame)",
        )
    note = f"time counts from the start of the measurement, {log.header.start_time.isoformat()}"
    highest = max(int(part.bus.max(initial=0)) for part in parts)
    buses = tuple(map(str, range(highest + 1)))
    whole = joined(parts, buses=buses, notes=(note,), damage=losses.damage())
    return whole if len(parts) == 1 else whole.take(_merged([part.time for part in parts]))


def _merged(times: Sequence[Int64]) -> Rows:
    """Order of all rows by their stamps that keeps the order of each group, also where its time goes back: a log that
    restarts must show."""
    return np.argsort(np.concatenate([np.maximum.accumulate(time) for time in times]), kind="stable")


def _part(log: Any, index: int, name: str, kind: int, losses: Losses) -> Frames:
    """Frames of one group: from its records, or by asammdf where these are not as usual."""
    found = layout(log._mdf, index, name)
    if found is None:
        return by_asammdf(log, index, name, kind, losses)
    return read_group(log._mdf, index, kind, found, losses)
