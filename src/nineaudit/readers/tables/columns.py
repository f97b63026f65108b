"""Which columns of a table are time and channels, and what becomes of their numbers: text tables and Parquet alike."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nineaudit.array import FloatArray, Sensor
from nineaudit.errors import RecordingError
from nineaudit.readers.contents import Contents
from nineaudit.readers.tables.dialect import base
from nineaudit.readers.tables.preamble import TIME_NAME, is_unit, unit_in_name
from nineaudit.recording import Damage, Trace
from nineaudit.signals import QUANTITY, suggestion, time_unit
from nineaudit.units import counted, factor

if TYPE_CHECKING:
    from nineaudit.rig import Rig

_SEVERAL = 3
"""Rows without any number that may be remarks or names said again; more are rows that were not understood."""


@dataclass(frozen=True)
class Columns:
    """Where a table keeps what a rig asks for: `time` and `channels` count from 0; `scale` s in the time's unit.

    `time` None: no column is that. `units` of the channels, None where the table does not say.
    """

    names: tuple[str, ...]
    time: int | None
    channels: tuple[int, ...]
    units: tuple[str | None, ...]
    scale: float = 1.0
    notes: tuple[str, ...] = ()

    @property
    def wanted(self) -> tuple[int, ...]:
        """The columns to be read: time, if there is one, before the channels."""
        return self.channels if self.time is None else (self.time, *self.channels)


def locate(rig: Rig, names: Sequence[str], path: Path, place: str, *, timeless: bool = False) -> Columns:
    """Find the rig's signals among the `names` of a table; raises RecordingError where one is missing or doubled.

    `timeless`: a table without a column of time is none the worse, unless the rig names one.
    """
    time = _time_column(rig, names, path, place, timeless)
    channels = tuple(_find(names, s.signal, f"channel {s.channel!r}", path, place) for s in rig.array.sensors)
    units = tuple(_unit(names[i], s) for i, s in zip(channels, rig.array.sensors, strict=True))
    odd = [
        f"column {names[i]!r}: its brackets hold no unit of {QUANTITY[s.kind].replace('_', ' ')} and count as its name"
        for i, s, unit in zip(channels, rig.array.sensors, units, strict=True)
        if unit is None and names[i] != s.signal
    ]
    return with_units(Columns(tuple(names), time, channels, units, notes=tuple(odd)), rig, {})


def _unit(name: str, sensor: Sensor) -> str | None:
    """The unit in a column's name; where the rig has the whole name, only one that is known of that quantity."""
    unit = unit_in_name(name, sensor.kind)
    if name != sensor.signal or unit is None or unit == sensor.unit:
        return unit
    return unit if is_unit(unit, QUANTITY[sensor.kind]) else None


def with_units(columns: Columns, rig: Rig, stated: Mapping[int, str]) -> Columns:
    """The columns with the units that the table states for some of them. Of time, the rig's and that of its name come
    first; where nothing says it, a note does."""
    units = tuple(stated.get(i) or unit for i, unit in zip(columns.channels, columns.units, strict=True))
    if columns.time is None:
        return replace(columns, units=units)
    name = columns.names[columns.time]
    unit = time_unit(name, rig.time_unit) or stated.get(columns.time)
    unsaid = f"time {name!r} is taken as seconds: neither its name nor the rig gives a unit"
    scale = factor(unit or "s", "time", place=f"column {name!r}")
    kept = tuple(note for note in columns.notes if note != unsaid)
    return replace(columns, units=units, scale=scale, notes=kept if unit else (*kept, unsaid))


def contents(
    rig: Rig,
    columns: Columns,
    time: FloatArray,
    values: Sequence[FloatArray],
    notes: Iterable[str],
    damage: Iterable[Damage] = (),
    first_unplaced: str = "",
) -> Contents:
    """Traces of one clock: `time` (n,) in the table's unit, `values` one (n,) a channel; no number is NaN.

    The arrays become those of the traces. Rows without a time stamp are left out and counted, and are Damage where they
    hold readings; `first_unplaced` says where the first is. Cells without a number are counted.
    """
    placed = np.isfinite(time)
    unplaced = int(np.count_nonzero(~placed))
    held = np.logical_or.reduce([np.isfinite(v) for v in values]) & ~placed
    if held.any():
        place = first_unplaced or f"row {int(np.argmax(held)) + 1}"
        left = Damage("readings in a row without a time stamp", place, int(held.sum()), "these rows are left out")
        damage = (*damage, left)
    if unplaced - int(held.sum()) > _SEVERAL:
        place = first_unplaced or f"row {int(np.argmin(placed | held)) + 1}"
        nothing = Damage("a row without a time stamp or a reading", place, unplaced - int(held.sum()))
        damage = (*damage, nothing)
    stamps = time[placed] if unplaced else time
    stamps = _read_only(stamps if columns.scale == 1.0 else stamps * columns.scale)
    readings = [_read_only(_finite(v[placed] if unplaced else v)) for v in values]
    traces = tuple(
        Trace(sensor.channel, sensor.signal, stamps, v, unit)
        for sensor, v, unit in zip(rig.array.sensors, readings, columns.units, strict=True)
    )
    counts = {
        "rows": time.size,
        "columns": len(columns.names),
        "invalid_cells": int(sum(np.count_nonzero(np.isnan(v)) for v in readings)),
        "rows_without_time": unplaced,
    }
    lost = (f"{counted(unplaced, 'row')} without a time stamp left out",) if unplaced else ()
    return Contents(traces, counts, (*columns.notes, *notes, *lost), tuple(damage))


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


def _finite(values: FloatArray) -> FloatArray:
    infinite = np.isinf(values)
    return np.where(infinite, np.nan, values) if infinite.any() else values


def _read_only(values: FloatArray) -> FloatArray:
    values.setflags(write=False)
    return values


def _time_column(rig: Rig, names: Sequence[str], path: Path, place: str, timeless: bool) -> int | None:
    if rig.time_signal is not None:
        return _find(names, rig.time_signal, "time", path, place)
    found = [name for name in names if TIME_NAME.fullmatch(name)]
    if found:
        return _find(names, found[0], "time", path, place)
    if timeless:
        return None
    raise RecordingError(
        "no time column",
        file=path,
        place=place,
        found=", ".join(names[:8]),
        expected="a column such as time_s",
        advice="name it in the rig file ([recording] time)",
    )


def _find(names: Sequence[str], signal: str, what: str, path: Path, place: str) -> int:
    """The column of that name; where there is none, the one that is named so but for a unit in brackets."""
    hits = [i for i, name in enumerate(names) if name == signal]
    hits = hits or [i for i, name in enumerate(names) if base(name) == signal]
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
