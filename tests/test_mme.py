"""ISO-MME tests: codes, clocks, status words, damage; what is written reads back; faults end in our errors."""

from __future__ import annotations

import os
import random
import sys
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import IO
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nineaudit.array import FloatArray
from nineaudit.errors import ConfigurationError, NineauditError, RecordingError
from nineaudit.readers import read
from nineaudit.readers.contents import Contents
from nineaudit.readers.mme import files as mme_files
from nineaudit.readers.mme.reader import read_mme
from nineaudit.rig import Rig, parse_rig
from nineaudit.writers import write_recording
from recordings import array_rig, motion

SMALL = '[rig]\nname="s"\n[units]\nacceleration="m/s^2"\n{recording}' + "".join(
    f'[[sensor]]\nchannel="{c}"\nkind="accelerometer"\nposition=[0,0,0]\naxis=[1,0,0]\nsignal="{{{c}}}"\n'
    for c in ("p", "q")
)
CODES = ("11HEAD0000H3ACXA", "11HEAD0000H3ACYA")
COUNT = 12
P, Q = np.arange(COUNT) + 0.5, -np.arange(float(COUNT))
ARRAY_RIG = array_rig()
MOTION = motion(ARRAY_RIG)


def rig(p: str = CODES[0], q: str = CODES[1], recording: str = '[recording]\nfilter_class="CFC1000"\n') -> Rig:
    return parse_rig(SMALL.format(p=p, q=q, recording=recording))


def channel(code: str, values: object, *, end: str = "", **keys: str) -> str:
    """Text of a channel file as laboratories write it."""
    header = {
        "Test object number": "1",
        "Name of the channel": f"name of {code[14]}",
        "Laboratory channel code": f"lab {code[14]}",
        "Customer channel code": "NOVALUE",
        "Channel code": code,
        "Unit": "m/(s*s)",
        "Reference channel": "implicit",
        "Reference channel name": "NOVALUE",
        "Transducer natural frequency": "NOVALUE",
        "Sampling interval": "0.01",
        "Time of first sample": "-0.05",
        "Number of samples": str(COUNT),
        "Data status": "ok",
    } | {key.replace("_", " "): value for key, value in keys.items()}
    lines = [f"{key:<28}:{value}" for key, value in header.items() if value != "-"]
    return "\n".join([*lines, *(f"{v:E}" if isinstance(v, float) else str(v) for v in values)]) + "\n" + end  # type: ignore[attr-defined]


def files(p: str = channel(CODES[0], P), q: str = channel(CODES[1], Q), **more: str) -> dict[str, str]:
    index = "Number of channels          :2\n" + "".join(
        f"Name of channel {i:03d}         :{code} / something\n" for i, code in enumerate(CODES, 1)
    )
    return {
        "T1.mme": "Data format edition number  :1.6\nTitle                       :Prüfung\n",
        "Channel/T1.chn": index,
        "Channel/T1.001": p,
        "Channel/T1.002": q,
    } | more


def folder(tmp_path: Path, content: dict[str, str]) -> Path:
    for name, text in content.items():
        (tmp_path / "test" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "test" / name).write_bytes(text.encode("cp1252"))
    return tmp_path / "test"


def archive(tmp_path: Path, content: dict[str, str]) -> Path:
    path = tmp_path / "T1.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as out:
        for name, text in content.items():
            out.writestr(name, text.encode("cp1252"))
    return path


def contents(tmp_path: Path, content: dict[str, str], asked: Rig | None = None) -> Contents:
    return read_mme(folder(tmp_path, content), asked or rig())


def same(found: Contents, p: object = P, q: object = Q) -> None:
    np.testing.assert_array_equal(found.traces[0].values, p)
    np.testing.assert_array_equal(found.traces[1].values, q)
    np.testing.assert_array_equal(found.traces[0].time, -0.05 + 0.01 * np.arange(COUNT))


