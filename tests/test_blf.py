"""BLF logs: equal to python-can where it reads them, whole where it does not, and every fault of a file said."""

from __future__ import annotations

import contextlib
import datetime
import random
import re
import struct
from itertools import pairwise
from pathlib import Path

import can
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import blf_files as made
from nineaudit.errors import RecordingError
from nineaudit.readers.can.blf import read_blf
from nineaudit.readers.can.frames import ERROR, ERROR_STATE, FD, OVERLOAD, RATE_SWITCH, REMOTE, SENT, Frames

FD_LENGTHS = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64]
ROW = tuple[int, int, int, int, str, bytes]


def rows(log: Frames) -> list[ROW]:
    """Every frame as (time, key, kind, length, bus, data)."""
    data = log.payload(np.arange(len(log)))
    return [
        (int(t), int(k), int(f), int(n), log.buses[b], bytes(d[: 0 if f & REMOTE else n]))
        for t, k, f, n, b, d in zip(log.time, log.key, log.kind, log.length, log.bus, data, strict=True)
    ]


def expected(message: can.Message) -> tuple[int, int, int, str, bytes]:
    """What a row is without its time, as python-can has the frame."""
    if message.is_error_frame:
        return (0, ERROR, 0, str(message.channel + 1), b"")
    flags = ((message.is_remote_frame, REMOTE), (message.is_fd, FD), (message.bitrate_switch, RATE_SWITCH))
    more = ((message.error_state_indicator, ERROR_STATE), (not message.is_rx, SENT))
    data = b"" if message.is_remote_frame else bytes(message.data)
    return (
        message.arbitration_id | message.is_extended_id << 31,
        sum(bit for flag, bit in (*flags, *more) if flag),
        message.dlc if message.is_remote_frame else len(data),
        str(message.channel + 1),
        data,
    )


def read_bytes(folder: Path, content: bytes, threads: int = 1) -> Frames:
    path = folder / "made.blf"
    path.write_bytes(content)
    return read_blf(path, threads)


def message(rng: random.Random, stamp: float) -> can.Message:
    """A random frame of any kind python-can can write."""
    extended, kind = rng.random() < 0.5, rng.choice(["classic", "classic", "fd", "remote", "error"])
    size = rng.choice(FD_LENGTHS) if kind == "fd" else rng.randrange(9)
    return can.Message(
        timestamp=stamp,
        arbitration_id=rng.getrandbits(29 if extended else 11),
        is_extended_id=extended,
        is_remote_frame=kind == "remote",
        is_error_frame=kind == "error",
        is_fd=kind == "fd",
        bitrate_switch=kind == "fd" and rng.random() < 0.5,
        error_state_indicator=kind == "fd" and rng.random() < 0.2,
        is_rx=rng.random() < 0.7,
        channel=rng.randrange(4),
        dlc=size,
        data=b"" if kind == "remote" else rng.choice([rng.randbytes(size), b"LOBJ" * 16])[:size],
    )


def written(path: Path, messages: list[can.Message], *, largest: int = 128 * 1024, level: int = -1) -> Path:
    """A log of python-can's with containers of at most so many bytes."""
    with can.BLFWriter(path, compression_level=level) as writer:
        writer.max_container_size = largest
        for m in messages:
            writer.on_message_received(m)
        while writer._buffer_size:  # python-can would write one more container only, and lose what is over
            writer._flush()
    return path


@settings(max_examples=25, derandomize=True, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    count=st.integers(1, 300),
    largest=st.sampled_from([50, 333, 4096, 128 * 1024]),
    level=st.sampled_from([-1, 0]),
    start=st.sampled_from([0.0, 1.7e9]),
    threads=st.integers(1, 3),
)
def test_frames_are_those_of_python_can(
    tmp_path_factory: pytest.TempPathFactory,
    seed: int,
    count: int,
    largest: int,
    level: int,
    start: float,
    threads: int,
) -> None:
    rng = random.Random(seed)
    stamp = start
    messages = []
    for _ in range(count):
        messages.append(message(rng, stamp))
        stamp += rng.random() * 1e-3
    path = written(tmp_path_factory.mktemp("blf") / "log.blf", messages, largest=largest, level=level)
    found, oracle = read_blf(path, threads), list(can.BLFReader(path))
    assert [row[1:] for row in rows(found)] == [expected(m) for m in oracle]
    np.testing.assert_allclose(found.time * 1e-9, [m.timestamp for m in oracle], rtol=0, atol=5e-7)
    assert (found.damage, found.notes) == ((), ())
    assert found.counts["objects"] == found.counts["objects_in_header"] == count


