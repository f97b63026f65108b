"""What changed between two lakes or two editions of one: each kind of change, sorted, with its exit code."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from campaign_entries import Entry, audited, entries, entry, lake_of
from nineaudit import cli
from nineaudit.campaign import lake
from nineaudit.campaign.results import diff
from nineaudit.files import sealed

OLD, NEW = "00aa11bb22cc", "abc123abc123"
CLIPPED = ("a1y:clipping=0.5",)


def called(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        cli.main(["campaign", "diff", *map(str, arguments)])
    shown = capsys.readouterr()
    return int(ended.value.code or 0), shown.out, shown.err


def altered(one: Entry, **changes: Any) -> Entry:
    """The entry with another result."""
    return {**one, "result": sealed({**{k: v for k, v in one["result"].items() if k != "seal"}, **changes})}


@pytest.fixture
def two(tmp_path: Path) -> str:
    """Two editions: 1 unchanged, 2 healthy then clipped, 3 fails another rule, 4 gone, 5 new, 6 only words."""
    before = [entry(n, edition=OLD, fault=()) for n in (1, 2, 3, 4, 6)]
    third = entry(3, fault=())
    findings = [{**f, "verdict": "fail"} if f["rule"] == "RQ105" else f for f in third["result"]["findings"]]
    sixth = entry(6, fault=(), finding="said in other words")
    after = [entry(1, fault=()), entry(2, fault=CLIPPED), altered(third, findings=findings), entry(5, fault=()), sixth]
    return lake_of(tmp_path / "lake", [*before, *after], NEW).uri


def test_each_kind_of_change_is_a_line_in_the_order_of_the_names(two: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, shown, _ = called(capsys, f"{two}@{OLD}", two)
    assert code == 1
    failed = sorted({f["rule"] for f in audited(CLIPPED)["findings"] if f["verdict"] == "fail"})
    lines = shown.splitlines()
    assert lines[0].startswith("data/series-2/T00002.csv: pass -> fail; healthy -> isolated (a1y); ")
    assert all(f"{rule} pass -> fail" in lines[0] for rule in failed)
    assert lines[1:] == [
        "data/series-3/T00003.csv: RQ105 pass -> fail",
        "data/series-4/T00004.csv: only in the base: pass",
        "data/series-5/T00005.csv: only in the head: pass",
        "1 pass -> fail",
        "2 of 4 changed, 1 only in the base, 1 only in the head",
    ]


def test_the_same_for_machines(two: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, shown, _ = called(capsys, f"{two}@{OLD[:4]}", f"{two}@{NEW}", "--format", "json")
    found = json.loads(shown)
    assert code == 1
    assert found["schema"] == "nineaudit/campaign-diff/1"
    assert (found["base"], found["head"]) == ({"lake": two, "edition": OLD}, {"lake": two, "edition": NEW})
    assert (found["recordings"], found["verdicts"]) == (4, {"pass -> fail": 1})
    assert (found["only_base"], found["only_head"]) == (["data/series-4/T00004.csv"], ["data/series-5/T00005.csv"])
    first, second = found["changed"]
    assert (first["base"]["status"], first["head"]["channels"]) == ("healthy", ["a1y"])
    assert second["rules"] == {"RQ105": {"base": "pass", "head": "fail"}}


def test_no_change_is_said_and_the_exit_code_is_0(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, other = (lake_of(tmp_path / name, entries(12)).uri for name in ("one", "other"))
    assert called(capsys, one, other) == (0, "0 of 12 changed, 0 only in the base, 0 only in the head\n", "")


def test_a_recording_that_could_not_be_audited_any_more_is_a_change(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = lake_of(tmp_path / "one", [entry(49, fault=())]).uri
    other = lake_of(tmp_path / "other", [entry(49)]).uri
    code, shown, _ = called(capsys, one, other)
    assert code == 1
    assert "T00049.csv: pass -> not audited; healthy -> no diagnosis; " in shown
    assert "RB303 pass -> absent" in shown


def test_damage_is_named_and_has_its_own_exit_code(two: str, capsys: pytest.CaptureFixture[str]) -> None:
    one = entry(1, fault=())
    place = lake.entry_name(one["uri"], one["key"])
    (Path(two) / place).write_text("{", encoding="utf-8")
    code, shown, _ = called(capsys, f"{two}@{OLD}", two)
    assert code == 3
    assert f"{place}: cannot be used: is no JSON document" in shown


def test_a_lake_or_edition_that_is_not_there_is_a_sentence(two: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, said = called(capsys, f"{two}@dddd", two)
    assert code == 2
    assert f"no edition dddd; expected one of {OLD}, {NEW}" in said
    code, _, said = called(capsys, two + "-nowhere", two)
    assert (code, said.count("\n")) == (2, 1)
    assert "is no lake" in said


def said(uri: str) -> diff.Said:
    return diff.Said(uri, "pass", None, (), {}, None)


def test_two_sorted_streams_are_walked_as_one() -> None:
    pairs = diff.paired(map(said, "acdf"), map(said, "bcef"))
    assert [(a and a.uri, b and b.uri) for a, b in pairs] == [
        ("a", None), (None, "b"), ("c", "c"), ("d", None), (None, "e"), ("f", "f"),
    ]  # fmt: skip
    assert list(diff.paired([], [])) == []
