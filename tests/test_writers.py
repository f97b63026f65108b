"""Writers: what is written reads back; nothing is overwritten, and nothing appears by halves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import recordings
from nineaudit.array import FloatArray, frozen
from nineaudit.errors import ConfigurationError
from nineaudit.readers import read
from nineaudit.recording import Recording
from nineaudit.rig import parse_rig
from nineaudit.signals import in_unit, si_factor
from nineaudit.units import G0
from nineaudit.writers import make_dbc, write_recording
from recordings import array_rig, database, motion, write_any

RIG = array_rig()
MOTION = motion(RIG)
READING = st.one_of(st.floats(1e-9, 1e12), st.floats(-1e12, -1e-9), st.sampled_from([0.0, np.nan]))
PER_FACTOR = st.sampled_from([1.0, G0, np.pi / 180, 1e-3, 0.3048, G0 / 0.4])


def with_readings(readings: FloatArray, time: FloatArray | None = None) -> Recording:
    readings = frozen(readings)
    return replace(
        MOTION, time=MOTION.time if time is None else frozen(time), readings=readings, valid=np.isfinite(readings)
    )


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False, width=64), min_size=1), PER_FACTOR)
def test_numbers_from_a_file_go_back_bit_for_bit(numbers: list[float], factor: float) -> None:
    """q·f read from a file is written as some q' with q'·f the same; any other number to a unit in the last place."""
    with np.errstate(over="ignore"):
        values = np.array(numbers) * factor
    values = values[np.isfinite(values) & ((np.abs(values) > 1e-290) | (values == 0)) & (np.abs(values) < 1e290)]
    np.testing.assert_array_equal(in_unit(values, factor) * factor, values)
    odd = np.array([v for v in numbers if 1e-290 < abs(v) < 1e290])
    np.testing.assert_array_max_ulp(in_unit(odd, factor) * factor, odd, 1)


@pytest.mark.parametrize("suffix", [".csv", ".tsv", ".parquet", ".mcap"])
@given(
    st.lists(st.lists(READING, min_size=6, max_size=6), min_size=8, max_size=10),
    st.floats(-100, 1e5),
    st.floats(1e-6, 1.0),
)
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_tables_keep_every_digit(
    tmp_path: Path, suffix: str, rows: list[list[float]], start: float, step: float
) -> None:
    """Read, write, read: the second reading equals the first, times, readings, and what is not valid."""
    readings = np.array(rows)
    recording = with_readings(readings, start + step * np.arange(len(rows)))
    path = tmp_path / f"r{suffix}"
    write_recording(recording, path, force=True)
    first = read(path, RIG)
    write_recording(first, tmp_path / f"again{suffix}", force=True)
    second = read(tmp_path / f"again{suffix}", RIG)
    np.testing.assert_array_equal(first.time, recording.time)
    np.testing.assert_array_equal(second.time, first.time)
    np.testing.assert_array_equal(second.readings, first.readings)
    np.testing.assert_array_equal(first.valid, recording.valid)
    np.testing.assert_array_max_ulp(first.readings[first.valid], readings[recording.valid], 1)


@pytest.mark.parametrize(
    "recording",
    [
        'time = "t_ms"',
        'time = "clock"\ntime_unit = "us"',
        'time = "time_s"\nseparator = ";"\ndecimal = ","',
        "",
    ],
)
def test_csv_follows_the_rig(tmp_path: Path, recording: str) -> None:
    rig = array_rig(recording)
    write_recording(replace(MOTION, rig=rig), tmp_path / "r.csv")
    found = read(tmp_path / "r.csv", rig)
    np.testing.assert_array_max_ulp(found.time, MOTION.time, 1)
    np.testing.assert_array_max_ulp(found.readings, MOTION.readings, 1)


def test_mcap_puts_signals_where_the_rig_says(tmp_path: Path) -> None:
    import json

    from mcap.reader import make_reader

    text = recordings.rig_text(recording="")
    for i, name in enumerate(("NAAP_A.A0X", "NAAP_A.A0Y", "NAAP_A.A0Z")):
        text = text.replace(name, f"/imu:linear_acceleration.{'xyz'[i]}")
    rig = parse_rig(text)
    write_recording(replace(MOTION, rig=rig), tmp_path / "r.mcap")
    found = read(tmp_path / "r.mcap", rig)
    np.testing.assert_allclose(found.time, MOTION.time, atol=1e-9, rtol=0)
    np.testing.assert_array_max_ulp(found.readings, MOTION.readings, 1)
    with (tmp_path / "r.mcap").open("rb") as file:
        messages = [json.loads(m.data) for _, c, m in make_reader(file).iter_messages() if c.topic == "/imu"]
    assert list(messages[0]) == ["linear_acceleration"]
    assert messages[7]["linear_acceleration"]["y"] * G0 == pytest.approx(MOTION.column("a0y")[7], rel=1e-15)


# --- CAN ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".blf", ".asc"])
def test_what_the_database_rounds_off_is_reported(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"r{suffix}"
    dbc = database(RIG, tmp_path)
    written = write_recording(MOTION, path, dbc=dbc)
    found = read(path, RIG, dbc=[dbc])
    error = np.abs(found.readings - MOTION.readings).max(axis=0)
    np.testing.assert_allclose(list(written.error.values()), error, rtol=1e-6)
    assert 0 < error.max() < 3e-3
    assert "the database rounds readings by up to" in written.notes[-1]
    again = tmp_path / f"again{suffix}"
    assert max(write_recording(found, again, dbc=dbc).error.values()) < 1e-9
    np.testing.assert_array_equal(read(again, RIG, dbc=[dbc]).readings, found.readings)


@pytest.mark.parametrize("value", [1.3 * 500 * G0, -1.3 * 500 * G0, np.inf])
def test_values_that_do_not_fit_are_an_error_and_never_wrapped(tmp_path: Path, value: float) -> None:
    readings = MOTION.readings.copy()
    readings[40, 1] = value
    with pytest.raises(ConfigurationError, match=r"signal NAAP_A.A0Y at -0.021 s: 1 readings do not fit") as caught:
        write_recording(with_readings(readings), tmp_path / "r.blf", dbc=database(RIG, tmp_path))
    assert "-624.951 to 624.951 g_0" in str(caught.value)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["rig.dbc"]


def test_ranges_that_are_none_are_not_held_against_a_value(tmp_path: Path) -> None:
    """[0|65535] for a signal of ten bits around zero, as in databases in use, states no range."""
    dbc = database(RIG, tmp_path)
    text = dbc.read_text()
    dbc.write_text(text.replace("[-624.9507|624.9507]", "[0|65535]"))
    assert dbc.read_text() != text
    write_recording(MOTION, tmp_path / "r.blf", dbc=dbc)
    assert (tmp_path / "r.blf").stat().st_size > 0


def test_a_stated_range_counts(tmp_path: Path) -> None:
    dbc = database(RIG, tmp_path)
    dbc.write_text(dbc.read_text().replace("[-624.9507|624.9507]", "[-0.1|0.1]"))
    with pytest.raises(ConfigurationError, match=r"do not fit the signal; found .*; expected -0.1 to 0.1 g_0"):
        write_recording(MOTION, tmp_path / "r.blf", dbc=dbc)


def test_samples_without_any_valid_reading_are_not_sent(tmp_path: Path) -> None:
    readings = MOTION.readings.copy()
    readings[100:110, :3] = np.nan  # all of NAAP_A
    dbc = database(RIG, tmp_path)
    write_recording(with_readings(readings), tmp_path / "r.blf", dbc=dbc)
    found = read(tmp_path / "r.blf", RIG, dbc=[dbc])
    np.testing.assert_array_equal(~found.valid[:, 0], np.isnan(readings[:, 0]))
    assert found.valid[:, 3:].all()
    assert found.clocks[0].lost == 10
    readings[200, 4] = np.nan  # one of NAAP_B
    with pytest.raises(ConfigurationError, match=r"channel a1z has no valid reading where others of its message have"):
        write_recording(with_readings(readings), tmp_path / "s.blf", dbc=dbc)


def test_a_rig_without_ranges_and_messages_gets_floats(tmp_path: Path) -> None:
    text = "\n".join(row for row in recordings.rig_text().splitlines() if not row.startswith(("range", "signal")))
    rig = parse_rig(text)
    dbc = database(rig, tmp_path)
    assert "SIG_VALTYPE_ 256 a0x : 1;" in dbc.read_text()
    readings = MOTION.readings.copy()
    readings[200, 4] = np.nan
    recording = replace(with_readings(readings), rig=rig)
    write_recording(recording, tmp_path / "r.blf", dbc=dbc)
    found = read(tmp_path / "r.blf", rig, dbc=[dbc])
    assert np.argwhere(~found.valid).tolist() == [[200, 4]]
    np.testing.assert_allclose(found.readings, readings, rtol=2**-23, atol=1e-30)


def test_the_database_made_for_a_rig_gives_its_units_and_headroom() -> None:
    from cantools.database import load_string

    messages = load_string(make_dbc(RIG), "dbc").messages  # strict: no overlaps, everything inside the frame
    signals = {f"{m.name}.{s.name}": s for m in messages for s in m.signals}
    assert set(signals) == {s.signal for s in RIG.array.sensors}
    for sensor in RIG.array.sensors:
        signal = signals[sensor.signal]
        assert si_factor(sensor, signal.unit) == sensor.to_si
        assert signal.maximum * sensor.to_si == pytest.approx(1.25 * (sensor.full_scale or 0), rel=0.01)


@pytest.mark.parametrize(
    ("signal", "says"),
    [("A.0x", "a name that a CAN database does not allow; found '0x'"), ("A.a b", "found 'a b'")],
)
def test_names_that_no_database_allows(signal: str, says: str) -> None:
    with pytest.raises(ConfigurationError, match=says):
        make_dbc(parse_rig(recordings.rig_text().replace("NAAP_A.A0X", signal)))


def test_too_many_signals_for_a_frame() -> None:
    text = recordings.rig_text().replace("NAAP_B", "NAAP_A")
    with pytest.raises(ConfigurationError, match=r"message NAAP_A: too many signals .* found 6; expected 5 or fewer"):
        make_dbc(parse_rig(text))


def test_long_frames_go_through_can_fd(tmp_path: Path) -> None:
    dbc = tmp_path / "fd.dbc"
    rows = [f' SG_ S{i} : {32 * i}|32@1- (1,0) [0|0] "" X' for i in range(6)]
    values = [f"SIG_VALTYPE_ 256 S{i} : 1;" for i in range(6)]
    dbc.write_text("\n".join(['VERSION ""', "NS_ :", "BS_:", "BU_: X", "BO_ 256 M: 24 X", *rows, *values, ""]))
    text = recordings.rig_text()
    for i, (_, _, _, signal) in enumerate(recordings.SENSORS.values()):
        text = text.replace(signal, f"M.S{i}")
    rig = parse_rig(text)
    for suffix in (".blf", ".asc"):
        path = tmp_path / f"r{suffix}"
        write_recording(replace(MOTION, rig=rig), path, dbc=dbc)
        np.testing.assert_allclose(read(path, rig, dbc=[dbc]).readings, MOTION.readings, rtol=2**-23, atol=1e-30)


# --- files --------------------------------------------------------------------------------------------------------


def test_repaired_readings_take_the_place_of_the_recorded(tmp_path: Path) -> None:
    write_recording(MOTION, tmp_path / "r.csv", readings=2 * MOTION.readings)
    np.testing.assert_array_max_ulp(read(tmp_path / "r.csv", RIG).readings, 2 * MOTION.readings, 1)
    with pytest.raises(ValueError, match="readings"):
        write_recording(MOTION, tmp_path / "s.csv", readings=MOTION.readings[:5])


def test_nothing_is_overwritten_unless_asked_for(tmp_path: Path) -> None:
    path = write_any(MOTION, tmp_path, ".csv")
    before = path.read_bytes()
    with pytest.raises(ConfigurationError, match="the file exists already") as caught:
        write_recording(MOTION, path, readings=2 * MOTION.readings)
    assert caught.value.exit_code == 2
    assert path.read_bytes() == before
    write_recording(MOTION, path, readings=2 * MOTION.readings, force=True)
    assert path.read_bytes() != before


@pytest.mark.parametrize("how", ["same", "other spelling", "link"])
def test_the_original_is_never_overwritten(tmp_path: Path, how: str) -> None:
    path = write_any(MOTION, tmp_path, ".csv")
    recording = read(path, RIG)
    target = {"same": path, "other spelling": tmp_path / "x" / ".." / path.name, "link": tmp_path / "link.csv"}[how]
    (tmp_path / "x").mkdir()
    if how == "link":
        target.symlink_to(path)
    before = path.read_bytes()
    with pytest.raises(ConfigurationError, match="the original recording is never overwritten"):
        write_recording(recording, target, force=True)
    assert path.read_bytes() == before


def test_a_failure_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import csv

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    class Full:
        def __init__(self, file: object, **_: object) -> None:
            file.write("half a file")  # type: ignore[attr-defined]

        writerow = writerows = staticmethod(fail)

    monkeypatch.setattr(csv, "writer", Full)
    with pytest.raises(ConfigurationError, match=r"r.csv: cannot be written: No space left on device"):
        write_recording(MOTION, tmp_path / "r.csv")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("r.xlsx", "no format to write; found '.xlsx'; expected one of .csv"),
        ("r", "found 'no suffix'"),
        ("none/r.csv", "the folder for it does not exist"),
        ("", "no format to write|is a folder"),
    ],
)
def test_places_where_nothing_can_be_written(tmp_path: Path, name: str, says: str) -> None:
    with pytest.raises(ConfigurationError, match=says):
        write_recording(MOTION, tmp_path / name)
