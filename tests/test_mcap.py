"""MCAP logs: whatever the library writes reads the same; damage of each kind is reported and the rest is kept."""

from __future__ import annotations

import importlib
import random
import re
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.writer import IndexType, Writer

from mcap_logs import COMPRESSIONS, PQ, STEP_NS, expected, of, oracle, pairs, pq, rig_of, value, write_log
from nineaudit.errors import RecordingError
from nineaudit.readers.contents import Contents
from nineaudit.readers.mcap.reader import read_mcap


def said(contents: Contents) -> str:
    return " | ".join(map(str, contents.damage))


# --- whole files --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("how", ["chunks", "no index", "loose", "bare"])
def test_whole_files_read_as_the_library_reads_them(tmp_path: Path, compression: str, how: str) -> None:
    options = {
        "chunks": {"attachment": True},
        "no index": {"index_types": IndexType.NONE},
        "loose": {"use_chunking": False},
        "bare": {"repeat_channels": False, "repeat_schemas": False, "use_statistics": False, "data_crcs": False},
    }[how]
    path = write_log(tmp_path / "t.mcap", compression=compression, **options)
    found = pq(path)
    assert found.damage == ()
    assert pairs(found) == expected()
    assert [t for t, _ in oracle(path, "/imu")] == [round(t * 1e9) for t in found.traces[0].time]
    assert (found.counts["messages"], found.counts["messages_used"], found.counts["topics"]) == (160, 120, 2)
    assert found.counts["chunks"] == (0 if how == "loose" else pytest.approx(20, abs=8))


def test_log_times_out_of_order_stay_in_the_order_of_the_file(tmp_path: Path) -> None:
    path, times = tmp_path / "t.mcap", [5, 3, 9, 1, 1, 7]
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/imu", "json", 0)
        for i, t in enumerate(times):
            writer.add_message(channel, log_time=t, publish_time=0, data=b'{"p": %d, "q": 0}' % i)
        writer.finish()
    found = pq(path)
    assert found.damage == ()
    assert pairs(found) == [(t * 1e-9, float(i), 0.0) for i, t in enumerate(times)]


def test_dates_keep_their_nanoseconds(tmp_path: Path) -> None:
    path, start = tmp_path / "t.mcap", 1_700_000_000_123_456_789
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/imu", "json", 0)
        for i in range(9):
            writer.add_message(channel, log_time=start + 7 * i, publish_time=0, data=b'{"p": 1, "q": 2}')
        writer.finish()
    found = pq(path)
    assert found.traces[0].time.tolist() == [7 * i * 1e-9 for i in range(9)]
    assert found.notes == (f"time counts from log time {start} ns",)


def test_one_topic_on_two_channels(tmp_path: Path) -> None:
    path = tmp_path / "t.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channels = [writer.register_channel("/imu", "json", 0) for _ in range(2)]
        for i in range(20):
            data = b'{"p": %d, "q": 0}' % i
            writer.add_message(channels[i % 3 == 0], log_time=i, publish_time=0, data=data)
        writer.finish()
    found = pq(path)
    assert found.traces[0].values.tolist() == list(range(20))
    assert found.notes == ("topic /imu comes on 2 channels",)


def test_channels_of_one_topic_with_other_fields(tmp_path: Path) -> None:
    path = tmp_path / "t.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channels = [writer.register_channel("/imu", "json", 0) for _ in range(2)]
        for i in range(6):
            data = b'{"p": %d, "q": 1}' % i if i % 2 else b'{"q": 2}'
            writer.add_message(channels[i % 2], log_time=i, publish_time=0, data=data)
        writer.finish()
    for signals in (("/imu:p", "q"), ("p", "/imu:q")):
        found = read_mcap(path, rig_of(*signals, recording='[recording]\ntime="p"\ntime_unit="ns"\n'))
        assert [t.time.tolist() for t in found.traces] == [[t * 1e-9 for t in range(6)]] * 2
        np.testing.assert_array_equal(found.traces[0].values, [np.nan, 1, np.nan, 3, np.nan, 5])
        assert found.traces[1].values.tolist() == [2, 1] * 3


