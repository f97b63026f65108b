"""Text tables (.csv, .tsv, .txt): a column of time, and columns that are signals by name."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from math import isfinite, nan
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import RecordingError
from nineaudit.readers import columns, dialect
from nineaudit.readers.contents import Contents
from nineaudit.readers.dialect import Dialect

if TYPE_CHECKING:
    from nineaudit.rig import Rig


def read_text_table(path: Path, rig: Rig) -> Contents:
    """Signals of a text table; what it accepts is said in dialect.detect.

    Cells that hold no number are NaN, counted, and the first of a column is named with its line.
    Raises RecordingError: not UTF-8, no header, a missing or doubled column, a row of the wrong length.
    """
    wanted = {sensor.signal for sensor in rig.array.sensors} | {rig.time_signal or ""}
    table = dialect.detect(path.read_bytes(), wanted, path, rig.separator, rig.decimal)
    found = columns.locate(rig, table.names, path, f"line {table.header_line}")
    wanted_columns = (found.time, *found.channels)
    values, notes = _fast(table, wanted_columns), list[str]()
    if values is None:
        values, notes = _by_cell(table, wanted_columns, path)
    if not table.body.endswith((b"\n", b"\r")):
        notes.append("the last line has no line end: is the file whole?")
    return columns.contents(rig, found, values[0], values[1:], notes)


def _fast(table: Dialect, wanted: Sequence[int]) -> list[FloatArray] | None:
    """The columns, where every row is as long as the header and every wanted cell a number; else None."""
    import pyarrow as pa
    from pyarrow import csv

    names = list(dict.fromkeys(f"c{i}" for i in wanted))
    try:
        parsed = csv.read_csv(
            pa.BufferReader(table.body),
            read_options=csv.ReadOptions(column_names=[f"c{i}" for i in range(len(table.names))]),
            parse_options=csv.ParseOptions(delimiter=table.separator),
            convert_options=csv.ConvertOptions(
                include_columns=names,
                column_types=dict.fromkeys(names, pa.float64()),
                decimal_point=table.decimal,
            ),
        )
    except pa.ArrowInvalid:
        return None
    if any(column.null_count for column in parsed.columns):
        return None
    values = [columns.floats(parsed.column(f"c{i}")) for i in wanted]
    return values if all(np.isfinite(v).all() for v in values) else None


def _by_cell(table: Dialect, wanted: Sequence[int], path: Path) -> tuple[list[FloatArray], list[str]]:
    """The columns cell by cell, with notes on what holds no number. Raises RecordingError for a ragged row."""
    values: list[list[float]] = [[] for _ in wanted]
    bad: Counter[int] = Counter()
    notes: dict[int, str] = {}
    for line, text in table.lines():
        cells = _row(table, text, line, path)
        for column, numbers in zip(wanted, values, strict=True):
            numbers.append(_number(cells[column], table.decimal))
            if numbers[-1] != numbers[-1]:  # NaN
                bad[column] += 1
                notes.setdefault(column, f"first in line {line}: {cells[column].strip()!r}")
        if len(cells) > len(table.names):
            notes[-1] = "rows end with a separator that the header does not have: it is left out"
    return [np.array(v) for v in values], [
        f"column {table.names[column]!r}: {bad[column]} cells hold no number, {note}" if column >= 0 else note
        for column, note in notes.items()
    ]


def _row(table: Dialect, text: str, line: int, path: Path) -> list[str]:
    """Cells of a row: as many as the header has, or one more that is empty (a separator at the end)."""
    cells = table.cells(text)
    surplus = len(cells) - len(table.names)
    if surplus == 0 or (surplus == 1 and not cells[-1].strip()):
        return cells
    raise RecordingError(
        "a row of the wrong length",
        file=path,
        place=f"line {line}",
        found=f"{len(cells)} cells",
        expected=f"{len(table.names)}, as many as the header has",
    )


def _number(cell: str, decimal: str) -> float:
    """The finite number in a cell, NaN for anything else (Python's 1_000 is no number here)."""
    text = cell.strip()
    if decimal == ",":
        text = "" if "." in text else text.replace(",", ".")
    try:
        value = nan if "_" in text else float(text)
    except ValueError:
        return nan
    return value if isfinite(value) else nan