# --- where it is --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("place", ["folder", "header", "archive", "archive in a folder", "flat", "upper case"])
def test_a_test_wherever_it_is(tmp_path: Path, place: str) -> None:
    content = files()
    if place == "flat":
        content = {name.rpartition("/")[2]: text for name, text in content.items()}
    if place == "upper case":
        content = {name.upper(): text for name, text in content.items()}
    if place == "archive in a folder":
        content = {f"lab/T1/{name}": text for name, text in content.items()}
    path = archive(tmp_path, content) if "archive" in place else folder(tmp_path, content)
    found = read(path / "T1.mme" if place == "header" else path, rig())
    np.testing.assert_array_equal(found.readings.T, [P, Q])
    assert found.source.format == "mme"
    assert found.source.unchanged_after_read
    assert found.source.damage == found.source.notes == ()
    assert found.source.counts == {"channels": 2, "channels_used": 2, "samples": 24, "invalid_samples": 0}


def test_a_fingerprint_is_of_all_the_files(tmp_path: Path) -> None:
    path = folder(tmp_path, files())
    size, sha256 = mme_files.fingerprint(path)
    assert size == sum(p.stat().st_size for p in path.rglob("*") if p.is_file())
    (path / "unrelated.txt").write_text("x")
    assert mme_files.fingerprint(path / "T1.mme") == (size, sha256)
    changed = path / "Channel" / "T1.002"
    changed.write_text(changed.read_text().replace("-1.1", "-1.2"))
    assert mme_files.fingerprint(path)[1] != sha256


@pytest.mark.skipif(os.name == "nt" or sys.platform == "darwin", reason="names there are Unicode")
def test_a_channel_file_may_have_a_name_that_is_not_utf_8(tmp_path: Path) -> None:
    path = folder(tmp_path, files())
    before = mme_files.fingerprint(path)[1]
    channel = next(path.rglob("*.001"))
    channel.rename(os.fsdecode(os.fsencode(channel.parent) + b"/T\xfc.001"))
    assert mme_files.fingerprint(path)[1] != before


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (files(**{"T2.mme": "x:y\n"}), r"holds more than one test; found 'T1.mme, T2.mme'; expected one .mme file"),
        ({"T1.mme": "a:b\n"}, r"no channel files of an ISO-MME test; found 'T1.mme'"),
        (
            files(q=channel(CODES[0], Q)),
            r"channel 'p': channel code '11HEAD0000H3ACXA' is there 2 times",
        ),
        (files(p=channel("11HEAD0000H3ACXB", P)), r"missing channel 'p'.*did you mean '11HEAD0000H3AC"),
        (files(p=channel(CODES[0], P, Sampling_interval="NOVALUE")), r"T1.001: a channel without a clock"),
        (files(p=channel(CODES[0], P, Sampling_interval="-1")), r"a channel without a clock; found '-1'"),
        (files(p=channel(CODES[0], P, Unit="furlong")), r"unknown unit of acceleration; found 'furlong'"),
        (files(p=channel(CODES[0], P, Reference_channel="explicit")), r"missing channel 'time of 11HEAD"),
    ],
)
def test_tests_that_cannot_be_read(tmp_path: Path, content: dict[str, str], says: str) -> None:
    for path in (folder(tmp_path, content), archive(tmp_path, content)):
        with pytest.raises(NineauditError, match=says):
            read(path, rig())


# --- which channel, its unit and clock ----------------------------------------------------------------------------


@pytest.mark.parametrize("p", [CODES[0], "11HEAD????H3ACX?", "lab X", "name of X"])
def test_a_signal_is_a_code_or_a_name(tmp_path: Path, p: str) -> None:
    same(contents(tmp_path, files(), rig(p)))


def test_a_code_may_stand_in_the_index_alone(tmp_path: Path) -> None:
    same(contents(tmp_path, files(p=channel(CODES[0], P, Channel_code="NOVALUE"))))


