"""Frames of a CAN log in ASAM MDF 4 (.mf4), through asammdf (extra ``mdf``).

The raw frames are in channel groups whose channel ``CAN_DataFrame`` (``CAN_ErrorFrame``, ``CAN_RemoteFrame``) is a
record (ASAM MDF bus logging). Time counts from the start of the measurement, as the file has it.
"""

from __future__ import annotations

import struct
import sys
import traceback
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from nineaudit.errors import ConfigurationError, RecordingError
from nineaudit.readers.can.frames import ERROR, REMOTE, Frames
from nineaudit.readers.can.losses import Losses
from nineaudit.readers.can.mdf_by_asammdf import by_asammdf
from nineaudit.readers.can.mdf_layout import layout
from nineaudit.readers.can.mdf_links import require_whole, unfinished
from nineaudit.readers.can.mdf_records import read_group
from nineaudit.readers.can.merged import merged
from nineaudit.readers.contents import cut_short

_KINDS = (("CAN_DataFrame", 0), ("CAN_RemoteFrame", REMOTE), ("CAN_ErrorFrame", ERROR))


def read_mdf(path: Path) -> Frames:
    """Frames of an MF4 log.

    Raises ConfigurationError where asammdf is not installed; RecordingError where the file is truncated or holds no
    CAN frames.
    """
    with opened(path) as log:
        return frames_of(log, path)


def frames_of(log: Any, path: Path) -> Frames:
    """Frames of an open file. RecordingError where it holds no CAN frames."""
    found = _frames(log, path)
    note = ("the logger did not finalise this file: frames after its end may be lost",) if unfinished(path) else ()
    return replace(found, notes=(*found.notes, *note))


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """asammdf's view of a whole file; what asammdf stumbles over is a RecordingError."""
    try:
        from asammdf import MDF
    except ImportError as error:
        raise ConfigurationError(
            "reading .mf4 needs asammdf", file=path, advice='pip install "nineaudit[mdf]"'
        ) from error
    require_whole(path)
    opening: tuple[type[Exception], ...] = (*_stumbles(), TypeError, AttributeError)
    try:
        log = MDF(path, process_bus_logging=False)  # type: ignore[call-arg]  # passed on by **kwargs
    except opening as error:
        _let_go(error)
        raise _stumbled(path, error) from error
    try:
        with log:
            yield log
    except _stumbles() as error:
        raise _stumbled(path, error) from error


def _stumbles() -> tuple[type[Exception], ...]:
    """What asammdf, and the libraries by which it inflates, raise over damaged files."""
    from asammdf.blocks.utils import MdfException

    own = ((sys.modules.get(module), name) for module, name in (("isal.igzip_lib", "IsalError"), ("zstd", "Error")))
    inflating = [getattr(module, name) for module, name in own if module]
    general = (ValueError, LookupError, ArithmeticError, RuntimeError, MemoryError, EOFError, struct.error, zlib.error)
    return (MdfException, *general, *inflating)


def _let_go(error: Exception) -> None:
    """Close what asammdf leaves behind where it stumbles: files, and a copy of a log that was not finalised. Its own
    close() misses what it had not read yet, or has let go."""
    for frame, _ in traceback.walk_tb(error.__traceback__):
        half: Any = frame.f_locals.get("self")
        if type(half).__name__ == "MDF4":
            for name in ("_file", "header", "identification"):
                vars(half).setdefault(name, None)
            half.close()


def _stumbled(path: Path, error: Exception) -> RecordingError:
    return cut_short(path, " ".join(str(error).split())[:120] or type(error).__name__, "no frames")


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
    return replace(merged(parts), buses=buses, notes=(note,), damage=losses.damage())


def _part(log: Any, index: int, name: str, kind: int, losses: Losses) -> Frames:
    """Frames of one group: from its records, or by asammdf where these are not as usual."""
    found = layout(log._mdf, index, name)
    if found is None:
        return by_asammdf(log, index, name, kind, losses)
    return read_group(log._mdf, index, kind, found, losses)
