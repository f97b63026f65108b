"""Is a BLF log whole? python-can reads one to wherever it ends and is silent about the rest.

A BLF file is a header and a chain of objects, most of them containers of deflated objects; an object is the
signature LOBJ, its header's size, the header's version, its own size and its type. As python-can's blf.py has it
(after Vector BLF by T. Lorenz), padding included.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

_FILE = struct.Struct("<4sL8xQQL")  # signature, header size, (versions), file size, inflated size, objects
_OBJECT = struct.Struct("<4sHHLL")  # signature, header size, header version, object size, type
_CONTAINER = struct.Struct("<H6xL4x")  # compression method, inflated size
_MARKER = struct.Struct("<LLL3xBLLL12x")  # ..., length of group name, of marker name, of description
_CONTAINER_TYPE, _MARKER_TYPE = 10, 96
_DEFLATED = 2


@dataclass(frozen=True)
class Scan:
    """`objects` in the containers; texts of global `markers`; `damage` in words and its `place`, None if whole."""

    objects: int = 0
    markers: tuple[str, ...] = ()
    damage: str | None = None
    place: str | None = None
    notes: tuple[str, ...] = ()


class _Damage(Exception):
    """Where the chain breaks; scan turns it into words."""

    def __init__(self, what: str, at: int | None = None) -> None:
        super().__init__(what)
        self.place = None if at is None else f"byte {at}"


def scan(data: bytes) -> Scan:
    """Follow the chain of objects of a BLF file to its end."""
    if len(data) < _FILE.size:
        return Scan(damage="the header is not whole", place=f"byte {len(data)}")
    _, start, size, _, stated = _FILE.unpack_from(data)
    stream = bytearray()
    try:
        for content in _containers(data, start):
            stream += content
        if len(data) < size:
            raise _Damage(f"{len(data)} of {size} bytes are there", len(data))
        objects, markers = _objects(bytes(stream))
    except _Damage as damage:
        return Scan(damage=str(damage), place=damage.place)
    notes = (f"the header counts {stated} objects, {objects} are there",) if stated != objects else ()
    return Scan(objects, tuple(markers), notes=notes)


def _containers(data: bytes, at: int) -> Iterator[bytes]:
    while at < len(data):
        if at + _OBJECT.size > len(data):
            raise _Damage("an object's header is not whole", at)
        signature, header, _, size, kind = _OBJECT.unpack_from(data, at)
        if signature != b"LOBJ" or size < _OBJECT.size:
            raise _Damage("no object where one must begin", at)
        if at + size > len(data):
            raise _Damage(f"an object of {size} bytes is cut after {len(data) - at}", at)
        if kind == _CONTAINER_TYPE:
            yield _inflate(data[at + header : at + size], at)
        else:
            yield data[at : at + size] + b"\0" * (-size % 4)
        at += size + size % 4


def _inflate(content: bytes, at: int) -> bytes:
    if len(content) < _CONTAINER.size:
        raise _Damage("a container without content", at)
    method, stated = _CONTAINER.unpack_from(content)
    inflated = content[_CONTAINER.size :]
    if method == _DEFLATED:
        try:
            inflated = zlib.decompress(inflated)
        except zlib.error as error:
            raise _Damage(f"a container cannot be inflated ({error})", at) from error
    if len(inflated) != stated:
        raise _Damage(f"a container holds {len(inflated)} bytes, its header says {stated}", at)
    return inflated


def _objects(stream: bytes) -> tuple[int, list[str]]:
    """Number of objects in the inflated stream and the texts of its global markers."""
    count, at, markers = 0, 0, []
    while True:
        begin = stream.find(b"LOBJ", at, at + 8)
        if begin < 0:
            break
        if begin + _OBJECT.size > len(stream):
            raise _Damage("the last object is not whole")
        _, header, _, size, kind = _OBJECT.unpack_from(stream, begin)
        if size < _OBJECT.size or begin + size > len(stream):
            raise _Damage("the last object is not whole")
        if kind == _MARKER_TYPE and begin + header + _MARKER.size <= len(stream):
            length = _MARKER.unpack_from(stream, begin + header)[4]
            text = begin + header + _MARKER.size
            markers.append(stream[text : text + length].decode("latin-1"))
        count, at = count + 1, begin + size
    if len(stream) - at >= 8:
        raise _Damage(f"object {count + 1} does not begin where object {count} ends")
    return count, markers