def test_the_real_log_is_that_of_python_can(shared_data: Path) -> None:
    path = shared_data / "rav4-can" / "drive-60s.blf"
    found, oracle = read_blf(path, threads=2), list(can.BLFReader(path))
    assert len(found) == 53_800
    assert [row[1:] for row in rows(found)] == [expected(m) for m in oracle]
    np.testing.assert_allclose(found.time * 1e-9, [m.timestamp for m in oracle], rtol=0, atol=5e-7)
    assert (found.damage, found.notes) == ((), ())


def test_time_is_exact_and_counts_from_the_date_in_the_header(tmp_path: Path) -> None:
    """A date, 10 µs and ns, headers of both versions; python-can's own stamps are floats, which are not exact."""
    ticks = 123_456_789_012_345_678
    objects = made.padded(
        made.obj(1, made.classic(1), ticks),
        made.obj(1, made.classic(1), 7, unit=1),
        made.obj(1, made.classic(1), ticks, version=2),
        made.obj(86, made.classic(1) + bytes(8), 7, unit=1, version=2),
    )
    date = (2026, 11, 0, 22, 8, 39, 6, 250)
    content = made.log(made.container(objects), start=date, objects=4)
    moment = datetime.datetime(2026, 11, 22, 8, 39, 6, 250_000, tzinfo=datetime.UTC)
    start = round(moment.timestamp() * 1000) * 1_000_000
    assert read_bytes(tmp_path, content).time.tolist() == [start + ticks, start + 70_000] * 2
    assert [m.timestamp for m in can.BLFReader(tmp_path / "made.blf")][1] == pytest.approx(start * 1e-9 + 7e-5)


def test_time_does_not_depend_on_the_time_zone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import time

    content = made.log(made.container(made.obj(1, made.classic(1))), start=(2026, 7, 3, 1, 12, 0, 0, 0), objects=1)
    found = []
    for zone in ("UTC", "Asia/Tokyo", "America/New_York"):
        monkeypatch.setenv("TZ", zone)
        time.tzset()
        found.append(read_bytes(tmp_path, content).time.tolist())
    monkeypatch.undo()
    time.tzset()
    assert found[0] == found[1] == found[2] == [1_782_907_200_000_000_000]


def test_a_header_without_a_date_is_said(tmp_path: Path) -> None:
    found = read_bytes(
        tmp_path, made.log(made.obj(1, made.classic(1), 5), start=(2026, 13, 0, 1, 0, 0, 0, 0), objects=1)
    )
    assert found.time.tolist() == [5]
    assert [str(d) for d in found.damage] == ["byte 40: the measurement's start is no date; times count from it"]


def test_types_that_python_can_does_not_write(tmp_path: Path) -> None:
    eleven = bytes(range(11))
    objects = made.padded(
        made.obj(86, made.classic(0x123, b"abc", channel=7) + bytes(8), 1),  # CAN_MESSAGE2
        made.obj(101, made.flexible64(0x80000123, bytes(range(64)), 15, flags=0x7000, way=1), 2),
        made.obj(101, made.flexible64(0x9, eleven[:5] + b"later" * 4, 5, valid=5, more=32 + 40 + 5), 3),
        made.obj(101, made.flexible64(0xA, b"abc" + b"ext!", 8, valid=8, more=32 + 40 + 3), 4),  # data left out
        made.obj(101, made.flexible64(0xB, b"", 8, flags=0x10, valid=0), 5),  # a classic remote frame
        made.obj(2, struct.pack("<HH", 3, 0), 6),
        made.obj(104, struct.pack("<BBBB40x", 4, 0, 0, 0), 7),
        made.obj(3, struct.pack("<HH", 5, 0), 8),
        made.obj(65, b"some text of an odd size!", 9),
        made.obj(86, made.classic(0x7, bytes(8), flags=2) + bytes(8), 10),  # a request to send
    )
    found = read_bytes(tmp_path, made.log(made.container(objects), objects=10))
    assert rows(found) == [
        (1, 0x123, 0, 3, "7", b"abc"),
        (2, 0x80000123, FD | RATE_SWITCH | ERROR_STATE | SENT, 64, "2", bytes(range(64))),
        (3, 0x9, FD, 5, "2", eleven[:5]),
        (4, 0xA, FD, 8, "2", b"abc" + bytes(5)),
        (5, 0xB, REMOTE, 8, "2", b""),
        (6, 0, ERROR, 0, "3", b""),
        (7, 0, ERROR, 0, "4", b""),
        (8, 0, OVERLOAD, 0, "5", b""),
        (10, 0x7, SENT, 8, "1", bytes(8)),
    ]
    assert found.damage == ()
    assert found.notes == (
        "1 FD frames with fewer bytes than they state, filled with zeros",
        "1 requests to send among the frames",
    )
    assert found.counts == {
        "objects": 10,
        "objects_in_header": 10,
        "bytes_of_file": (tmp_path / "made.blf").stat().st_size,
        "bytes_in_header": (tmp_path / "made.blf").stat().st_size,
        "other_objects": 1,
        "objects_of_type_65": 1,
    }
    theirs = [expected(m) for m in can.BLFReader(tmp_path / "made.blf") if not m.is_error_frame]
    ours = [row[1:] for row in rows(found) if not row[2] & (ERROR | OVERLOAD)]
    assert ours[:-1] == theirs[:-1]  # to python-can, a request to send was received


