"""Paths that are refused, devices, links, full disks: a sentence, the right exit code, and nothing else harmed."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from nineaudit import cli
from nineaudit.files import partial_name, write_whole
from nineaudit.report import write_report
from nineaudit.rig import parse_rig, preset_text
from nineaudit.simulate import simulate
from nineaudit.writers import write_recording
from report_example import healthy

LONG = "x" * 300
FULL = "x" * 245


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.toml").write_text(preset_text("naap-3222"), encoding="utf-8")
    write_recording(simulate(parse_rig(preset_text("naap-3222")), "general", seed=1).recording, tmp_path / "T1.csv")
    return tmp_path


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    with pytest.raises(SystemExit) as ended:
        cli.main(list(arguments))
    return int(ended.value.code or 0), capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["check", f"{LONG}.csv", "--rig", "rig.toml"], 3),
        (["check", "T1.csv", "--rig", f"{LONG}.toml"], 2),
        (["check", "T1.csv", "--rig", "rig.toml", "--html", f"{LONG}.html"], 2),
        (["check", "T1.csv", "--rig", "rig.toml", "--json", f"{LONG}.json"], 2),
        (["check", "T1.csv", "--rig", "rig.toml", "--junit", f"{LONG}.xml"], 2),
        (["repair", "T1.csv", "--rig", "rig.toml", "--output", f"{LONG}.csv", "--channel", "a1y"], 2),
        (["motion", "T1.csv", "--rig", "rig.toml", "--output", f"{LONG}.csv"], 2),
        (["verify", LONG], 2),
        (["rules", "check", LONG], 2),
    ],
    ids=lambda v: "-".join(v[:2])[:20] if isinstance(v, list) else str(v),
)
def test_a_name_that_is_too_long_is_no_defect(
    folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], code: int
) -> None:
    before = sorted(os.listdir(folder))
    found, said = run(capsys, *arguments)
    assert found == code
    assert "defect" not in said
    assert "name too long" in said.lower()
    assert sorted(os.listdir(folder)) == before


def test_a_name_that_just_fits_is_written(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = folder / f"{FULL}.html"
    assert run(capsys, "check", "T1.csv", "--rig", "rig.toml", "--html", str(page))[0] == 0
    assert page.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert run(capsys, "motion", "T1.csv", "--rig", "rig.toml", "--output", f"{FULL}.csv")[0] == 0
    assert sorted(p.name[-9:] for p in folder.iterdir()) == sorted(["T1.csv", "rig.toml", "xxxx.html", "xxxxx.csv"])


def test_names_on_the_way_differ_where_names_do() -> None:
    one, other = (partial_name(Path("é" * 120 + end)) for end in ("a.html", "b.html"))
    assert one != other
    assert max(len(os.fsencode(p.name)) for p in (one, other)) < 255
    assert partial_name(Path("T1.asc")).with_suffix(".dbc") == partial_name(Path("T1.dbc"))
    assert partial_name(Path(f"{FULL}.asc")).with_suffix(".dbc") == partial_name(Path(f"{FULL}.dbc"))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes with a name are of POSIX")
def test_a_report_is_written_to_a_pipe_and_through_a_link_and_takes_the_place_of_neither(tmp_path: Path) -> None:
    """Root's report to /dev/null would take the device's place."""
    pipe, link, file = tmp_path / "pipe.html", tmp_path / "link.html", tmp_path / "file.html"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
    write_whole(pipe, "short")
    assert os.read(reader, 10) == b"short"
    link.symlink_to(file.name)
    write_report(healthy(), link)
    os.close(reader)
    assert pipe.is_fifo()
    assert link.is_symlink()
    assert file.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


@pytest.mark.skipif(not Path("/dev/full").is_char_device(), reason="/dev/full is of Linux")
@pytest.mark.parametrize("option", ["--html", "--json", "--junit", "--summary"])
def test_a_full_device_is_said_and_stays_a_device(
    folder: Path, capsys: pytest.CaptureFixture[str], option: str
) -> None:
    link = folder / "full.out"  # were the link replaced, the device would be safe
    link.symlink_to("/dev/full")
    found, said = run(capsys, "check", "T1.csv", "--rig", "rig.toml", option, str(link))
    assert found == 2
    assert "No space left on device" in said
    assert link.is_symlink()
    assert Path("/dev/full").is_char_device()


def test_a_link_to_itself_is_no_defect(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "loop.html").symlink_to("loop.html")
    found, said = run(capsys, "check", "T1.csv", "--rig", "rig.toml", "--html", "loop.html")
    assert (found, "defect" in said) == (0, False)
    assert (folder / "loop.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
