"""The answer of a query as text: a table for people, CSV, JSON; or as a Parquet file."""

from __future__ import annotations

import csv
import datetime as dt
import io
import json
import math
from decimal import Decimal
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from nineaudit.errors import ConfigurationError
from nineaudit.files import partial_name, settle
from nineaudit.outputs import make_folder, unwritable
from nineaudit.report.numbers import printable

if TYPE_CHECKING:
    import pyarrow as pa

SHOWN: Final = 200
"""Rows of a table for people; how many more there are is said."""
FORMATS: Final = ("table", "csv", "json", "parquet")


def style(wanted: str | None, output: Path | None) -> str:
    """The format: as asked for, else of the output's suffix, else a table. ConfigurationError."""
    suffix = output.suffix.lower().lstrip(".") if output else ""
    found = wanted or (suffix if suffix in FORMATS else "table")
    if found not in FORMATS:
        raise ConfigurationError("unknown format", place="--format", found=found, expected=", ".join(FORMATS))
    if found == "parquet" and output is None:
        raise ConfigurationError("Parquet is no text", place="--format", advice="name a file with --output F.parquet")
    return found


def as_text(answer: pa.Table, form: str, width: int | None = None) -> str:
    """The answer as a table of at most `width` signs, CSV or JSON; repeated names of columns are numbered."""
    answer = distinct(answer)
    if form == "table":
        return _table(answer, width)
    return _csv(answer) if form == "csv" else _json(answer)


def write_parquet(answer: pa.Table, path: Path) -> None:
    """Write the answer, whole or not at all. ConfigurationError where that cannot be."""
    import pyarrow.parquet as pq

    make_folder(path.parent)
    partial = partial_name(path)
    try:
        pq.write_table(distinct(answer), partial)
        settle(partial, path)
    except OSError as error:
        raise unwritable(path, error) from error
    finally:
        partial.unlink(missing_ok=True)


def distinct(answer: pa.Table) -> pa.Table:
    """The answer with each name of a column once: uri, uri_1, as an object of JSON needs them."""
    taken, names = set(answer.column_names), list[str]()
    for name in answer.column_names:
        new = name
        if name in names:
            new = next(other for i in count(1) if (other := f"{name}_{i}") not in taken)
        taken.add(new)
        names.append(new)
    return answer.rename_columns(names)


def _rows(answer: pa.Table) -> list[list[Any]]:
    """Row by row, plain values only: numbers, text, truth, None, lists and dictionaries of them."""
    columns = [[_plain(value) for value in column.to_pylist(maps_as_pydicts="strict")] for column in answer.columns]
    return [list(row) for row in zip(*columns, strict=True)]


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Decimal):  # what DuckDB makes of sum() of whole numbers, and of 0.1
        return int(value) if value == value.to_integral_value() else float(value)
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if isinstance(value, dt.date | dt.time | dt.datetime):
        return value.isoformat()
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def _table(answer: pa.Table, width: int | None) -> str:
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    shown = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for field in answer.schema:
        right = any(kind in str(field.type) for kind in ("int", "double", "float", "decimal"))
        shown.add_column(Text(printable(field.name)), justify="right" if right else "left", overflow="fold")
    for row in _rows(answer.slice(0, SHOWN)):
        shown.add_row(*(Text(_cell(value)) for value in row))
    console = Console(file=io.StringIO(), width=width or 200, color_system=None, legacy_windows=False)
    text = "".join(segment.text for segment in console.render(shown))
    lines = [line.rstrip() for line in text.splitlines()]
    more = answer.num_rows - SHOWN
    last = f"{answer.num_rows} row{'' if answer.num_rows == 1 else 's'}"
    return "\n".join([*lines, "", f"{last}, {SHOWN} shown; --format csv gives all" if more > 0 else last])


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return ", ".join(map(_cell, value))
    return printable(json.dumps(value, ensure_ascii=False) if isinstance(value, dict) else value)


def _csv(answer: pa.Table) -> str:
    """With a header; lists and dictionaries as JSON, no value as nothing."""
    written = io.StringIO()
    out = csv.writer(written, lineterminator="\n")
    out.writerow(answer.column_names)
    nested = (list, dict)
    for row in _rows(answer):
        out.writerow([json.dumps(v, ensure_ascii=False) if isinstance(v, nested) else v for v in row])
    return written.getvalue().removesuffix("\n")


def _json(answer: pa.Table) -> str:
    """A list of objects, one a row."""
    names = answer.column_names
    rows = [dict(zip(names, row, strict=True)) for row in _rows(answer)]
    return json.dumps(rows, indent=2, ensure_ascii=False, allow_nan=False)