def test_topics_that_are_not_asked_for_are_not_decoded(tmp_path: Path) -> None:
    path = tmp_path / "t.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        imu = writer.register_channel("/imu", "json", 0)
        odd = writer.register_channel("/odd", "flatbuffer", 0)
        for i in range(10):
            writer.add_message(imu, log_time=i, publish_time=0, data=b'{"p": 1, "q": 2}')
            writer.add_message(odd, log_time=i, publish_time=0, data=b"\xff")
        writer.finish()
    assert pq(path).counts["messages"] == 20
    assert read_mcap(path, rig_of("p", "q")).counts["messages_used"] == 10
    with pytest.raises(
        RecordingError, match=r"topic /odd: messages in an encoding that is not read; found 'flatbuffer"
    ):
        read_mcap(path, rig_of("/odd:x"))


# --- damage ---------------------------------------------------------------------------------------------------------

Change = Callable[[bytearray], None]


def first(opcode: Opcode, offset: int = 0, which: int = 0) -> Callable[[bytes], int]:
    return lambda data: of(data, opcode)[which][0] + offset


def flip(place: Callable[[bytes], int]) -> Change:
    def change(data: bytearray) -> None:
        data[place(bytes(data))] ^= 0x41

    return change


def set_bytes(place: Callable[[bytes], int], new: bytes) -> Change:
    def change(data: bytearray) -> None:
        at = place(bytes(data))
        data[at : at + len(new)] = new

    return change


DAMAGE: dict[str, tuple[Change, str, bool]] = {
    # name: (change, what is said, whether messages are lost by it)
    "a flipped byte in a chunk": (flip(first(Opcode.CHUNK, 120, 2)), "does not (inflate|hold)", True),
    "the length of a chunk": (
        set_bytes(first(Opcode.CHUNK, 5, 2), b"\x07"),
        "data section: a record longer than",
        True,
    ),
    "a shorter length": (set_bytes(first(Opcode.CHUNK, 1, 2), b"\x32\0"), "a field longer than its record", True),
    "the kind of a record": (set_bytes(first(Opcode.CHUNK, 0, 2), b"\x90"), "no chunk where the summary says", True),
    "an unknown compression": (flip(first(Opcode.CHUNK, 9 + 32, 2)), "unknown compression", True),
    "a bomb": (
        set_bytes(first(Opcode.CHUNK, 9 + 16, 2), b"\0" * 5 + b"\x01"),
        "states more bytes than it can hold",
        True,
    ),
    "the size of a chunk": (flip(first(Opcode.CHUNK, 9 + 16, 2)), "not of the size it states|inflate", True),
    "a message index": (flip(first(Opcode.MESSAGE_INDEX, 9 + 6 + 8, 2)), "a message index that does not fit", False),
    "an attachment": (flip(first(Opcode.ATTACHMENT, 60)), "an attachment whose checksum", False),
    "the summary": (flip(first(Opcode.STATISTICS, 12)), "summary: its checksum", False),
    "the data section's checksum": (flip(first(Opcode.DATA_END, 10)), "the data section's checksum", False),
    "opcode 0": (set_bytes(first(Opcode.ATTACHMENT), b"\0"), "a record of opcode 0", False),
}


@pytest.mark.parametrize("name", DAMAGE)
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_damage_is_reported_and_the_rest_is_kept(tmp_path: Path, name: str, compression: str) -> None:
    change, says, loses = DAMAGE[name]
    path = write_log(tmp_path / "t.mcap", compression=compression, attachment=True)
    data = bytearray(path.read_bytes())
    if compression == "none" and name in ("a bomb", "an unknown compression"):
        says = "not of the size it states|unknown compression|longer than its record"
    change(data)
    assert data != path.read_bytes()
    path.write_bytes(data)
    found = pq(path)
    assert re.search(says, said(found)), said(found)
    kept = pairs(found)
    assert set(kept) <= set(expected())
    assert (len(kept) < 120) == loses
    assert len(kept) > 100  # one chunk at most is lost
    assert all(d.place.startswith("byte ") and int(d.place[5:]) <= len(data) for d in found.damage)