@pytest.mark.parametrize("pad", [(0, 1), (1, 4), (-1, 4)], ids=["none", "odd", "to four"])
@pytest.mark.parametrize("cut", [7, 16, 33, 100, 10_000])
def test_objects_of_odd_sizes_across_containers(tmp_path: Path, pad: tuple[int, int], cut: int) -> None:
    """Padding of all three kinds that writers are known for, containers that end anywhere, deflated or not."""
    rng = random.Random(5)
    sizes = [rng.randrange(65) for _ in range(40)]
    objects = [
        made.obj(101, made.flexible64(i, bytes([i]) * n, FD_LENGTHS.index(n) if n in FD_LENGTHS else 0), i)
        for i, n in enumerate(sizes)
    ]
    stream = b"".join(o + bytes(len(o) * pad[0] % pad[1]) for o in objects)
    parts = [stream[i : i + cut] for i in range(0, len(stream), cut)]
    content = made.padded(*(made.container(part, method=2 * (i % 2)) for i, part in enumerate(parts)))
    found = read_bytes(tmp_path, made.log(content, objects=40))
    assert rows(found) == [(i, i, FD, n, "2", bytes([i]) * n) for i, n in enumerate(sizes)]
    assert found.damage == ()


def test_signatures_in_payloads_do_not_mislead(tmp_path: Path) -> None:
    """Whole objects inside of payloads, aligned and not, in the file and in its containers."""
    inner = made.obj(1, made.classic(0x666, b"wrong"), 666)
    objects = [made.obj(100, made.flexible(i, (bytes(i % 8) + inner + b"LOBJ" * 16)[:64], 15), i) for i in range(200)]
    stream = made.padded(*objects)
    content = made.padded(*(made.container(stream[i : i + 3000], method=0) for i in range(0, len(stream), 3000)))
    found = read_bytes(tmp_path, made.log(content, objects=200))
    assert found.key.tolist() == found.time.tolist() == list(range(200))
    assert found.damage == ()


def test_objects_outside_of_containers(tmp_path: Path) -> None:
    """They are frames like others, and do not break an object that two containers share."""
    one, two, three = (made.obj(1, made.classic(i, b"abcd"), i) for i in (1, 2, 3))
    content = made.container(one[:20]) + bytes(0)
    content = made.padded(content, two, three, made.container(one[20:]), made.obj(1, made.classic(4), 4))
    found = read_bytes(tmp_path, made.log(content, objects=4))
    assert found.key.tolist() == [2, 3, 1, 4]
    assert found.damage == ()
    bare = read_bytes(
        tmp_path, made.log(made.padded(*(made.obj(1, made.classic(i), i) for i in range(999))), objects=999)
    )
    assert bare.key.tolist() == list(range(999))
    assert bare.damage == ()


