"""MCAP logs for tests: written by the mcap library, and read by it as the oracle; damage of one known field."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from nineaudit.readers.contents import Contents
from nineaudit.readers.mcap.parse import Channel
from nineaudit.readers.mcap.reader import read_mcap
from nineaudit.readers.mcap.records import Batch
from nineaudit.rig import Rig, parse_rig

COMPRESSIONS = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}
STEP_NS = 10**6


def rig_of(*signals: str, recording: str = "") -> Rig:
    """A rig whose sensors c0, c1, ... are these signals."""
    sensors = "".join(
        f'[[sensor]]\nchannel="c{k}"\nkind="accelerometer"\nposition=[0,0,0]\naxis=[1,0,0]\nsignal="{signal}"\n'
        for k, signal in enumerate(signals)
    )
    return parse_rig(f'[rig]\nname="t"\n[units]\nacceleration="m/s^2"\n{recording}{sensors}')


def value(i: int, k: int = 0) -> float:
    """The number that message i carries."""
    return float(np.sin(0.7 * i + k)) * (i + 1)


def write_log(
    path: Path,
    count: int = 120,
    *,
    compression: str = "zstd",
    chunk_size: int = 900,
    data_crcs: bool = True,
    attachment: bool = False,
    **options: Any,
) -> Path:
    """JSON messages p, q on /imu, others on /other, in several chunks."""
    with path.open("wb") as file:
        settings: dict[str, Any] = {"compression": COMPRESSIONS[compression], "chunk_size": chunk_size}
        writer = Writer(file, enable_data_crcs=data_crcs, **settings, **options)
        writer.start()
        schema = writer.register_schema("s", "jsonschema", b"{}")
        imu = writer.register_channel("/imu", "json", schema)
        other = writer.register_channel("/other", "json", schema)
        for i in range(count):
            data = json.dumps({"p": value(i), "q": value(i, 1)}).encode()
            writer.add_message(imu, log_time=i * STEP_NS, publish_time=0, data=data, sequence=i)
            if i % 3 == 0:
                writer.add_message(other, log_time=i * STEP_NS, publish_time=0, data=b'{"r": 1}', sequence=i)
        if attachment:
            writer.add_attachment(0, 0, "photo.txt", "text/plain", b"a photograph")
        writer.finish()  # type: ignore[no-untyped-call]
    return path


PQ = rig_of("/imu:p", "/imu:q")


def records(data: bytes, at: int = 8) -> list[tuple[int, int, int]]:
    """(opcode, begin, end) of each record outside chunks, by the specification."""
    found = []
    while at < len(data) - 8:
        op, size = struct.unpack_from("<BQ", data, at)
        found.append((op, at, at + 9 + size))
        at += 9 + size
    return found


def of(data: bytes, opcode: Opcode) -> list[tuple[int, int]]:
    """(begin, end) of the records of one kind."""
    return [(at, end) for op, at, end in records(data) if op == opcode]


def oracle(path: Path, topic: str) -> list[tuple[int, bytes]]:
    """(log time, data) of a topic's messages, by the mcap library."""
    topics, found = {}, []
    with path.open("rb") as file:
        for record in StreamReader(file, validate_crcs=True).records:
            kind = type(record).__name__
            if kind == "Channel":
                topics[record.id] = record.topic
            elif kind == "Message" and topics[record.channel_id] == topic:
                found.append((record.log_time, record.data))
    return found


def pairs(contents: Contents) -> list[tuple[float, ...]]:
    """(time, values...) of each sample."""
    return list(zip(contents.traces[0].time.tolist(), *(t.values.tolist() for t in contents.traces), strict=True))


def pq(path: Path) -> Contents:
    return read_mcap(path, PQ)


def expected(count: int = 120) -> list[tuple[float, ...]]:
    """What a whole log of write_log holds."""
    return [(i * STEP_NS * 1e-9, value(i), value(i, 1)) for i in range(count)]


def batch_of(messages: list[bytes], *, before: bytes = b"\xa5\x5a\x01") -> Batch:
    """Messages in one chunk, each behind bytes that are none of its own."""
    data = b"".join(before + m for m in messages)
    sizes = np.array([len(m) for m in messages], dtype=np.int64)
    ends = np.cumsum(sizes + len(before))
    count = np.arange(len(messages), dtype=np.int64)
    return Batch(Channel(1, 1, "/t", ""), data, ends - sizes, ends, count, count, 0)


Messages = dict[str, dict[str, list[float]]]
"""Of each message inside the message its fields, and of each field a value a message."""


def in_encoding(path: Path, encoding: str, times: list[float], messages: Messages) -> None:
    """Messages of `time_s` and of messages of numbers: "ros1", "ros2" (fields in order, without gaps), "protobuf"."""
    schema, wire = _described(encoding, messages)
    columns = [times, *(values for fields in messages.values() for values in fields.values())]
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=20_000)
        writer.start()
        number = writer.register_schema("test.Array" if encoding == "protobuf" else "test/msg/Array", *schema)
        channel = writer.register_channel("/array", wire, number)
        for i, row in enumerate(zip(*columns, strict=True)):
            writer.add_message(channel, log_time=i * 100_000, publish_time=0, data=_packed(encoding, row, messages))
        writer.finish()  # type: ignore[no-untyped-call]


def _described(encoding: str, messages: Messages) -> tuple[tuple[str, bytes], str]:
    """(encoding, text) of the schema, and the encoding of messages."""
    if encoding == "protobuf":
        return ("protobuf", _descriptors(messages).SerializeToString()), "protobuf"
    text = "float64 time_s\n" + "".join(f"test/{name.replace('_', '')} {name}\n" for name in messages)
    for name, fields in messages.items():
        text += "=" * 80 + f"\nMSG: test/{name.replace('_', '')}\n" + "".join(f"float64 {f}\n" for f in fields)
    return (("ros1msg", text.encode()), "ros1") if encoding == "ros1" else (("ros2msg", text.encode()), "cdr")


def _descriptors(messages: Messages) -> Any:
    from google.protobuf.descriptor_pb2 import FileDescriptorSet

    found = FileDescriptorSet()
    file = found.file.add(name="array.proto", package="test", syntax="proto3")
    whole = file.message_type.add(name="Array")
    whole.field.add(name="time_s", number=1, type=1, label=1)
    for k, (name, fields) in enumerate(messages.items()):
        whole.field.add(name=name, number=k + 2, type=11, label=1, type_name=f".test.{name}")
        inner = file.message_type.add(name=name)
        for j, field in enumerate(fields):
            inner.field.add(name=field, number=j + 1, type=1, label=1)
    return found


def _packed(encoding: str, row: tuple[float, ...], messages: Messages) -> bytes:
    if encoding != "protobuf":
        return (b"\0\1\0\0" if encoding == "ros2" else b"") + struct.pack(f"<{len(row)}d", *row)
    values = iter(row)
    out = _double(1, next(values))
    for k, fields in enumerate(messages.values()):
        inner = b"".join(_double(j + 1, next(values)) for j in range(len(fields)))
        out += bytes([k + 2 << 3 | 2, len(inner)]) + inner
    return out


def _double(number: int, value: float) -> bytes:
    return bytes([number << 3 | 1]) + struct.pack("<d", value)