def test_a_damaged_chunk_says_how_many_messages_it_held(tmp_path: Path) -> None:
    path = write_log(tmp_path / "t.mcap", compression="none")
    data = bytearray(path.read_bytes())
    at, end = of(data, Opcode.CHUNK)[3]
    data[end - 5] ^= 1
    path.write_bytes(data)
    found = pq(path)
    lost = 160 - int(found.counts["messages"])
    damage = next(d for d in found.damage if "checksum (CRC) does not hold" in d.what and "chunk" in d.what)
    assert (damage.place, damage.count, damage.lost) == (f"byte {at}", 1, f"{lost} messages lost")
    assert any(f"they state 160, the file holds {160 - lost}" in d.lost for d in found.damage)


def test_the_first_chunk_damaged_the_summary_tells_the_channels(tmp_path: Path) -> None:
    path = write_log(tmp_path / "t.mcap")
    data = bytearray(path.read_bytes())
    data[of(data, Opcode.CHUNK)[0][0] + 100] ^= 1
    path.write_bytes(data)
    kept = pairs(pq(path))
    assert kept == expected()[-len(kept) :]
    assert len(kept) > 100


def test_the_first_chunk_damaged_and_no_copy_of_the_channels(tmp_path: Path) -> None:
    path = write_log(tmp_path / "t.mcap", repeat_channels=False)
    data = bytearray(path.read_bytes())
    data[of(data, Opcode.CHUNK)[0][0] + 100] ^= 1
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=r"missing channel 'c0'; expected a topic '/imu'; the file is damaged"):
        pq(path)


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("data_crcs", [True, False])
def test_a_truncated_file_is_read_to_its_last_good_chunk(tmp_path: Path, compression: str, data_crcs: bool) -> None:
    path = write_log(tmp_path / "t.mcap", compression=compression, data_crcs=data_crcs)
    data = path.read_bytes()
    chunks = of(data, Opcode.CHUNK)
    whole = len(pairs(pq(path)))
    for at, end in (chunks[0], chunks[4], chunks[-1]):
        for cut in (at, at + 4, at + 20, (at + end) // 2, end - 1):
            path.write_bytes(data[:cut])
            if at == chunks[0][0]:
                with pytest.raises(RecordingError, match="the file is cut short or damaged"):
                    pq(path)
                continue
            found = pq(path)
            kept = pairs(found)
            assert kept == expected()[: len(kept)]
            assert 0 < len(kept) < whole
            assert "cut short, or was never closed" in said(found)
            assert "an unknown number of messages lost" in said(found)


def test_a_damaged_summary_loses_nothing(tmp_path: Path) -> None:
    path = write_log(tmp_path / "t.mcap")
    data = bytearray(path.read_bytes())
    data[of(data, Opcode.STATISTICS)[0][0] + 12] ^= 1
    path.write_bytes(data)
    found = pq(path)
    assert pairs(found) == expected()
    assert [(d.what, d.lost) for d in found.damage] == [
        ("summary: its checksum (CRC) does not hold", "its counts and copies are not used")
    ]


def test_a_file_cut_within_its_summary_loses_nothing(tmp_path: Path) -> None:
    path = write_log(tmp_path / "t.mcap")
    data = path.read_bytes()
    path.write_bytes(data[:-40])
    found = pq(path)
    assert pairs(found) == expected()
    assert [(d.what[:25], d.lost) for d in found.damage] == [("the file is cut short, or", "its data section is whole")]


def rewritten(data: bytes, opcode: Opcode, which: int, content: bytes) -> bytes:
    """A record's content in place of another, no summary behind, so that no place in it is wrong."""
    at, end = of(data, opcode)[which]
    stop, _ = of(data, Opcode.DATA_END)[0]
    record = bytes([opcode]) + struct.pack("<Q", len(content)) + content
    tail = b"\x0f" + struct.pack("<QI", 4, 0) + b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0)
    return data[:at] + record + data[end:stop] + tail + data[-8:]


