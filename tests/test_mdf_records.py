"""MF4 frames out of records of any layout: against what was written, and against asammdf's own records."""

from __future__ import annotations

import struct
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mdf_files import DATA, ERROR, REMOTE, Blocks, Row, Style, random_rows, write_mf4
from nineaudit.errors import RecordingError
from nineaudit.readers.can import mdf
from nineaudit.readers.can.frames import Frames
from nineaudit.readers.can.mdf import read_mdf
from nineaudit.recording import Damage

pytest.importorskip("asammdf")
COLUMNS = ("time", "key", "bus", "kind", "length", "data", "long_rows", "long")
KINDS = {REMOTE: 1, ERROR: 2}


def check(log: Frames, rows: list[Row], kind: int = 0) -> None:
    """The log is those frames, in that order."""
    assert log.time.tolist() == [row["time"] for row in rows]
    assert log.bus.tolist() == [row["BusChannel"] for row in rows]
    assert log.key.tolist() == [0 if kind == 2 else row["ID"] | row["IDE"] << 31 for row in rows]
    bits = [row["EDL"] * 8 | row["BRS"] * 16 | row["ESI"] * 32 | row["Dir"] * 64 | kind for row in rows]
    assert log.kind.tolist() == bits
    if kind:
        assert log.length.tolist() == [0 if kind == 2 else min(row["DLC"], 8) for row in rows]
        return
    assert log.length.tolist() == [len(row["bytes"]) for row in rows]
    for i, row in enumerate(rows):
        held = log.payload(np.array([i]))[0].tobytes()
        assert held == row["bytes"].ljust(len(held), b"\0")


def forced(path: Path, monkeypatch: pytest.MonkeyPatch) -> Frames:
    """The same by asammdf's own reading of records."""
    with monkeypatch.context() as patch:
        patch.setattr(mdf, "layout", lambda *_: None)
        return read_mdf(path)


def equal(one: Frames, other: Frames) -> None:
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


STYLES = st.builds(
    Style,
    seed=st.integers(0, 2**16),
    width=st.sampled_from([0, 3, 8, 12, 64]),
    unsorted=st.booleans(),
    clock=st.sampled_from(["f8", "u8"]),
    compression=st.sampled_from(["", "deflate", "transposed"]),
    cuts=st.integers(0, 5),
)


@settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(style=STYLES, count=st.integers(1, 90))
def test_any_layout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, style: Style, count: int) -> None:
    rows = random_rows(np.random.default_rng(style.seed + 1), count, style.width)
    path = write_mf4(tmp_path / "any.mf4", [(DATA, rows, style)])
    with monkeypatch.context() as patch:  # no way round
        patch.setattr(mdf, "by_asammdf", lambda *_: pytest.fail("not read from its records"))
        log = read_mdf(path)
    check(log, rows)
    assert log.damage == ()
    equal(log, forced(path, monkeypatch))


@pytest.mark.parametrize("compression", range(7))
def test_every_compression_that_asammdf_writes(tmp_path: Path, compression: int) -> None:
    """Deflate, zstd and LZ4, as is and transposed; MDF 4.30 has the last four."""
    from asammdf import MDF

    rows = random_rows(np.random.default_rng(4), 500, 64)
    path = write_mf4(tmp_path / "plain.mf4", [(DATA, rows, Style(width=64))])
    with MDF(path, process_bus_logging=False) as plain, MDF(version="4.30") as out:
        out.append(plain.get("CAN_DataFrame", group=0, raw=True))
        out.save(tmp_path / "t.mf4", overwrite=True, compression=compression)
    log = read_mdf(tmp_path / "t.mf4")
    check(log, rows)
    assert log.damage == ()
    assert (b"##DZ" in (tmp_path / "t.mf4").read_bytes()) == (compression > 0)


def test_windows_smaller_than_the_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nineaudit.readers.can.mdf_blocks._WINDOW", 100)
    monkeypatch.setattr("nineaudit.readers.can.mdf_records._ROWS", 7)
    for style in (Style(width=0, cuts=3), Style(width=64, cuts=3, compression="deflate"), Style(width=8)):
        rows = random_rows(np.random.default_rng(5), 200, style.width)
        check(read_mdf(write_mf4(tmp_path / "t.mf4", [(DATA, rows, style)])), rows)


def test_groups_of_all_kinds_by_their_stamps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(6)
    groups = [(name, random_rows(rng, 30, 8), Style(k)) for k, name in enumerate((DATA, DATA, REMOTE, ERROR))]
    path = write_mf4(tmp_path / "t.mf4", groups)
    log = read_mdf(path)
    assert len(log) == 120
    assert (np.diff(log.time) >= 0).all()
    for name, kind in KINDS.items():
        rows = next(rows for n, rows, _ in groups if n == name)
        check(log.take(np.flatnonzero(log.kind & kind)), rows, kind)
    equal(log, forced(path, monkeypatch))


