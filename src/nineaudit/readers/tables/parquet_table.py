"""Parquet tables: columns by name as in a text table; nulls are readings that are not there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import RecordingError
from nineaudit.readers.contents import Contents, cut_short
from nineaudit.readers.tables import columns
from nineaudit.recording import Damage
from nineaudit.units import counted, factor

if TYPE_CHECKING:
    from nineaudit.rig import Rig

LARGEST: Final = 2 * 2**30
"""Bytes of a row group, unpacked, beyond which it is not read."""


def read_parquet(path: Path, rig: Rig) -> Contents:
    """Signals of a Parquet file; a group of rows that is damaged (by its checksum, or not to be unpacked) is left out.

    Units are those of a field's metadata `unit`. Raises RecordingError: the footer is damaged or cut off (nothing can
    be read without it), a missing, doubled or non-numeric column.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(path, page_checksum_verification=True)
        schema = file.schema_arrow
    except (pa.ArrowException, OSError) as error:
        raise cut_short(path, _said(error), "no rows") from error
    found = columns.with_units(columns.locate(rig, schema.names, path, "schema"), rig, _units(schema))
    wanted = list(dict.fromkeys(schema.names[i] for i in found.wanted))
    groups, damage = _groups(file, wanted)
    if not groups and damage:
        raise cut_short(path, damage[0].what, "no rows", place=damage[0].place)
    table = pa.concat_tables(groups) if groups else schema.empty_table()
    assert found.time is not None
    time, notes = table.column(schema.names[found.time]), []
    if pa.types.is_timestamp(time.type):
        found = replace(found, scale=factor(time.type.unit, "time"), notes=())
        stamps, start = _ticks(time)
        notes.append(f"time is counted from {start}")
    elif pa.types.is_duration(time.type):
        found = replace(found, scale=factor(time.type.unit, "time"), notes=())
        stamps = _numbers(time.cast(pa.int64()), path, schema.names[found.time])
    else:
        stamps = _numbers(time, path, schema.names[found.time])
    values = [_numbers(table.column(schema.names[i]), path, schema.names[i]) for i in found.channels]
    return columns.contents(rig, found, stamps, values, notes, damage)


def _groups(file: Any, wanted: Sequence[str]) -> tuple[list[Any], list[Damage]]:
    """Tables of the groups of rows that can be read, and one Damage for those that cannot."""
    import pyarrow as pa

    groups: list[Any] = []
    lost: list[tuple[int, str]] = []
    for index in range(file.num_row_groups):
        size = file.metadata.row_group(index).total_byte_size
        try:
            if not 0 <= size <= LARGEST:
                raise pa.ArrowInvalid(f"{counted(size, 'byte')} when unpacked")
            groups.append(file.read_row_group(index, columns=wanted, use_threads=False))
        except (pa.ArrowException, OSError) as error:
            lost.append((index, _said(error)))
    if not lost:
        return groups, []
    rows = sum(file.metadata.row_group(index).num_rows for index, _ in lost)
    what = f"a group of rows that cannot be read: {lost[0][1]}"
    return groups, [Damage(what, f"row group {lost[0][0] + 1}", len(lost), f"{counted(rows, 'row')} left out")]


def _units(schema: Any) -> dict[int, str]:
    """Units by column, of the fields whose metadata state one."""
    stated = {i: (schema.field(i).metadata or {}).get(b"unit", b"") for i in range(len(schema.names))}
    return {i: unit.decode("utf-8", "replace") for i, unit in stated.items() if unit}


def _said(error: BaseException) -> str:
    return str(error).partition("\n")[0][:200]


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
        return columns.floats(column.cast(pa.float64(), safe=not pa.types.is_integer(column.type)))
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError) as error:
        raise RecordingError(
            "a column that does not hold numbers",
            file=path,
            place=f"column {name!r}",
            found=str(column.type),
            expected="a numeric column",
        ) from error
