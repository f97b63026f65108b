"""A table that says which recordings a campaign has, with which rig, and what is known of each test."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import date, datetime
from pathlib import PurePosixPath
from typing import Any, Final

from nineaudit.campaign.places import name_of, read_bytes
from nineaudit.campaign.stores import told
from nineaudit.errors import ConfigurationError

TABLES: Final = (".csv", ".tsv", ".parquet", ".jsonl", ".ndjson")
COLUMN: Final = "recording"
KNOWN: Final = frozenset({COLUMN, "rig", "dbc", "number", "item", "date", "laboratory"})
_HEAD: Final = 65536
_WHOLE: Final = 2.0**53

Row = dict[str, str]


def is_table(uri: str) -> bool:
    """Whether a file is a table of recordings, and no recording: it has a column `recording` (or `rig`). A file that
    cannot be read is none: its audit says why. Only its beginning (of Parquet, its end) is read."""
    suffix = _suffix(uri)
    if suffix not in TABLES:
        return False
    if suffix in (".jsonl", ".ndjson"):
        return True
    try:
        return bool({COLUMN, "rig"} & set(_columns(uri, suffix)))
    except ConfigurationError:
        return False


def rows(uri: str) -> Iterator[tuple[str, Row]]:
    """(place, row) of a table; no empty cells. ConfigurationError: it cannot be read, no column `recording`, a column
    twice, a row without a recording."""
    suffix = _suffix(uri)
    if suffix not in (".jsonl", ".ndjson"):
        _require_columns(uri, _columns(uri, suffix))
    for i, row in enumerate(_rows(uri, suffix), 1):
        if None in row:
            raise ConfigurationError("a row with more cells than the header", file=uri, place=f"row {i}")
        filled = {_column(name): _text(value) for name, value in row.items() if _text(value)}
        if COLUMN not in filled:
            raise ConfigurationError("a row without a recording", file=uri, place=f"row {i}", expected=COLUMN)
        yield f"{name_of(uri)} row {i}", filled


def _require_columns(uri: str, names: Sequence[str]) -> None:
    if COLUMN not in names:
        found = ", ".join(names)
        raise ConfigurationError("has no column of recordings", file=uri, found=found, expected=f"a column {COLUMN}")
    twice = next((name for name in names if name and names.count(name) > 1), None)
    if twice:
        raise ConfigurationError("has a column twice", file=uri, found=twice, advice="name them differently")


def _columns(uri: str, suffix: str) -> list[str]:
    if suffix == ".parquet":
        import pyarrow.parquet as pq

        with _opened(uri) as file:
            return [_column(name) for name in pq.read_schema(file).names]
    line = io.StringIO(_head(uri).decode("utf-8-sig", "replace"), newline=None).readline()
    return [_column(name) for name in next(csv.reader([line], delimiter=_separator(line, suffix)), [])]


def _rows(uri: str, suffix: str) -> Iterator[Mapping[str, Any]]:
    if suffix == ".parquet":
        yield from _of_parquet(uri)
        return
    try:
        text = read_bytes(uri, "cannot be read").decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ConfigurationError("is not UTF-8", file=uri, place=f"byte {error.start}") from error
    yield from _json_lines(uri, text) if suffix in (".jsonl", ".ndjson") else _of_text(uri, text, suffix)


def _of_text(uri: str, text: str, suffix: str) -> Iterator[Mapping[str, Any]]:
    lines = io.StringIO(text, newline=None)
    separator = _separator(lines.readline(), suffix)
    lines.seek(0)
    count = 0
    try:
        for row in csv.DictReader(lines, delimiter=separator, restval=""):
            count += 1
            yield row
    except csv.Error as error:
        raise ConfigurationError(f"cannot be read: {error}", file=uri, place=f"row {count + 1}") from error


def _json_lines(uri: str, text: str) -> Iterator[Mapping[str, Any]]:
    for i, line in enumerate(io.StringIO(text, newline=None), 1):
        if not line.strip():
            continue
        try:
            row = json.loads(line)
            json.dumps(
                row, ensure_ascii=False
            ).encode()  # half a pair of surrogates is a text to json, and to nothing else
        except (ValueError, RecursionError) as error:
            raise ConfigurationError(f"is no JSON: {error}", file=uri, place=f"line {i}") from error
        if not isinstance(row, dict):
            raise ConfigurationError("is no object", file=uri, place=f"line {i}", expected='{"recording": ...}')
        yield row


def _of_parquet(uri: str) -> Iterator[Mapping[str, Any]]:
    import pyarrow.parquet as pq

    with _opened(uri) as file:
        for batch in pq.ParquetFile(file).iter_batches():
            yield from batch.to_pylist()


@contextmanager
def _opened(uri: str) -> Iterator[Any]:
    """A file from which parts are read. ConfigurationError: of the store, or of Parquet that is damaged."""
    from fsspec.core import url_to_fs
    from pyarrow.lib import ArrowException

    with told(uri, "cannot be read", also=(ArrowException, OverflowError)):  # OverflowError: a date that Python has not
        fs, path = url_to_fs(uri)
        with fs.open(path, "rb") as file:
            yield file


def _head(uri: str) -> bytes:
    from fsspec.core import url_to_fs

    with told(uri, "cannot be read"):
        fs, path = url_to_fs(uri)
        return bytes(fs.cat_file(path, start=0, end=_HEAD))


def _column(name: str) -> str:
    """A name of a column; those that are known are known in capitals too."""
    plain = str(name).strip()
    return plain.lower() if plain.lower() in KNOWN else plain


def _separator(head: str, suffix: str) -> str:
    """Of a CSV table: a semicolon where the header has more of them than commas."""
    if suffix == ".tsv":
        return "\t"
    return ";" if head.count(";") > head.count(",") else ","


def _text(value: object) -> str:
    """A cell as text; dates as YYYY-MM-DD."""
    if value is None or (isinstance(value, float) and value != value):
        return ""
    if isinstance(value, float) and value.is_integer() and abs(value) < _WHOLE:
        return str(int(value))  # a column of whole numbers with an empty cell
    if isinstance(value, datetime) and not any((value.hour, value.minute, value.second, value.microsecond)):
        return value.date().isoformat()
    return value.isoformat() if isinstance(value, date) else str(value).strip()


def _suffix(uri: str) -> str:
    return PurePosixPath(name_of(uri)).suffix.lower()
