"""Readers: one motion in every format; files that are damaged, empty, misnamed or incomplete."""

from __future__ import annotations

import itertools
import json
import re
import struct
import zlib
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import recordings
from nineaudit.errors import ConfigurationError, NineauditError, RecordingError
from nineaudit.readers import READERS, read
from nineaudit.recording import Recording
from nineaudit.rig import Rig, parse_rig
from recordings import CAN_FORMATS, MCAP_FORMATS, TABLE_FORMATS, array_rig, motion, write_any

RIG = array_rig()
MOTION = motion(RIG)
SMALL = '[rig]\nname="s"\n[units]\nacceleration="m/s^2"\n{recording}' + "".join(
    f'[[sensor]]\nchannel="{c}"\nkind="accelerometer"\nposition=[0,0,0]\naxis=[1,0,0]\n' for c in ("p", "q")
)


def small_rig(recording: str = '[recording]\ntime="t_s"\n') -> Rig:
    return parse_rig(SMALL.format(recording=recording))


def rows(count: int = 12, pattern: str = "{t},{p},{q}\n") -> str:
    return "".join(pattern.format(t=i / 100, p=i + 0.5, q=-i) for i in range(count))


def table(tmp_path: Path, text: str | bytes, name: str = "t.csv") -> Path:
    path = tmp_path / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def test_every_suffix_has_the_same_tests() -> None:
    tested = {Path(f"x{suffix}").suffix for suffix in CAN_FORMATS + TABLE_FORMATS}
    assert tested | {".mme", ".zip"} == set(READERS)  # tests/test_mme.py


@pytest.mark.parametrize("suffix", CAN_FORMATS + TABLE_FORMATS + MCAP_FORMATS)
def test_the_same_motion_in_every_format(tmp_path: Path, suffix: str) -> None:
    path = write_any(MOTION, tmp_path, suffix)
    found = read(path, RIG, dbc=[tmp_path / "rig.dbc"] if suffix in CAN_FORMATS else [])
    if suffix in CAN_FORMATS:  # half a step of the database: 1.25 full scale in 2^20 steps, to three digits
        step = np.array([1.25 * (s.full_scale or 0) / (2**20 - 1) * 1.005 for s in RIG.array.sensors])
    else:  # one unit in the last place of the largest reading
        step = np.spacing(np.abs(MOTION.readings).max(axis=0)) * 2
    assert (np.abs(found.readings - MOTION.readings).max(axis=0) <= 0.5 * step).all()
    assert found.valid.all()
    # Logs that only python-can writes count from a date: stamps in floating-point seconds are 0.24 µs apart.
    dated = suffix in (".log", ".trc", ".can.csv", ".mf4", ".db")
    start = MOTION.time[0] if dated else 0.0
    np.testing.assert_allclose(found.time, MOTION.time - start, atol=2.5e-7 if dated else 1e-9, rtol=0)
    assert found.clocks[0].rate == pytest.approx(1e4, rel=1e-4)
    assert (found.clocks[0].gaps, found.clocks[0].lost, found.resampled) == ((), 0, ())
    assert found.source.unchanged_after_read
    assert found.source.size == path.stat().st_size or suffix == ".mme"  # a test of several files


def test_the_source_is_hashed_before_and_after(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import hashlib

    path = table(tmp_path, "t_s,p,q\n" + rows())
    source = read(path, small_rig()).source
    assert source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert source.unchanged_after_read

    def tampering(path: Path, rig: Rig) -> Any:
        contents = READERS[".tsv"](path, rig)
        path.write_bytes(path.read_bytes() + b"9,9,9\n")
        return contents

    monkeypatch.setattr("nineaudit.readers.READERS", {**READERS, ".csv": tampering})
    assert not read(path, small_rig()).source.unchanged_after_read


# --- text tables -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("head", "pattern"),
    [
        ("t_s,p,q\n", "{t},{p},{q}\n"),
        ("\ufefft_s,p,q\n", "{t},{p},{q}\n"),
        ("# made by hand\n#\n\nt_s,p,q\n", "{t},{p},{q}\n"),
        ("t_s;p;q\n", "{t};{p};{q}\n"),
        ("t_s\tp\tq\n", "{t}\t{p}\t{q}\n"),
        ("t_s|p|q\n", "{t}|{p}|{q}\n"),
        (' "t_s", p ,q\n', "{t}, {p} ,{q}\n"),
        ("t_s,p,q\r\n", "{t},{p},{q}\r\n"),
        ("t_s,p,q\n", '"{t}","{p}",{q}\n'),
        ("q,other,p,t_s\n", "{q},text here,{p},{t}\n"),
        ("t_s,p,q\n", "{t},{p},{q},\n"),
        ("t_s,p,q,\n", "{t},{p},{q},\n"),
        ("t_s,p,q\n", "{t},{p},{q}\n\n"),
    ],
)
def test_dialects_read_the_same(tmp_path: Path, head: str, pattern: str) -> None:
    found = read(table(tmp_path, head + rows(pattern=pattern)), small_rig())
    np.testing.assert_array_equal(found.time, np.arange(12) / 100)
    np.testing.assert_array_equal(found.readings.T, [np.arange(12) + 0.5, -np.arange(12.0)])


