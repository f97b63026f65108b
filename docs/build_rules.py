"""Write the pages of the rules from their sheets: ``python docs/build_rules.py``. CI expects that to change nothing.

A page has what the sheet says, the cases that the tests hold the rule to, and how to accept a violation.
"""

from __future__ import annotations

import re
import tomllib
from itertools import groupby
from pathlib import Path
from typing import Any

from nineaudit.report.findings import family_title
from nineaudit.rulebook import WAIVER_RULE, Rule, limit_lines, load_rulebook, waiver_lines

HERE = Path(__file__).parent
FOLDER = HERE / "rules"
CASES = HERE.parent / "fixtures" / "cases"
MADE = "<!-- Made from the rule sheets by docs/build_rules.py; change the sheet, not this page. -->"


def pages(rules: tuple[Rule, ...] | None = None) -> dict[str, str]:
    """File name -> Markdown: a page for each rule, and their index."""
    sheets = load_rulebook().rules if rules is None else rules
    return {f"{rule.code}.md": page(rule, cases(rule.code)) for rule in sheets} | {"index.md": index(sheets)}


def page(rule: Rule, tested: list[dict[str, Any]]) -> str:
    """The page of one rule."""
    parts = [
        MADE,
        f"# {rule.code}: {escaped(rule.title)}",
        f"Severity **{rule.severity}** · {escaped(family_title(family(rule)))} · [all rules](index.md)",
        "## Why",
        escaped(rule.why),
        "## What is computed",
        escaped(rule.equation),
        f"Standard: {escaped(rule.clause)}" if rule.clause else "",
        *limits(rule),
        "## Example",
        f"- Violates: {escaped(rule.violates)}\n- Conforms: {escaped(rule.conforms)}",
        *(("## What to do", escaped(rule.advice)) if rule.advice else ()),
        "## To accept a violation for a time",
        *accepting(rule),
        *held_to(rule, tested),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def limits(rule: Rule) -> tuple[str, ...]:
    """The limits, and how to set others."""
    if not rule.limits:
        return ()
    lines = [line.strip() for line in limit_lines(rule)]
    said = (
        f"Of [the sheet](../../rules/{rule.code}.toml); a changed copy of it, in a folder for `--rules`, sets others."
    )
    return "## Limits", fenced("toml", ["[limits]", *lines]), said


def accepting(rule: Rule) -> tuple[str, ...]:
    """A waiver for the rule; waivers are not waived."""
    if rule.code == WAIVER_RULE:
        return ("Not possible: waivers are not waived.",)
    said = "In a file for `nineaudit check --waivers`. The finding stays visible; see [waivers](../ci.md#waivers)."
    return said, fenced("toml", waiver_lines(rule))


def held_to(rule: Rule, tested: list[dict[str, Any]]) -> tuple[str, ...]:
    """The cases of the tests, with the verdict of each."""
    if not tested:
        return ()
    rows = [f"| {escaped(case['name'])} | {case['verdict'].replace('_', ' ')} |" for case in tested]
    source = f"From [fixtures/cases/{rule.code}.toml](../../fixtures/cases/{rule.code}.toml)."
    return "## What the tests hold it to", "\n".join(["| recording | verdict |", "|---|---|", *rows]), source


def index(rules: tuple[Rule, ...]) -> str:
    """All rules, by family."""
    said = "`nineaudit rules explain CODE` prints the same on the terminal, with the rules that `--rules` adds."
    parts = [MADE, "# The rules", said]
    for code, members in groupby(rules, family):
        rows = [f"| [{rule.code}]({rule.code}.md) | {rule.severity} | {escaped(rule.title)} |" for rule in members]
        parts += [
            f"## {escaped(family_title(code))}",
            "\n".join(["| code | severity | rule |", "|---|---|---|", *rows]),
        ]
    return "\n\n".join(parts) + "\n"


def cases(code: str) -> list[dict[str, Any]]:
    """The cases of a rule's tests."""
    file = CASES / f"{code}.toml"
    found: list[dict[str, Any]] = tomllib.loads(file.read_text(encoding="utf-8"))["case"] if file.is_file() else []
    return found


def family(rule: Rule) -> str:
    return rule.code.rstrip("0123456789")


def fenced(language: str, lines: list[str]) -> str:
    return "\n".join([f"```{language}", *lines, "```"])


def escaped(text: str) -> str:
    """Text that Markdown leaves as it is, except `code` in backquotes."""
    parts = re.split(r"(`[^`]+`)", text)
    return "".join(part if part.startswith("`") else re.sub(r"([\\`*_{}\[\]<>#|~])", r"\\\1", part) for part in parts)


def main(folder: Path = FOLDER) -> None:
    """Write the pages, and take away those of rules that are no more."""
    folder.mkdir(exist_ok=True)
    made = pages()
    for name, text in made.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    for page in folder.glob("*.md"):
        if page.name not in made:
            page.unlink()


if __name__ == "__main__":
    main()