def chunk(records: bytes, size: int, compression: bytes, packed: bytes) -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, zlib.crc32(records)) + struct.pack("<I", len(compression)) + compression
    return head + struct.pack("<Q", len(packed)) + packed


@pytest.mark.parametrize(
    ("bomb", "stated"),
    [
        (zstandard.compress(b"\0" * 2**26), 2**40),
        (zstandard.compress(b"\0" * 2**26), 1000),
        (zstandard.ZstdCompressor(write_content_size=False).compress(b"\0" * 2**26), 1000),
        (lz4.frame.compress(b"\0" * 2**26), 2**40),
        (lz4.frame.compress(b"\0" * 2**26), 1000),
    ],
)
def test_bombs_take_no_memory(tmp_path: Path, bomb: bytes, stated: int) -> None:
    import tracemalloc

    path = write_log(tmp_path / "t.mcap")
    name = b"zstd" if bomb[:4] == b"\x28\xb5\x2f\xfd" else b"lz4"
    path.write_bytes(rewritten(path.read_bytes(), Opcode.CHUNK, 2, chunk(b"", stated, name, bomb)))
    tracemalloc.start()
    found = pq(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert "chunk" in said(found)
    assert len(pairs(found)) > 100
    assert peak < 8e6


def message(channel: int, time: int, data: bytes) -> bytes:
    content = struct.pack("<HIQQ", channel, 0, time, 0) + data
    return b"\x05" + struct.pack("<Q", len(content)) + content


@pytest.mark.parametrize(
    ("records", "says"),
    [
        (message(77, 5, b"{}"), "a message of a channel that is not described; 1 message lost"),
        (message(1, 2**63 + 5, b"{}"), "a log time after the year 2262; 1 message lost"),
        (message(2, 5, b"{}") + b"\x05" + b"\xff" * 8, "a record longer than what is left in a chunk"),
        (b"\x05" + struct.pack("<Q", 3) + b"abc", "a message shorter than its head"),
        (b"\x04" + struct.pack("<QHHI", 8, 1, 9, 2**31), "schema or channel: a field longer than its record"),
        (b"\x03" + struct.pack("<QHI", 8, 1, 2) + b"\xff\xff", "schema or channel: text that is not UTF-8"),
        (b"\x03" + struct.pack("<QHIII", 14, 1, 0, 0, 0), "two definitions of one schema or channel id"),
    ],
)
def test_records_in_a_chunk_that_cannot_be(tmp_path: Path, records: bytes, says: str) -> None:
    path = write_log(tmp_path / "t.mcap", index_types=IndexType.NONE)
    path.write_bytes(rewritten(path.read_bytes(), Opcode.CHUNK, 2, chunk(records, len(records), b"", records)))
    found = pq(path)
    assert says in said(found)
    assert set(pairs(found)) <= set(expected())
    assert len(pairs(found)) > 100


def test_a_schema_that_is_missing_is_no_matter_of_json(tmp_path: Path) -> None:
    path = tmp_path / "t.mcap"
    for encoding in ("json", "cdr"):
        with path.open("wb") as file:
            writer = Writer(file)
            writer.start()
            channel = writer.register_channel("/imu", encoding, 9)
            writer.add_message(channel, log_time=1, publish_time=0, data=b'{"p": 1, "q": 2}')
            writer.finish()
        if encoding == "json":
            assert pairs(pq(path)) == [(1e-9, 1.0, 2.0)]
    with pytest.raises(
        RecordingError, match="topic /imu: messages in an encoding that is not read; found 'cdr, schema none'"
    ):
        pq(path)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"\x89MCAP0\r\n", "no messages could be read"),
        (b"\x89MCAP0\r\n" * 2, "no messages could be read"),
        (b"\x89MCAP0\r\n" + b"\0" * 200, "no messages could be read"),
        (b"\x89MCAP0\r\n\x06" + b"\xff" * 8, "no messages could be read"),
        (b"\x89MCAX0\r\n" * 9, "not an MCAP file"),
        (b"", "not an MCAP file"),
    ],
)
def test_files_without_messages(tmp_path: Path, data: bytes, says: str) -> None:
    path = tmp_path / "t.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=says):
        pq(path)


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("data_crcs", [True, False])
@pytest.mark.parametrize("kind", ["flip", "random", "cut", "insert", "delete"])
def test_no_byte_changes_a_value_in_silence(tmp_path: Path, compression: str, data_crcs: bool, kind: str) -> None:
    """Values are those written, and all there unless damage is reported; nothing but RecordingError is raised."""
    draw = random.Random(f"{compression}{data_crcs}{kind}")
    path = write_log(tmp_path / "t.mcap", 40, compression=compression, data_crcs=data_crcs, attachment=True)
    whole = path.read_bytes()
    right = expected(40)
    reported = 0
    for _ in range(50):
        data, at = bytearray(whole), draw.randrange(len(whole))
        if kind == "flip":
            data[at] ^= 1 << draw.randrange(8)
        elif kind == "random":
            data[at : at + 4] = draw.randbytes(4)
        elif kind == "cut":
            del data[at:]
        elif kind == "insert":
            data[at:at] = draw.randbytes(draw.randrange(1, 20))
        else:
            del data[at : at + draw.randrange(1, 20)]
        path.write_bytes(data)
        try:
            found = pq(path)
        except RecordingError:
            reported += 1
            continue
        reported += bool(found.damage)
        assert set(pairs(found)) <= set(right)
        assert found.damage or pairs(found) == right
    assert reported > 25


