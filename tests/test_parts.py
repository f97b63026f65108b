"""A recording of several files, each with a clock of its own."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from nineaudit.array import FloatArray, frozen
from nineaudit.bus import Bus, Identifier
from nineaudit.cli import app
from nineaudit.errors import ConfigurationError, RecordingError
from nineaudit.parts import Part, files, recordings
from nineaudit.readers import Contents, read
from nineaudit.readers.clocks.joined import join
from nineaudit.recording import Recording, Source, Trace
from nineaudit.report import result_schema
from nineaudit.rig import Rig, parse_rig
from nineaudit.writers import write_recording

SENSORS = "".join(
    f'[[sensor]]\nchannel="{group}{axis}"\nkind="{kind}"\nsignal="{axis}"\nposition=[{20 * (group == "b")},0,0]\n'
    f"axis={[float(axis == other) for other in 'xyz']}\n"
    for group, kind in (("a", "accelerometer"), ("b", "accelerometer"), ("w", "gyroscope"))
    for axis in "xyz"
)
HEAD = '[rig]\nname="three loggers"\n[units]\nacceleration="m/s^2"\n[recording]\ntime="t_s"\n'
RATES = {"a": 2000.0, "b": 500.0, "w": 800.0}


def part(group: str, more: str = "") -> str:
    return f'[[part]]\nfile="{{name}}_{group}.csv"\nchannels={[group + axis for axis in "xyz"]}\n{more}\n'


def rig(**more: str) -> Rig:
    return parse_rig(HEAD + "".join(part(group, more.get(group, "")) for group in "abw") + SENSORS)


def signals(seed: int = 0) -> Callable[[FloatArray], FloatArray]:
    """(n,3) band-limited at 90 Hz, a pulse about 0.5 s."""
    rng = np.random.default_rng(seed)
    frequency, phase, size = rng.uniform(5, 90, 20), rng.uniform(0, 6, 20), rng.normal(size=(20, 3))
    return lambda t: (
        np.sin(2 * np.pi * np.multiply.outer(t, frequency) + phase) @ size * np.exp(-(((t[:, None] - 0.5) / 0.15) ** 2))
    )


def write(path: Path, time: FloatArray, values: FloatArray) -> Path:
    np.savetxt(path, np.column_stack([time, values]), delimiter=",", header="t_s,x,y,z", comments="", fmt="%.12g")
    return path


def three(folder: Path, name: str = "T1", *, seed: int = 0, noise: float = 0.0, late: float = 0.0) -> list[Path]:
    """Three files of one motion; b's clock reads `late` seconds too much."""
    rng, motion, made = np.random.default_rng(seed + 1), signals(seed), []
    for group, rate in RATES.items():
        t = np.arange(0.003 if group == "b" else 0.0, 1.0, 1 / rate)
        values = motion(t) + noise * rng.normal(size=(t.size, 3))
        made.append(write(folder / f"{name}_{group}.csv", t + (late if group == "b" else 0.0), values))
    return made


# --- reading ------------------------------------------------------------------------------------------------------


def test_any_file_and_all_of_them_name_the_recording(tmp_path: Path) -> None:
    made = three(tmp_path)
    found = [read(named, rig()) for named in (*made, made[::-1])]
    assert found[0].channels == ("ax", "ay", "az", "bx", "by", "bz", "wx", "wy", "wz")
    for other in found[1:]:
        np.testing.assert_array_equal(other.readings, found[0].readings)
    motion = signals()(found[0].time)
    assert found[0].rate == pytest.approx(2000)
    assert found[0].valid[10:-10].all()
    for first in (0, 3, 6):
        np.testing.assert_allclose(found[0].readings[10:-10, first : first + 3], motion[10:-10], atol=2e-4)
    assert found[0].resampled == ("bx", "by", "bz", "wx", "wy", "wz")