@pytest.mark.parametrize(("unit", "factor"), [("g", 9.80665), ("m/(s*s)", 1.0), ("mm/(s*s)", 1e-3), ("NOVALUE", 1.0)])
def test_the_unit_of_the_header(tmp_path: Path, unit: str, factor: float) -> None:
    found = read(folder(tmp_path, files(p=channel(CODES[0], P, Unit=unit))), rig())
    np.testing.assert_array_equal(found.column("p"), P * factor)


@pytest.mark.parametrize(("unit", "scale"), [("s", 1.0), ("ms", 1e-3)])
def test_an_explicit_clock(tmp_path: Path, unit: str, scale: float) -> None:
    time = np.arange(COUNT) ** 2 / 4
    clock = channel("11TIRS000000TI00", time, Unit=unit, Name_of_the_channel="clock")
    explicit = {"Reference_channel": "explicit", "Reference_channel_name": "11TIRS000000TI00"}
    p, q = channel(CODES[0], P, **explicit), channel(CODES[1], Q[:-2], Number_of_samples="10", **explicit)
    found = contents(tmp_path, files(p, q, **{"Channel/T1.003": clock}))
    np.testing.assert_array_equal(found.traces[0].time, time * scale)
    np.testing.assert_array_equal(found.traces[1].time, time[:-2] * scale)
    assert [str(d) for d in found.damage] == [
        "T1.002: 10 samples for 12 times of T1.003; what has no partner is left out"
    ]


def test_what_the_codes_say_otherwise_than_the_rig(tmp_path: Path) -> None:
    p = channel("11HEAD0000H3AC1C", P, Laboratory_channel_code="lab X", Data_status="linearised data")
    q = channel(CODES[1], Q, Channel_frequency_class="60", Time_of_first_sample="NOVALUE")
    found = contents(tmp_path, {k: v for k, v in files(p, q).items() if not k.endswith("chn")}, rig("lab X"))
    assert found.notes == (
        "filter class CFC180 by the header of p (rig: CFC1000)",
        "filter class CFC60 by the header of q (rig: CFC1000)",
        "polarity stated as other than that of SAE J211, values taken as they are: p",
        "scaled or linearised by the laboratory: p",
        "no time of first sample, taken as 0: q",
    )
    assert [d.what for d in found.damage] == ["no index of channels (.chn)"]


# --- damage -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("status", ["channel failed", "meaningless data", "questionable data", "System failed"])
def test_a_status_other_than_ok_is_damage(tmp_path: Path, status: str) -> None:
    found = contents(tmp_path, files(p=channel(CODES[0], P, Data_status=status)))
    same(found)
    said = f"T1.001: the laboratory's status of the channel is '{status.lower()}'; it is read as it is"
    assert [str(d) for d in found.damage] == [said]


def test_a_channel_without_data(tmp_path: Path) -> None:
    found = contents(tmp_path, files(p=channel(CODES[0], [], Data_status="no data", Number_of_samples="0")))
    same(found, np.full(COUNT, np.nan))
    assert [d.what for d in found.damage] == ["the laboratory's status of the channel is 'no data'"]


def test_samples_that_are_missing_keep_their_place(tmp_path: Path) -> None:
    p: list[object] = list(P)
    p[3], p[5], p[7], p[8] = "NOVALUE", "1_0", "", "1:5"
    found = contents(tmp_path, files(p=channel(CODES[0], p)))
    same(found, np.where(np.isin(np.arange(COUNT), [3, 5, 7, 8]), np.nan, P))
    assert found.counts["invalid_samples"] == 4
    assert [str(d) for d in found.damage] == [
        "T1.001 line 19: a sample that is no number (2 times, first there); they are missing"
    ]


def test_a_cut_channel(tmp_path: Path) -> None:
    found = contents(tmp_path, files(p=channel(CODES[0], P)[:-33]))
    kept = len(found.traces[0].values)
    assert 8 <= kept < COUNT
    np.testing.assert_array_equal(found.traces[0].values[:-1], P[: kept - 1])
    assert [d.what for d in found.damage] == [
        "the last line has no line end: the file may be cut",
        f"{kept} samples for the 12 that its header states",
    ]


