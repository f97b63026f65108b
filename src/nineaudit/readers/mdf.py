"""Frames of a CAN log in ASAM MDF 4 (.mf4), through asammdf (extra ``mdf``).

The raw frames are in channel groups whose channel ``CAN_DataFrame`` (``CAN_ErrorFrame``, ``CAN_RemoteFrame``) is a
record (ASAM MDF bus logging). Time counts from the start of the measurement, as the file has it.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from nineaudit.can_database import EXTENDED
from nineaudit.errors import ConfigurationError, RecordingError
from nineaudit.readers.contents import cut_short
from nineaudit.readers.frames import Frames, Series

_HEADER_AT = 64
_UNFINISHED = b"UnFinMF "
_BLOCK = struct.Struct("<4s4xQQ")  # id, length, number of links; links follow, 8 bytes each


def read_mdf(path: Path, wanted: Iterable[int]) -> Frames:
    """Frames of an MF4 log; only `wanted` keys are kept.

    Raises ConfigurationError where asammdf is not installed; RecordingError where the file is truncated, was not
    finalised, or holds no CAN frames.
    """
    try:
        from asammdf import MDF
        from asammdf.blocks.utils import MdfException
    except ImportError as error:
        raise ConfigurationError(
            "reading .mf4 needs asammdf", file=path, advice='pip install "nineaudit[mdf]"'
        ) from error
    _require_whole(path)
    try:
        with MDF(path) as log:
            frames = _frames(log, path, frozenset(wanted))
    except (MdfException, ValueError, KeyError, IndexError, struct.error) as error:
        raise cut_short(path, " ".join(str(error).split())[:120], "no frames") from error
    with path.open("rb") as file:
        unfinished = file.read(len(_UNFINISHED)) == _UNFINISHED
    note = ("the logger did not finalise this file: frames after its end may be lost",) if unfinished else ()
    return replace(frames, notes=(*frames.notes, *note))


def _require_whole(path: Path) -> None:
    """Follow every link between blocks: asammdf leaves open files behind where it stumbles over a cut one.

    In a file that its logger did not finalise the last data block is open: it ends with the file.
    """
    data = path.read_bytes()
    unfinished = data.startswith(_UNFINISHED)
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


def _groups(log: Any, name: str) -> Iterator[tuple[int, Any]]:
    """(group, records with their time stamps) of one kind of bus event."""
    for index, group in enumerate(log.groups):
        if group.channel_group.cycles_nr and any(channel.name == name for channel in group.channels):
            yield index, log.get(name, group=index, raw=True)


def _frames(log: Any, path: Path, wanted: frozenset[int]) -> Frames:
    time, keys, length, bus, payloads = [], [], [], [], []
    for _, records in _groups(log, "CAN_DataFrame"):
        fields = records.samples
        names = fields.dtype.names
        ident = fields["CAN_DataFrame.ID"].astype(np.int64)
        extended = fields["CAN_DataFrame.IDE"].astype(bool) if "CAN_DataFrame.IDE" in names else (ident > 0x7FF)
        time.append(np.asarray(records.timestamps, dtype=np.float64))
        keys.append((ident & 0x1FFFFFFF) | np.where(extended, EXTENDED, 0))
        length.append(fields["CAN_DataFrame.DataLength"].astype(np.intp))
        bus.append(_column(fields, "CAN_DataFrame.BusChannel", len(ident)))
        payloads.append(np.atleast_2d(fields["CAN_DataFrame.DataBytes"]).astype(np.uint8))
    if not keys:
        raise RecordingError(
            "no CAN frames in this MF4 file", file=path, expected="raw frames (channels CAN_DataFrame)"
        )
    width = max(8, max(p.shape[1] for p in payloads))
    payload = np.vstack([np.pad(p, ((0, 0), (0, width - p.shape[1]))) for p in payloads])
    return _collect(
        log,
        wanted,
        np.concatenate(time),
        np.concatenate(keys),
        np.concatenate(length),
        np.concatenate(bus),
        payload,
    )


def _column(fields: Any, name: str, count: int) -> Any:
    return fields[name].astype(np.int64) if name in fields.dtype.names else np.zeros(count, dtype=np.int64)


def _collect(log: Any, wanted: frozenset[int], time: Any, keys: Any, length: Any, bus: Any, payload: Any) -> Frames:
    series = {}
    for key in wanted:
        rows = np.flatnonzero(keys == key)
        if rows.size:
            buses = tuple(map(str, bus[rows].tolist()))
            series[key] = Series(time[rows], payload[rows], length[rows], buses)
    errors = sum(len(records) for _, records in _groups(log, "CAN_ErrorFrame"))
    remote = sum(len(records) for _, records in _groups(log, "CAN_RemoteFrame"))
    counts: dict[str, float] = {
        "frames": int(time.size) + errors + remote,
        "error_frames": errors,
        "remote_frames": remote,
        "bytes": int(length.sum()),
    }
    note = f"time counts from the start of the measurement, {log.header.start_time.isoformat()}"
    ids = Counter(dict(zip(*(u.tolist() for u in np.unique(keys, return_counts=True)), strict=True)))
    return Frames(series, counts, float(time.min()), float(time.max()), (note,), ids=ids)
