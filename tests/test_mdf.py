"""MF4: raw frames as columns against asammdf's records, and channels that were decoded when they were recorded."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nineaudit.errors import RecordingError
from nineaudit.readers import read
from nineaudit.readers.can.frames import key_counts
from nineaudit.readers.can.mdf import read_mdf
from nineaudit.rig import load_rig, parse_rig

asammdf = pytest.importorskip("asammdf")
TIME = 0.001 * np.arange(50)
RIG = """
[rig]
name = "two"
[units]
acceleration = "g_0"
[[sensor]]
channel = "p"
kind = "accelerometer"
position = [0.0, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]
signal = "{p}"
[[sensor]]
channel = "q"
kind = "accelerometer"
position = [10.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
signal = "{q}"
"""


def written(folder: Path, *groups: tuple[str, Sequence[Any]]) -> Path:
    path = folder / "measured.mf4"
    with asammdf.MDF() as log:
        for name, signals in groups:
            log.append(list(signals), acq_name=name)
        log.save(path, overwrite=True)
    return path


def signal(name: str, values: Any, unit: str = "m/s^2", **rest: Any) -> Any:
    return asammdf.Signal(np.asarray(values), TIME, name=name, unit=unit, **rest)


def test_channels_by_name_in_the_unit_of_the_file(tmp_path: Path) -> None:
    path = written(tmp_path, ("A", [signal("one", np.sin(TIME)), signal("two", np.arange(50, dtype="i2"), unit="g")]))
    found = read(path, parse_rig(RIG.format(p="one", q="two")))
    np.testing.assert_allclose(found.column("p"), np.sin(TIME), rtol=1e-12)
    np.testing.assert_allclose(found.column("q"), 9.80665 * np.arange(50), rtol=1e-12)
    np.testing.assert_allclose(found.time, TIME, atol=1e-12)


def test_samples_that_the_file_marks_invalid_are_not_valid(tmp_path: Path) -> None:
    marks = np.zeros(50, dtype=bool)
    marks[[3, 40]] = True
    values = np.arange(50.0)
    values[7] = np.inf
    path = written(tmp_path, ("A", [signal("one", values, invalidation_bits=marks), signal("two", values)]))
    found = read(path, parse_rig(RIG.format(p="one", q="two")))
    assert np.flatnonzero(~found.valid[:, 0]).tolist() == [3, 7, 40]
    assert np.flatnonzero(~found.valid[:, 1]).tolist() == [7]
    assert found.source.counts["invalid_values"] == 4


def test_one_name_in_two_groups_is_told_apart(tmp_path: Path) -> None:
    path = written(tmp_path, ("A", [signal("one", TIME)]), ("B", [signal("one", -TIME)]))
    found = read(path, parse_rig(RIG.format(p="A.one", q="B.one")))
    np.testing.assert_array_equal(found.column("p"), -found.column("q"))
    with pytest.raises(RecordingError, match=r"more than one group has 'one'.*A\.one, B\.one"):
        read(path, parse_rig(RIG.format(p="one", q="B.one")))


@pytest.mark.parametrize(
    ("name", "says"), [("on", r"missing channel 'p'.*did you mean 'one'"), ("text", "does not hold numbers")]
)
def test_channels_that_cannot_be_read(tmp_path: Path, name: str, says: str) -> None:
    text = signal("text", np.array([b"abc"] * 50), encoding="utf-8")
    path = written(tmp_path, ("A", [signal("one", TIME), text]))
    with pytest.raises(RecordingError, match=says):
        read(path, parse_rig(RIG.format(p=name, q="one")))


@pytest.mark.parametrize(("name", "count"), [("drive-45s", 5477), ("by-hand-115s", 57849)])
def test_real_logs_frame_by_frame(shared_data: Path, name: str, count: int) -> None:
    path = shared_data / "canmod-imu" / f"{name}.mf4"
    log = read_mdf(path)
    assert len(log) == count
    assert (np.diff(log.time) >= 0).all()
    with asammdf.MDF(path) as reference:
        parts = [
            reference.get("CAN_DataFrame", group=i, raw=True)
            for i, group in enumerate(reference.groups)
            if any(channel.name == "CAN_DataFrame" for channel in group.channels)
        ]
        fields = np.concatenate([part.samples["CAN_DataFrame.ID"].astype(np.int64) & 0x1FFFFFFF for part in parts])
    keys = {key & 0x1FFFFFFF: n for key, n in key_counts(log).items()}
    assert keys == dict(zip(*(x.tolist() for x in np.unique(fields, return_counts=True)), strict=True))


def test_a_log_of_frames_is_opened_once(shared_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened, folder, whole = [], shared_data / "canmod-imu", asammdf.MDF

    def counted(path: Path, **options: Any) -> Any:
        opened.append(path.name)
        return whole(path, **options)

    monkeypatch.setattr(asammdf, "MDF", counted)
    rig = load_rig(Path(__file__).parents[1] / "fixtures" / "rigs" / "canmod-imu.toml")
    found = read(folder / "drive-45s.mf4", rig, dbc=[folder / "canmod-gps.dbc"])
    assert opened == ["drive-45s.mf4"]
    assert found.source.counts["frames"] == 5477


def test_a_unit_that_is_none_of_the_quantity_is_an_error_of_the_recording(tmp_path: Path) -> None:
    path = written(tmp_path, ("A", [signal("one", TIME), signal("two", TIME, unit="V")]))
    with pytest.raises(RecordingError, match=r"measured.mf4: signal two: unknown unit of acceleration; found 'V'"):
        read(path, parse_rig(RIG.format(p="one", q="two")))