@pytest.mark.parametrize("setting", ["", 'separator=";"\ndecimal=","\n'])
def test_decimal_comma_is_detected_or_set(tmp_path: Path, setting: str) -> None:
    text = "t_s;p;q\n" + rows(pattern="{t};{p};{q}\n").replace(".", ",")
    found = read(table(tmp_path, text), small_rig(f'[recording]\ntime="t_s"\n{setting}'))
    np.testing.assert_array_equal(found.column("p"), np.arange(12) + 0.5)


@pytest.mark.parametrize(
    ("name", "recording", "scale"),
    [
        ("t_ms", '[recording]\ntime="t_ms"\n', 1e-3),
        ("t_us", '[recording]\ntime="t_us"\n', 1e-6),
        ("t_ns", "", 1e-9),
        ("Time [ms]", "", 1e-3),
        ("clock", '[recording]\ntime="clock"\ntime_unit="us"\n', 1e-6),
    ],
)
def test_unit_of_time_by_suffix_or_rig(tmp_path: Path, name: str, recording: str, scale: float) -> None:
    found = read(table(tmp_path, f"{name},p,q\n" + rows()), small_rig(recording))
    np.testing.assert_allclose(found.time, np.arange(12) / 100 * scale, rtol=1e-15)


def test_time_without_a_unit_is_said_to_be_taken_as_seconds(tmp_path: Path) -> None:
    found = read(table(tmp_path, "time,p,q\n" + rows()), small_rig(""))
    assert any("taken as seconds" in note for note in found.source.notes)


def test_cells_without_a_number_are_invalid_counted_and_named(tmp_path: Path) -> None:
    lines = ("t_s,p,q\n" + rows()).splitlines()
    lines[4] = "0.03,n/a,-3"
    lines[6] = "0.05,,-5"
    lines[8] = "0.07,1_000,inf"
    found = read(table(tmp_path, "\n".join(lines) + "\n"), small_rig())
    assert found.source.counts["invalid_cells"] == 4
    assert np.flatnonzero(~found.valid[:, 0]).tolist() == [3, 5, 7]
    assert np.flatnonzero(~found.valid[:, 1]).tolist() == [7]
    assert np.isnan(found.readings[~found.valid]).all()
    assert "column 'p': 3 cells without a number, first in line 5: 'n/a'" in found.source.notes


def test_rows_without_a_time_are_left_out_and_counted(tmp_path: Path) -> None:
    found = read(table(tmp_path, "t_s,p,q\n" + rows() + ",99,99\n"), small_rig())
    assert found.time.size == 12
    assert found.source.counts["rows_without_time"] == 1


