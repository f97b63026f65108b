"""From a repair to `check` and `verify`: what was made is told from what was measured, and changes are found."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from nineaudit import cli, commands, repair, verify
from nineaudit.auditing import Audit, audit
from nineaudit.errors import ConfigurationError, RecordingError
from nineaudit.files import is_sealed
from nineaudit.finding import Verdict
from nineaudit.provenance import path_beside
from nineaudit.readers import read
from nineaudit.report import lines, result_document
from nineaudit.rig import load_rig, preset_text
from nineaudit.simulate import simulate
from nineaudit.writers import encode, write_recording

NOW = datetime(2026, 3, 1, 12, tzinfo=UTC)
FORMATS = [".csv", ".parquet", ".mcap", ".zip", ".mme"]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Audit]:
    """A folder with a rig and a recording in which a1y clips, as CSV; its audit."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "rig.toml").write_text(preset_text("naap-3222"), encoding="utf-8")
    rig = load_rig(folder / "rig.toml")
    write_recording(simulate(rig, "general", faults=["a1y:clipping=0.5"]).recording, folder / "T.csv")
    return folder, audit(read(folder / "T.csv", rig))


@pytest.fixture
def here(made: tuple[Path, Audit], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Audit:
    """The audit, as of a copy in a new folder, which is the working directory."""
    from dataclasses import replace

    shutil.copytree(made[0], tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    found = made[1]
    source = replace(found.recording.source, path=Path("T.csv"))
    return replace(found, recording=replace(found.recording, source=source))


def names() -> set[str]:
    return {path.name for path in Path().iterdir()}


# --- the record and the round trip --------------------------------------------------------------------------------


def test_the_record_says_what_from_what_how_by_whom_and_with_what(here: Audit) -> None:
    place = repair.repair(here, Path("new.csv"), reason="clipped", by="A. Tester", now=NOW)
    document = json.loads(place.read_text(encoding="utf-8"))
    assert is_sealed(document)
    assert document["rig"]["sha256"] == here.recording.rig.sha256
    assert document["rulebook"] == {"sha256": here.rulebook.sha256, "rules": len(here.rulebook.rules)}
    assert (document["reason"], document["by"], document["utc"]) == (
        "clipped",
        "A. Tester",
        "2026-03-01T12:00:00+00:00",
    )
    assert document["tool"]["version"]
    assert 0 < document["u_rms"] <= document["u_max"]
    rebuilt = here.reconstruction
    assert rebuilt is not None
    inside = np.zeros(len(here.recording.time), dtype=bool)
    for first, last in document["stretches_s"]["a1y"]:
        inside |= (here.recording.time >= first) & (here.recording.time <= last)
    np.testing.assert_array_equal(inside, rebuilt.replaced[:, 0])


@pytest.mark.parametrize("suffix", FORMATS)
def test_what_is_read_back_is_told_from_what_was_measured(here: Audit, suffix: str) -> None:
    output = Path(f"new{suffix}")
    repair.repair(here, output, now=NOW)
    found = read(output, here.recording.rig)
    rebuilt = here.reconstruction
    assert rebuilt is not None
    (remade,) = found.remade
    assert (remade.channel, remade.from_others, remade.original) == ("a1y", True, here.recording.source.sha256)
    column = found.rig.array.index("a1y")
    np.testing.assert_array_equal(found.made_of_others[:, column], rebuilt.replaced[:, 0])
    assert found.made_of_others.sum() == rebuilt.replaced.sum()
    np.testing.assert_allclose(found.readings, repair.repaired_readings(here, rebuilt), rtol=1e-12)
    assert found.source.provenance is not None
    assert found.source.provenance.fits
    assert [answer.state for answer in verify.verify([output])] == [0, 0, 0]


def test_check_says_so_everywhere_and_does_not_take_it_for_evidence(here: Audit) -> None:
    repair.repair(here, Path("new.csv"), now=NOW)
    done = audit(read("new.csv", here.recording.rig))
    (finding,) = [f for f in done.findings if f.rule == "RQ107"]
    assert (finding.verdict, finding.channels) == (Verdict.WARN, ("a1y",))
    assert any("warning RQ107 a1y" in line for line in lines(done))
    assert "a1y is reconstructed, not measured" in lines(done)[-1]
    (row,) = result_document(done)["recording"]["reconstructed"]
    assert (row["channel"], row["samples"], row["independent"]) == ("a1y", 570, False)
    compared = [f.reason for f in done.findings if f.rule in ("RB301", "RB302", "RB303") and f.measure]
    assert compared
    assert all("samples of a1y that were made of the other channels are left out" in reason for reason in compared)
    column = done.recording.rig.array.index("a1y")
    weight = done.case.fit_data.weight
    assert (weight[:, column] == 0).any()
    assert (np.delete(weight, column, axis=1) > 0).all()
    assert done.diagnosis.smallest_detectable["a1y"] > here.diagnosis.smallest_detectable["a0x"]


def test_a_file_that_was_altered_after_its_repair_fails(here: Audit) -> None:
    repair.repair(here, Path("new.csv"), now=NOW)
    with Path("new.csv").open("a", encoding="utf-8") as file:
        file.write("\n")
    found = read("new.csv", here.recording.rig)
    assert found.source.provenance is not None
    assert not found.source.provenance.fits
    (damage,) = found.source.damage
    assert "new.csv.provenance.json: this record is of a file with another hash" in str(damage)
    assert [made.channel for made in found.remade] == ["a1y"]
    assert verify.exit_code(verify.verify([Path("new.csv")])) == 1


def test_the_log_tells_it_without_the_file_beside(here: Audit) -> None:
    place = repair.repair(here, Path("new.mcap"), now=NOW)
    beside = json.loads(place.read_text(encoding="utf-8"))
    place.unlink()
    found = read("new.mcap", here.recording.rig)
    assert [made.channel for made in found.remade] == ["a1y"]
    assert found.source.provenance is not None
    inside = dict(found.source.provenance.document)
    assert inside.pop("mcap") == {"topics": {"a1y": "/nineaudit/a1y"}}
    assert inside == {k: v for k, v in beside.items() if k not in ("output", "seal")}


def test_an_mcap_log_keeps_every_byte(here: Audit) -> None:
    encode(here.recording, Path("T.mcap"))
    before = Path("T.mcap").read_bytes()
    done = audit(read("T.mcap", here.recording.rig))
    repair.repair(done, Path("new.mcap"), now=NOW)
    after = Path("new.mcap").read_bytes()
    same = int(np.argmin([a == b for a, b in zip(before, after, strict=False)]))
    assert same > 0.9 * len(before)
    assert Path("T.mcap").read_bytes() == before
    before_, after_ = read("T.mcap", done.recording.rig), read("new.mcap", done.recording.rig)
    np.testing.assert_array_equal(after_.time, before_.time)
    assert after_.resampled == ()
    others = [c for c in done.recording.channels if c != "a1y"]
    for channel in others:
        np.testing.assert_array_equal(after_.column(channel), before_.column(channel))
    assert (after_.column("a1y") != before_.column("a1y")).sum() == 570


def test_what_of_a_damaged_log_is_not_carried_over_is_said(here: Audit) -> None:
    encode(here.recording, Path("T.mcap"))
    whole = Path("T.mcap").read_bytes()
    Path("T.mcap").write_bytes(whole[: int(0.98 * len(whole))])
    done = audit(read("T.mcap", here.recording.rig))
    assert done.recording.source.damage
    said = commands.repaired(done, Path("new.mcap"), channel="a1y")
    document = json.loads(path_beside(Path("new.mcap")).read_text(encoding="utf-8"))
    assert document["original"]["damage"] == [str(damage) for damage in done.recording.source.damage]
    first, *rest = document["not_carried_over"]
    assert "was written anew: topics that are not the rig's, attachments and metadata" in first
    assert rest == [f"T.mcap: {damage}" for damage in done.recording.source.damage]
    assert [line for line in said if "not carried over from T.mcap: " in line] == [
        f"new.mcap: not carried over from {lost}" for lost in document["not_carried_over"]
    ]


def test_a_whole_recording_leaves_nothing_behind(here: Audit) -> None:
    encode(here.recording, Path("T.mcap"))
    done = audit(read("T.mcap", here.recording.rig))
    assert not any("not carried over" in line for line in commands.repaired(done, Path("new.mcap")))
    document = json.loads(path_beside(Path("new.mcap")).read_text(encoding="utf-8"))
    assert document["not_carried_over"] == []
    assert "damage" not in document["original"]


def test_a_repair_of_a_repair_tells_both(here: Audit) -> None:
    repair.repair(here, Path("first.csv"), now=NOW)
    again = audit(read("first.csv", here.recording.rig))
    place = repair.repair(again, Path("second.csv"), channel="a2x", now=NOW)
    document = json.loads(place.read_text(encoding="utf-8"))
    assert document["previous"]["original"]["sha256"] == here.recording.source.sha256
    found = read("second.csv", here.recording.rig)
    assert [made.channel for made in found.remade] == ["a1y", "a2x"]
    states = {Path(a.place).name: a.state for a in verify.verify([Path("second.csv")])}
    assert states == {"second.csv.provenance.json": 0, "second.csv": 0, "first.csv": 0, "T.csv": 0}


# --- nothing is lost ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".csv", ".mcap"])
@pytest.mark.parametrize("where", ["original", "disk", "record"])
def test_with_force_what_was_there_comes_back_when_the_run_fails(
    here: Audit, suffix: str, where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    output = Path(f"new{suffix}")
    output.write_text("precious", encoding="utf-8")
    path_beside(output).write_text("its record", encoding="utf-8")
    before = names()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    if where == "original":
        Path("T.csv").write_text("another recording", encoding="utf-8")
    else:
        place = "nineaudit.writers.settle" if where == "disk" else "nineaudit.repair.write_whole"
        monkeypatch.setattr(place, full)
    with pytest.raises((RecordingError, ConfigurationError), match=r"has changed|No space"):
        repair.repair(here, output, force=True, now=NOW)
    assert output.read_text(encoding="utf-8") == "precious"
    assert path_beside(output).read_text(encoding="utf-8") == "its record"
    assert names() == before


def test_an_older_mme_test_is_replaced_with_its_record_or_both_stay(
    here: Audit, monkeypatch: pytest.MonkeyPatch
) -> None:
    repair.repair(here, Path("new.mme"), reason="first", now=NOW)
    kept = {p: p.read_bytes() for p in [Path("new.mme"), path_beside(Path("new.mme")), *Path("Channel").iterdir()]}
    with monkeypatch.context() as broken:
        broken.setattr("nineaudit.repair.write_whole", Mock(side_effect=OSError(28, "No space left on device")))
        with pytest.raises(ConfigurationError, match="No space"):
            repair.repair(here, Path("new.mme"), force=True, now=NOW)
    assert {p: p.read_bytes() for p in kept} == kept
    Path("Channel/new.001").write_text("altered", encoding="utf-8")
    place = repair.repair(here, Path("new.mme"), reason="second", force=True, now=NOW)
    assert json.loads(place.read_text(encoding="utf-8"))["reason"] == "second"
    assert [answer.state for answer in verify.verify([Path("new.mme")])] == [0, 0, 0]
    assert not [name for name in names() if name.startswith(".")]


def test_without_force_neither_file_is_overwritten(here: Audit) -> None:
    path_beside(Path("new.csv")).write_text("a record", encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"new.csv.provenance.json: the file exists.*--force"):
        repair.repair(here, Path("new.csv"), now=NOW)
    assert not Path("new.csv").exists()


def test_an_original_that_is_gone_cannot_vouch(here: Audit) -> None:
    Path("T.csv").unlink()
    with pytest.raises(RecordingError, match="found 'no file'"):
        repair.repair(here, Path("new.csv"), now=NOW)
    assert "new.csv" not in names()


STOPPED = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell starts its background jobs deaf to it
import nineaudit.repair, nineaudit.writers, nineaudit.files
from nineaudit import cli
def stop(*_):
    os.kill(os.getpid(), signal.SIGINT)
    signal.sigtimedwait([], 5)
{place} = stop
cli.main(sys.argv[1:])
"""


@pytest.mark.parametrize("place", ["nineaudit.repair._require_unchanged", "nineaudit.writers.settle"])
def test_ctrl_c_leaves_no_half_written_file_and_ends_with_130(here: Audit, place: str) -> None:
    assert here.reconstruction is not None
    before = names()
    arguments = ["repair", "T.csv", "--rig", "rig.toml", "--output", "new.csv", "--log", "audit.jsonl"]
    code = STOPPED.format(place=place)
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 130 == 128 + signal.SIGINT, done.stderr
    assert "Traceback" not in done.stderr
    assert names() == before


# --- verify -------------------------------------------------------------------------------------------------------


def called(*arguments: str) -> int:
    with pytest.raises(SystemExit) as ended:
        cli.main(arguments)
    return int(ended.value.code or 0)


@pytest.fixture(scope="module")
def bundled(made: tuple[Path, Audit], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with recording, result, page, repair and log."""
    folder = tmp_path_factory.mktemp("bundled")
    shutil.copytree(made[0], folder, dirs_exist_ok=True)
    common = ("T.csv", "--rig", "rig.toml", "--log", "a.jsonl")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert called("check", *common, "--json", "T.json", "--html", "T.html") == 1
        assert called("repair", *common, "--output", "new.csv") == 0
    return folder


@pytest.fixture
def bundle(
    bundled: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, list[str]]]:
    """`verify` of paths in a copy of `bundled`: (exit code, lines)."""
    shutil.copytree(bundled, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)

    def call(*paths: str) -> tuple[int, list[str]]:
        code = called("verify", *paths)
        return code, capsys.readouterr().out.splitlines()

    return call


Bundle = Callable[..., tuple[int, list[str]]]


def test_verify_finds_any_change_and_names_it(bundle: Bundle) -> None:
    code, said = bundle(".")
    assert code == 0, said
    assert all(": unchanged: " in line for line in said)
    tampered: dict[str, Callable[[str], str]] = {
        "T.csv": lambda text: text.replace("0.0", "0.1", 1),
        "T.json": lambda text: text.replace('"verdict": "fail"', '"verdict": "pass"', 1),
        "T.html": lambda text: text.replace("Fail", "Pass", 1),
        "rig.toml": lambda text: text + "\n",
        "new.csv": lambda text: text.replace("1", "2", 1),
        "new.csv.provenance.json": lambda text: text.replace('"by": ""', '"by": "somebody"'),
        "a.jsonl": lambda text: text.replace('"verdict":"fail"', '"verdict":"pass"', 1),
    }
    for name, change in tampered.items():
        before = Path(name).read_bytes()
        Path(name).write_text(change(before.decode()), encoding="utf-8", newline="")
        assert Path(name).read_bytes() != before, name
        code, said = bundle(".")
        changed = [line for line in said if "CHANGED" in line]
        assert code == 1, name
        assert changed
        assert all(line.startswith(name) for line in changed), changed
        Path(name).write_bytes(before)
    assert bundle(".")[0] == 0


def test_the_line_of_a_log_that_was_altered_is_named(bundle: Bundle) -> None:
    text = Path("a.jsonl").read_text(encoding="utf-8")
    first, second = text.splitlines()
    entry = json.loads(first)
    assert (entry["verdict"], entry["exit_code"], entry["command"][0]) == ("fail", 1, "check")
    assert {Path(o["path"]).name for o in entry["outputs"]} == {"T.json", "T.html"}
    assert {i["path"] for i in json.loads(second)["inputs"]} == {"T.csv", "rig.toml"}
    Path("a.jsonl").write_text(first.replace("fail", "pass") + "\n" + second + "\n", encoding="utf-8")
    code, said = bundle("a.jsonl")
    assert code == 1
    assert said[0].startswith("a.jsonl: line 1: CHANGED: was altered")


def test_what_cannot_be_verified_is_no_success(bundle: Bundle) -> None:
    assert bundle("T.csv")[0] == 3
    assert bundle("no-such-file.csv")[0] == 3
    Path("empty").mkdir()
    assert bundle("empty")[0] == 3
    Path("bad.jsonl").write_text("", encoding="utf-8")
    assert bundle("bad.jsonl")[0] == 3
    Path("a.jsonl.head").unlink()
    code, said = bundle("a.jsonl")
    assert code == 3
    assert "a.jsonl.head is not there" in said[0]
    Path("T.csv").rename("moved.csv")
    code, said = bundle("T.json")
    assert (code, said[-1]) == (3, "T.csv: NOT VERIFIED: it is not there; T.json holds its hash")


@pytest.mark.parametrize("text", ['{"schema": "nineaudit/result/1"}', '[{"schema": "nineaudit/result/1"}, 1]',
                                  '{"schema": "nineaudit/result/1", "recording": [1], "seal": null}'])  # fmt: skip
def test_results_that_others_wrote_do_not_stop_it(text: str, tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text(text, encoding="utf-8")
    assert verify.exit_code(verify.verify([tmp_path])) == 1


def test_names_in_a_log_cannot_reach_the_terminal_raw(bundle: Bundle) -> None:
    hostile = {"schema": "nineaudit/result/1", "recording": {"path": "x\x1b[2J\u202e.csv", "sha256": "3f"}}
    Path("h.json").write_text(json.dumps(hostile), encoding="utf-8")
    _, said = bundle("h.json")
    assert not any("\x1b" in line or "\u202e" in line for line in said)


@pytest.mark.parametrize("place", ["T.csv", "rig.toml", "T.json"])
def test_the_log_is_never_another_file_of_the_command(
    here: Audit, place: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert here.reconstruction is not None
    before = Path("T.csv").read_bytes()
    with pytest.raises(SystemExit) as ended:
        cli.main(["check", "T.csv", "--rig", "rig.toml", "--json", "T.json", "--log", place])
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith("nineaudit: ")
    assert Path("T.csv").read_bytes() == before
