"""Numbers out of JSON objects by Arrow's parser, in all cases in which it gives what Python's would."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from nineaudit.readers.mcap.columns import Column, is_number

if TYPE_CHECKING:
    import pyarrow as pa

Step = tuple[type, str | int]
"""Into an object by a key, or into a list by an item."""
_LOOKED_AT: Final = 8
"""Messages that are looked at for one that has every number."""

_EXACT: Final = 2.0**53
"""Integers below are floating-point numbers too."""


def by_arrow(texts: Sequence[bytes], paths: Sequence[str]) -> tuple[Column, ...] | None:
    """Columns of the numbers at paths; None where Arrow refuses a text, or a path could mean two things.

    Every text must begin with { and end with }. As Arrow takes no { right behind a } inside an object or list, nor a
    line end inside a string, none can go on in the next: as many rows as texts are one a text.
    """
    routes = next((found for text in texts[:_LOOKED_AT] if (found := _routes(text, paths)) is not None), None)
    if routes is None or not all(text[:1] == b"{" and text[-1:] == b"}" for text in texts):
        return None
    joined = b"\n".join(texts)
    if _two_ways(joined, paths) or not _is_text(joined):
        return None
    table = _parsed(joined, routes, whole=True)
    if table is None:
        table = _parsed(joined, routes, whole=False)
    if table is None or table.num_rows != len(texts):
        return None
    columns = [_column(table, steps) for steps, _ in routes]
    whole = [_whole(column) if integer else column for column, (_, integer) in zip(columns, routes, strict=True)]
    exact = tuple(column for column in whole if column is not None)
    return exact if len(exact) == len(routes) else None


def _routes(text: bytes, paths: Sequence[str]) -> list[tuple[list[Step], bool]] | None:
    """Steps to each number of a message, and whether it is an integer; None where one is not there."""
    try:
        message = json.loads(text)
    except (ValueError, RecursionError):
        return None
    routes = []
    for path in paths:
        steps: list[Step] = []
        place = message
        for name in path.split("."):
            step = _step(place, name)
            if step is None:
                return None
            steps.append(step)
            place = place[step[1]]
        if not is_number(place):
            return None
        routes.append((steps, isinstance(place, int)))
    return routes if routes and isinstance(message, dict) else None


def _step(place: Any, name: str) -> Step | None:
    if isinstance(place, dict):
        return (dict, name) if name in place else None
    if isinstance(place, list) and name.isdecimal() and int(name) < len(place):
        return list, int(name)
    return None


def _two_ways(joined: bytes, paths: Sequence[str]) -> bool:
    """Whether a key may stand there that holds points itself: the end of a path, plain or escaped."""
    names = [path.split(".", k)[k] for path in paths for k in range(path.count("."))]
    dotted = any(json.dumps(name, ensure_ascii=False).encode() in joined for name in set(names))
    return dotted or (bool(names) and b"\\u" in joined)


def _is_text(joined: bytes) -> bool:
    """Whether bytes are UTF-8, which Arrow does not ask."""
    try:
        return joined.isascii() or bool(joined.decode())
    except UnicodeDecodeError:
        return False


def _parsed(joined: bytes, routes: Sequence[tuple[list[Step], bool]], *, whole: bool) -> pa.Table | None:
    """A table of the fields of routes: integers as such (`whole`), or all as floating-point numbers."""
    import pyarrow as pa
    import pyarrow.json

    tree: dict[str, Any] = {}
    for steps, integer in routes:
        _plant(tree, steps, pa.int64() if integer and whole else pa.float64())
    reading = pyarrow.json.ReadOptions(use_threads=False, block_size=len(joined) + 1)
    schema = pa.schema([(name, _type(kind)) for name, kind in tree.items()])
    parsing = pyarrow.json.ParseOptions(explicit_schema=schema, unexpected_field_behavior="ignore")
    try:
        return pyarrow.json.read_json(io.BytesIO(joined), read_options=reading, parse_options=parsing)
    except pa.ArrowException:
        return None


def _plant(tree: dict[str, Any], steps: Sequence[Step], leaf: pa.DataType) -> None:
    """A route into a tree of fields; the one field of a list is named ""."""
    place = tree
    names = [str(key) if kind is dict else "" for kind, key in steps]
    for name, (kind, _) in zip(names[:-1], steps[1:], strict=True):
        place = place.setdefault(name, {"list": kind is list, "of": {}})["of"]
    if place.get(names[-1]) != leaf and names[-1] in place:
        leaf = max(leaf, place[names[-1]], key=str)
    place[names[-1]] = leaf


def _type(kind: Any) -> pa.DataType:
    import pyarrow as pa

    if not isinstance(kind, Mapping):
        return kind
    fields = [(name, _type(inner)) for name, inner in kind["of"].items()]
    return pa.list_(fields[0][1]) if kind["list"] else pa.struct(fields)


def _column(table: pa.Table, steps: Sequence[Step]) -> Column:
    import pyarrow.compute

    place = table.column(str(steps[0][1])).combine_chunks()
    for kind, key in steps[1:]:
        place = pyarrow.compute.struct_field(place, [key]) if kind is dict else _item(place, int(key))
    there = place.is_valid().to_numpy(zero_copy_only=False)
    values = place.fill_null(0).to_numpy(zero_copy_only=False)
    return Column(values, there & np.isfinite(values))


def _whole(column: Column) -> Column | None:
    """A column of which one number is an integer: as integers where all are; None where some of them have more digits
    than the floating-point numbers that they were read as."""
    if column.values.dtype.kind == "i":
        return column
    if (np.abs(column.values[column.there]) >= _EXACT).any():
        return None
    whole = np.where(column.there, column.values, 0).astype(np.int64)
    return Column(whole, column.there) if (whole == column.values)[column.there].all() else column


def _item(lists: pa.ListArray, item: int) -> pa.Array:
    """One item of each list, null where it has fewer."""
    import pyarrow as pa

    offsets = lists.offsets.to_numpy()
    place = offsets[:-1] + item
    short = (place >= offsets[1:]) | ~lists.is_valid().to_numpy(zero_copy_only=False)
    return lists.values.take(pa.array(np.where(short, 0, place), mask=short))
