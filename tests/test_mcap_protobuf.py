"""Protobuf messages in MCAP: random descriptors and messages, whole, merged and damaged, against the library."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer

from mcap_logs import batch_of, pairs, rig_of
from nineaudit.errors import RecordingError
from nineaudit.readers.mcap.columns import Undecodable, is_number
from nineaudit.readers.mcap.parse import Schema
from nineaudit.readers.mcap.protobuf import Protobuf, message_class
from nineaudit.readers.mcap.reader import read_mcap

SEVERAL = settings(derandomize=True, max_examples=60, deadline=None)
# Numbers of FieldDescriptor.Type with the smallest and largest value.
INTEGERS = {3: (-(2**63), 2**63 - 1), 4: (0, 2**64 - 1), 5: (-(2**31), 2**31 - 1), 6: (0, 2**64 - 1), 7: (0, 2**32 - 1)}
INTEGERS |= {13: (0, 2**32 - 1), 15: (-(2**31), 2**31 - 1), 16: (-(2**63), 2**63 - 1)}
INTEGERS |= {17: (-(2**31), 2**31 - 1), 18: (-(2**63), 2**63 - 1)}
SCALARS = [1, 2, 8, 9, *INTEGERS]  # 1 double, 2 float, 8 bool, 9 string


class Kinds:
    """Random message types in one file, proto2 or proto3."""

    def __init__(self, draw: random.Random, *, oneofs: bool = False) -> None:
        self.draw, self.oneofs = draw, oneofs
        self.proto3 = draw.random() < 0.6
        self.file = descriptor_pb2.FileDescriptorProto(name="t.proto", package="t")
        self.file.syntax = "proto3" if self.proto3 else "proto2"
        self.add(0)
        pool = descriptor_pool.DescriptorPool()
        pool.Add(self.file)
        self.kind: Any = message_factory.GetMessageClass(pool.FindMessageTypeByName("t.M0"))

    def add(self, depth: int) -> str:
        made = self.file.message_type.add(name=f"M{len(self.file.message_type)}")
        for k in range(self.draw.randrange(1, 6)):
            nested = self.draw.random() < 0.35 and depth < 3
            of = {"type": 11, "type_name": self.add(depth + 1)} if nested else {"type": self.draw.choice(SCALARS)}
            label = self.draw.choice([1, 1, 1, 3])
            number = self.draw.choice([k + 1, 20 + k, 3000 + k])
            field = made.field.add(name=f"f{k}", number=number, label=label, **of)
            if label == 3 and not nested and of["type"] != 9:
                field.options.packed = self.draw.random() < 0.5
            elif self.proto3 and label == 1 and not nested and self.draw.random() < 0.3:
                field.proto3_optional = True
                field.oneof_index = len(made.oneof_decl)
                made.oneof_decl.add(name=f"_f{k}")
        if self.oneofs:
            made.oneof_decl.add(name="either")
            for name, number in (("left", 91), ("right", 92)):
                made.field.add(name=name, number=number, label=1, type=1, oneof_index=len(made.oneof_decl) - 1)
            self.synthetic_last(made)
        return f".t.{made.name}"

    @staticmethod
    def synthetic_last(made: Any) -> None:
        """Oneofs of optional fields must stand behind the others."""
        real = len(made.oneof_decl) - 1
        names = [o.name for o in made.oneof_decl]
        del made.oneof_decl[:]
        for name in [names[real], *names[:real]]:
            made.oneof_decl.add(name=name)
        for field in made.field:
            if field.HasField("oneof_index"):
                field.oneof_index = 0 if field.oneof_index == real else field.oneof_index + 1

    def message(self, kind: Any = None) -> Any:
        message = (kind or self.kind)()
        for field in message.DESCRIPTOR.fields:
            if self.draw.random() < 0.25:
                continue
            if field.is_repeated:
                values = [self.value(field) for _ in range(self.draw.randrange(4))]
                getattr(message, field.name).extend(values)
            elif field.message_type is not None:
                getattr(message, field.name).CopyFrom(self.value(field))
            else:
                setattr(message, field.name, self.value(field))
        return message

    def value(self, field: Any) -> Any:
        if field.message_type is not None:
            return self.message(message_factory.GetMessageClass(field.message_type))
        if field.type in INTEGERS:
            low, high = INTEGERS[field.type]
            return self.draw.choice([0, low, high, self.draw.randint(low, high), self.draw.randint(0, 300)])
        if field.type in (1, 2):
            return self.draw.choice([0.0, -2.5, float("nan"), float("inf"), float(np.float32(self.draw.gauss(0, 9)))])
        return "wörd" if field.type == 9 else self.draw.random() < 0.5


def expected(message: Any, path: str) -> Any:
    """The number at a path, as the library gives it; None where it is not set or a sequence is too short."""
    names = path.split(".")
    while names:
        field = message.DESCRIPTOR.fields_by_name[names.pop(0)]
        if field.has_presence and not message.HasField(field.name):
            return None
        message = getattr(message, field.name)
        if field.is_repeated:
            item = int(names.pop(0))
            message = message[item] if item < len(message) else None
        if message is None:
            return None
    return message


def paths_of(decoder: Protobuf) -> list[str]:
    """Paths of all numbers, and of the third item of what is repeated."""
    found = decoder.leaves(batch_of([b""]))[:30]
    return [*found, *(p.replace(".0", ".2", 1) for p in found if ".0" in p)]


def check(decoder: Protobuf, raw: list[bytes]) -> None:
    """Numbers as the library's, wherever it decodes a message; where it does not, ours may be more lenient only in
    what is not asked for (text that is not UTF-8, nested messages)."""
    paths = paths_of(decoder)
    found = decoder.read(batch_of(raw), paths)
    for k, data in enumerate(raw):
        try:
            message = decoder.kind.FromString(data)
        except DecodeError:
            continue
        assert found.good[k]
        for path, column in zip(paths, found.columns, strict=True):
            value = expected(message, path)
            assert column.there[k] == is_number(value), path
            assert not column.there[k] or column.values[k] == value, path


@given(st.integers(0, 10**9), st.booleans())
@SEVERAL
def test_random_messages(seed: int, oneofs: bool) -> None:
    kinds = Kinds(random.Random(seed), oneofs=oneofs)
    check(Protobuf(kinds.kind), [kinds.message().SerializeToString() for _ in range(8)])


@given(st.integers(0, 10**9))
@SEVERAL
def test_messages_in_parts(seed: int) -> None:
    """One message behind another is both merged: the last number holds, sequences and nested messages are joined."""
    kinds = Kinds(random.Random(seed))
    raw = [kinds.message().SerializeToString() + kinds.message().SerializeToString() for _ in range(8)]
    check(Protobuf(kinds.kind), raw)


@given(st.integers(0, 10**9))
@SEVERAL
def test_messages_that_are_changed(seed: int) -> None:
    draw = random.Random(seed)
    kinds = Kinds(draw)
    raw = []
    for _ in range(8):
        data = bytearray(kinds.message().SerializeToString() or b"\x08")
        at = draw.randrange(len(data))
        change = draw.randrange(4)
        if change == 0:
            data[at] ^= 1 << draw.randrange(8)
        elif change == 1:
            del data[at:]
        elif change == 2:
            data[at:at] = draw.randbytes(3)
        else:
            data[at:at] = b"\xff" * draw.randrange(1, 12)
        raw.append(bytes(data))
    check(Protobuf(kinds.kind), raw)


@pytest.mark.parametrize(
    ("data", "good"),
    [
        (b"\x09" + b"\0" * 8, True),
        (b"\x09" + b"\0" * 7, False),
        (b"\x0b\x0c", True),  # a group
        (b"\x0f", False),
        (b"\x00\x00", False),
        (b"\x10" + b"\xff" * 9 + b"\x01", True),
        (b"\x10" + b"\xff" * 10 + b"\x01", False),
        (b"\x12\xff\xff\xff\xff\x0f", False),
        (b"\x12\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01", False),
        (b"\x80", False),
    ],
)
def test_the_wire_format(data: bytes, good: bool) -> None:
    decoder = Protobuf(simple())
    found = decoder.read(batch_of([data, b"\x09" + b"\0" * 8]), ["x"])
    assert found.good.tolist() == [good, True]


def simple() -> Any:
    pool = descriptor_pool.DescriptorPool()
    pool.Add(descriptors().file[0])
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("t.Imu"))


def descriptors() -> Any:
    found = descriptor_pb2.FileDescriptorSet()
    file = found.file.add(name="imu.proto", package="t", syntax="proto3")
    vector = file.message_type.add(name="Vector")
    for number, name in enumerate("xyz", 1):
        vector.field.add(name=name, number=number, type=1, label=1)
    stamp = file.message_type.add(name="Stamp")
    stamp.field.add(name="seconds", number=1, type=3, label=1)
    stamp.field.add(name="nanos", number=2, type=5, label=1)
    imu = file.message_type.add(name="Imu")
    imu.field.add(name="x", number=1, type=1, label=1)
    imu.field.add(name="stamp", number=5, type=11, label=1, type_name=".t.Stamp")
    imu.field.add(name="acc", number=6, type=11, label=1, type_name=".t.Vector")
    return found


def test_a_file_with_stamps(tmp_path: Path) -> None:
    path, kind = tmp_path / "t.mcap", simple()
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=500)
        writer.start()
        schema = writer.register_schema("t.Imu", "protobuf", descriptors().SerializeToString())
        channel = writer.register_channel("/imu", "protobuf", schema)
        for i in range(60):
            stamp = {"seconds": 1_700_000_000, "nanos": i * 10**7}
            message = kind(stamp=stamp, acc={"x": i - 5.0, "y": i * 1.5} if i != 9 else None)
            data = message.SerializeToString() + (b"\x80" if i == 20 else b"")
            writer.add_message(channel, log_time=i, publish_time=0, data=data)
        writer.finish()
    recording = '[recording]\ntime="stamp"\n'
    found = read_mcap(path, rig_of("/imu:acc.x", "/imu:acc.y", recording=recording))
    sample = pairs(found)
    assert np.isnan(sample.pop(9)[1:]).all()
    assert sample == [((i * 10**7) * 1e-9, i - 5.0, i * 1.5) for i in range(60) if i not in (9, 20)]
    assert [d.what for d in found.damage] == ["topic /imu: a message that cannot be decoded"]
    assert found.counts["undecodable_messages"] == 1
    assert found.counts["messages_without_time"] == 1
    assert found.counts["invalid_values"] == 2
    with pytest.raises(RecordingError, match=r"missing channel 'c0'.*did you mean 'acc\.[xyz]'"):
        read_mcap(path, rig_of("/imu:acc.w"))


@pytest.mark.parametrize(
    "data", [b"\xff", b"", descriptors().SerializeToString()[:-9], b"\x0a\x04\x0a\x02\xff\xfe", b"\x0a\x05\x1a\x03abc"]
)
def test_descriptors_that_cannot_be_read(data: bytes) -> None:
    with pytest.raises(Undecodable, match=r"descriptors that do not describe t\.Imu"):
        message_class(Schema(1, "t.Imu", "protobuf", data))
