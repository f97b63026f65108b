"""docs/rules: what the sheets say, all of it, and nothing older."""

from __future__ import annotations

import importlib.util
import re
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from markdown_it import MarkdownIt

from nineaudit.rulebook import load_rulebook, parse_sheet, waiver_lines
from nineaudit.waivers import parse_waivers

ROOT = Path(__file__).parents[1]
CURE = "stale: run `python docs/build_rules.py` and commit docs/rules"


def load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("build_rules", ROOT / "docs" / "build_rules.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


build = load()
RULES = load_rulebook().rules


def rendered(markdown: str) -> str:
    """The text that a reader sees: HTML of the page without its tags, entities resolved, white space as one."""
    import html

    page = MarkdownIt("commonmark").enable("table").render(markdown)
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", page)).split())


def as_shown(text: str) -> str:
    return " ".join(text.replace("`", " ").split())


def test_the_pages_are_those_of_the_sheets() -> None:
    there = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "rules").glob("*.md")}
    made = build.pages()
    assert sorted(there) == sorted(made), CURE
    assert [name for name in made if made[name] != there[name]] == [], CURE


def test_a_page_that_no_sheet_has_is_taken_away(tmp_path: Path) -> None:
    (tmp_path / "XX999.md").write_text("old", encoding="utf-8")
    build.main(tmp_path)
    assert {path.stem for path in tmp_path.iterdir()} == {rule.code for rule in RULES} | {"index"}


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.code)
def test_a_page_shows_every_word_of_its_sheet(rule: object) -> None:
    shown = re.sub(r" ?` ?", " ", rendered(build.page(rule, build.cases(rule.code))))  # type: ignore[attr-defined]
    squeezed = shown.replace(" ", "")
    for key in ("code", "title", "why", "equation", "clause", "advice", "violates", "conforms"):
        said = getattr(rule, key)
        assert as_shown(said).replace(" ", "") in squeezed, key


def test_a_sheet_cannot_bring_markup_into_its_page() -> None:
    evil = "<img src=x onerror=alert(1)> [x](javascript:1) | *b* ```\n# head"
    example = {"violates": evil, "conforms": evil}
    keys = dict.fromkeys(("title", "why", "equation", "clause", "advice"), evil)
    rule = parse_sheet({"code": "XX001", "severity": "error", "example": example, **keys})
    html = MarkdownIt("commonmark").render(build.page(rule, [{"name": evil, "verdict": "pass"}]))
    assert "<img" not in html
    assert 'javascript:1"' not in html
    assert html.count("<h1>") == 1


def test_the_index_has_a_row_for_each_rule() -> None:
    text = build.pages()["index.md"]
    assert re.findall(r"^\| \[(\w+)\]", text, re.MULTILINE) == [rule.code for rule in RULES]


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.code)
def test_the_waiver_of_a_page_is_one(rule: object) -> None:
    (waiver,) = parse_waivers(tomllib.loads("\n".join(waiver_lines(rule))), None, [rule.code])  # type: ignore[arg-type, attr-defined]
    assert (waiver.rule, waiver.channels, waiver.max_value) == (rule.code, ("a1y",), 1.0)  # type: ignore[attr-defined]
