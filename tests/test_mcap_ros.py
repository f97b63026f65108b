"""ROS messages in MCAP: random types, both byte orders, against the mcap library's decoder and what was written."""

from __future__ import annotations

import random
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap_ros2._dynamic import generate_dynamic

from mcap_logs import batch_of, pairs, rig_of
from nineaudit.errors import RecordingError
from nineaudit.readers.mcap.cdr import Ros
from nineaudit.readers.mcap.columns import Undecodable, is_number
from nineaudit.readers.mcap.fields import leaves, lookup
from nineaudit.readers.mcap.reader import read_mcap
from nineaudit.readers.mcap.ros import message_type

CODES = {"float32": "f", "float64": "d", "bool": "?", "byte": "B", "uint8": "B", "int8": "b"}
CODES |= {"int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q"}
SEVERAL = settings(derandomize=True, max_examples=60, deadline=None)
# encapsulation: representation identifier, byte order, largest alignment
CDR = {"big": (0, ">", 8), "little": (1, "<", 8), "XCDR2 big": (6, ">", 4), "XCDR2": (7, "<", 4)}


class Kinds:
    """Random message definitions: {name: [(field, type, array)]}; array None, a number, or "" for a sequence."""

    def __init__(self, draw: random.Random) -> None:
        self.draw, self.of = draw, dict[str, list[tuple[str, str, Any]]]()
        self.add(0)

    def add(self, depth: int) -> str:
        name = f"M{len(self.of)}"
        self.of[name] = []
        for k in range(self.draw.randrange(1, 5)):
            choice = self.draw.random()
            kind = "string" if choice < 0.15 else self.draw.choice(list(CODES))
            if choice > 0.7 and depth < 3:
                kind = self.add(depth + 1)
            array = self.draw.choice([None, None, None, "", self.draw.randrange(1, 4)])
            self.of[name].append((f"f{k}", kind, array))
        return name

    def text(self) -> str:
        def body(name: str) -> str:
            marks = {None: "", "": "[]"}
            return "".join(f"{t}{marks.get(a, f'[{a}]')} {f}  # said\n" for f, t, a in self.of[name])

        parts = [body("M0"), *(f"MSG: p/{name}\nint32 LIMIT=5\n{body(name)}" for name in self.of if name != "M0")]
        return ("=" * 80 + "\n").join(parts)

    def values(self, name: str = "M0") -> dict[str, Any]:
        """A message's values."""

        def one(kind: str) -> Any:
            if kind in self.of:
                return self.values(kind)
            if kind == "string":
                return "é" * self.draw.randrange(4)
            if kind in ("float32", "float64"):
                return self.draw.choice(
                    [0.0, -1.5, float("nan"), float("inf"), float(np.float32(self.draw.gauss(0, 9)))]
                )
            return self.draw.random() < 0.5 if kind == "bool" else self.draw.randrange(*limits(kind))

        def many(kind: str, array: Any) -> Any:
            return one(kind) if array is None else [one(kind) for _ in range(array or self.draw.randrange(4))]

        return {field: many(kind, array) for field, kind, array in self.of[name]}


def limits(kind: str) -> tuple[int, int]:
    bits = 8 * struct.calcsize("<" + CODES[kind])
    return (0, 2**bits) if CODES[kind].isupper() else (-(2 ** (bits - 1)), 2 ** (bits - 1))


def encoded(kinds: Kinds, message: dict[str, Any], order: str, most: int) -> bytes:
    """A message as its encoding says: fields aligned to their size, to `most` at most."""
    out = bytearray()

    def number(code: str, value: Any) -> None:
        size = struct.calcsize("<" + code)
        out.extend(b"\xee" * (-len(out) % min(size, most)) + struct.pack(order + code, value))

    def one(kind: str, value: Any) -> None:
        if kind in kinds.of:
            struct_(kind, value)
        elif kind == "string":
            text = value.encode() + b"\0" * (most > 1)
            number("I", len(text))
            out.extend(text)
        else:
            number(CODES[kind], value)

    def struct_(name: str, values: dict[str, Any]) -> None:
        for field, kind, array in kinds.of[name]:
            if array == "":
                number("I", len(values[field]))
            for value in [values[field]] if array is None else values[field]:
                one(kind, value)

    struct_("M0", message)
    return bytes(out)


def same(found: Any, expected: list[Any], good: Any) -> bool:
    """Whether a column has the numbers that are expected, and says which there are."""
    right = [v if g and is_number(v) else None for v, g in zip(expected, good.tolist(), strict=True)]
    ours = [v if t else None for v, t in zip(found.values.tolist(), found.there.tolist(), strict=True)]
    return ours == right