def test_time_that_goes_back_in_a_group_shows(tmp_path: Path) -> None:
    rows = random_rows(np.random.default_rng(7), 20, 8)
    rows[10:] = [row | {"time": row["time"] - rows[10]["time"]} for row in rows[10:]]
    others = random_rows(np.random.default_rng(8), 5, 8)
    alone = read_mdf(write_mf4(tmp_path / "a.mf4", [(DATA, rows, Style())]))
    assert alone.time.tolist() == [row["time"] for row in rows]
    both = read_mdf(write_mf4(tmp_path / "b.mf4", [(DATA, rows, Style()), (ERROR, others, Style())]))
    assert both.time[(both.kind & 2) == 0].tolist() == [row["time"] for row in rows]


@pytest.mark.parametrize("stamp", [np.nan, np.inf, -np.inf, 1e300, 9.3e9, -1e10])
@pytest.mark.parametrize("plain", [True, False])
def test_a_stamp_that_is_no_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stamp: float, plain: bool) -> None:
    """Converted to int64 it would be a time of 1677, or any other."""
    rows = random_rows(np.random.default_rng(9), 12, 8)
    spoilt = [row | ({"time": stamp * 1e9} if i in (3, 7) else {}) for i, row in enumerate(rows)]
    path = write_mf4(tmp_path / "t.mf4", [(DATA, spoilt, Style())])
    log = read_mdf(path) if plain else forced(path, monkeypatch)
    check(log, [row for i, row in enumerate(rows) if i not in (3, 7)])
    (damage,) = log.damage
    assert damage.what == "a time stamp that is no number or beyond the year 2262"
    assert (damage.count, damage.lost) == (2, "2 frames lost")
    assert damage.place == ("record 4 of channel group 0" if plain else "channel group 0")


@pytest.mark.parametrize("width", [0, 8])
def test_a_length_beyond_the_data(tmp_path: Path, width: int) -> None:
    """The bytes that are there are kept."""
    rows = random_rows(np.random.default_rng(10), 12, 8)
    full = 5
    rows[full] |= {"DataLength": 60, "bytes": b"abcdefgh"}
    log = read_mdf(write_mf4(tmp_path / "t.mf4", [(DATA, rows, Style(width=width))]))
    check(log, rows)
    assert log.damage == (Damage("a length beyond the bytes that are there", f"record {full + 1} of channel group 0"),)


def test_no_data_at_all_are_not_zeros(tmp_path: Path) -> None:
    rows = random_rows(np.random.default_rng(11), 12, 8)
    path = write_mf4(tmp_path / "t.mf4", [(DATA, rows, Style())])
    path.write_bytes(path.read_bytes().replace(b"CAN_DataFrame.DataBytes", b"CAN_DataFrame.DataOther"))
    log = read_mdf(path)
    assert not log.length.any()
    assert log.damage[0].count == sum(row["DataLength"] > 0 for row in rows)


def test_signal_data_that_are_not_there(tmp_path: Path) -> None:
    rows = random_rows(np.random.default_rng(12), 12, 0)
    log = read_mdf(write_mf4(tmp_path / "t.mf4", [(DATA, rows, Style(width=0, offset=1 << 40))]))
    assert len(log) == 12
    assert not log.length.any()
    assert not log.data.any()
    assert log.damage[0].what == "data of a frame that are not where its record says"
    assert log.damage[0].count == 12


def test_frames_that_the_file_marks_as_not_valid(tmp_path: Path) -> None:
    rows = random_rows(np.random.default_rng(13), 12, 8)
    path = write_mf4(tmp_path / "t.mf4", [(DATA, rows, Style(marks=(2, 9)))])
    log = read_mdf(path)
    check(log, [row for i, row in enumerate(rows) if i not in (2, 9)])
    (damage,) = log.damage
    assert (damage.what, damage.count) == ("a frame that the file itself marks as not valid", 2)
    assert damage.place == "record 3 of channel group 0"


def test_fewer_records_than_stated(tmp_path: Path) -> None:
    """A number of records is no reason to take memory for them."""
    rows = random_rows(np.random.default_rng(14), 12, 8)
    for more in (5, 2**50):
        log = read_mdf(write_mf4(tmp_path / "t.mf4", [(DATA, rows, Style(states=more))]))
        check(log, rows)
        assert log.damage == (
            Damage("fewer records than the channel group states", "channel group 0", lost=f"{more} frames lost"),
        )