def test_more_samples_than_stated_headers_that_are_odd_and_nul_bytes(tmp_path: Path) -> None:
    p = channel(CODES[0], P, Number_of_samples="11").replace("Unit", "nonsense\nUnit")
    found = contents(tmp_path, files(p, channel(CODES[1], Q) + "\0" * 50))
    same(found)
    assert [(d.what, d.place) for d in found.damage] == [
        ("a line of the header without a colon", "T1.001 line 6"),
        ("12 samples for the 11 that its header states", "T1.001"),
        ("NUL bytes after the samples", "T1.002 line 26"),
    ]


def test_an_index_that_is_not_of_the_files(tmp_path: Path) -> None:
    content = files()
    content["Channel/T1.chn"] = content["Channel/T1.chn"].replace("H3ACY", "H3ACZ") + "Name of channel 009 :x / y\n"
    found = contents(tmp_path, content)
    same(found)
    assert [(d.what, d.place) for d in found.damage] == [
        ("a channel of the index without a file", "channel 009"),
        ("another channel code than in the index", "T1.002"),
    ]


def test_a_member_of_an_archive_that_is_damaged(tmp_path: Path) -> None:
    path = tmp_path / "T1.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as out:
        for name, text in files().items():
            out.writestr(name, text.encode("cp1252"))
    data = path.read_bytes()
    path.write_bytes(data.replace(b"3.500000E+00", b"7.500000E+00"))
    found = read_mme(path, rig())
    same(found, np.where(P == 3.5, 7.5, P))
    assert found.damage[0].place == "Channel/T1.001"
    assert "its checksum (CRC-32) is wrong" in found.damage[0].what


@pytest.mark.parametrize("streamed", [False, True])
def test_an_archive_that_is_cut(tmp_path: Path, streamed: bool) -> None:
    """Its directory, at the end, is lost: the files are found by the headers before them."""
    path = archive(tmp_path, files())
    if streamed:  # sizes and checksums behind the data, as writers to a pipe have them
        with path.open("wb") as raw, zipfile.ZipFile(_Pipe(raw), "w", zipfile.ZIP_DEFLATED) as out:
            for name, text in files().items():
                out.writestr(name, text.encode("cp1252"))
    data = path.read_bytes()
    path.write_bytes(data[: data.index(b"PK\x01\x02") + 9])
    found = read_mme(path, rig())
    same(found)
    assert len(found.damage) == 1
    assert found.damage[0].what.startswith("the directory of the archive cannot be read")
    path.write_bytes(data[: data.rindex(b"PK\x03\x04") + 250])
    found = read_mme(path, rig(CODES[0], "lab X"))
    same(found, P, P)
    path.write_bytes(data[:20])
    with pytest.raises(RecordingError, match="cut short or damaged: the directory of the archive cannot be read"):
        read(path, rig())


class _Pipe:
    """A file that cannot be wound back."""

    def __init__(self, file: IO[bytes]) -> None:
        self.write, self.flush = file.write, file.flush


def test_a_bomb_is_read_to_its_bound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bound = 2**20
    monkeypatch.setattr(mme_files, "LARGEST", bound)
    monkeypatch.setattr("nineaudit.readers.mme.reader.LARGEST", bound)
    path = archive(tmp_path, files(p=channel(CODES[0], P) + "0.0\n" * 2**22))
    assert path.stat().st_size < 2**16
    found = read_mme(path, rig())
    assert found.traces[0].values.size * 4 <= bound
    assert f"Channel/T1.001: more than {bound} bytes in a file; the rest is not read" in map(str, found.damage)


