"""Parquet tables: units of fields, damaged groups of rows, files that are cut or flipped."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from nineaudit.errors import NineauditError, RecordingError
from nineaudit.readers import read
from nineaudit.readers.tables import parquet_table
from nineaudit.readers.tables.parquet_table import read_parquet
from nineaudit.rig import parse_rig
from nineaudit.writers import write_recording
from recordings import array_rig, motion

RIG = parse_rig(
    '[rig]\nname="s"\n[units]\nacceleration="m/s^2"\n'
    + "".join(f'[[sensor]]\nchannel="{c}"\nkind="accelerometer"\nposition=[0,0,0]\naxis=[1,0,0]\n' for c in ("p", "q"))
)
COUNT = 40
P = np.arange(COUNT) + 0.5


def file(tmp_path: Path, *, unit: bytes = b"", **options: object) -> Path:
    fields = [pa.field("t_s", pa.float64()), pa.field("p", pa.float64(), metadata={b"unit": unit} if unit else None)]
    schema = pa.schema([*fields, pa.field("q", pa.float64())])
    columns = {"t_s": (np.arange(COUNT) / 100).tolist(), "p": P.tolist(), "q": (-P).tolist()}
    path = tmp_path / "t.parquet"
    settings = {"row_group_size": 10, "compression": "none", "use_dictionary": False, "write_page_checksum": True}
    pq.write_table(pa.table(columns, schema=schema), path, **(settings | options))
    return path


def test_the_unit_of_a_field(tmp_path: Path) -> None:
    found = read_parquet(file(tmp_path, unit=b"g"), RIG)
    assert [t.unit for t in found.traces] == ["g", None]


def test_a_flipped_byte_costs_its_group_of_rows_alone(tmp_path: Path) -> None:
    path = file(tmp_path)
    whole = path.read_bytes()
    place = whole.index(np.float64(25.5).tobytes())
    path.write_bytes(whole[:place] + np.float64(99.5).tobytes() + whole[place + 8 :])
    found = read_parquet(path, RIG)
    np.testing.assert_array_equal(found.traces[0].values, np.delete(P, np.arange(20, 30)))
    assert [(d.place, d.count, d.lost) for d in found.damage] == [("row group 3", 1, "10 rows left out")]


def test_a_written_recording_carries_checksums(tmp_path: Path) -> None:
    recording = motion(array_rig())
    path = tmp_path / "t.parquet"
    write_recording(recording, path)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=r"row group 1: .*cut short or damaged: a group of rows that cannot"):
        read(path, recording.rig)


def test_a_group_that_is_too_large_is_not_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parquet_table, "LARGEST", 100)
    with pytest.raises(RecordingError, match=r"bytes when unpacked"):
        read_parquet(file(tmp_path), RIG)


def test_a_table_without_rows(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    names = ("t_s", "p", "q")
    pq.write_table(pa.table({name: pa.array([], pa.float64()) for name in names}), path)
    with pytest.raises(RecordingError, match="too few samples"):
        read(path, RIG)


@pytest.mark.parametrize("seed", range(3))
def test_flipped_and_cut_files_end_in_a_recording_or_one_of_our_errors(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    path = file(tmp_path, compression=("none", "snappy", "zstd")[seed])
    whole = path.read_bytes()
    ends = {True: 0, False: 0}
    for _ in range(60):
        data = bytearray(whole)
        for _ in range(rng.randint(1, 3)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        path.write_bytes(bytes(data[: rng.randrange(len(data))] if rng.random() < 0.2 else data))
        try:
            found = read(path, RIG)
        except NineauditError:
            ends[False] += 1
        else:
            ends[True] += 1
            assert np.isfinite(found.time).all()
    assert min(ends.values()) > 0


def test_integers_beyond_what_floats_hold_and_durations(tmp_path: Path) -> None:
    path, p = tmp_path / "t.parquet", np.arange(COUNT, dtype=np.uint64) + np.uint64(2**63)
    durations = pa.array([i * 10 for i in range(COUNT)], pa.duration("ms"))
    pq.write_table(pa.table({"t_s": durations, "p": p, "q": p.astype(np.int64) // 3}), path)
    found = read_parquet(path, RIG)
    np.testing.assert_array_equal(found.traces[0].values, p.astype(np.float64))
    np.testing.assert_array_equal(found.traces[0].time, np.arange(COUNT) * 10 * 1e-3)
