"""Numbers out of many protobuf messages at once, by the descriptors that the log carries.

What the walk of the wire format cannot read (groups, oneofs, maps, packed varints) the protobuf library reads.
Source: protobuf.dev, "Application Note: Field Presence": a field with presence that is not set has no number, one
without is 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from nineaudit.array import BoolArray
from nineaudit.readers.mcap.columns import Column, Decoded, Undecodable, numbers
from nineaudit.readers.mcap.parse import Int64, Schema
from nineaudit.readers.mcap.records import Batch
from nineaudit.readers.mcap.wire import I32, I64, VARINT, Scalar, Want, Wants, walked

if TYPE_CHECKING:
    from google.protobuf.descriptor import Descriptor, FieldDescriptor

# Numbers of FieldDescriptor.Type.
_SCALARS: Final = {
    1: Scalar(I64, "f8"),  # double
    2: Scalar(I32, "f4"),  # float
    3: Scalar(VARINT, "i8"),  # int64
    4: Scalar(VARINT, "u8"),  # uint64
    5: Scalar(VARINT, "i4"),  # int32
    6: Scalar(I64, "u8"),  # fixed64
    7: Scalar(I32, "u4"),  # fixed32
    13: Scalar(VARINT, "u4"),  # uint32
    14: Scalar(VARINT, "i4"),  # enum
    15: Scalar(I32, "i4"),  # sfixed32
    16: Scalar(I64, "i8"),  # sfixed64
    17: Scalar(VARINT, "i4", zigzag=True),  # sint32
    18: Scalar(VARINT, "i8", zigzag=True),  # sint64
}


def message_class(schema: Schema) -> Any:
    """The library's class of a schema's messages. Raises Undecodable: descriptors that are none or lack the message."""
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.descriptor_pool import DescriptorPool
    from google.protobuf.message import DecodeError
    from google.protobuf.message_factory import GetMessageClass

    pool = DescriptorPool()
    try:
        files = {file.name: file for file in FileDescriptorSet.FromString(schema.data).file}
        while files:
            _add(next(iter(files)), files, pool)
        return GetMessageClass(pool.FindMessageTypeByName(schema.name))
    except (DecodeError, TypeError, KeyError, ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())[:120]
        raise Undecodable(f"descriptors that do not describe {schema.name}: {reason}") from error


def _add(name: str, files: dict[str, Any], pool: Any) -> None:
    """A file and, before it, those that it imports."""
    file = files.pop(name)
    for other in file.dependency:
        if other in files:
            _add(other, files, pool)
    pool.Add(file)


@dataclass(frozen=True, eq=False)
class Protobuf:
    """Decoder of messages of one class of the protobuf library."""

    kind: Any

    def has(self, path: str, batch: Batch) -> bool:  # noqa: ARG002
        """Whether the message type has a number at a path."""
        return _field_path(self.kind.DESCRIPTOR, path) is not None

    def leaves(self, batch: Batch) -> list[str]:  # noqa: ARG002
        """Paths of the type's numbers, of repeated ones the first."""
        return list(_leaves(self.kind.DESCRIPTOR, "", 0))

    def read(self, batch: Batch, paths: Sequence[str]) -> Decoded:
        """The numbers at paths. A message that the wire format or the library refuses is not good."""
        places = [_field_path(self.kind.DESCRIPTOR, path) for path in paths]
        if any(_intricate(place) for place in places if place):
            return Decoded(*_by_library(self.kind, batch, np.arange(len(batch)), places))
        found = walked(batch, _wants(places), [_dtype(place) for place in places])
        odd = np.flatnonzero(found.odd)
        if len(odd):
            columns, found.good[odd] = _by_library(self.kind, batch, odd, places)
            for ours, theirs in zip(found.columns, columns, strict=True):
                ours.values[odd], ours.there[odd] = theirs.values, theirs.there
        return Decoded(found.columns, found.good)


Place = list[tuple["FieldDescriptor", int]]
"""Fields from the message down, and of each the item (0 where it is not repeated)."""


def _field_path(kind: Descriptor, path: str) -> Place | None:
    """The fields of a path to a number, None where it leads to none."""
    place: Place = []
    names = path.split(".")
    while names:
        found = kind.fields_by_name.get(names.pop(0)) if kind is not None else None
        if found is None or (found.is_repeated and not (names and names[0].isdecimal())):
            return None
        place.append((found, int(names.pop(0)) if found.is_repeated else 0))
        kind = found.message_type
    return place if place and place[-1][0].type in _SCALARS else None


def _dtype(place: Place | None) -> str:
    return _SCALARS[place[-1][0].type].dtype if place else "f8"


def _intricate(place: Place) -> bool:
    """Whether only the library may read a field: one of a oneof, or in a map."""
    of = [f.containing_oneof for f, _ in place]
    maps = [f.message_type is not None and f.message_type.GetOptions().map_entry for f, _ in place]
    return any(o is not None and len(o.fields) > 1 for o in of) or any(maps)


def _leaves(kind: Descriptor, prefix: str, depth: int) -> Iterator[str]:
    for found in kind.fields:
        name = f"{prefix}{found.name}" + (".0" if found.is_repeated else "")
        if found.type in _SCALARS:
            yield name
        elif found.message_type is not None and depth < 5:
            yield from _leaves(found.message_type, f"{name}.", depth + 1)


def _wants(places: Sequence[Place | None]) -> Wants:
    """Places as a tree of fields."""
    tree: Wants = {}
    for column, place in enumerate(places):
        level = tree
        for found, item in place or ():
            want = level.setdefault(found.number, _want(found))
            if want.scalar is None:
                level = want.inner.setdefault(item, {})
            else:
                want.columns.setdefault(item, []).append(column)
    return tree


def _want(found: FieldDescriptor) -> Want:
    present = not found.has_presence and not found.is_repeated
    return Want(_SCALARS.get(found.type), found.is_repeated, present)


def _by_library(
    kind: Any, batch: Batch, rows: Int64, places: Sequence[Place | None]
) -> tuple[tuple[Column, ...], BoolArray]:
    """Columns of some messages of a batch as the library decodes them, and which it could."""
    from google.protobuf.message import DecodeError

    messages: list[Any] = []
    for start, end in zip(batch.starts[rows].tolist(), batch.ends[rows].tolist(), strict=True):
        try:
            messages.append(kind.FromString(bytes(batch.data[start:end])))
        except DecodeError:
            messages.append(None)
    columns = (numbers([_value(m, place) for m in messages], _dtype(place)) for place in places)
    return tuple(columns), np.array([m is not None for m in messages], dtype=bool)


def _value(message: Any, place: Place | None) -> Any:
    if place is None:
        return None
    for found, item in place:
        if message is None or (found.has_presence and not message.HasField(found.name)):
            return None
        message = getattr(message, found.name)
        if found.is_repeated:
            message = message[item] if item < len(message) else None
    return message