def test_length_codes(tmp_path: Path) -> None:
    """A classic code of 9 to 15 means eight bytes; what cannot be a code, or is more than 64 bytes, is damage."""
    eight = b"12345678"
    objects = made.padded(
        made.obj(1, made.classic(1, eight, dlc=9)),
        made.obj(1, made.classic(2, eight, dlc=200)),
        made.obj(100, made.flexible(3, bytes(64), 15, valid=200)),
        made.obj(100, made.flexible(4, bytes(12), 15, valid=12)),
        made.obj(1, made.classic(5, dlc=3, flags=0x80)),
    )
    found = read_bytes(tmp_path, made.log(made.container(objects), objects=5))
    assert found.length.tolist() == [8, 8, 64, 12, 3]
    assert [(d.what, d.place) for d in found.damage] == [
        ("a classic frame states a length code above 15, read as 8 bytes", "byte 144, inflated byte 48"),
        ("an FD frame states more than 64 bytes", "byte 144, inflated byte 96"),
    ]
    assert found.notes == (
        "2 FD frames whose valid bytes are not those of their length code",
        "1 classic frames with a length code above 8, which means 8 bytes",
    )


def test_the_origin_of_our_own_logs(tmp_path: Path) -> None:
    path = tmp_path / "own.blf"
    with can.BLFWriter(path) as writer:
        writer.log_event("some event", 0.0)
        writer.log_event("nineaudit time origin -0.02 s", 0.0)
        writer.on_message_received(can.Message(timestamp=0.0, arbitration_id=1, channel=0))
    found = read_blf(path)
    assert (found.origin, found.time.tolist(), found.counts["objects_of_type_96"]) == (-20_000_000, [0], 2)


# Faults of a file.


FRAMES = [made.obj(1, made.classic(i, struct.pack("<q", i)), i) for i in range(60)]
PARTS = [made.container(b"".join(FRAMES[i : i + 10])) for i in range(0, 60, 10)]


def place(part: int) -> int:
    """Byte of the file at which a container begins."""
    return 144 + sum(len(p) + len(p) % 4 for p in PARTS[:part])


def damaged(tmp_path: Path, content: bytes) -> tuple[list[int], list[str]]:
    """Identifiers that are read, and what is said of the damage, but for what follows from it: the header's counts."""
    found = read_bytes(tmp_path, content)
    said = [str(d) for d in found.damage if "the header" not in d.what and "its header states" not in d.what]
    return found.key.tolist(), said


def whole(*parts: bytes, **rest: int) -> bytes:
    return made.log(made.padded(*parts), objects=60, **rest)


def without(*lost: range) -> list[int]:
    return [i for i in range(60) if not any(i in part for part in lost)]


def test_a_truncated_file_is_read_to_its_last_whole_object(tmp_path: Path) -> None:
    """Cut in a container, in its header, in the header of the file, and between containers."""
    content = whole(*PARTS)
    ids, said = damaged(tmp_path, content[: place(3) + len(PARTS[3]) - 12])
    assert ids[:30] == list(range(30))
    assert 30 < len(ids) < 40
    assert ids == list(range(len(ids)))
    assert said[0] == f"byte {place(3)}: the file ends inside of a container"
    ids, said = damaged(tmp_path, content[: place(3) + 10])
    assert ids == list(range(30))
    assert said == [f"byte {place(3)}: the file ends inside of an object; 10 bytes lost"]
    found = read_bytes(tmp_path, content[: place(3)])
    assert found.key.tolist() == list(range(30))
    assert [str(d) for d in found.damage] == [
        f"byte {place(3)}: the file has {place(3)} of the {len(content)} bytes its header states",
        "byte 32: 30 of the 60 objects that the header counts are there",
    ]
    with pytest.raises(RecordingError, match=r"byte 50: the header of this BLF log is not whole"):
        read_bytes(tmp_path, content[:50])


