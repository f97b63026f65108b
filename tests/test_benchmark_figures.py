"""The table of the readers' benchmarks: figures survive being printed, and what is short is marked."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def scripts_side_by_side(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scripts import each other as they do when one of them is run."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "benchmarks"))


@pytest.mark.parametrize(
    ("sense", "measured", "mark"),
    [(">=", 18.0, "pass"), (">=", 17.99, "SHORT"), ("<=", 2.3, "pass"), ("<=", 2.31, "SHORT")],
)
def test_a_figure_is_read_again_from_its_line(sense: str, measured: float, mark: str) -> None:
    figures = import_module("figures")
    one = figures.Figure("BLF: read / inflating alone, all decoded", measured, sense, 18.0 if sense == ">=" else 2.3)
    line = figures.table([one])
    assert line.endswith(f"  {mark}")
    assert figures.figure(line + "\n") == one


def test_other_lines_hold_no_figure() -> None:
    figures = import_module("figures")
    assert figures.figure("ratio 5.2, asked 2.5\n") is None


def test_the_figures_of_mf4_are_taken_from_its_sentences() -> None:
    readers = import_module("readers")
    said = ["ratio 5.2; turn by turn 4.9 or more, median 5.1\n", "asked 2.5; peak memory 47 bytes a frame, asked 160\n"]
    found = [one for line in said for one in readers.of_mdf(line)]
    assert [(one.measured, one.asked, one.holds) for one in found] == [(5.2, 2.5, True), (47.0, 160, True)]
