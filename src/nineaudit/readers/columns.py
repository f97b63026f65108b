"""Which columns of a table are time and channels, and what becomes of their numbers: text tables and Parquet alike."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nineaudit.array import FloatArray, frozen
from nineaudit.errors import RecordingError
from nineaudit.readers.contents import Contents
from nineaudit.recording import Trace
from nineaudit.signals import suggestion, time_unit
from nineaudit.units import factor

if TYPE_CHECKING:
    from nineaudit.rig import Rig

_TIME_NAME = re.compile(r"(t|time|timestamp|zeit)([_ ]?[\[(]?(s|ms|us|µs|ns)[\])]?)?", re.IGNORECASE)


@dataclass(frozen=True)
class Columns:
    """Where a table keeps what a rig asks for: `time` and `channels` count from 0; `scale` s in the time's unit."""

    names: tuple[str, ...]
    time: int
    scale: float
    channels: tuple[int, ...]
    notes: tuple[str, ...]


def locate(rig: Rig, names: Sequence[str], path: Path, place: str) -> Columns:
    """Find the rig's signals among the `names` of a table; raises RecordingError where one is missing or doubled."""
    time = _time_column(rig, names, path, place)
    stated = time_unit(names[time], rig.time_unit)
    unsaid = f"time {names[time]!r} is taken as seconds: neither its name nor the rig gives a unit"
    return Columns(
        names=tuple(names),
        time=time,
        scale=factor(stated or "s", "time"),
        channels=tuple(_find(names, s.signal, f"channel {s.channel!r}", path, place) for s in rig.array.sensors),
        notes=() if stated else (unsaid,),
    )


def contents(
    rig: Rig, columns: Columns, time: FloatArray, values: Sequence[FloatArray], notes: Iterable[str]
) -> Contents:
    """Traces of one clock: `time` (n,) in the table's unit, `values` one (n,) a channel; no number is NaN.

    Rows without a time stamp are left out and counted; so are, without being left out, cells without a number.
    """
    placed = np.isfinite(time)
    stamps = frozen(time[placed] * columns.scale)
    readings = [np.where(np.isfinite(v), v, np.nan)[placed] for v in values]
    traces = tuple(
        Trace(sensor.channel, sensor.signal, stamps, frozen(v))
        for sensor, v in zip(rig.array.sensors, readings, strict=True)
    )
    unplaced = int(np.count_nonzero(~placed))
    counts = {
        "rows": time.size,
        "columns": len(columns.names),
        "invalid_cells": int(sum(np.count_nonzero(np.isnan(v)) for v in readings)),
        "rows_without_time": unplaced,
    }
    lost = (f"{unplaced} rows without a time stamp are left out",) if unplaced else ()
    return Contents(traces, counts, (*columns.notes, *notes, *lost))


def floats(column: Any) -> FloatArray:
    """(n,) numbers of an Arrow column of doubles, nulls NaN; taken from its buffer (``to_numpy`` imports pandas)."""
    import pyarrow as pa

    if column.null_count:
        column = pa.chunked_array([chunk.fill_null(np.nan) for chunk in column.chunks], pa.float64())
    parts = [
        np.frombuffer(chunk.buffers()[1], dtype=np.float64)[chunk.offset : chunk.offset + len(chunk)]
        for chunk in column.chunks
        if len(chunk)
    ]
    return np.concatenate(parts) if parts else np.empty(0)


def _time_column(rig: Rig, names: Sequence[str], path: Path, place: str) -> int:
    if rig.time_signal is not None:
        return _find(names, rig.time_signal, "time", path, place)
    found = [name for name in names if _TIME_NAME.fullmatch(name)]
    if not found:
        raise RecordingError(
            "no time column",
            file=path,
            place=place,
            found=", ".join(names[:8]),
            expected="a column such as time_s",
            advice="name it in the rig file ([recording] time)",
        )
    return _find(names, found[0], "time", path, place)


def _find(names: Sequence[str], signal: str, what: str, path: Path, place: str) -> int:
    hits = [i for i, name in enumerate(names) if name == signal]
    if len(hits) == 1:
        return hits[0]
    if hits:
        raise RecordingError(
            f"{what}: column {signal!r} is there {len(hits)} times",
            file=path,
            place=place,
            found="columns " + ", ".join(str(i + 1) for i in hits),
            expected="one",
        )
    raise RecordingError(
        f"missing {what}",
        file=path,
        place=place,
        expected=f"a column {signal!r}",
        advice=suggestion(signal, names),
    )