def test_every_cut_of_a_file_gives_its_whole_objects(tmp_path: Path) -> None:
    content = whole(*PARTS[:3])
    for end in range(place(1), len(content), 3):
        ids, _ = damaged(tmp_path, content[:end])
        assert ids == list(range(len(ids)))
        assert len(ids) >= 10 * ((end - 144) // (len(PARTS[0]) + 8))


def test_a_damaged_container_is_left_out(tmp_path: Path) -> None:
    broken = bytearray(PARTS[2])
    broken[60] ^= 0x40
    ids, said = damaged(tmp_path, whole(*PARTS[:2], bytes(broken), *PARTS[3:]))
    assert ids == without(range(20, 30))
    assert said == [f"byte {place(2)}: the deflated data of a container is damaged; {len(broken)} bytes lost"]
    unknown = bytearray(PARTS[2])
    unknown[16] = 9
    ids, said = damaged(tmp_path, whole(*PARTS[:2], bytes(unknown), *PARTS[3:]))
    assert ids == without(range(20, 30))
    assert "compressed by a method that is not known" in said[0]


def test_objects_at_the_borders_of_a_lost_container_are_lost_with_it_and_no_more(tmp_path: Path) -> None:
    stream = b"".join(FRAMES)
    parts = [made.container(stream[i : i + 500]) for i in range(0, len(stream), 500)]
    parts[2] = parts[2][:40] + bytes([parts[2][40] ^ 1]) + parts[2][41:]
    ids, said = damaged(tmp_path, whole(*parts))
    assert ids == without(range(1000 // 48, -(-1500 // 48)))
    assert [text.split(": ")[1] for text in said] == [
        f"the deflated data of a container is damaged; {len(parts[2])} bytes lost",
        "an object is cut off; 40 bytes lost",
        "rest of an object whose begin is lost; 36 bytes lost",
    ]


@pytest.mark.parametrize("size", [0, 5, 31, 40, 70_000, 2**31, 2**32 - 1])
def test_a_container_of_a_wrong_size_is_read_where_its_data_tell_its_end(tmp_path: Path, size: int) -> None:
    lying = PARTS[2][:8] + struct.pack("<L", size) + PARTS[2][12:]
    ids, said = damaged(tmp_path, whole(*PARTS[:2], lying, *PARTS[3:]))
    assert set(without(range(20, 30))) <= set(ids)
    assert ids == sorted(ids)
    assert said[0].split(":")[0] in (f"byte {place(2)}", f"byte {place(2) + size}")


@pytest.mark.parametrize("stated", [0, 1, 479, 481, 2**32 - 1])
def test_a_container_that_states_another_size_than_it_inflates_to(tmp_path: Path, stated: int) -> None:
    lying = made.container(b"".join(FRAMES[20:30]), stated=stated)
    ids, said = damaged(tmp_path, whole(*PARTS[:2], lying, *PARTS[3:]))
    assert ids == list(range(60))
    assert said == [f"byte {place(2)}: a container holds other than the bytes it states"]


@pytest.mark.parametrize(("limit", "most"), [(1 << 20, 8 << 20), (1 << 24, 5 << 24)])
def test_a_bomb_is_not_inflated_beyond_a_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: int, most: int
) -> None:
    """64 MiB of zeros in 64 KiB, with the limit at 1 MiB, and at 16 MiB, where so short a body is inflated at once:
    what is before and behind it is read."""
    import tracemalloc

    from nineaudit.readers.can import blf_inflate

    monkeypatch.setattr(blf_inflate, "LARGEST", limit)
    bomb = made.container(bytes(1 << 26), stated=2**32 - 1)
    tracemalloc.start()
    ids, said = damaged(tmp_path, whole(*PARTS[:2], bomb, *PARTS[3:]))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert ids == without(range(20, 30))
    assert said == [f"byte {place(2)}: a container inflates to more than {limit} bytes; {len(bomb)} bytes lost"]
    assert peak < most


@pytest.mark.parametrize("size", [0, 1, 15, 16, 31, 33, 47, 49, 4000, 2**31, 2**32 - 1])
@pytest.mark.parametrize("method", [0, 2])
def test_an_object_of_a_wrong_size_costs_itself_only(tmp_path: Path, size: int, method: int) -> None:
    """Also a size of 0, which a reader that adds it up never gets past."""
    objects = [*FRAMES[:25], made.obj(1, made.classic(25, bytes(8)), 25, size=size), *FRAMES[26:]]
    stream = b"".join(objects)
    parts = [made.container(stream[i : i + 500], method=method) for i in range(0, len(stream), 500)]
    ids, said = damaged(tmp_path, whole(*parts))
    assert [i for i in ids if i != 25] == without(range(25, 26))
    assert ids == sorted(ids)
    assert len(said) in (1, 2)


@pytest.mark.parametrize("junk", [4, 5, 50, 5000])
def test_garbage_between_objects_is_passed_over(tmp_path: Path, junk: int) -> None:
    """In the stream of objects, and between containers."""
    garbage = random.Random(1).randbytes(junk)
    stream = b"".join([*FRAMES[:25], garbage, *FRAMES[25:]])
    parts = [made.container(stream[i : i + 500]) for i in range(0, len(stream), 500)]
    ids, said = damaged(tmp_path, whole(*parts))
    assert ids == list(range(60))
    assert len(said) == 1
    assert said[0].endswith(f"no object where one must begin; {junk} bytes lost")
    ids, said = damaged(tmp_path, whole(*PARTS[:3], garbage, *PARTS[3:]))
    assert ids == list(range(60))
    found = re.fullmatch(r"byte (\d+): no object where one must begin; (\d+) bytes lost", said[0])
    assert found
    assert place(3) - 3 <= int(found[1]) <= place(3)  # padding counts with it
    assert junk <= int(found[2]) <= junk + 6
    assert len(said) == 1


def test_frames_too_small_for_their_type(tmp_path: Path) -> None:
    objects = [
        made.obj(1, made.classic(1, bytes(8))[:7], 1),
        made.obj(1, made.classic(2, b"abcdefgh")[:11], 2),
        made.obj(100, made.flexible(3, bytes(64), 15)[:19], 3),
        made.obj(101, made.flexible64(4, b"", 0)[:39], 4),
        made.obj(73, b"", 5),
        made.obj(1, made.classic(6, b"abcdefgh"), 6),
    ]
    found = read_bytes(tmp_path, made.log(made.container(made.padded(*objects)), objects=6))
    assert rows(found) == [(2, 2, 0, 3, "1", b"abc"), (6, 6, 0, 8, "1", b"abcdefgh")]
    assert [str(d) for d in found.damage] == [
        "byte 144, inflated byte 0: a frame's object is smaller than its fields (4 times, first there); 193 bytes lost",
        "byte 144, inflated byte 42: a frame's object ends before its data",
    ]


def test_times_and_headers_that_cannot_be(tmp_path: Path) -> None:
    strange = bytearray(made.obj(1, made.classic(2), 2))
    strange[6] = 3  # a version of the header that frames do not have
    objects = made.padded(
        made.obj(1, made.classic(1), 2**64 - 1),
        bytes(strange),
        made.obj(1, made.classic(3), 2**62, unit=1),
        made.obj(1, made.classic(4), 4, unit=0),
    )
    found = read_bytes(tmp_path, made.log(made.container(objects), objects=4))
    assert (found.time.tolist(), found.key.tolist()) == ([4], [4])
    assert [(d.what, d.count) for d in found.damage] == [
        ("a frame's object has a header of a kind that is not known", 1),
        ("a frame is stamped with a time beyond the year 2262", 2),
    ]
    assert found.notes == ("1 frames stamped in a unit that is not known, read as ns",)


@pytest.mark.parametrize("header", [0, 71, 100, 145, 2**32 - 1])
def test_a_header_of_a_wrong_size(tmp_path: Path, header: int) -> None:
    ids, said = damaged(tmp_path, whole(*PARTS, header=header))
    assert ids == list(range(60))
    assert said == []
    said = [str(d) for d in read_blf(tmp_path / "made.blf").damage]
    assert said == [f"byte 4: the header states {header} bytes for itself, and no object begins there"]


def test_what_the_header_counts(tmp_path: Path) -> None:
    found = read_bytes(tmp_path, made.log(made.container(b"".join(FRAMES)), objects=10))
    assert found.notes == ("the header counts 10 objects, 60 are there: the log was not closed, or appended to",)
    assert found.damage == ()
    assert (found.counts["objects"], found.counts["objects_in_header"]) == (60, 10)
    found = read_bytes(tmp_path, made.log(made.container(b"".join(FRAMES)), objects=60, size=144))
    assert found.notes == (f"the header states 144 bytes, the file has {(tmp_path / 'made.blf').stat().st_size}",)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", r"byte 0: not a BLF log; found b''"),
        (b"LOBJ" * 100, r"byte 0: not a BLF log; found b'LOBJ'; expected LOGG and a header of 72 bytes"),
        (made.log(b""), r"no CAN frames in this log; found 'no objects'"),
        (made.log(made.container(made.obj(65, b"text"))), r"no CAN frames in this log; found '1 other objects'"),
        (made.log(bytes(5000)), r"no CAN frames .* byte 144: no object where one must begin; 5000 bytes lost"),
        (made.log(b"LOBJ" * 5000), r"no CAN frames in this log"),
        (made.log(made.container(bytes(100))[:40]), r"byte 144: the file ends inside of a container"),
    ],
    ids=["empty", "other", "no frames", "no CAN", "zeros", "signatures", "nothing whole"],
)
def test_files_without_a_frame(tmp_path: Path, content: bytes, said: str) -> None:
    with pytest.raises(RecordingError, match=said):
        read_bytes(tmp_path, content)


