"""TOML tables held to a form: every key known and of its type, else one clear sentence (rule sheets, waivers)."""

from __future__ import annotations

import datetime as dt
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from nineaudit.errors import ConfigurationError

_NAMES: dict[type, str] = {
    str: "text in quotation marks",
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    list: "a list of texts",
    dict: "a table",
    dt.date: "a date such as 2026-05-31",
}
_SCHEMA: dict[type, dict[str, Any]] = {
    str: {"type": "string", "minLength": 1},
    float: {"type": "number"},
    int: {"type": "integer"},
    bool: {"type": "boolean"},
    list: {"type": "array", "items": {"type": "string"}, "minItems": 1},
    dict: {"type": "object"},
    dt.date: {"type": "string", "format": "date"},
}


@dataclass(frozen=True)
class Key:
    """A key of a table: the type of its value, whether it must be there, what it may be, what it means."""

    type: type
    help: str
    required: bool = True
    choices: tuple[str, ...] = ()


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file. Raises ConfigurationError with the place of the first mistake."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigurationError(f"cannot be read: {error.strerror or error}", file=path) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"is not a TOML file: {error}", file=path, expected="TOML in UTF-8") from error


def nearest(name: str, known: Collection[str]) -> str:
    """``did you mean 'limits'?`` or the list of what there is."""
    close = get_close_matches(name, list(known), n=1, cutoff=0.6)
    return f"did you mean {close[0]!r}?" if close else "known: " + ", ".join(sorted(known))


def is_a(value: object, wanted: type) -> bool:
    """Whether a TOML value is of a type; a whole number is a number, true is not."""
    if isinstance(value, bool):
        return wanted is bool
    if wanted is float:
        return isinstance(value, int | float) and value == value
    if wanted is dt.date:
        return isinstance(value, dt.date) and not isinstance(value, dt.datetime)
    if wanted is list:
        return isinstance(value, list) and bool(value) and all(isinstance(v, str) and v for v in value)
    return isinstance(value, wanted) and value != ""


def name_of(wanted: type) -> str:
    """A type in the words of an error message."""
    return _NAMES[wanted]


def check_table(table: Mapping[str, Any], keys: Mapping[str, Key], *, file: Path | None, place: str = "") -> None:
    """Hold `table` to `keys`. Raises ConfigurationError: unknown, missing, of a wrong type, no allowed value."""
    for name, value in table.items():
        where = f"{place} {name}".strip()
        if name not in keys:
            raise ConfigurationError(
                "unknown key", file=file, place=place or None, found=name, advice=nearest(name, keys)
            )
        key = keys[name]
        if not is_a(value, key.type):
            raise ConfigurationError("wrong type", file=file, place=where, found=value, expected=name_of(key.type))
        if key.choices and value not in key.choices:
            raise ConfigurationError(
                "unknown value",
                file=file,
                place=where,
                found=value,
                expected="one of " + ", ".join(key.choices),
            )
    for name, key in keys.items():
        if key.required and name not in table:
            expected = f"{name_of(key.type)}: {key.help}"
            raise ConfigurationError("missing key", file=file, place=f"{place} {name}".strip(), expected=expected)


def schema_of(keys: Mapping[str, Key], **more: Any) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a table."""
    properties = {
        name: _SCHEMA[key.type] | {"description": key.help} | ({"enum": list(key.choices)} if key.choices else {})
        for name, key in keys.items()
    }
    required = [name for name, key in keys.items() if key.required]
    return {
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": False,
    } | more