def paths_of(messages: list[dict[str, Any]]) -> list[str]:
    """Paths of numbers in any of the messages, and one beyond a sequence."""
    return sorted({path for m in messages for path in leaves(m)})


@given(st.integers(0, 10**9), st.sampled_from(list(CDR)))
@SEVERAL
def test_cdr_of_random_types(seed: int, kind: str) -> None:
    draw = random.Random(seed)
    kinds = Kinds(draw)
    number, order, most = CDR[kind]
    messages = [kinds.values() for _ in range(draw.randrange(1, 9))]
    raw = [bytes([0, number, 0, 0]) + encoded(kinds, m, order, most) for m in messages]
    decoder = Ros(message_type("p/msg/M0", kinds.text(), "ros2"), True)
    paths = paths_of(messages)
    found = decoder.read(batch_of(raw), paths)
    assert found.good.all()
    assert found.longer == 0
    if most == 8:  # the library does not know XCDR2
        decode = generate_dynamic("p/msg/M0", kinds.text())["p/msg/M0"]
        for path, column in zip(paths, found.columns, strict=True):
            assert same(column, [theirs(decode(r), path) for r in raw], found.good), path
    for path, column in zip(paths, found.columns, strict=True):
        assert same(column, [lookup(m, path) for m in messages], found.good), path


def theirs(message: Any, path: str) -> Any:
    """The value at a path of a message of the library, None where a sequence is too short."""
    for name in path.split("."):
        if name.isdecimal() and int(name) >= len(message):
            return None
        message = message[int(name)] if name.isdecimal() else getattr(message, name)
    return message


@given(st.integers(0, 10**9))
@SEVERAL
def test_ros_1_of_random_types(seed: int) -> None:
    draw = random.Random(seed)
    kinds = Kinds(draw)
    messages = [kinds.values() for _ in range(draw.randrange(1, 9))]
    raw = [encoded(kinds, m, "<", 1) for m in messages]
    text = kinds.text().replace("byte", "uint8")
    found = Ros(message_type("p/M0", text, "ros1"), False).read(batch_of(raw), paths_of(messages))
    assert found.good.all()
    for path, column in zip(paths_of(messages), found.columns, strict=True):
        assert same(column, [lookup(m, path) for m in messages], found.good), path


@given(st.integers(0, 10**9))
@SEVERAL
def test_messages_that_are_cut_or_changed(seed: int) -> None:
    """A message that ends too early is not good; of one that is changed no number differs from the library's."""
    draw = random.Random(seed)
    kinds = Kinds(draw)
    messages = [kinds.values() for _ in range(6)]
    whole = [b"\0\1\0\0" + encoded(kinds, m, "<", 8) for m in messages]
    raw = [bytearray(r) for r in whole]
    del raw[0][-1:]
    del raw[1][draw.randrange(len(raw[1])) :]
    for r in raw[2:4]:
        at = draw.randrange(4, len(r))
        r[at : at + 4] = draw.randbytes(4)[: len(r) - at]
    raw[4][1] = 3
    batch = batch_of([bytes(r) for r in raw])
    paths = paths_of(messages)
    found = Ros(message_type("p/M0", kinds.text(), "ros2"), True).read(batch, paths)
    assert not found.good[[0, 1, 4]].any()
    assert found.good[5]
    decode = generate_dynamic("p/M0", kinds.text())["p/M0"]
    for k in np.flatnonzero(found.good[:4]):
        try:
            message = decode(bytes(raw[k]))
        except UnicodeDecodeError:
            continue
        for path, column in zip(paths, found.columns, strict=True):
            value = theirs(message, path)
            assert column.there[k] == is_number(value)
            assert not column.there[k] or column.values[k] == value


def test_a_long_count_is_not_believed() -> None:
    text = "p/N[] a\nfloat64 x\n" + "=" * 80 + "\nMSG: p/N\nstring s\n"
    kind = message_type("p/M", text, "ros1")
    raw = [struct.pack("<I", 2**32 - 1) + b"\0" * 40, struct.pack("<IId", 1, 0, 2.5)]
    found = Ros(kind, False).read(batch_of(raw), ["x"])
    assert found.good.tolist() == [False, True]
    assert found.columns[0].values[1] == 2.5
    empty = message_type("p/M", text.replace("string s", "# nothing"), "ros1")
    found = Ros(empty, False).read(batch_of([struct.pack("<Id", 2**32 - 1, 2.5)]), ["x"])
    assert found.columns[0].values.tolist() == [2.5]


