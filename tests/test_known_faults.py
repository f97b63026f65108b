"""What other readers pass over in silence, hang on or read wrongly: said by `nineaudit check`, with its exit code."""

from __future__ import annotations

import json
import struct
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from blf_files import container
from blf_files import log as blf_log
from nineaudit import cli
from nineaudit.readers import read
from nineaudit.recording import Recording
from recordings import CAN_FORMATS, array_rig, motion, rig_text, write_any

RIG = array_rig()
MOTION = motion(RIG, duration_s=0.2)
STEPS = np.array([1.25 * (s.full_scale or 0) / (2**20 - 1) * 1.005 for s in RIG.array.sensors])


def whole(folder: Path, suffix: str) -> Path:
    return write_any(MOTION, folder, suffix)


def cut_inside_a_container(folder: Path) -> Path:
    """Nine tenths of the file: the last container, of several, ends in the middle of its deflated bytes."""
    path = _in_containers(whole(folder, ".blf"))
    path.write_bytes(path.read_bytes()[: int(0.9 * path.stat().st_size)])
    return path


def object_size_of_zero(folder: Path) -> Path:
    """A frame in the middle says that it is 0 bytes long."""
    path = whole(folder, ".blf")
    content = bytearray(_content(path))
    at = content.index(b"LOBJ", len(content) // 2)
    content[at + 8 : at + 12] = bytes(4)
    path.write_bytes(blf_log(container(bytes(content))))
    return path


def container_size_of_zero(folder: Path) -> Path:
    path = _in_containers(whole(folder, ".blf"))
    data = bytearray(path.read_bytes())
    at = data.index(b"LOBJ", len(data) // 2)
    data[at + 8 : at + 12] = bytes(4)
    path.write_bytes(data)
    return path


def flipped_byte_in_a_chunk(folder: Path) -> Path:
    """One bit of one number, in one of several chunks; the file stays as long as it was."""
    from mcap.writer import CompressionType, Writer

    path = folder / "t.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE, chunk_size=20_000)
        writer.start()
        schema = writer.register_schema("s", "jsonschema", b"{}")
        channel = writer.register_channel("/array", "json", schema)
        for i, row in enumerate(_in_units(MOTION)):
            message: dict[str, dict[str, float]] = {}
            for sensor, value in zip(RIG.array.sensors, row, strict=True):
                name, _, field = sensor.signal.partition(".")
                message.setdefault(name, {})[field] = value
            writer.add_message(channel, i * 100_000, json.dumps(message).encode(), 0)
        writer.finish()
    data = bytearray(path.read_bytes())
    at = data.index(b'"A0X": ', len(data) // 2) + 10
    data[at] = ord("7") if data[at] != ord("7") else ord("3")
    path.write_bytes(data)
    return path


def decimal_commas(folder: Path) -> Path:
    """As Vector's tools write ASC on a computer of another language."""
    path = whole(folder, ".asc")
    lines = path.read_text().splitlines()
    path.write_text("\n".join(_with_comma(line) for line in lines) + "\n")
    return path


def fd_frames_in_trc(folder: Path) -> Path:
    """Frames of 12 bytes with data length code 9, which python-can takes for their length."""
    path = whole(folder, ".trc")
    lines = path.read_text().splitlines()
    path.write_text("\n".join(line if line.startswith(";") else _longer(line) for line in lines) + "\n")
    dbc = folder / "rig.dbc"
    dbc.write_text(dbc.read_text().replace(": 8 ", ": 12 "))
    return path


def trailing_commas(folder: Path) -> Path:
    """Behind every row but the header: pandas takes the first column for an index and moves the others."""
    path = whole(folder, ".csv")
    head, *rows = path.read_text().splitlines()
    path.write_text("\n".join([head, *(row + "," for row in rows)]) + "\n")
    return path


def half_a_database(folder: Path) -> Path:
    """It ends in the middle of a signal of its third message: cantools reads it without a word, as two messages."""
    path, dbc = whole(folder, ".blf"), folder / "rig.dbc"
    dbc.write_text(dbc.read_text() + "BO_ 258 NAAP_C: 8 Vector__XXX\n SG_ A2X : 0|20@1- (0.0")
    return path


class Case(NamedTuple):
    make: Callable[[Path], Path]
    code: int
    says: tuple[str, ...]
    kept: tuple[int, int]
    """Samples that are read: between these, of N."""


N = MOTION.time.size
ALL = (N, N)
CASES = [
    Case(cut_inside_a_container, 1, ("RQ106", "byte ", "container"), (N // 2, N - 10)),
    Case(object_size_of_zero, 1, ("RQ106", "no object where one must begin", "1 place >"), (N - 2, N)),
    Case(container_size_of_zero, 1, ("RQ106", "1 place > 0 places"), ALL),
    Case(flipped_byte_in_a_chunk, 1, ("RQ106", "checksum (CRC)", "messages lost"), (N // 2, N - 10)),
    Case(decimal_commas, 0, (), ALL),
    Case(fd_frames_in_trc, 0, (), ALL),
    Case(trailing_commas, 0, (), ALL),
    Case(half_a_database, 1, ("RQ106", "rig.dbc line ", "ends inside a statement"), ALL),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.make.__name__)
def test_a_known_fault_is_said_and_what_is_good_is_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], case: Case
) -> None:
    path = case.make(tmp_path)
    code, said = check(path, capsys)
    assert code == case.code, said
    assert all(text in said for text in case.says), said
    assert bool(case.says) == ("RQ106" in said), said
    found = of(path)
    low, high = case.kept
    assert low <= np.count_nonzero(found.valid.all(axis=1)) <= high
    _, mine, its = np.intersect1d(
        np.rint((MOTION.time - MOTION.time[0]) * 1e7), np.rint((found.time - _start(path)) * 1e7), return_indices=True
    )
    assert len(its) >= low
    off = np.abs(found.readings[its] - MOTION.readings[mine])
    assert (off[found.valid[its]] <= np.broadcast_to(STEPS, off.shape)[found.valid[its]]).all()


def test_times_of_an_asc_log_do_not_depend_on_the_time_zone_of_who_reads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path, seen = whole(tmp_path, ".asc"), []
    for zone in ("UTC", "America/New_York", "Asia/Kolkata"):
        monkeypatch.setenv("TZ", zone)
        time.tzset()
        code, said = check(path, capsys, "--json", str(tmp_path / f"{zone.split('/')[0]}.json"))
        assert (code, "RQ106" in said) == (0, False)
        seen.append((of(path).time.tobytes(), of(path).source.notes))
    monkeypatch.undo()
    time.tzset()
    assert seen[0] == seen[1] == seen[2]
    assert any("time zone" in note for note in seen[0][1])


def check(path: Path, capsys: pytest.CaptureFixture[str], *more: str) -> tuple[int, str]:
    """(exit code, standard output) of `nineaudit check`; nothing but findings is said."""
    rig = path.parent / "rig.toml"
    rig.write_text(rig_text(recording='time = "time_s"' if path.suffix == ".csv" else ""))
    databases = [f"--dbc={path.parent / 'rig.dbc'}"] if path.suffix in CAN_FORMATS else []
    with pytest.raises(SystemExit) as ended:
        cli.main(["check", str(path), f"--rig={rig}", "--select=RQ106,CB", *databases, *more])
    shown = capsys.readouterr()
    assert not shown.err
    return int(str(ended.value.code)), shown.out


def of(path: Path) -> Recording:
    rig = RIG if path.suffix == ".csv" else array_rig(recording="")
    return read(path, rig, dbc=[path.parent / "rig.dbc"] if path.suffix in CAN_FORMATS else [])


def _start(path: Path) -> float:
    """Of the motion, in the log: others than nineaudit write counts from the first frame."""
    return 0.0 if path.suffix in (".trc", ".mcap") else float(MOTION.time[0])


def _content(path: Path) -> bytes:
    """All objects of a BLF file, out of their containers."""
    data, at, found = path.read_bytes(), 144, b""
    while at + 32 <= len(data):
        size = struct.unpack_from("<L", data, at + 8)[0]
        found += zlib.decompress(data[at + 32 : at + size])
        at += size + size % 4
    return found


def _in_containers(path: Path, size: int = 8_000) -> Path:
    """The same log in containers of some kB, which cut objects anywhere."""
    content = _content(path)
    parts = [container(content[i : i + size]) for i in range(0, len(content), size)]
    path.write_bytes(blf_log(b"".join(p + bytes(len(p) % 4) for p in parts)))
    return path


def _in_units(recording: Recording) -> Iterator[list[float]]:
    factors = np.array([s.to_si for s in RIG.array.sensors])
    yield from (recording.readings / factors).tolist()


def _longer(line: str) -> str:
    """A TRC line of a frame of 8 bytes as that of an FD frame of 12."""
    number, stamp, kind, bus, identifier, way, reserved, length, *data = line.split()
    assert (kind, length, len(data)) == ("DT", "8", 8)
    return f"{number} {stamp} FD {bus} {identifier} {way} {reserved} 9 {' '.join(data)} 00 00 00 00"


def _with_comma(line: str) -> str:
    stamp = line.split()[0]
    return line.replace(stamp, stamp.replace(".", ","), 1) if stamp[0].isdigit() else line
