"""Parquet tables: columns by name as in a text table; nulls are readings that are not there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import RecordingError
from nineaudit.readers import columns
from nineaudit.readers.contents import Contents, cut_short
from nineaudit.units import factor

if TYPE_CHECKING:
    from nineaudit.rig import Rig


def read_parquet(path: Path, rig: Rig) -> Contents:
    """Signals of a Parquet file. Raises RecordingError: damaged, a missing, doubled or non-numeric column."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        names = tuple(pq.read_schema(path).names)
        found = columns.locate(rig, names, path, "schema")
        wanted = dict.fromkeys(names[i] for i in (found.time, *found.channels))
        table = pq.read_table(path, columns=list(wanted))
    except (pa.ArrowException, OSError) as error:
        raise cut_short(path, str(error).partition("\n")[0], "no rows") from error
    time, notes = table.column(names[found.time]), []
    if pa.types.is_timestamp(time.type):
        found = replace(found, scale=factor(time.type.unit, "time"), notes=())
        stamps, start = _ticks(time)
        notes.append(f"time is counted from {start}")
    else:
        stamps = _numbers(time, path, names[found.time])
    values = [_numbers(table.column(names[i]), path, names[i]) for i in found.channels]
    return columns.contents(rig, found, stamps, values, notes)


def _ticks(column: Any) -> tuple[FloatArray, str]:
    """Dates as ticks of their unit since the first, exactly; and the first in words."""
    import pyarrow as pa

    ticks = column.cast(pa.int64()).to_pylist()
    start = next((i for i, tick in enumerate(ticks) if tick is not None), None)
    if start is None:
        return np.full(len(ticks), np.nan), "nothing"
    since = [np.nan if tick is None else float(tick - ticks[start]) for tick in ticks]
    return np.array(since, dtype=np.float64), str(column[start].cast(pa.string()))


def _numbers(column: Any, path: Path, name: str) -> FloatArray:
    import pyarrow as pa

    try:
        return columns.floats(column.cast(pa.float64()))
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError) as error:
        raise RecordingError(
            "a column that does not hold numbers",
            file=path,
            place=f"column {name!r}",
            found=str(column.type),
            expected="a numeric column",
        ) from error
