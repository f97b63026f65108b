"""Campaigns among hostile names, other clients of the same lake, and tables of before."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from campaign_entries import EDITION, entries, lake_of
from campaigns import campaign
from nineaudit.campaign import entries as reading
from nineaudit.campaign import lake as lakes
from nineaudit.campaign import task
from nineaudit.campaign.compact import compact


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