def test_the_time_base_is_while_every_part_was_recording(tmp_path: Path) -> None:
    found = read(three(tmp_path)[0], rig())
    assert (found.time[0], found.time[-1]) == pytest.approx((0.003, 0.998), abs=1e-3)
    assert any("ax: 6 samples at the start" in note for note in found.source.notes)
    assert found.native[0].time[0] == 0.0


def test_a_short_fast_part_gives_the_clock(tmp_path: Path) -> None:
    """2 kHz for a second, the others for ten: the common second is at 2 kHz, though the others have more samples."""
    made, motion = three(tmp_path), signals()
    for path, rate in zip(made[1:], (500, 800), strict=True):
        t = np.arange(-4, 6, 1 / rate)
        write(path, t, motion(t))
    found = read(made[0], rig())
    assert found.rate == pytest.approx(2000)
    assert found.resampled == ("bx", "by", "bz", "wx", "wy", "wz")
    np.testing.assert_array_equal(found.time, found.native[0].time)
    np.testing.assert_allclose(found.readings[:, 3:6], motion(found.time), atol=1e-4)


def test_every_file_stands_in_the_source_with_its_hash(tmp_path: Path) -> None:
    made = three(tmp_path)
    before = [path.read_bytes() for path in made]
    source = read(made[2], rig()).source
    assert [p.path for p in source.parts] == made
    assert [p.sha256 for p in source.parts] == [hashlib.sha256(data).hexdigest() for data in before]
    assert (source.path, source.sha256, source.size) == (made[0], source.parts[0].sha256, len(before[0]))
    assert source.unchanged_after_read
    assert source.counts["rows"] == sum(len(data.splitlines()) - 1 for data in before)
    assert [path.read_bytes() for path in made] == before
    assert sum("taken at their word" in note for note in source.notes) == 2


def test_two_files_of_one_clock_are_one_file(tmp_path: Path) -> None:
    """Split by columns, the numbers are those of the file that holds both, bit for bit."""
    t, rng = np.arange(500) / 1000, np.random.default_rng(3)
    values = rng.normal(size=(500, 9))
    for i, group in enumerate("abw"):
        write(tmp_path / f"T1_{group}.csv", t, values[:, 3 * i : 3 * i + 3])
    parts = read(tmp_path / "T1_b.csv", rig())
    header = "t_s," + ",".join(parts.channels)
    np.savetxt(
        tmp_path / "all.csv", np.column_stack([t, values]), delimiter=",", header=header, comments="", fmt="%.12g"
    )
    whole = read(tmp_path / "all.csv", rig())
    np.testing.assert_array_equal(parts.readings, whole.readings)
    np.testing.assert_array_equal(parts.time, whole.time)
    assert parts.alignments == whole.alignments == ()
    assert whole.source.parts == ()


