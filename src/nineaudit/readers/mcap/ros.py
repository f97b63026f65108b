"""Message definitions of ROS 1 and ROS 2 as trees of types.

Sources: ROS 1 msg format (wiki.ros.org/msg); ROS 2 interface definitions (docs.ros.org, "About ROS 2 interfaces");
definitions of several messages in one text as MCAP's registry describes under "ros1msg" and "ros2msg".
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from nineaudit.readers.mcap.columns import Undecodable


@dataclass(frozen=True, eq=False)
class Number:
    """A number or truth value: its numpy type without byte order."""

    dtype: str

    @property
    def size(self) -> int:
        return int(self.dtype[1:])


@dataclass(frozen=True, eq=False)
class Text:
    """A string: its length as uint32, then its bytes."""


@dataclass(frozen=True, eq=False)
class Struct:
    """A message: its fields in order."""

    fields: tuple[tuple[str, Type], ...]


@dataclass(frozen=True, eq=False)
class Array:
    """Items of one type: `count` of them, or as many as a uint32 before them says (None)."""

    item: Type
    count: int | None


Type = Number | Text | Struct | Array

_BOTH: Final = {
    "bool": "b1",
    "float32": "f4",
    "float64": "f8",
    **{f"int{8 * n}": f"i{n}" for n in (1, 2, 4, 8)},
    **{f"uint{8 * n}": f"u{n}" for n in (1, 2, 4, 8)},
}
_ROS1: Final = _BOTH | {"char": "u1", "byte": "i1"}
_ROS2: Final = _BOTH | {"char": "u1", "byte": "u1"}
_DEEPEST: Final = 64
_LARGEST: Final = 2**31
_FIELD = re.compile(r"^([\w/]+)(?:<=(\d+))?(\[(?:<=)?\d*\])?\s+([A-Za-z]\w*)\s*(.*)$")
_BUILT_IN: Final = {
    "ros1": {
        "time": "uint32 secs\nuint32 nsecs",
        "duration": "int32 secs\nint32 nsecs",
    },
    "ros2": {
        "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
        "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
    },
}


def message_type(name: str, text: str, dialect: str) -> Struct:
    """The type of message `name`; `dialect` "ros1" or "ros2".

    Raises Undecodable: a line that is no definition, a type that is not defined, contains itself or is not read.
    """
    parts = {short(key): body for key, body in _BUILT_IN[dialect].items()} | _parts(name, text)
    return _Builder(parts, _ROS1 if dialect == "ros1" else _ROS2, dialect == "ros1").struct(short(name), 0)


def short(name: str) -> str:
    """package/Type of package/msg/Type."""
    package, _, rest = name.partition("/")
    return f"{package}/{rest.rpartition('/')[2]}" if rest else name


def _parts(name: str, text: str) -> dict[str, str]:
    """Definitions by name: the first is that of `name`, the others follow lines of "=" and "MSG: name"."""
    first, *others = re.split(r"^={3,}\s*$", text, flags=re.MULTILINE)
    found = {short(name): first}
    for part in others:
        head, _, body = part.strip().partition("\n")
        if not head.startswith("MSG:"):
            raise Undecodable(f"a definition without a name: {head[:40]!r}")
        found.setdefault(short(head[4:].strip()), body)
    return found


class _Builder:
    """Types of a schema, each built once."""

    def __init__(self, parts: Mapping[str, str], numbers: Mapping[str, str], ros1: bool) -> None:
        self.parts, self.numbers, self.ros1 = parts, numbers, ros1
        self.done: dict[str, Struct] = {}

    def struct(self, name: str, depth: int) -> Struct:
        if depth > _DEEPEST:
            raise Undecodable(f"{name} contains itself, or is nested too deep")
        if name not in self.done:
            package = name.partition("/")[0]
            lines = _lines(self.parts[name])
            fields = tuple((field, self.type(kind, array, package, depth)) for field, kind, array in lines)
            self.done[name] = Struct(fields or (() if self.ros1 else (("structure_needs_at_least_one_member", _BYTE),)))
        return self.done[name]

    def type(self, name: str, array: str | None, package: str, depth: int) -> Type:
        item = self.item(name, package, depth)
        if array is None:
            return item
        count = int(array[1:-1]) if array[1:-1].isdecimal() else None
        if count is not None and count > _LARGEST:
            raise Undecodable("an array of more items than can be")
        return Array(item, count)

    def item(self, name: str, package: str, depth: int) -> Type:
        if name in self.numbers:
            return Number(self.numbers[name])
        if name == "string":
            return Text()
        for known in (name, "std_msgs/Header" if name == "Header" else f"{package}/{name}", short(name)):
            if known in self.parts:
                return self.struct(known, depth + 1)
        raise Undecodable(f"type {name} is not defined" if name != "wstring" else "strings of wide characters")


_BYTE: Final = Number("u1")


def _lines(text: str) -> Iterator[tuple[str, str, str | None]]:
    """(field, type, array brackets) of each field; constants and comments are none."""
    for line in text.splitlines():
        bare = line.partition("#")[0].strip()
        if not bare:
            continue
        found = _FIELD.match(bare)
        if found is None:
            raise Undecodable(f"a line that defines no field: {bare[:60]!r}")
        name, _, array, field, rest = found.groups()
        if not rest.startswith("="):
            yield field, name, array