def test_messages_longer_than_their_type_are_counted() -> None:
    kind = message_type("p/M", "float32 x", "ros2")
    raw = [b"\0\1\0\0" + struct.pack("<f", 1.5) + b"\0" * n for n in (0, 3, 40)]
    found = Ros(kind, True).read(batch_of(raw), ["x"])
    assert (found.good.all(), found.longer, found.columns[0].values.tolist()) == (True, 1, [1.5] * 3)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("p/M a", "contains itself"),
        ("p/Other a", "type p/Other is not defined"),
        ("wstring a", "strings of wide characters"),
        ("float64", "a line that defines no field: 'float64'"),
        ("float64 a\n===\nfloat64 b", "a definition without a name"),
        ("float64[999999999999999999999999] a", "an array of more items than can be"),
    ],
)
def test_definitions_that_cannot_be_read(text: str, says: str) -> None:
    with pytest.raises(Undecodable, match=says):
        message_type("p/M", text, "ros2")


def test_a_definition_that_grows_without_bound_is_no_hang() -> None:
    parts = [f"MSG: p/N{k}\np/N{k + 1} a\np/N{k + 1} b\n" for k in range(40)] + ["MSG: p/N40\nfloat64 x\n"]
    kind = message_type("p/M", ("=" * 80 + "\n").join(["p/N0 n\nfloat64 y\n", *parts]), "ros1")
    found = Ros(kind, False).read(batch_of([b"\0" * 80]), ["y"])
    assert not found.good.any()


IMU = """std_msgs/Header header
float64[] samples
p/Vector3 acc
================================================================================
MSG: std_msgs/Header
{stamp} stamp
string frame_id
================================================================================
MSG: p/Vector3
float64 x
float64 y
"""


def imu(i: int, order: str, ros1: bool) -> bytes:
    """Message i; the length of its text and of its sequence change."""
    frame, samples = b"imu"[: i % 4], [i + 0.5 * k for k in range(i % 3)]
    out = bytearray()

    def put(shape: str, *values: Any) -> None:
        size = struct.calcsize(order + shape[-1])
        out.extend(b"\0" * (0 if ros1 else -len(out) % size) + struct.pack(order + shape, *values))

    put("II", 1_700_000_000, i * 1000 + 1)
    put("I", len(frame))
    out.extend(frame)
    put("I", len(samples))
    for value in [*samples, 2.0 * i, -i]:
        put("d", value)
    return bytes(out)


@pytest.mark.parametrize("kind", ["cdr <", "cdr >", "ros1"])
@pytest.mark.parametrize("chunking", [True, False])
def test_files_with_stamps(tmp_path: Path, kind: str, chunking: bool) -> None:
    from mcap.writer import Writer

    path, ros1, order = tmp_path / "t.mcap", kind == "ros1", kind.removeprefix("cdr ").replace("ros1", "<")
    encoding, schema_encoding = ("ros1", "ros1msg") if ros1 else ("cdr", "ros2msg")
    head = b"" if ros1 else bytes([0, order == "<", 0, 0])
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=600, use_chunking=chunking)
        writer.start()
        text = IMU.format(stamp="time" if ros1 else "builtin_interfaces/Time")
        schema = writer.register_schema("p/Imu" if ros1 else "p/msg/Imu", schema_encoding, text.encode())
        channel = writer.register_channel("/imu", encoding, schema)
        for i in range(50):
            writer.add_message(channel, log_time=i, publish_time=0, data=head + imu(i, order, ros1))
        writer.finish()
    signals = ("/imu:acc.x", "/imu:acc.y", "/imu:samples.1")
    found = read_mcap(path, rig_of(*signals, recording='[recording]\ntime="header.stamp"\n'))
    assert found.damage == ()
    columns = list(zip(*pairs(found), strict=True))
    assert columns[0] == tuple(i * 1000 * 1e-9 for i in range(50))
    assert columns[1:3] == [tuple(2.0 * i for i in range(50)), tuple(-float(i) for i in range(50))]
    np.testing.assert_array_equal(columns[3], [i + 0.5 if i % 3 == 2 else np.nan for i in range(50)])
    assert found.notes[0] == "time counts from log time 1700000000000000001 ns"
    with pytest.raises(RecordingError, match=r"topic /imu: missing channel 'c0'.*did you mean 'acc\.[xy]'"):
        read_mcap(path, rig_of("/imu:acc.w"))
    assert pairs(read_mcap(path, rig_of("acc.x")))[3] == (3 * 1e-9, 6.0)