def test_one_file_of_all_channels_is_written_and_read_again(tmp_path: Path) -> None:
    """What `repair` writes: signals that the parts call by one name are called by their channels."""
    found = read(three(tmp_path)[0], rig())
    write_recording(found, tmp_path / "repaired.csv")
    again = read(tmp_path / "repaired.csv", rig())
    np.testing.assert_allclose(again.readings, found.readings, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(again.valid, found.valid)


def test_all_clocks_may_be_shifted_by_a_statement(tmp_path: Path) -> None:
    made = three(tmp_path, late=2.5)
    with pytest.raises(RecordingError, match="no time in common"):
        read(made[0], rig())
    found = read(made[0], rig(b="offset_s=-2.5\noffset_u_s=3e-5"))
    straight = read(three(tmp_path, "T2")[0], rig())
    both = [np.isin(one.time, other.time) for one, other in ((found, straight), (straight, found))]
    assert both[0].mean() > 0.99
    np.testing.assert_allclose(found.readings[both[0]], straight.readings[both[1]], atol=1e-6)
    b = next(a for a in found.alignments if a.channel == "bx")
    assert b.u_timing == pytest.approx(3e-5, rel=1e-3)
    assert any("-2.5 s added to its time stamps, ± 3e-05 s, as the rig states" in n for n in found.source.notes)


@pytest.mark.parametrize("missing", [0, 1, 2])
def test_a_part_that_is_not_there(tmp_path: Path, missing: int) -> None:
    made = three(tmp_path)
    made[missing].unlink()
    with pytest.raises(RecordingError, match=rf"T1_{'abw'[missing]}.csv: a part of the recording is not there"):
        read(made[missing - 1], rig())


def test_a_list_holds_one_of_each(tmp_path: Path) -> None:
    made = three(tmp_path)
    for named in (made[:2], [*made[:2], made[1]], []):
        with pytest.raises(ConfigurationError, match="the files are not one of each part"):
            read(named, rig())
    with pytest.raises(ConfigurationError, match=r"a rig file with a \[\[part\]\] for each file"):
        read(made, parse_rig(HEAD + SENSORS.split("[[sensor]]", 2)[0] + "[[sensor]]" + SENSORS.split("[[sensor]]")[1]))


def test_an_original_is_never_written_to(tmp_path: Path) -> None:
    made = three(tmp_path)
    found = read(made[0], rig())
    for path in made:
        with pytest.raises(ConfigurationError, match="the original recording is never overwritten"):
            write_recording(found, path, force=True)


def test_buses_of_several_logs_keep_their_names(tmp_path: Path) -> None:
    """Rules of the bus see every log: identifiers and loads of each, restarts added, absent what came in none."""
    made, t = three(tmp_path), np.arange(100) / 100

    def log(path: Path, seen: Rig) -> tuple[Contents, Source]:
        group = path.stem[-1]
        identifier = Identifier(0x24, None, "0", True, 100, 0.0, 1.0, 0.01, 0.0, 0.01, False)
        absent = {"a": ("P", "Q"), "b": ("Q", "R"), "w": ()}[group]
        bus = Bus((identifier,), absent, 1, {"a": 0.5, "b": 0.25, "w": 0.75}[group], (), 5e5, False)
        traces = tuple(Trace(s.channel, s.signal, frozen(t), frozen(t)) for s in seen.array.sensors)
        return Contents(traces, bus=None if group == "w" else bus), Source(path, "blf", "", 0, counts={"frames": 100})

    joined = join(made, rig(), log)
    bus = joined.contents.bus
    assert bus is not None
    assert [x.bus for x in bus.identifiers] == ["T1_a.csv 0", "T1_b.csv 0"]
    assert (bus.absent, bus.restarts, bus.first_restart, bus.bit_rate) == (("Q",), 2, 0.25, 5e5)
    assert joined.source.counts == {"frames": 300}


# --- which file is which ------------------------------------------------------------------------------------------


def test_patterns() -> None:
    parts = (Part("{name}.csv", ("p",)), Part("{name}_gyro.csv", ("q",)))
    assert files(Path("d/T1_gyro.csv"), parts) == (Path("d/T1.csv"), Path("d/T1_gyro.csv"))
    assert files(Path("T1.csv"), parts) == (Path("T1.csv"), Path("T1_gyro.csv"))
    assert files(Path("T1.blf"), parts) == (Path("T1.blf"),)
    paths = [Path(name) for name in ("T2_gyro.csv", "T1.csv", "T1_gyro.csv", "T2.csv", "x.blf")]
    assert recordings(paths, parts) == (Path("T2.csv"), Path("T1.csv"), Path("x.blf"))


def test_patterns_with_folders() -> None:
    parts = (Part("acc/{name}.csv", ("p",)), Part("gyro/{name}.csv", ("q",)))
    assert files(Path("run/gyro/T1.csv"), parts) == (Path("run/acc/T1.csv"), Path("run/gyro/T1.csv"))
    fixed = (Part("acc.csv", ("p",)), Part("gyro.csv", ("q",)))
    assert files(Path("T1/acc.csv"), fixed) == (Path("T1/acc.csv"), Path("T1/gyro.csv"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (part("a") + part("b"), "channel wx is in no part"),
        (
            part("a") + part("b") + part("w") + '[[part]]\nfile="{name}_c.csv"\nchannels=["ax"]',
            r"4: has the same channel",
        ),
        (part("a") + part("b") + part("w").replace("wz", "wq"), "no such channel; found 'wq'; expected one of ax"),
        (part("a") + part("b") + part("w").replace("{name}", "T1"), "a pattern of its own; found 'T1_w.csv'"),
        (part("a", 'align="correlation"') + part("b") + part("w"), "1 align: nothing to find"),
        (part("a") + part("b", 'align="correlation"\noffset_s=1.0') + part("w"), "2 align: nothing to find"),
        (part("a", "chanels=[]") + part("b") + part("w"), "unknown key; found 'chanels'.*did you mean 'channels'"),
        (part("a", 'align="sound"') + part("b") + part("w"), r"\[\[part\]\] 1 .*align: wrong value; found 'sound'"),
        ('[[part]]\nchannels=["ax"]', "missing key 'file'"),
    ],
)
def test_parts_of_a_rig_file_that_are_wrong(text: str, said: str) -> None:
    with pytest.raises(ConfigurationError, match=said):
        parse_rig(HEAD + text + "\n" + SENSORS)


# --- offsets that are found ---------------------------------------------------------------------------------------


def test_an_offset_is_found_within_its_uncertainty(tmp_path: Path) -> None:
    asked, errors = rig(b='align="correlation"'), []
    for seed in range(12):
        late = float(np.random.default_rng(seed).uniform(-40, 40))
        found = read(three(tmp_path, seed=seed, noise=0.3, late=late)[0], asked)
        b = next(a for a in found.alignments if a.channel == "bx")
        (note,) = (n for n in found.source.notes if "found by correlation" in n)
        moved = float(note.split(": ")[1].split(" s added")[0])
        errors.append((moved + late) / b.u_timing)
        assert b.u_timing < 3e-4
    assert np.abs(errors).max() < 4
    assert 0.4 < np.sqrt(np.mean(np.square(errors))) < 1.8


def test_an_offset_that_cannot_be_found(tmp_path: Path) -> None:
    asked, t = rig(b='align="correlation"'), np.arange(0, 1, 1 / 500)
    made = three(tmp_path)
    write(made[1], t, np.random.default_rng(1).normal(size=(500, 3)))
    with pytest.raises(RecordingError, match=r"T1_b.csv: its readings explain .* no offset to find"):
        read(made[0], asked)
    for phases, said in ((np.zeros(3), r"two offsets are as good, 0.02[456] s apart"), (np.arange(3), "tells no time")):
        for path, rate in zip(made[:2], (2000, 500), strict=True):
            t = np.arange(0, 1, 1 / rate)
            write(path, t, np.sin(2 * np.pi * 20 * t[:, None] + phases))
        with pytest.raises(RecordingError, match=said):
            read(made[0], asked)
    with pytest.raises(RecordingError, match="no sensor of a kind that the first part has"):
        read(three(tmp_path)[0], rig(w='align="correlation"'))


# --- the command line ---------------------------------------------------------------------------------------------


def two_loggers() -> Rig:
    """Without redundancy: quick to audit."""
    sensors = "".join(
        "[[sensor]]" + text for text in SENSORS.split("[[sensor]]") if text[:12].strip()[9:10] in ("a", "w")
    )
    return parse_rig(HEAD + part("a") + part("w") + sensors)


def test_check_audits_each_recording_once(tmp_path: Path) -> None:
    import jsonschema

    made = [path for name in ("T1", "T2") for path in three(tmp_path, name) if not path.stem.endswith("b")]
    (tmp_path / "rig.toml").write_text(two_loggers().text)
    command = ["check", *map(str, made), "--rig", str(tmp_path / "rig.toml"), "--select", "RQ1", "--format", "json"]
    documents = json.loads(CliRunner().invoke(app, command).stdout)
    assert [Path(d["recording"]["path"]).name for d in documents] == ["T1_a.csv", "T2_a.csv"]
    for document in documents:
        jsonschema.Draft202012Validator(result_schema()).validate(document)
        assert [p["path"][-5:] for p in document["recording"]["parts"]] == ["a.csv", "w.csv"]
        assert document["recording"]["parts"][0]["sha256"] == document["recording"]["sha256"]


@pytest.mark.parametrize("command", ["check --html", "motion --output", "repair --output", "budget --html"])
def test_no_command_writes_to_another_part(tmp_path: Path, command: str) -> None:
    made = three(tmp_path)
    (tmp_path / "rig.toml").write_text(rig().text)
    name, option = command.split()
    named = ["--recording", str(made[0])] if name == "budget" else [str(made[0]), "--rig"]
    done = CliRunner().invoke(app, [name, *named, str(tmp_path / "rig.toml"), option, str(made[1])])
    assert isinstance(done.exception, ConfigurationError)
    assert "an input is never written to" in str(done.exception)


# --- of others ----------------------------------------------------------------------------------------------------


def test_impactor(shared_data: Path) -> None:
    """Three loggers on one rigid body (DATA.md). Two of the clocks run 0.5 % fast."""
    channels = {"acc100g": ("h", "_(100g)"), "acc40g": ("l", "_(40g)"), "gyro": ("w", "")}
    text = '[rig]\nname="impactor"\n[units]\nangular_rate="deg/s"\n[recording]\ntime="t_s"\n'
    for name, (group, suffix) in channels.items():
        text += f'[[part]]\nfile="{{name}}_{name}_impact.csv"\nchannels={[group + a for a in "xyz"]}\n'
        kind = "gyroscope" if group == "w" else "accelerometer"
        for axis in "xyz":
            direction = [float(axis == other) for other in "xyz"]
            text += f'[[sensor]]\nchannel="{group}{axis}"\nkind="{kind}"\nsignal="{axis.upper()}{suffix}"\n'
            text += f"position=[0,0,0]\naxis={direction}\n"
    folder = shared_data / "impactor-clipping"
    found = read(folder / "6mps_sphere_1_gyro_impact.csv", parse_rig(text))
    assert len(found.source.parts) == 3
    assert found.readings.shape == (9984, 9)
    by_channel = {a.channel: a for a in found.alignments}
    assert set(by_channel) == {"lx", "ly", "lz", "wx", "wy", "wz"}
    assert (by_channel["lx"].ratio, by_channel["wx"].ratio) == ((1, 10), (4, 25))
    assert by_channel["lx"].drift == pytest.approx(4.6e-3, abs=5e-4)
    assert by_channel["wx"].drift == pytest.approx(6.0e-3, abs=5e-4)
    assert found.valid.mean() > 0.995
    asked = parse_rig(text.replace("channels=['lx', 'ly', 'lz']", "channels=['lx', 'ly', 'lz']\nalign='correlation'"))
    lag = read(folder / "6mps_sphere_1_acc100g_impact.csv", asked)
    (note,) = (n for n in lag.source.notes if "found by correlation" in n)
    assert float(note.split(": ")[1].split(" s added")[0]) == pytest.approx(-0.7e-3, abs=0.2e-3)
    # The two triaxes feel one impact; the small one clips at 42 g, and lags by its own filter.
    assert 0.95 < likeness(found, "hx", "lx") < 0.98 < likeness(lag, "hx", "lx")


def likeness(found: Recording, one: str, other: str) -> float:
    both = np.isfinite(found.column(one)) & np.isfinite(found.column(other))
    return float(np.corrcoef(found.column(one)[both], found.column(other)[both])[0, 1])
