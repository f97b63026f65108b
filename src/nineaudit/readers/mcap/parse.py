"""Records of an MCAP log, each against the bytes that are there. No length is believed.

Source: MCAP file format specification, mcap.dev/spec: "Records" and "Serialization". All integers little-endian;
strings, arrays and maps carry their length in bytes as uint32.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Int64 = NDArray[np.int64]
Data = bytes | memoryview

MAGIC: Final = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(9, 16)
"""Opcodes."""
RECORD_HEAD: Final = 9
"""Bytes of opcode (uint8) and length (uint64)."""
MESSAGE_HEAD: Final = 22
"""Bytes of a message before its data: channel id 2, sequence 4, log time 8, publish time 8."""

_RECORD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQI")
_CHUNK_INDEX = struct.Struct("<QQQQ")
_STATISTICS = struct.Struct("<QHIIIIQQ")
_FOOTER = struct.Struct("<QQI")


class Malformed(Exception):
    """A record that does not hold what its kind must; never leaves the MCAP reader."""


class Record(NamedTuple):
    """A record: its opcode, the byte at which it begins, and where its content begins and ends."""

    op: int
    at: int
    start: int
    end: int


class Schema(NamedTuple):
    id: int
    name: str
    encoding: str
    data: bytes


class Channel(NamedTuple):
    id: int
    schema_id: int
    topic: str
    encoding: str


class Chunk(NamedTuple):
    """A chunk's header: stated size and CRC of its records, and where the compressed records begin and end."""

    at: int
    size: int
    crc: int
    compression: str
    start: int
    end: int


class Index(NamedTuple):
    """A message index: log times in ns and offsets in the chunk, (n,) each, of one channel's messages."""

    channel: int
    times: Int64
    offsets: Int64


class Statistics(NamedTuple):
    messages: int
    chunks: int
    attachments: int
    by_channel: Mapping[int, int]


class Footer(NamedTuple):
    summary_start: int
    crc: int


def record_at(data: Data, at: int, end: int) -> Record:
    """The record that begins at byte `at`. Raises Malformed where it does not fit before `end`."""
    if at + RECORD_HEAD > end:
        raise Malformed("cut short within the head of a record")
    op, size = _RECORD.unpack_from(data, at)
    if size > end - at - RECORD_HEAD:
        raise Malformed("a record longer than what is left")
    return Record(op, at, at + RECORD_HEAD, at + RECORD_HEAD + size)


def records(data: Data, at: int, end: int) -> Iterator[Record]:
    """Records one after the other. Raises Malformed at the first that does not fit."""
    while at < end:
        record = record_at(data, at, end)
        yield record
        at = record.end


def schema(data: Data, record: Record) -> Schema:
    (number,) = _unpack(struct.Struct("<H"), data, record)
    name, at = _text(data, record.start + 2, record.end)
    encoding, at = _text(data, at, record.end)
    start, end = _prefixed(data, at, record.end)
    return Schema(number, name, encoding, bytes(data[start:end]))


def channel(data: Data, record: Record) -> Channel:
    number, schema_id = _unpack(struct.Struct("<HH"), data, record)
    topic, at = _text(data, record.start + 4, record.end)
    encoding, _ = _text(data, at, record.end)
    return Channel(number, schema_id, topic, encoding)


def chunk(data: Data, record: Record) -> Chunk:
    _, _, size, crc = _unpack(_CHUNK, data, record)
    compression, at = _text(data, record.start + _CHUNK.size, record.end)
    start, end = _prefixed(data, at, record.end, "<Q")
    return Chunk(record.at, size, crc, compression, start, end)


def index(data: Data, record: Record) -> Index:
    (number,) = _unpack(struct.Struct("<H"), data, record)
    start, end = _prefixed(data, record.start + 2, record.end)
    pairs = np.frombuffer(data, dtype="<i8", count=(end - start) // 16 * 2, offset=start).reshape(-1, 2)
    return Index(number, pairs[:, 0], pairs[:, 1])


def metadata(data: Data, record: Record) -> tuple[str, dict[str, str]]:
    """A metadata record's name and its keys and values."""
    name, at = _text(data, record.start, record.end)
    at, end = _prefixed(data, at, record.end)
    found = {}
    while at < end:
        key, at = _text(data, at, end)
        found[key], at = _text(data, at, end)
    return name, found


def attachment(data: Data, record: Record) -> tuple[int, int]:
    """An attachment's CRC, and the byte where it stands: it is that of the record's content before it."""
    _, at = _text(data, record.start + 16, record.end)
    _, at = _text(data, at, record.end)
    _, at = _prefixed(data, at, record.end, "<Q")
    return _number(data, at, record.end, "<I"), at


def statistics(data: Data, record: Record) -> Statistics:
    messages, _, _, attachments, _, chunks, _, _ = _unpack(_STATISTICS, data, record)
    start, end = _prefixed(data, record.start + _STATISTICS.size, record.end)
    whole = end - (end - start) % 10
    counts = dict(struct.Struct("<HQ").iter_unpack(data[start:whole]))
    return Statistics(messages, chunks, attachments, counts)


def chunk_offset(data: Data, record: Record) -> int:
    """Where the chunk begins that a chunk index is of."""
    return int(_unpack(_CHUNK_INDEX, data, record)[2])


def footer(data: Data, record: Record) -> Footer:
    start, _, crc = _unpack(_FOOTER, data, record)
    return Footer(start, crc)


def data_end(data: Data, record: Record) -> int:
    """The CRC of the data section, 0 for none."""
    return _number(data, record.start, record.end, "<I")


def _unpack(shape: struct.Struct, data: Data, record: Record) -> tuple[int, ...]:
    if record.end - record.start < shape.size:
        raise Malformed("a record shorter than its kind must be")
    return shape.unpack_from(data, record.start)


def _number(data: Data, at: int, end: int, shape: str) -> int:
    size = struct.calcsize(shape)
    if at + size > end:
        raise Malformed("a record shorter than its kind must be")
    return int(struct.unpack_from(shape, data, at)[0])


def _prefixed(data: Data, at: int, end: int, shape: str = "<I") -> tuple[int, int]:
    """Where a field of stated length begins and ends."""
    size = _number(data, at, end, shape)
    start = at + struct.calcsize(shape)
    if size > end - start:
        raise Malformed("a field longer than its record")
    return start, start + size


def _text(data: Data, at: int, end: int) -> tuple[str, int]:
    start, stop = _prefixed(data, at, end)
    try:
        return str(bytes(data[start:stop]), "utf-8"), stop
    except UnicodeDecodeError as error:
        raise Malformed("text that is not UTF-8") from error
