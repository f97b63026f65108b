"""Campaigns among hostile names, other clients of the same lake, and tables of before."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaign_entries import EDITION, entries, lake_of
from nineaudit.campaign import entries as reading
from nineaudit.campaign import lake as lakes
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
