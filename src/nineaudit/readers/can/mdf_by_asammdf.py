"""CAN frames of an MF4 channel group as asammdf gives them: whatever the layout of its records, and slower."""

from __future__ import annotations

from typing import Any

import numpy as np

from nineaudit.can_bits import ByteMatrix
from nineaudit.readers.can.frames import LONG, SHORT, Frames, frames
from nineaudit.readers.can.losses import Losses
from nineaudit.readers.can.mdf_records import FEWER, STAMP, TOO_LONG, flags, keys, lengths, nanoseconds


def by_asammdf(log: Any, index: int, name: str, kind: int, losses: Losses) -> Frames:
    """Frames `name` of group `index` of an open file; `kind` is 0, REMOTE or ERROR."""
    records = log.get(name, group=index, raw=True)
    fields, count = records.samples, len(records.samples)
    there = f"channel group {index}"
    if count < log.groups[index].channel_group.cycles_nr:
        losses.add(FEWER, there, lost=int(log.groups[index].channel_group.cycles_nr) - count)
    numbers = {full.removeprefix(f"{name}."): fields[full] for full in fields.dtype.names}
    held = np.atleast_2d(numbers.get("DataBytes", np.zeros((count, 0), dtype=np.uint8)))
    length = np.asarray(lengths(kind, numbers, count)).astype(np.int64)
    if not kind:
        beyond = int(np.count_nonzero(length > min(held.shape[1], LONG)))
        if beyond:
            losses.add(TOO_LONG, there, beyond)
        length = np.minimum(length, min(held.shape[1], LONG))
    rows = np.flatnonzero((length > SHORT) & (kind == 0))
    of_data = length if not kind else np.zeros(count, dtype=np.int64)
    time = np.empty(count, dtype=np.int64)
    lost = nanoseconds(np.asarray(records.timestamps, dtype=np.float64), time)
    found = frames(
        time,
        keys(kind, numbers, count),
        numbers.get("BusChannel", np.zeros(count)),
        flags(kind, numbers, count),
        length,
        _fitted(held, of_data, SHORT),
        rows,
        _fitted(held[rows], length[rows], LONG),
    )
    if lost is None:
        return found
    losses.add(STAMP, there, int(lost.sum()), int(lost.sum()))
    return found.take(np.flatnonzero(~lost))


def _fitted(data: ByteMatrix, length: Any, width: int) -> ByteMatrix:
    """(n, width) of (n, any) bytes, zeros beyond each frame's `length` (n,)."""
    out = np.zeros((len(data), width), dtype=np.uint8)
    out[:, : data.shape[1]] = data[:, :width]
    short = np.flatnonzero(length < min(width, data.shape[1]))
    out[short] = np.where(np.arange(width) < length[short, None], out[short], 0)
    return out