def test_samples_are_read_in_slices_to_a_bound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nineaudit.readers.mme.channel._SLICE", 30)
    p: list[object] = list(P)
    p[7] = "gap"
    content = files(p=channel(CODES[0], p))
    found = contents(tmp_path, content)
    same(found, np.where(P == 7.5, np.nan, P))
    assert [str(d) for d in found.damage] == ["T1.001 line 21: a sample that is no number; they are missing"]
    monkeypatch.setattr("nineaudit.readers.mme.channel.MOST", 10)
    found = contents(tmp_path, content)
    np.testing.assert_array_equal(found.traces[1].values, Q[:10])
    assert "T1.002: more than 10 samples in a channel; the rest is not read" in map(str, found.damage)
    monkeypatch.setattr(mme_files, "MOST_CHANNELS", 1)
    with pytest.raises(RecordingError, match="too many channels; found 2; expected up to 1"):
        contents(tmp_path, content)


@pytest.mark.parametrize("seed", range(4))
def test_flipped_and_cut_tests_end_in_a_recording_or_one_of_our_errors(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    whole = archive(tmp_path, files()).read_bytes() if seed % 2 else b""
    ends = {True: 0, False: 0}
    for _ in range(50):
        if whole:
            path = tmp_path / "T1.zip"
            path.write_bytes(_flipped(whole, rng))
        else:
            path = folder(tmp_path, files())
            victim = rng.choice(sorted(p for p in path.rglob("*") if p.is_file()))
            victim.write_bytes(_flipped(victim.read_bytes(), rng))
        try:
            found = read(path, rig())
        except NineauditError:
            ends[False] += 1
        else:
            ends[True] += 1
            assert np.isfinite(found.time).all()
    assert min(ends.values()) > 0


def _flipped(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        out[rng.randrange(len(out))] = rng.choice([0, 10, 13, 46, 58, 255, rng.randrange(256)])
    return bytes(out[: rng.randrange(len(out))] if rng.random() < 0.2 else out)


# --- writing ------------------------------------------------------------------------------------------------------


def test_what_is_written_is_the_same_each_time_and_reads_back(tmp_path: Path) -> None:
    paths = [tmp_path / "A.zip", tmp_path / "a" / "A.zip", tmp_path / "b" / "A.mme"]
    for path in paths:
        path.parent.mkdir(exist_ok=True)
        write_recording(MOTION, path)
        np.testing.assert_allclose(read(path, ARRAY_RIG).readings, MOTION.readings, rtol=2.3e-16)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    with zipfile.ZipFile(paths[0]) as packed:
        assert {n: packed.read(n) for n in packed.namelist()} == {
            p.relative_to(tmp_path / "b").as_posix(): p.read_bytes() for p in (tmp_path / "b").rglob("*") if p.is_file()
        }
    with pytest.raises(
        ConfigurationError, match=r"Channel: the folder exists already, with files of another test; found 'A.001'"
    ):
        write_recording(MOTION, tmp_path / "b" / "B.mme")
    assert not (tmp_path / "b" / "B.mme").exists()


@settings(max_examples=20, deadline=None, derandomize=True)
@given(
    values=st.lists(st.floats(-1e6, 1e6) | st.just(float("nan")), min_size=8, max_size=20),
    regular=st.booleans(),
    start=st.floats(-1, 1),
)
def test_any_readings_read_back(
    tmp_path_factory: pytest.TempPathFactory, values: list[float], regular: bool, start: float
) -> None:
    n = len(values)
    steps = np.arange(n) if regular else np.cumsum(1 + np.arange(n) % 3)
    time = start + 1e-4 * steps
    readings: FloatArray = np.column_stack([values, np.roll(values, 1)])
    asked = rig()
    sample = replace(MOTION, rig=asked, time=time, readings=readings, valid=np.isfinite(readings))
    path = tmp_path_factory.getbasetemp() / "any.zip"
    write_recording(sample, path, force=True)
    found = read_mme(path, asked)
    for trace, column in zip(found.traces, readings.T, strict=True):
        np.testing.assert_array_equal(trace.values, column)
        np.testing.assert_allclose(trace.time, time, rtol=0, atol=1e-9)
    statuses = {d.what for d in found.damage}
    assert statuses <= {"the laboratory's status of the channel is 'no data'"}


def test_a_code_of_the_rig_is_written_and_others_are_made_up(tmp_path: Path) -> None:
    write_recording(MOTION, tmp_path / "A.zip")
    asked = rig()
    sample = replace(MOTION, rig=asked, readings=MOTION.readings[:, :2], valid=MOTION.valid[:, :2])
    done = write_recording(sample, tmp_path / "B.zip")
    assert done.notes == ()
    with zipfile.ZipFile(tmp_path / "B.zip") as packed:
        assert f":{CODES[0]}\n" in packed.read("Channel/B.001").decode()
        assert "which is not altered" in packed.read("B.mme").decode()
    with zipfile.ZipFile(tmp_path / "A.zip") as packed:
        assert ":1?????030000ACY0\n" in packed.read("Channel/A.004").decode()


def test_what_was_rebuilt_is_said_in_its_channel(tmp_path: Path) -> None:
    readings = MOTION.readings.copy()
    readings[5:9, 3] += 1
    write_recording(MOTION, tmp_path / "R.zip", readings=readings)
    with zipfile.ZipFile(tmp_path / "R.zip") as packed:
        mended, other = (packed.read(f"Channel/R.{i:03d}").decode() for i in (4, 3))
    assert "Comments                    :4 samples rebuilt by nineaudit; the original is not altered" in mended
    assert "Comments" not in other


def files_of(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize("name", ["A.mme", "A.zip"])
def test_an_older_test_is_replaced_when_asked_for_and_only_by_a_whole_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    path = tmp_path / name
    write_recording(replace(MOTION, readings=MOTION.readings + 1.0), path)
    (tmp_path / "kept.txt").write_text("kept", encoding="utf-8")
    before = files_of(tmp_path)
    with pytest.raises(ConfigurationError, match="exists already"):
        write_recording(MOTION, path)
    with monkeypatch.context() as broken:  # the disk is full when the last file takes its name
        broken.setattr("nineaudit.files.os.replace", Mock(side_effect=OSError(28, "No space left on device")))
        with pytest.raises(ConfigurationError, match="cannot be written: No space left on device"):
            write_recording(MOTION, path, force=True)
    assert files_of(tmp_path) == before
    assert not [p.name for p in tmp_path.iterdir() if p.name.startswith(".")]
    write_recording(MOTION, path, force=True)
    np.testing.assert_allclose(read(path, ARRAY_RIG).readings, MOTION.readings, rtol=2.3e-16)
    assert files_of(tmp_path).keys() == before.keys()
    assert not [p.name for p in tmp_path.iterdir() if p.name.startswith(".")]


def test_force_takes_nothing_of_another_test_nor_of_the_original(tmp_path: Path) -> None:
    write_recording(MOTION, tmp_path / "A.mme")
    before = files_of(tmp_path)
    original = read(tmp_path, ARRAY_RIG)
    for path, says in [
        (tmp_path / "A.mme", "the original recording is never overwritten"),
        (tmp_path / "B.mme", "the original recording is never overwritten"),
    ]:
        with pytest.raises(ConfigurationError, match=says):
            write_recording(original, path, force=True)
    with pytest.raises(ConfigurationError, match=r"with files of another test; found 'A\.001'"):
        write_recording(MOTION, tmp_path / "B.mme", force=True)
    with pytest.raises(ConfigurationError, match="the original recording is never overwritten"):
        write_recording(read(tmp_path / "A.mme", ARRAY_RIG), tmp_path / "A.mme", force=True)
    assert files_of(tmp_path) == before
    loose = tmp_path / "loose"
    loose.mkdir()
    (loose / "c.001").write_bytes(b"")
    with pytest.raises(ConfigurationError, match=r"c\.001: it is a channel of a test of this name"):
        write_recording(MOTION, loose / "C.mme", force=True)