# Random bytes.


def fuzzed(method: int, rng: random.Random) -> tuple[bytes, list[int], list[tuple[int, int]], list[ROW]]:
    """A log of 120 frames in small containers; where these begin; the containers of each frame; the frames."""
    sizes = [rng.choice([0, 3, 8, 8, 8]) if i % 4 else rng.choice(FD_LENGTHS) for i in range(120)]
    data = [rng.randbytes(n) for n in sizes]
    objects = [
        made.obj(1, made.classic(i, d), i) if i % 4 else made.obj(100, made.flexible(i, d, FD_LENGTHS.index(len(d))), i)
        for i, d in enumerate(data)
    ]
    stream = b"".join(objects)
    edges = np.cumsum([0, *map(len, objects)]).tolist()
    cut = 450
    parts = [made.container(stream[i : i + cut], method=method) for i in range(0, len(stream), cut)]
    begins = np.cumsum([144, *(len(p) + len(p) % 4 for p in parts)]).tolist()
    held = [(a // cut, (b - 1) // cut) for a, b in pairwise(edges)]
    frames = [(i, i, 0 if i % 4 else FD, len(d), "1", d) for i, d in enumerate(data)]
    return made.log(made.padded(*parts), objects=120), begins, held, frames


@pytest.mark.parametrize("method", [0, 2])
def test_random_bytes_cost_no_frame_of_another_container(tmp_path: Path, method: int) -> None:
    """A few hundred logs with one to three bytes changed: no error, no frame lost that is in whole containers only,
    none out of order; where the content has a checksum, none that was not written."""
    rng = random.Random(20261122 + method)
    content, begins, held, frames = fuzzed(method, rng)
    assert rows(read_bytes(tmp_path, content)) == frames
    for _ in range(150):
        flipped = bytearray(content)
        places = [rng.randrange(144, len(content)) for _ in range(rng.choice([1, 1, 1, 3]))]
        for at in places:
            flipped[at] ^= rng.randrange(1, 256)
        found = read_bytes(tmp_path, bytes(flipped))
        touched = {int(np.searchsorted(begins, at, side="right")) - 1 for at in places}
        left = [row for row, (a, b) in zip(frames, held, strict=True) if not touched & set(range(a, b + 1))]
        got = rows(found)
        assert [row for row in got if row in set(left)] == left, places
        if method == 2:
            assert [row for row in frames if row in set(got)] == got, places
            assert found.damage or got == frames


def test_random_bytes_in_the_header_and_random_cuts(tmp_path: Path) -> None:
    """Only what is no BLF log any more is refused."""
    rng = random.Random(7)
    content, begins, held, frames = fuzzed(2, rng)
    for at in range(4, 144):
        flipped = content[:at] + bytes([content[at] ^ rng.randrange(1, 256)]) + content[at + 1 :]
        assert [row[1:] for row in rows(read_bytes(tmp_path, flipped))] == [row[1:] for row in frames]
    for _ in range(100):
        end = rng.randrange(800, len(content))
        got = rows(read_bytes(tmp_path, content[:end]))
        assert got == frames[: len(got)]
        more = rows(read_bytes(tmp_path, content[:end] + rng.randbytes(20)))
        whole = sum(begins[last + 1] <= end for _, last in held)
        assert more[:whole] == frames[:whole]


def test_random_content_behind_a_header(tmp_path: Path) -> None:
    """Noise with signatures in it, and with whole heads of objects and containers: frames or RecordingError."""
    rng = random.Random(11)
    read = 0
    for _ in range(80):
        words = [
            b"LOBJ",
            b"LOBJ" + struct.pack("<HHLL", 32, 1, rng.choice([0, 40, 48, 2**31]), rng.choice([1, 10, 101])),
        ]
        content = b"".join(rng.choice([*words, rng.randbytes(rng.randrange(40))]) for _ in range(60))
        for part in (content, made.container(content), made.padded(*PARTS[:2], content, *PARTS[2:])):
            with contextlib.suppress(RecordingError):  # no CAN frames
                read += len(read_bytes(tmp_path, made.log(part)))
    assert read >= 80 * 60 * 0.9


def test_markers_that_state_no_origin(tmp_path: Path) -> None:
    """Text that only looks like one, and one that no stamp could bear."""
    for text in (b"nineaudit time origin -e.- s", b"nineaudit time origin 1e300 s", b"nineaudit time origin \xff s"):
        marker = struct.pack("<LLL3xBLLL12x", 0, 0, 0, 0, len(text), 0, 0) + text
        content = made.padded(made.obj(96, marker), made.obj(1, made.classic(1)))
        assert read_bytes(tmp_path, made.log(made.container(content), objects=2)).origin == 0


def test_a_large_object_over_many_containers_is_searched_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 3 MB, in containers of 64 KiB that are handed on one by one; and one that only says that it is so large."""
    from nineaudit.readers.can import blf_containers, blf_stream

    monkeypatch.setattr(blf_containers, "WINDOW", 1 << 16)
    searched = []
    follow = blf_stream.follow
    monkeypatch.setattr(blf_stream, "follow", lambda buffer, **rest: searched.append(1) or follow(buffer, **rest))
    large = made.obj(65, random.Random(3).randbytes(3_000_000))
    lying = made.obj(65, bytes(3_000_000), size=3_000_100)
    for one in (large, lying):
        searched.clear()
        stream = made.padded(made.obj(1, made.classic(1)), one, *FRAMES)
        parts = [made.container(stream[i : i + 65536]) for i in range(0, len(stream), 65536)]
        found = read_bytes(tmp_path, made.log(made.padded(*parts), objects=62))
        assert found.key.tolist() == [1, *range(60)]
        assert len(searched) <= 6
        assert bool(found.damage) == (one is lying)


@pytest.mark.parametrize("kind", [1, 65])
def test_a_wrong_size_that_ends_where_a_container_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: int
) -> None:
    """An object counts only once the next begins at its end, however the stream is cut; a frame is never that large."""
    from nineaudit.readers.can import blf_containers

    monkeypatch.setattr(blf_containers, "WINDOW", 1)
    for count in range(1, 11):
        lying = made.obj(kind, made.classic(0), size=250 * count)
        stream = b"".join([lying, *FRAMES[1:]])
        parts = [made.container(stream[i : i + 250], method=2 * (count % 2)) for i in range(0, len(stream), 250)]
        ids, said = damaged(tmp_path, whole(*parts))
        assert [i for i in ids if i] == list(range(1, 60))
        assert said
    stream = b"".join([*FRAMES[:5], made.obj(1, made.classic(5), size=48 * 20), *FRAMES[6:]])
    ids, said = damaged(tmp_path, whole(made.container(stream)))
    assert ids == without(range(5, 6))
    assert said == ["byte 144, inflated byte 240: no object where one must begin; 48 bytes lost"]


def test_types_that_are_frames_are_the_same_everywhere() -> None:
    from nineaudit.readers.can import blf_chain, blf_objects

    assert set(blf_chain.FRAMES) == set(blf_objects.TYPES)


@pytest.mark.parametrize(("year", "day"), [(9000, 1), (2262, 12), (1600, 1), (1969, 31)])
def test_a_start_that_no_measurement_has_is_no_date(tmp_path: Path, year: int, day: int) -> None:
    """Found by fuzzing: nanoseconds since 1970 of the year 9000 do not fit 64 bits."""
    path = tmp_path / "log.blf"
    with can.BLFWriter(path) as out:
        for i in range(3):
            out.on_message_received(can.Message(timestamp=1.7e9 + i, arbitration_id=5, data=[i]))
    data = bytearray(path.read_bytes())
    data[40:56] = struct.pack("<8H", year, 1, 0, day, 0, 0, 0, 0)
    path.write_bytes(data)
    log = read_blf(path)
    assert np.diff(log.time).tolist() == [10**9, 10**9]
    assert log.time[0] < 10**9
    assert [x.place for x in log.damage] == ["byte 40"]
