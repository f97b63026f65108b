"""The audit of one recording of a campaign: into a lake, or for whoever calls it."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import zipfile
from pathlib import Path

import pytest

from campaigns import campaign, contents, entries
from nineaudit.campaign import lake as lakes
from nineaudit.campaign import task
from nineaudit.errors import ConfigurationError
from nineaudit.files import is_sealed


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(campaign(tmp_path))
    return tmp_path


def test_an_entry_is_the_result_under_the_name_of_its_uri(folder: Path) -> None:
    entry = task.audit_one("tests/T1.csv", "rig.toml", test={"number": "42"})
    assert entry["schema"] == "nineaudit/lake-entry/1"
    assert entry["uri"] == entry["result"]["recording"]["path"] == "tests/T1.csv"
    assert entry["test"] == {"number": "42"}
    assert entry["result"]["verdict"] in ("pass", "fail", "inconclusive")
    assert is_sealed(entry["result"])
    assert str(folder) not in json.dumps(entry)


def test_audit_one_can_be_sent_to_any_engine() -> None:
    assert pickle.loads(pickle.dumps(task.audit_one)) is task.audit_one


def test_what_is_in_the_lake_is_not_done_again_until_something_changes(folder: Path) -> None:
    first = task.audit_one("tests/T1.csv", "rig.toml", lake="lake")
    before = contents(folder / "lake", ".")
    again = task.audit_one("tests/T1.csv", "rig.toml", lake="lake")
    assert (first["kept"], again["kept"]) == (False, True)
    assert first["key"] == again["key"]
    assert contents(folder / "lake", ".") == before
    text = Path("rig.toml").read_text(encoding="utf-8")
    Path("rig.toml").write_text(text + "# a remark\n", encoding="utf-8")
    assert not task.audit_one("tests/T1.csv", "rig.toml", lake="lake")["kept"]
    Path("rig.toml").write_text(text, encoding="utf-8")
    back = task.audit_one("tests/T1.csv", "rig.toml", lake="lake")
    assert (back["kept"], back["key"]) == (True, first["key"])
    assert entries(folder / "lake")["T1.csv"]["key"] == first["key"]


def test_what_a_table_says_of_the_test_is_part_of_the_entry(folder: Path) -> None:
    keys = [task.audit_one("tests/T1.csv", "rig.toml", lake="lake", test={"number": n})["key"] for n in "12"]
    assert keys[0] != keys[1]
    assert entries(folder / "lake")["T1.csv"]["test"] == {"number": "2"}


def test_resume_trusts_size_and_time_and_nothing_else_does() -> None:
    file = Path("tests/T1.csv")
    task.audit_one("tests/T1.csv", "rig.toml", lake="lake")
    stat, data = file.stat(), file.read_bytes()
    file.write_bytes(data.replace(b"1", b"2"))
    os.utime(file, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    assert task.audit_one("tests/T1.csv", "rig.toml", lake="lake", resume=True)["kept"]
    assert not task.audit_one("tests/T1.csv", "rig.toml", lake="lake")["kept"]
    file.write_bytes(data + b"\n")
    assert not task.audit_one("tests/T1.csv", "rig.toml", lake="lake", resume=True)["kept"]


def test_an_unreadable_recording_is_kept_like_any(folder: Path) -> None:
    Path("tests/broken.mcap").write_bytes(b"no log at all")
    first = task.audit_one("tests/broken.mcap", "rig.toml", lake="lake")
    assert (first["verdict"], first["kept"], first["transient"]) == ("not_audited", False, False)
    assert task.audit_one("tests/broken.mcap", "rig.toml", lake="lake")["kept"]
    gone = task.audit_one("tests/gone.csv", "rig.toml", lake="lake")
    assert gone["verdict"] == "not_audited"
    assert "transient" not in entries(folder / "lake")["gone.csv"]


@pytest.mark.parametrize("uri", ["tests/gone.csv", "memory://gone.csv"])
def test_a_recording_that_is_nowhere_is_told_by_its_verdict_with_a_lake_and_without(uri: str) -> None:
    entry = task.audit_one(uri, "rig.toml")
    assert (entry["uri"], entry["result"]["verdict"]) == (uri, "not_audited")
    assert "no such file" in entry["result"]["reason"].lower()
    assert task.audit_one(uri, "rig.toml", lake="lake")["reason"] == entry["result"]["reason"]


def test_a_configuration_that_is_wrong_for_one_recording_costs_only_that() -> None:
    Path("tests/bus.blf").write_bytes(b"LOGG" + bytes(200))
    assert task.audit_one("tests/bus.blf", "rig.toml", lake="lake")["verdict"] == "not_audited"


def test_a_report_is_kept_of_those_asked_for(folder: Path) -> None:
    def reports() -> int:
        return len(list((folder / "lake" / "reports").glob("*"))) if (folder / "lake" / "reports").exists() else 0

    gate = task.audit_one("tests/T1.csv", "rig.toml", lake="lake", reports="none")["gate"]
    assert reports() == 0
    for kind, count in (("failed", 1 if gate == "error" else 0), ("all", 1)):
        for part in ("results", "editions"):
            shutil.rmtree(folder / "lake" / part)
        task.audit_one("tests/T1.csv", "rig.toml", lake="lake", reports=kind)
        assert reports() == count
    with pytest.raises(ConfigurationError, match="--reports"):
        task.audit_one("tests/T1.csv", "rig.toml", lake="lake", reports="some")


def test_an_archive_member_is_audited_as_the_file_itself() -> None:
    with zipfile.ZipFile("all.zip", "w") as archive:
        archive.write("tests/T1.csv", "deep/T1.csv")
    uri = "zip://deep/T1.csv::all.zip"
    inside, outside = task.audit_one(uri, "rig.toml"), task.audit_one("tests/T1.csv", "rig.toml")
    assert inside["result"]["recording"]["path"] == uri
    assert inside["key"] == outside["key"]
    for entry in (inside, outside):
        del entry["result"]["recording"]["path"], entry["result"]["seal"]
    assert inside["result"] == outside["result"]


def test_a_copy_leaves_no_trace_of_where_it_was() -> None:
    with zipfile.ZipFile("all.zip", "w") as archive:
        archive.writestr("deep/broken.mcap", b"no log at all")
    entry = task.audit_one("zip://deep/broken.mcap::all.zip", "rig.toml")
    assert entry["result"]["reason"].startswith("zip://deep/broken.mcap: ")
    assert entry["result"]["recording"]["path"] == "zip://deep/broken.mcap::all.zip"


def test_a_waiver_for_another_recording_is_no_finding_of_this() -> None:
    Path("w.toml").write_text(
        '[[waiver]]\nrule = "RB301"\nrecordings = "other.csv"\nreason = "r"\napproved_by = "a"\n'
        "approved_on = 2026-01-01\nexpires = 2099-01-01\n",
        encoding="utf-8",
    )
    found = task.audit_one("tests/T1.csv", "rig.toml", waivers="w.toml")["result"]["findings"]
    assert [f["verdict"] for f in found if f["rule"] == "WV001"] == ["not_applicable"]


def test_a_lake_of_another_kind_is_named() -> None:
    with pytest.raises(ConfigurationError, match="is no lake"):
        lakes.open_lake("tests")
    Path("tests/lake.json").write_text('{"schema": "nineaudit/lake/9"}', encoding="utf-8")
    with pytest.raises(ConfigurationError, match="nineaudit/lake/1"):
        lakes.open_lake("tests", create=True)
