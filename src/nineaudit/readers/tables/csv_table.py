"""Text tables (.csv, .tsv, .txt): a column of time, and columns that are signals by name. Memory is that of a block
and of the numbers."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import RecordingError
from nineaudit.readers.contents import Contents
from nineaudit.readers.tables import columns, preamble
from nineaudit.readers.tables.columns import Columns
from nineaudit.readers.tables.dialect import Dialect, detect, is_number
from nineaudit.readers.tables.preamble import Surroundings
from nineaudit.readers.tables.table_rows import Rows
from nineaudit.readers.tables.text_blocks import BLOCK, Encoding, blocks, encoding_of
from nineaudit.recording import Damage

if TYPE_CHECKING:
    from nineaudit.rig import Rig

_SEVERAL = 3
"""Rows of numbers above the names are readings; fewer may be numbers of channels or sensors."""


def read_text_table(path: Path, rig: Rig) -> Contents:
    """Signals of a text table; what it accepts is said in dialect.detect and preamble.

    Cells that hold no number are NaN, counted, and the first of a column is named with its line. Rows of the wrong
    length and a last line without an end are Damage. Time is made from a rate that the file states where it has no
    column of time, and said so.
    Raises RecordingError: no text, no header, a missing or doubled column, thousands separators, no row at all.
    """
    with path.open("rb") as file:
        encoding = encoding_of(file.read(BLOCK), path)
        stream = blocks(file, encoding)
        return _read(next(stream, b""), stream, encoding, path, rig)


def _read(first: bytes, rest: Iterator[bytes], encoding: Encoding, path: Path, rig: Rig) -> Contents:
    wanted = {sensor.signal for sensor in rig.array.sensors} | {rig.time_signal or ""} - {""}
    table, said = detect(first, encoding, wanted, path, rig.separator, rig.decimal), ""
    if rig.time_signal is None:
        table, said = preamble.time_named(table)
    found = columns.locate(rig, table.names, path, table.header_place, timeless=True)
    around = preamble.surroundings(table, found.time, found.channels, rig)
    found = columns.with_units(found, rig, around.units)
    if found.time is None and around.rate is None:
        columns.locate(rig, table.names, path, table.header_place)  # says that there is no column of time
    rows = Rows(table, found.wanted, path, around.first + 1, keep=found.time is None, whole=path.stat().st_size)
    for block in chain([first[table.offsets[around.first] :]], rest):
        if block:
            rows.add(block)
    notes = [note for note in (encoding.note, table.note, said, *around.notes) if note]
    return _contents(rows, found, around, notes, path, rig)


def _contents(rows: Rows, found: Columns, around: Surroundings, notes: list[str], path: Path, rig: Rig) -> Contents:
    values = [rows.column(i) for i in range(len(found.wanted))]
    if not values[0].size and rows.ragged:
        raise RecordingError(
            "no row has as many cells as the header", file=path, place=str(next(rows.damage())), expected="rows"
        )
    if found.time is None:
        rate = around.rate or np.nan
        time = np.arange(values[0].size) / rate
        notes.append(f"no column of time: it is counted from 0 at the {rate:g} Hz that {around.place} states")
    else:
        time = values.pop(0)
        _require_times(time, rows, found.time, path)
    first = rows.first_bad.get(-1 if found.time is None else found.time, "").removeprefix("first in ")
    damage = (*_above(rows.table), *rows.damage())
    return columns.contents(rig, found, time, values, [*notes, *rows.notes()], damage, first)


def _require_times(time: FloatArray, rows: Rows, column: int, path: Path) -> None:
    if time.size and not np.isfinite(time).any():
        raise RecordingError(
            "no row has a time that is a number",
            file=path,
            place=f"column {rows.table.names[column]!r}",
            found=rows.first_bad.get(column, "no number"),
            expected="seconds, or another unit that its name or the rig says",
            advice="export the time as a number, or name another column in the rig file ([recording] time)",
        )


def _above(table: Dialect) -> tuple[Damage, ...]:
    """Rows of numbers above the row of names: another table, or one that was pasted together."""
    above = [
        i
        for i, line in enumerate(table.lines[: table.header])
        if len(cells := table.cells(line)) == len(table.names) > 1 and all(is_number(cell) for cell in cells)
    ]
    if len(above) < _SEVERAL:
        return ()
    what = "a row of numbers above the names of the columns"
    return (Damage(what, f"line {above[0] + 1}", len(above), "these rows are left out"),)
