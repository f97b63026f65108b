"""From the text of a rig file to its validated tables, or one sentence that says where it is wrong."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from nineaudit.errors import ConfigurationError
from nineaudit.presets import nearest
from nineaudit.rig_schema import (
    PartTable,
    PointTable,
    RecordingTable,
    RigFile,
    RigTable,
    SensorTable,
    TestTable,
    UncertaintyTable,
    UnitsTable,
)

_TABLES: Mapping[str, type[BaseModel]] = {
    "rig": RigTable,
    "units": UnitsTable,
    "recording": RecordingTable,
    "test": TestTable,
    "uncertainty": UncertaintyTable,
    "sensor": SensorTable,
    "point": PointTable,
    "part": PartTable,
}
_ARRAYS = ("sensor", "point", "part")
_EXPECTED = {
    "string_pattern_mismatch": "text without blanks at its ends",
    "string_too_short": "some text",
    "string_too_long": "a single character",
    "string_type": "text in quotation marks",
    "float_type": "a number",
    "greater_than": "a number greater than 0",
    "greater_than_equal": "a number not less than 0",
}
_LONGEST_REPR = 80


def decode(data: bytes, path: Path) -> str:
    """Text of a rig file; a byte order mark is dropped. ConfigurationError where it is not UTF-8."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ConfigurationError(
            "the rig file is not UTF-8 text",
            file=path,
            place=f"byte {error.start}",
            found=data[error.start : error.start + 1],
            expected="a TOML file in UTF-8",
            advice="save it again with that encoding",
        ) from error


def read_tables(text: str, path: Path | None) -> RigFile:
    """The tables of a rig file, in its own units; ConfigurationError names the first thing wrong."""
    document = _toml(text, path)
    try:
        return RigFile.model_validate(document)
    except ValidationError as error:
        raise _explain(error.errors(include_url=False), document, path) from error


def table_place(table: str, index: int | None = None, name: object = None) -> str:
    """How messages name a table: ``[units]``, ``[[sensor]] 3 (a1y)``; `index` from 0."""
    if table not in _ARRAYS:
        return f"[{table}]"
    number = "" if index is None else f" {index + 1}"
    return f"[[{table}]]{number}" + (f" ({name})" if isinstance(name, str) else "")


def describe(table: str, key: str) -> str:
    """What a key is for: the first sentence of its description in the schema."""
    text = _TABLES[table].model_fields[key].description or key
    first = re.split(r"[.;:] ", text.rstrip("."))[0]
    return first[0].lower() + first[1:]


def _toml(text: str, path: Path | None) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        what, _, where = str(error).partition(" (at ")
        raise ConfigurationError(
            f"not valid TOML: {what[:1].lower()}{what[1:]}", file=path, place=where.rstrip(")") or None
        ) from error
    except (ValueError, RecursionError) as error:  # integers of thousands of digits, brackets thousands deep
        raise ConfigurationError("not readable TOML: a number too long or nesting too deep", file=path) from error


def _explain(errors: list[ErrorDetails], document: Mapping[str, Any], path: Path | None) -> ConfigurationError:
    """The first error as a sentence; unknown keys come first, since a misspelt key is also a missing one."""
    errors.sort(key=lambda e: e["type"] != "extra_forbidden")
    error = errors[0]
    details = _unknown_key(error) if error["type"] == "extra_forbidden" else _wrong_value(error)
    more = len(errors) - 1
    advice = [
        details.pop("advice", ""),
        f"({more} more error{'s' * (more > 1)} in this file)" if more else "",
    ]
    inside = error["type"] in ("extra_forbidden", "missing")
    return ConfigurationError(
        **details,
        file=path,
        place=_place(error["loc"][:-1] if inside else error["loc"], document) or None,
        advice=" ".join(a for a in advice if a) or None,
    )


def _unknown_key(error: ErrorDetails) -> dict[str, Any]:
    *table, key = error["loc"]
    model: type[BaseModel] = _TABLES[str(table[0])] if table else RigFile
    known = tuple(model.model_fields)
    close = nearest(str(key), known)
    return {
        "what": "unknown key" if table else "unknown table",
        "found": str(key),
        "expected": "one of " + ", ".join(known),
        "advice": f"did you mean {close!r}?" if close else "",
    }


def _wrong_value(error: ErrorDetails) -> dict[str, Any]:
    if error["type"] == "missing":
        table, key = str(error["loc"][0]), str(error["loc"][-1])
        return {"what": f"missing key {key!r}", "expected": describe(table, key)}
    return {
        "what": "wrong value",
        "found": _brief(error["input"]),
        "expected": _expected(error),
        "advice": str(error.get("ctx", {}).get("advice", "")),
    }


def _brief(value: object) -> object:
    """The value itself where it prints in a few words, else what it is."""
    try:
        text = repr(value)
    except ValueError:  # Python refuses to print an integer of thousands of digits
        return f"{type(value).__name__} of thousands of digits"
    return value if len(text) <= _LONGEST_REPR else text[:_LONGEST_REPR] + "..."


def _expected(error: ErrorDetails) -> str:
    kind, first, context = error["type"], str(error["loc"][0]), error.get("ctx", {})
    if kind in ("too_short", "too_long"):
        return f"{context.get('min_length', context.get('max_length'))} numbers"
    if kind in ("list_type", "model_type") and len(error["loc"]) <= 2:
        if first in _ARRAYS:
            return f"tables headed [[{first}]], in double brackets"
        if len(error["loc"]) == 1:
            return f"one table headed [{first}], in single brackets"
    return _EXPECTED.get(kind, error["msg"].removeprefix("Input should be "))


def _place(loc: tuple[int | str, ...], document: Mapping[str, Any]) -> str:
    """``[[sensor]] 3 (a1y) axis, number 2`` for ("sensor", 2, "axis", 1)."""
    if not loc:
        return ""
    table, rest = str(loc[0]), loc[1:]
    place = table_place(table)
    if rest and isinstance(rest[0], int):
        entry = document[table][rest[0]]
        place = table_place(table, rest[0], _name(entry))
        rest = rest[1:]
    for part in rest:
        place += f", number {part + 1}" if isinstance(part, int) else f" {part}"
    return place


def _name(entry: object) -> object:
    return entry.get("channel", entry.get("name", entry.get("file"))) if isinstance(entry, Mapping) else None