def test_a_last_line_without_an_end_is_damage(tmp_path: Path) -> None:
    damage = read(table(tmp_path, "t_s,p,q\n" + rows()[:-1]), small_rig()).source.damage
    assert [str(d) for d in damage] == [
        "line 13: the last line has no line end: the file may be cut; its last number may not be whole"
    ]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("t_s,p,r\n" + rows(), r"line 1: missing channel 'q'; expected a column 'q'; there is t_s, p, r"),
        ("t_s,pp,q\n" + rows(), r"missing channel 'p'.*did you mean 'pp'"),
        ("t_s,p,p,q\n" + rows(pattern="{t},{p},{p},{q}\n"), r"column 'p' is there 2 times; found 'columns 2, 3'"),
        ("time,p,q\n" + rows(), r"missing time; expected a column 't_s'"),
        (rows(), r"line 1: no header row"),
        ("t_s,p,q\n", r"a header but no rows"),
        ("# only\n\n", r"nothing but blank lines and comments"),
        ("", r"the file is empty"),
        ("t_s,p,q\n" + rows(5), r"too few samples; found '5 with a time stamp"),
        (
            "t_s,p,q\n" + rows(pattern="x,{p},{q}\n"),
            r"t_s': no row has a time that is a number; found \"first in line 2: 'x'",
        ),
    ],
)
def test_tables_that_cannot_be_read(tmp_path: Path, text: str | bytes, says: str) -> None:
    path = table(tmp_path, text)
    with pytest.raises(RecordingError, match=says) as caught:
        read(path, small_rig())
    assert caught.value.exit_code == 3
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_parquet_of_text_and_cut_parquet(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = tmp_path / "t.parquet"
    pq.write_table(pa.table({"t_s": [i / 100 for i in range(12)], "p": ["x"] * 12, "q": [1.0] * 12}), path)
    with pytest.raises(RecordingError, match="column 'p': a column that does not hold numbers; found 'string'"):
        read(path, small_rig())
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(RecordingError, match="cut short or damaged"):
        read(path, small_rig())


def test_parquet_dates_are_counted_exactly(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    ticks = pa.array([1_700_000_000_000_000_000 + 100_000 * i for i in range(12)], pa.timestamp("ns"))
    numbers = [float(i) for i in range(12)]
    pq.write_table(pa.table({"t_s": ticks, "p": numbers, "q": [None, *numbers[1:]]}), tmp_path / "t.parquet")
    found = read(tmp_path / "t.parquet", small_rig())
    np.testing.assert_array_equal(found.time, np.arange(12) * 100_000 * 1e-9)
    assert np.flatnonzero(~found.valid[:, 1]).tolist() == [0]
    assert any("2023-11-14" in note for note in found.source.notes)


# --- which file ---------------------------------------------------------------------------------------------------


def test_files_that_are_no_recordings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cases = [
        (tmp_path / "none.csv", "cannot be read: No such file"),
        (tmp_path, "is a folder, not a recording"),
        (table(tmp_path, "x", "t.xlsx"), "unknown kind of file; found '.xlsx'; expected one of .csv"),
        (table(tmp_path, "x", "t.bfl"), "did you mean '.blf'"),
        (table(tmp_path, "t_s,p,q\n", "t.blf"), r"byte 0: the content is not what the suffix .blf says"),
        (table(tmp_path, b"LOGG" + bytes(200), "u.csv"), "found 'a BLF log'; expected text; rename it to .blf"),
        (table(tmp_path, b"\x89MCAP0\r\n" + bytes(99), "u.blf"), "found 'an MCAP log'; expected a BLF log"),
        (table(tmp_path, b"PK\x03\x04" + bytes(99), "v.csv"), r"found 'a ZIP archive \(or a spreadsheet\)'"),
    ]
    for path, says in cases:
        with pytest.raises(RecordingError, match=says):
            read(path, small_rig())
    locked = table(tmp_path, "t_s,p,q\n" + rows())

    def refuse(*_: Any, **__: Any) -> Any:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(RecordingError, match="cannot be read: Permission denied"):
        read(locked, small_rig())


# --- CAN ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def blf(tmp_path: Path) -> Path:
    return write_any(MOTION, tmp_path, ".blf")


def read_can(path: Path, rig: Rig = RIG) -> Recording:
    return read(path, rig, dbc=[path.parent / "rig.dbc"])


def test_counts_of_a_can_log(tmp_path: Path, blf: Path) -> None:
    import can

    with can.BLFReader(blf) as log:
        frames = list(log)
    short = frames[100]
    short.data, short.dlc = short.data[:3], 3
    stranger = can.Message(timestamp=frames[50].timestamp, arbitration_id=0x7AB, data=[1, 2, 3], is_extended_id=False)
    extended = can.Message(timestamp=frames[50].timestamp, arbitration_id=0x100, data=[0] * 8, is_extended_id=True)
    error = can.Message(timestamp=frames[51].timestamp, is_error_frame=True)
    remote = can.Message(
        timestamp=frames[52].timestamp, arbitration_id=0x100, is_remote_frame=True, dlc=8, is_extended_id=False
    )
    path = tmp_path / "more.blf"
    with can.BLFWriter(path) as out:
        for frame in [*frames[:53], stranger, extended, error, remote, *frames[53:]]:
            out.on_message_received(frame)
    found = read_can(path)
    n = 2 * MOTION.time.size
    expected = {
        "frames": n + 4,
        "error_frames": 1,
        "remote_frames": 1,
        "overload_frames": 0,
        "bytes": 8 * n - 5 + 3 + 8,
        "other_objects": 0,
        "frames_used": n,
        "frames_not_in_database": 2,
        "frames_of_other_buses": 0,
        "short_frames": 1,
        "undecodable_frames": 0,
        "unavailable_values": 0,
    }
    assert {name: found.source.counts[name] for name in expected} == expected
    assert not found.source.damage
    assert found.bus is not None
    assert sum(x.frames for x in found.bus.identifiers) == n + 2
    invalid = np.argwhere(~found.valid)
    assert invalid[:, 0].tolist() == [50, 50, 50]
    assert [found.channels[i] for i in invalid[:, 1]] == ["a0x", "a0y", "a0z"]


def test_one_message_on_two_buses_is_taken_from_one(tmp_path: Path, blf: Path) -> None:
    import can

    with can.BLFReader(blf) as log:
        frames = list(log)
    path = tmp_path / "two.blf"
    with can.BLFWriter(path) as out:
        for i, frame in enumerate(frames):
            out.on_message_received(frame)
            if i % 10 == 0:
                frame.channel, frame.data = 1, bytes(8)
                out.on_message_received(frame)
    found = read_can(path)
    left_out = -(-len(frames) // 10)
    assert found.source.counts["frames_of_other_buses"] == left_out
    assert any("taken from bus 1" in note for note in found.source.notes)
    assert np.abs(found.readings - MOTION.readings).max() < 3e-3


@pytest.mark.parametrize(
    ("signal", "says"),
    [
        ("NAAP_A.A0Q", r"signal NAAP_A.A0Q: message NAAP_A .* has no signal A0Q; did you mean 'A0"),
        ("NAAP_C.A0X", r"no message NAAP_C; did you mean 'NAAP_"),
        ("A0Q", r"the CAN database has no signal A0Q; did you mean"),
    ],
)
def test_unknown_signals_suggest_the_nearest(blf: Path, signal: str, says: str) -> None:
    rig = parse_rig(recordings.rig_text().replace("NAAP_A.A0X", signal))
    with pytest.raises(ConfigurationError, match=says):
        read_can(blf, rig)


def test_a_bare_signal_is_enough_where_it_is_unique(blf: Path) -> None:
    rig = parse_rig(recordings.rig_text().replace("NAAP_A.A0X", "A0X"))
    np.testing.assert_array_equal(read_can(blf, rig).readings, read_can(blf).readings)


def test_a_bare_signal_of_two_messages_is_asked_about(blf: Path) -> None:
    dbc = blf.parent / "rig.dbc"
    dbc.write_text(dbc.read_text().replace(" A1Y ", " A0X "))
    rig = parse_rig(recordings.rig_text().replace("NAAP_A.A0X", "A0X").replace("NAAP_B.A1Y", "NAAP_B.A0X"))
    with pytest.raises(ConfigurationError, match=r"more than one message.*NAAP_A.A0X \(0x100\), NAAP_B.A0X \(0x101\)"):
        read_can(blf, rig)


def test_without_a_database_or_with_a_bad_one(tmp_path: Path, blf: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"needs a database.*--dbc"):
        read(blf, RIG)
    bad = table(tmp_path, "BO_ nonsense", "bad.dbc")
    with pytest.raises(ConfigurationError, match=r"bad.dbc: not a CAN database that can be used"):
        read(blf, RIG, dbc=[bad])
    with pytest.raises(ConfigurationError, match=r"none.dbc: cannot read the CAN database: No such file"):
        read(blf, RIG, dbc=[tmp_path / "none.dbc"])


def test_a_message_that_is_not_in_the_log(blf: Path) -> None:
    dbc = blf.parent / "rig.dbc"
    dbc.write_text(dbc.read_text().replace("BO_ 257 NAAP_B", "BO_ 300 NAAP_B"))
    with pytest.raises(RecordingError, match=r"missing channel 'a1y': no frame of message NAAP_B \(0x12C\)") as caught:
        read_can(blf)
    assert "1502 frames, most of them NAAP_A 0x100" in str(caught.value)


def test_the_unit_of_the_database_comes_first(blf: Path) -> None:
    dbc = blf.parent / "rig.dbc"
    text = dbc.read_text()
    dbc.write_text(text.replace('"g_0"', '"m/s^2"'))
    found = read_can(blf)
    accelerations = [i for i, s in enumerate(RIG.array.sensors) if s.kind == "accelerometer"]
    np.testing.assert_allclose(found.readings[:, accelerations] * 9.80665, MOTION.readings[:, accelerations], atol=3e-3)
    assert any("a0x in m/s^2 (rig: g_0)" in note for note in found.source.notes)
    dbc.write_text(text.replace('"g_0"', '"furlong"'))
    with pytest.raises(RecordingError, match=r"signal NAAP_A.A0X: unknown unit of acceleration; found 'furlong'"):
        read_can(blf)


def test_multiplexed_signals_are_samples_only_where_they_are(tmp_path: Path) -> None:
    import can

    dbc = """VERSION ""\nNS_ :\nBS_:\nBU_: X\nBO_ 256 M: 8 X
 SG_ page M : 0|8@1+ (1,0) [0|255] "" X
 SG_ p m0 : 8|16@1- (0.5,0) [0|0] "m/s^2" X
 SG_ q m1 : 8|16@1- (0.25,1) [0|0] "m/s^2" X
"""
    path = tmp_path / "m.blf"
    with can.BLFWriter(path) as out:
        for i in range(40):
            data = struct.pack("<Bh5x", i % 2, i - 20)
            out.on_message_received(
                can.Message(timestamp=i * 0.01, arbitration_id=256, data=data, is_extended_id=False)
            )
    found = read(path, small_rig(""), dbc=[table(tmp_path, dbc, "m.dbc")])
    p, q = found.native
    np.testing.assert_allclose(p.time, np.arange(0, 0.4, 0.02), atol=1.1e-9)
    np.testing.assert_array_equal(p.values, 0.5 * (np.arange(0, 40, 2) - 20))
    np.testing.assert_array_equal(q.values, 0.25 * (np.arange(1, 40, 2) - 20) + 1)
    assert found.resampled == ("q",)


NEWLINE = b"\n"

# --- damage -------------------------------------------------------------------------------------------------------


def containers(data: bytes) -> list[tuple[int, int]]:
    """(offset, size) of the objects of a BLF file."""
    found, at = [], struct.unpack_from("<L", data, 4)[0]
    while at < len(data):
        size = struct.unpack_from("<L", data, at + 8)[0]
        found.append((at, size))
        at += size + size % 4
    return found


@pytest.mark.parametrize("where", ["within", "between", "header"])
def test_a_cut_blf_keeps_what_is_whole_and_says_what_is_not(tmp_path: Path, where: str) -> None:
    import can

    whole = write_any(motion(RIG, duration_s=0.3), tmp_path, ".blf")
    data = whole.read_bytes()
    objects = containers(data)
    assert len(objects) > 2
    at, size = objects[-1]
    cut = {"within": at + size // 2, "between": at, "header": at + 7}[where]
    path = table(tmp_path, data[:cut], "cut.blf")
    if where == "between":  # the reference says nothing
        with can.BLFReader(path) as log, can.BLFReader(whole) as other:
            assert 0 < sum(1 for _ in log) < sum(1 for _ in other)
    found, all_of_it = read_can(path), read_can(whole)
    assert found.source.damage
    assert not all_of_it.source.damage
    n = found.time.size
    assert 100 < n < all_of_it.time.size
    np.testing.assert_array_equal(found.readings[:-1], all_of_it.readings[: n - 1])


def test_flipped_bits_in_a_blf_are_found(tmp_path: Path) -> None:
    blf = write_any(motion(RIG, duration_s=0.3), tmp_path, ".blf")
    whole = read(blf, RIG, dbc=[tmp_path / "rig.dbc"])
    data = bytearray(blf.read_bytes())
    at, size = containers(bytes(data))[0]
    zlib.decompress(data[at + 32 : at + size])  # it was whole
    data[at + size // 2] ^= 0xFF
    with pytest.raises(zlib.error):
        zlib.decompress(data[at + 32 : at + size])
    blf.write_bytes(data)
    found = read_can(blf)
    assert any(f"byte {at}" in str(x) for x in found.source.damage), found.source.damage
    assert found.source.counts["frames"] < whole.source.counts["frames"]


@pytest.mark.parametrize("suffix", [".asc", ".log", ".trc", ".can.csv"])
def test_a_cut_text_log(tmp_path: Path, suffix: str) -> None:
    path = write_any(MOTION, tmp_path, suffix)
    whole, data = read_can(path), path.read_bytes()
    cut = data[: len(data) // 2]
    cut = cut[: cut.rindex(b"\n", 0, -20) + 15]
    assert not cut.endswith(b"\n")
    path.write_bytes(cut)
    found = read_can(path)
    assert [x.place for x in found.source.damage] == [f"line {cut.count(NEWLINE) + 1}"]
    assert 10 < found.time.size < whole.time.size
    np.testing.assert_array_equal(found.readings[:-1], whole.readings[: found.time.size - 1])


def test_an_asc_log_without_its_end_is_remarked(tmp_path: Path) -> None:
    path = write_any(MOTION, tmp_path, ".asc")
    path.write_text(path.read_text().replace("End TriggerBlock\n", ""))
    assert any("End TriggerBlock" in note for note in read_can(path).source.notes)


def test_an_asc_log_without_the_end_of_its_header_keeps_its_first_frame(tmp_path: Path) -> None:
    path = write_any(MOTION, tmp_path, ".asc")
    text = re.sub(r"no internal events logged\nBegin.*\n", "", path.read_text())
    path.write_text(text.replace("End TriggerBlock\n", ""))
    assert read_can(path).source.counts["frames"] == 2 * MOTION.time.size


def test_asc_stamps_from_frame_to_frame_are_added_up(tmp_path: Path) -> None:
    path = write_any(MOTION, tmp_path, ".asc")
    whole = read_can(path)
    stamp = re.compile(r"^( *)([0-9]+\.[0-9]+)(?= )", re.M)
    stamps = [Decimal(found[2]) for found in stamp.finditer(path.read_text())]
    steps = iter([stamps[0], *(b - a for a, b in itertools.pairwise(stamps))])
    text = stamp.sub(lambda found: f"{found[1]}{next(steps):.6f}", path.read_text())
    path.write_text(text.replace("timestamps absolute", "timestamps relative"))
    np.testing.assert_array_equal(read_can(path).time, whole.time)


@pytest.mark.usefixtures("blf")
def test_text_that_is_no_can_log(tmp_path: Path) -> None:
    for name, says in {
        "x.log": "line 1: no CAN frames in this log; found 'Dear reader,'; expected",
        "x.asc": "no CAN frames in this log",
        "x.trc": "no CAN frames in this log",
    }.items():
        path = table(tmp_path, "Dear reader,\nthis is a letter.\n", name)
        with pytest.raises(RecordingError, match=says):
            read_can(path)


@pytest.mark.parametrize("part", [0.1, 0.5, 0.99])
def test_a_cut_mf4(tmp_path: Path, part: float) -> None:
    path = write_any(MOTION, tmp_path, ".mf4")
    data = path.read_bytes()
    path.write_bytes(data[: int(part * len(data))])
    with pytest.raises(RecordingError, match="cut short or damaged"):
        read_can(path)


def test_mf4_without_asammdf_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    path = write_any(MOTION, tmp_path, ".mf4")
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(ConfigurationError, match=r'needs asammdf; pip install "nineaudit\[mdf\]"'):
        read_can(path)


@pytest.mark.parametrize("part", [0.2, 0.6])
def test_a_cut_mcap(tmp_path: Path, part: float) -> None:
    path = write_any(MOTION, tmp_path, ".mcap")
    data = path.read_bytes()
    path.write_bytes(data[: int(part * len(data))])
    with pytest.raises(RecordingError, match=r"cut short or damaged.* no messages could be read"):
        read(path, RIG)


def test_a_flipped_byte_in_an_mcap_chunk(tmp_path: Path) -> None:
    from mcap.writer import CompressionType, Writer

    path = tmp_path / "t.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start()
        schema = writer.register_schema("s", "jsonschema", b"{}")
        channel = writer.register_channel("/imu", "json", schema)
        for i in range(20):
            data = json.dumps({"p": i + 0.5, "q": -i}).encode()
            writer.add_message(channel, log_time=i * 10**7, publish_time=0, data=data)
        writer.finish()
    assert read(path, small_rig("")).column("p")[3] == 3.5
    whole = path.read_bytes()
    assert whole.count(b'"p": 3.5') == 1
    path.write_bytes(whole.replace(b'"p": 3.5', b'"p": 7.5'))
    with pytest.raises(RecordingError, match=r"a chunk whose checksum \(CRC\) does not hold; 20 messages lost"):
        read(path, small_rig(""))


# --- MCAP ---------------------------------------------------------------------------------------------------------

IMU = """float64 t
geometry_msgs/Vector3 linear_acceleration
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""


def write_ros(path: Path, count: int = 20) -> None:
    from mcap_ros2.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        schema = writer.register_msgdef("test/Imu", IMU)
        for i in range(count):
            message = {"t": i / 100, "linear_acceleration": {"x": i + 0.5, "y": -i, "z": 0.0}}
            stamp = 1_700_000_000_000_000_000 + i * 10**7
            writer.write_message("/imu", schema, message, log_time=stamp, publish_time=stamp, sequence=i)
        writer.finish()


def with_signals(rig: Rig, *signals: str) -> Rig:
    sensors = tuple(replace(s, signal=signal) for s, signal in zip(rig.array.sensors, signals, strict=True))
    return replace(rig, array=replace(rig.array, sensors=sensors))


def test_ros2_messages(tmp_path: Path) -> None:
    path = tmp_path / "ros.mcap"
    write_ros(path)
    rig = with_signals(small_rig(""), "/imu:linear_acceleration.x", "/imu:linear_acceleration.y")
    found = read(path, rig)
    np.testing.assert_array_equal(found.readings.T, [np.arange(20) + 0.5, -np.arange(20.0)])
    np.testing.assert_array_equal(found.time, np.arange(20) * 10**7 * 1e-9)
    assert any("1700000000000000000 ns" in note for note in found.source.notes)
    timed = read(path, replace(rig, time_signal="/imu:t"))
    np.testing.assert_array_equal(timed.time, np.arange(20) / 100)


@pytest.mark.parametrize(
    ("signal", "says"),
    [
        ("/imu:linear_acceleration.w", r"topic /imu: missing channel 'p'.*did you mean 'linear_acceleration\.[xyz]'"),
        ("/img:x", r"missing channel 'p'; expected a topic '/img'; did you mean '/imu'"),
        ("w", r"missing channel 'p'; expected /topic:w"),
    ],
)
def test_missing_topics_and_fields(tmp_path: Path, signal: str, says: str) -> None:
    path = tmp_path / "ros.mcap"
    write_ros(path)
    with pytest.raises(RecordingError, match=says):
        read(path, with_signals(small_rig(""), signal, "/imu:linear_acceleration.y"))


def test_json_values_that_are_no_numbers(tmp_path: Path) -> None:
    from mcap.writer import Writer

    path = tmp_path / "t.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/imu", "json", 0)
        odd = {3: b'{"p": null, "q": 1}', 4: b'{"q": 1}', 5: b'{"p": "x", "q": 1}', 6: b"not json"}
        for i in range(20):
            data = odd.get(i, b'{"p": 2.5, "q": 1}')
            writer.add_message(channel, log_time=i * 10**7, publish_time=0, data=data)
        writer.finish()
    found = read(path, small_rig(""))
    assert np.flatnonzero(~found.valid[:, 0]).tolist() == [3, 4, 5, 6]
    assert np.flatnonzero(~found.valid[:, 1]).tolist() == [6]
    assert found.source.counts["undecodable_messages"] == 1
    assert found.source.counts["invalid_values"] == 5


def test_an_encoding_that_is_not_read(tmp_path: Path) -> None:
    from mcap.writer import Writer

    path = tmp_path / "t.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/imu", "protobuf", 0)
        writer.add_message(channel, log_time=0, publish_time=0, data=b"\x08\x01")
        writer.finish()
    with pytest.raises(
        RecordingError, match=r"topic /imu: messages in an encoding.*protobuf.*expected JSON, protobuf, ROS 2"
    ):
        read(path, with_signals(small_rig(""), "/imu:p", "/imu:q"))


def test_every_error_is_one_of_ours() -> None:
    assert issubclass(RecordingError, NineauditError)
    assert (RecordingError.exit_code, ConfigurationError.exit_code) == (3, 2)