@pytest.mark.parametrize("transposed", [True, False])
def test_a_damaged_block_loses_only_its_records(tmp_path: Path, transposed: bool) -> None:
    def spoil(blocks: Blocks, begin: int, _: int) -> None:
        second = blocks.data.index(b"##DZ", blocks.data.index(b"##DZ", begin) + 1)
        blocks.data[second + 60] ^= 0xFF

    rows = random_rows(np.random.default_rng(15), 60, 8)
    style = Style(cuts=3, compression="transposed" if transposed else "deflate")
    whole = write_mf4(tmp_path / "whole.mf4", [(DATA, rows, style)])
    log = read_mdf(write_mf4(tmp_path / "t.mf4", [(DATA, rows, replace(style, spoil=spoil))]))
    kept = [i for i, row in enumerate(rows) if row["time"] in set(log.time.tolist())]
    check(log, [rows[i] for i in kept])
    lost = sorted(set(range(60)) - set(kept))
    assert lost == list(range(lost[0], lost[-1] + 1))
    assert 0 < len(lost) < 60
    at = whole.read_bytes().index(b"##DZ", whole.read_bytes().index(b"##DZ") + 1) + 48
    assert log.damage == (
        Damage("a compressed block of data that does not inflate as it states", f"byte {at}"),
        Damage("fewer records than the channel group states", "channel group 0", lost=f"{len(lost)} frames lost"),
    )


def test_a_damaged_block_of_signal_data_empties_its_frames(tmp_path: Path) -> None:
    rows = random_rows(np.random.default_rng(16), 60, 0)
    path = write_mf4(tmp_path / "t.mf4", [(DATA, rows, Style(width=0, cuts=3, compression="deflate"))])
    data = bytearray(path.read_bytes())
    blocks = [i for i in range(len(data)) if data[i : i + 4] == b"##DZ" and data[i + 24 : i + 26] == b"SD"]
    data[blocks[1] + 60] ^= 0xFF
    path.write_bytes(data)
    log = read_mdf(path)
    sizes = [struct.unpack_from("<Q", data, at + 32)[0] for at in blocks]
    begin, end = sizes[0], sizes[0] + sizes[1]
    starts = np.cumsum([0, *(4 + len(row["bytes"]) for row in rows)])
    gone = [bool(a < end and b > begin) for a, b in pairwise(starts.tolist())]
    expected = [row | {"bytes": b""} if bad else row for row, bad in zip(rows, gone, strict=True)]
    check(log, expected)
    assert 0 < sum(gone) < 60
    said = {d.what: d.count for d in log.damage}
    assert said["data of a frame that are not where its record says"] == sum(gone)
    assert said["a compressed block of data that does not inflate as it states"] == 1


def test_a_damaged_block_that_only_asammdf_can_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = random_rows(np.random.default_rng(17), 60, 8)
    path = write_mf4(tmp_path / "t.mf4", [(DATA, rows, Style(compression="deflate"))])
    data = bytearray(path.read_bytes())
    data[data.index(b"##DZ") + 60] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="cut short or damaged"):
        forced(path, monkeypatch)


def test_blocks_in_a_circle(tmp_path: Path) -> None:
    """asammdf would follow them for ever."""
    groups = [(DATA, random_rows(np.random.default_rng(k), 5, 8), Style()) for k in range(2)]
    path = write_mf4(tmp_path / "t.mf4", groups)
    data = bytearray(path.read_bytes())
    first = struct.unpack_from("<Q", data, 64 + 24)[0]
    second = struct.unpack_from("<Q", data, first + 24)[0]
    struct.pack_into("<Q", data, second + 24, first)
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=f"byte {second}.*linked in a circle"):
        read_mdf(path)


def test_damaged_bytes_are_read_or_refused(tmp_path: Path) -> None:
    """No hang, no exception of a library, no more frames than were written."""
    rng, outcomes = np.random.default_rng(18), list[Any]()
    for seed in range(150):
        style = Style(seed, (0, 8, 64)[seed % 3], bool(seed & 1), "f8", ("", "deflate", "transposed")[seed // 3 % 3], 2)
        path = write_mf4(tmp_path / "t.mf4", [(DATA, random_rows(rng, 20, style.width), style)])
        data = bytearray(path.read_bytes())
        for place in rng.integers(168, len(data), 3):
            data[place] = rng.integers(256)
        path.write_bytes(data)
        try:
            outcomes.append(len(read_mdf(path)))
        except RecordingError as error:
            outcomes.append(str(error))
    assert all(isinstance(x, str) or x <= 20 for x in outcomes)
    assert sum(isinstance(x, str) for x in outcomes) < 150
