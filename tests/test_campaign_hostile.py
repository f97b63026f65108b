"""Campaigns among hostile names, other clients of the same lake, and tables of before."""

from __future__ import annotations

import os
from itertools import pairwise
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from campaign_entries import EDITION, entries, entry, lake_of
from campaigns import campaign
from nineaudit import cli
from nineaudit.campaign import entries as reading
from nineaudit.campaign import lake as lakes
from nineaudit.campaign import running, task
from nineaudit.campaign.guard import NO_LIMITS
from nineaudit.campaign.health.assess import Health, Member, State
from nineaudit.campaign.health.page import section
from nineaudit.campaign.results.compact import compact
from nineaudit.campaign.results.stale import behind
from nineaudit.campaign.source_tables import is_table, rows
from nineaudit.campaign.sources import find
from nineaudit.errors import ConfigurationError


def called(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        cli.main([str(argument) for argument in arguments])
    shown = capsys.readouterr()
    return int(ended.value.code or 0), shown.out, shown.err


@pytest.mark.parametrize("name", ["lake [1]", "lake*", "lake?", "lake #1 ü"])
def test_a_lake_may_have_any_name(tmp_path: Path, name: str) -> None:
    lake = lake_of(tmp_path / name, entries(3))
    assert compact(lake).recordings == 3
    assert len(list(lakes.entries(lake))) == 3


def test_an_entry_that_a_run_replaces_while_all_are_read_is_read_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lake, (first, *_) = lake_of(tmp_path / "lake", []), list(entries(1))
    lakes.write_entry(lake, {**first, "key": "0" * 32, "transient": True}, transient=True)
    places = reading._places

    def overtaken(*asked: object) -> list[tuple[str, str]]:
        found = list(places(*asked))  # type: ignore[arg-type]
        lakes.write_entry(lake, first)  # takes the entry of before away
        return found

    monkeypatch.setattr(reading, "_places", overtaken)
    damaged: list[reading.Damaged] = []
    assert list(reading.current_entries(lake, EDITION, damaged)) == [first]
    assert damaged == []


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder: a rig, a recording, and a file that is none."""
    monkeypatch.chdir(campaign(tmp_path, ["T1.csv"]))
    Path("tests/broken.csv").write_text("no recording\n", encoding="utf-8")
    return tmp_path


def audited(uri: str, rig: str = "rig.toml", **options: Any) -> dict[str, Any]:
    return task.audit_one(uri, rig, lake="lake", **options)


@pytest.mark.usefixtures("home")
def test_a_report_that_is_asked_for_later_is_made() -> None:
    assert not audited("tests/T1.csv", reports="none")["kept"]
    assert not audited("tests/T1.csv", reports="all", resume=True)["kept"]
    assert len(list(Path("lake/reports").iterdir())) == 1
    assert audited("tests/T1.csv", reports="all")["kept"]


@pytest.mark.usefixtures("home")
def test_what_could_not_be_audited_is_told_again() -> None:
    first, again = (audited("tests/broken.csv", resume=True) for _ in range(2))
    assert (first["kept"], again["kept"]) == (False, True)
    assert "no rows below it" in first["reason"] == again["reason"]


@pytest.mark.usefixtures("home")
def test_an_entry_that_was_removed_is_made_again() -> None:
    audited("tests/T1.csv")
    (entry,) = Path("lake/results").rglob("*.json")
    before = entry.read_bytes()
    entry.unlink()
    assert not audited("tests/T1.csv", resume=True)["kept"]
    assert entry.read_bytes() == before


@pytest.mark.usefixtures("home")
def test_the_key_is_of_what_the_result_says_and_not_of_where_the_rig_is() -> None:
    Path("elsewhere").mkdir()
    unnamed = Path("rig.toml").read_text(encoding="utf-8").replace('name = "test"', "", 1)
    for name in ("rig.toml", "elsewhere/rig.toml", "sled.toml"):
        Path(name).write_text(unnamed, encoding="utf-8")
    key = audited("tests/T1.csv")["key"]
    assert audited("tests/T1.csv", "elsewhere/rig.toml")["key"] == key
    named = task.audit_one("tests/T1.csv", "sled.toml")
    assert named["result"]["rig"]["name"] == "sled"
    assert named["key"] != key


def test_names_of_sensors_do_not_lie_on_each_other() -> None:
    def member(i: int) -> Member:
        seat = ("a head form with a long name", f"channel_of_many_signs_{i}")
        state = State.TOO_FEW if i % 2 else State.RECALIBRATE
        name = f"{seat[1]} of {seat[0]}"
        return Member(name, False, False, (seat,), 3, "", "", {"gain": (0.01 * i, 0.01)}, (), state, True)

    sensors = tuple(sorted(map(member, range(40)), key=lambda m: list(State).index(m.state)))
    strip = section(Health(sensors, (), (), {}, 3, False, 0.01)).charts[0]
    at = [place for place, _ in strip.across]
    assert sensors[0].name == sorted(m.name for m in sensors)[int(at[0])]
    assert min(b - a for a, b in pairwise(at)) >= 40 / 5
    assert all(len(name) <= 12 and "head form" not in name for _, name in strip.across)


def test_a_query_of_tables_that_are_behind_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lake = lake_of(tmp_path / "lake", entries(3))
    compact(lake)
    query = ("campaign", "query", lake.uri, "SELECT count(*) FROM recordings")
    assert called(capsys, *query)[2] == ""
    later = Path(lake.place("tables/recordings.parquet")).stat().st_mtime + 5
    lakes.write_entry(lake, entry(7))
    for folder in Path(lake.place(f"editions/{EDITION}")).iterdir():
        os.utime(folder, (later, later))
    code, _, said = called(capsys, *query)
    assert (code, "results are newer than the tables" in said) == (0, True)
    _, _, said = called(capsys, "campaign", "report", lake.uri, "--junit", tmp_path / "j.xml")
    assert said.count("\n") == 1
    lakes.write(lake, "head.json", {"edition": "f" * 12})
    assert "the newest run is of edition ffffffffffff" in called(capsys, *query)[2]


def test_a_query_of_a_store_looks_at_its_runs() -> None:
    lake = lake_of("memory://behind", entries(2))
    compact(lake)
    assert behind(lake, EDITION) is None
    lakes.write_text(lake, "runs/20260101T000000Z-0-1.jsonl", '{"uri": "a", "kept": true}\n')
    assert behind(lake, EDITION) is None
    lakes.write_text(lake, "runs/20260101T000000Z-1-1.jsonl", '{"uri": "a", "kept": false}\n')
    assert "newer than the tables" in (behind(lake, EDITION) or "")


@pytest.mark.usefixtures("home")
def test_what_lies_beside_recordings_is_none() -> None:
    for name in ("README.txt", "ReadMe.csv", "SHA256SUMS.txt", "Thumbs.db", "daq.log", "sub/daq.log"):
        Path("tests", name).parent.mkdir(exist_ok=True)
        Path("tests", name).write_text("see the wiki\n", encoding="utf-8")

    def found(source: str, *exclude: str) -> list[str]:
        return sorted(Path(one.uri).name for one in find([source], lambda _: (), exclude=exclude))

    assert found("tests") == ["T1.csv", "broken.csv", "daq.log", "daq.log"]
    assert found("tests", "*.log", "broken*") == found("tests/*", "*.log", "tests/broken.csv") == ["T1.csv"]
    assert found("tests/README.txt") == ["README.txt"], "what is named is audited"


def test_a_table_of_a_spreadsheet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("t.csv").write_text("\ufeffRecording;Number;Speed\nT1.csv;7;50\nT2.csv;;\n", encoding="utf-8")
    assert is_table("t.csv")
    assert [row for _, row in rows("t.csv")] == [
        {"recording": "T1.csv", "number": "7", "Speed": "50"},
        {"recording": "T2.csv"},
    ]
    whole = pa.table({"recording": ["T1.csv", "T2.csv"], "number": [4711.0, float("nan")]})
    pq.write_table(whole, "t.parquet")
    assert [row.get("number") for _, row in rows("t.parquet")] == ["4711", None]
    Path("t.csv").write_text("recording,number\nT1.csv,7,8\n", encoding="utf-8")
    with pytest.raises(ConfigurationError, match="row 1: a row with more cells than the header"):
        list(rows("t.csv"))


def test_a_worker_of_another_version_is_told() -> None:
    with pytest.raises(ConfigurationError, match=r"another nineaudit; found '?0\.0\.0|expected '?0\.0\.0"):
        running.perform({"uri": "T1.csv", "version": "0.0.0"}, NO_LIMITS, "none:none")


@pytest.mark.usefixtures("home")
@pytest.mark.parametrize("lake", ["tests", "."])
def test_a_lake_is_not_where_the_recordings_are(lake: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, said = called(capsys, "campaign", "run", "tests", "--rig", "rig.toml", "--lake", lake)
    assert code == 2
    assert "the recordings are in it" in said
    assert not (Path(lake) / "lake.json").exists()