def test_the_largest_chunk_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_log(tmp_path / "t.mcap")
    monkeypatch.setattr("nineaudit.readers.inflate.LARGEST", 500)
    found = pq(path)
    assert f"a chunk that states more bytes than it can hold ({int(found.counts['chunks']) - 1} times" in said(found)


def test_memory_does_not_grow_with_topics_that_are_not_used(tmp_path: Path) -> None:
    import tracemalloc

    path = tmp_path / "t.mcap"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=2**18)
        writer.start()
        imu, other = (writer.register_channel(topic, "json", 0) for topic in ("/imu", "/camera"))
        for i in range(300):
            writer.add_message(imu, log_time=i * STEP_NS, publish_time=0, data=b'{"p": %r, "q": 0}' % value(i))
            writer.add_message(other, log_time=i * STEP_NS, publish_time=0, data=bytes(2**16))
        writer.finish()
    read_mcap(path, PQ)
    tracemalloc.start()
    read_mcap(path, PQ)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2e6  # of 20 MB


@pytest.mark.parametrize("kind", ["ros2", "protobuf", "json"])
def test_an_imu_in_every_encoding_as_the_library_decodes_it(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "benchmarks"))
    bench, path = importlib.import_module("readers_mcap"), tmp_path / "t.mcap"
    getattr(bench, f"write_{kind}")(path, 300)
    times, values = bench.by_library(path, kind)
    found = read_mcap(path, bench.rig_of(bench.FIELDS))
    assert found.damage == ()
    assert found.traces[0].time.tolist() == (times * 1e-9).tolist()
    assert [t.values.tolist() for t in found.traces] == values.T.tolist()
    stamped = read_mcap(path, replace(bench.rig_of(bench.FIELDS[:1]), time_signal="header.stamp"))
    assert stamped.traces[0].time.tolist() == found.traces[0].time.tolist()
