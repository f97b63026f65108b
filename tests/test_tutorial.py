"""docs/tutorial.md: every command in it is run, in order, and shows what the page says that it shows.

``python tests/test_tutorial.py`` writes the real output into the page.
"""

from __future__ import annotations

import json
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from test_readme import run, sessions

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "tutorial.md"
BLOCK = re.compile(r"(?:`(?P<file>[\w.-]+)`:\n\n)?^```(?P<language>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
HASH = re.compile(r"\b[0-9a-f]{12,64}\b")
"""The beginning of a SHA-256: the last bits of another machine's arithmetic change it."""


def steps() -> Iterator[tuple[str, str, str]]:
    """In the order of the page: ("write", name, text) of a file, ("run", command, output) of a command."""
    for block in BLOCK.finditer(PAGE.read_text(encoding="utf-8")):
        if block["file"]:
            yield "write", block["file"], block["text"]
        elif block["language"] == "console":
            for command, output in sessions(block["text"]):
                yield "run", command, output


def expected_code(command: str) -> int:
    """1 of an audit that finds something; the page tells of each."""
    found = command.startswith("nineaudit check T0042.csv") or ("--fail-on" in command and "--waivers" not in command)
    return int(found)


def test_the_page_shows_what_its_commands_do_and_says_what_is_filed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    kinds = [kind for kind, _, _ in steps()]
    assert (kinds.count("run"), kinds.count("write")) == (11, 1)
    for kind, subject, text in steps():
        if kind == "write":
            Path(subject).write_text(text, encoding="utf-8")
            continue
        code, shown = run(subject)
        assert code == expected_code(subject), shown
        assert HASH.sub("#", shown) == HASH.sub("#", text), subject
    check_what_is_filed(tmp_path)


def check_what_is_filed(folder: Path) -> None:
    """As the page says: the culprit, the roll, the effect on BrIC and HIC, the waiver that stays visible."""
    before, after = (
        json.loads((folder / name).read_text(encoding="utf-8")) for name in ("T0042.json", "T0042-repaired.json")
    )
    assert (before["verdict"], before["diagnosis"]["channels"]) == ("fail", ["a2z"])
    assert before["diagnosis"]["candidates"][0]["fault"] == "zero_shift"
    changes = {name: change["before"] / change["after"] for name, change in before["impact"].items()}
    assert changes["BrIC"] > 1.5
    assert 0.95 < changes["HIC15"] < 1.05
    (waived,) = [f for f in after["findings"] if f["verdict"] == "waived"]
    assert (waived["rule"], waived["channels"]) == ("RQ107", ["a2z"])
    assert "B. Engineer" in waived["reason"]
    assert "B. Engineer" in (folder / "T0042-repaired.html").read_text(encoding="utf-8")


def test_the_words_of_the_page_are_those_of_its_numbers() -> None:
    """More than 150° and BrIC 1.4 at first; twice, more than twice, and 6 % too high."""
    first, last = (text for _, command, text in steps() if command.startswith("nineaudit motion"))
    names = ("roll", "BrIC", "peak ω", "HIC15")
    before, after = ([float(re.search(rf"{name} +([\d.]+)", text)[1]) for name in names] for text in (first, last))  # type: ignore[index]
    assert before[0] > 150 > 25 > after[0]
    assert before[1] == pytest.approx(1.4, abs=0.05)
    ratios = [b / a for b, a in zip(before, after, strict=True)]
    assert (round(ratios[1]), ratios[2] > 2, round(ratios[3], 2)) == (2, True, 1.06)


def update() -> None:
    """Write what the commands print into the page."""
    page = PAGE.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as made:
        os.chdir(made)
        for block in BLOCK.finditer(page):
            if block["file"]:
                Path(block["file"]).write_text(block["text"], encoding="utf-8")
            elif block["language"] == "console":
                shown = "".join(f"$ {command}\n{run(command)[1]}" for command, _ in sessions(block["text"]))
                page = page.replace(f"```console\n{block['text']}```", f"```console\n{shown}```")
        os.chdir(ROOT)
    PAGE.write_text(page, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    sys.exit(update())
