"""The rules: one TOML sheet each, which explains itself and holds the limits. No thresholds live in code."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from nineaudit.errors import ConfigurationError
from nineaudit.finding import Severity
from nineaudit.tables import Key, check_table, nearest, read_toml, schema_of

CODE = re.compile(r"[A-Z]{2,4}[0-9]{3}")
WAIVER_RULE = "WV001"
"""The rule that speaks of waivers."""
LIMITS = "Limits (a changed copy of the sheet, in a folder for `--rules`, sets others):"

_KEYS = {
    "code": Key(str, "two to four capital letters and three digits; the file is named after it"),
    "title": Key(str, "what holds for a good recording, as a sentence"),
    "severity": Key(str, "what a violation is", choices=tuple(Severity)),
    "why": Key(str, "what a violation means for the test engineer"),
    "equation": Key(str, "what is computed, with its source"),
    "clause": Key(str, "clause of a standard", required=False),
    "advice": Key(str, "what to do about a violation", required=False),
    "limits": Key(dict, "limits and settings of the check, by name", required=False),
    "example": Key(dict, "what violates the rule and what conforms to it"),
}
_EXAMPLE = {
    "violates": Key(str, "a recording that violates the rule"),
    "conforms": Key(str, "a recording that conforms to it"),
}


@dataclass(frozen=True)
class Rule:
    """One sheet. `limits` are the keyword arguments of the check of the same code."""

    code: str
    title: str
    severity: Severity
    why: str
    equation: str
    violates: str
    conforms: str
    limits: Mapping[str, Any]
    clause: str = ""
    advice: str = ""
    path: Path | None = None

    @property
    def packaged(self) -> bool:
        """Whether it is a rule of nineaudit, not one that `--rules` added or put in its place."""
        return self.path is not None and self.path.parent == default_directory()


@dataclass(frozen=True)
class Rulebook:
    """Rules in the order of their codes, and the SHA-256 of their content (the same on every platform)."""

    rules: tuple[Rule, ...]
    sha256: str

    def __getitem__(self, code: str) -> Rule:
        """The rule of a code; ConfigurationError names the nearest when there is none."""
        for rule in self.rules:
            if rule.code == code:
                return rule
        raise ConfigurationError("no such rule", found=code, advice=nearest(code, self.codes))

    def __contains__(self, code: object) -> bool:
        return code in self.codes

    @property
    def codes(self) -> tuple[str, ...]:
        return tuple(rule.code for rule in self.rules)


def default_directory() -> Path:
    """The sheets of the package; in a checkout, those of its top-level folder."""
    packaged = Path(__file__).parent / "rules"
    return packaged if packaged.is_dir() else Path(__file__).parents[2] / "rules"


def load_rulebook(
    extra_dir: str | Path | None = None,
    select: Iterable[str] | str | None = None,
    ignore: Iterable[str] | str | None = None,
) -> Rulebook:
    """The packaged rules, with the sheets of `extra_dir` added or put in the place of those of the same code.

    `select` keeps and `ignore` drops rules by code or by the beginning of a code (``RB``, ``RQ2``); a text is
    split at commas. Raises ConfigurationError: bad sheet, no sheet in `extra_dir`, a code that fits no rule.
    """
    found = {rule.code: rule for rule in _load(default_directory())}
    if extra_dir is not None:
        found |= {rule.code: rule for rule in _load(Path(extra_dir))}
    kept = set(found) if select is None else _matching(select, found, "--select")
    dropped = set() if ignore is None else _matching(ignore, found, "--ignore")
    rules = tuple(found[code] for code in sorted(kept - dropped))
    if not rules:
        raise ConfigurationError(
            "no rule is left", place="--select, --ignore", advice="`nineaudit rules list` shows them"
        )
    return Rulebook(rules, _sha256(rules))


def parse_sheet(table: Mapping[str, Any], path: Path | None = None) -> Rule:
    """A rule from the table of its sheet. Raises ConfigurationError with file and key."""
    check_table(table, _KEYS, file=path)
    check_table(table["example"], _EXAMPLE, file=path, place="[example]")
    code = table["code"]
    if not CODE.fullmatch(code):
        expected = "capital letters and three digits, such as RQ202"
        raise ConfigurationError("bad code", file=path, place="code", found=code, expected=expected)
    if path is not None and path.stem != code:
        raise ConfigurationError(
            "the file is not named after its rule", file=path, place="code", found=code, expected=path.stem
        )
    words = {
        key: " ".join(table[key].split()) for key in ("title", "why", "equation", "clause", "advice") if key in table
    }
    return Rule(
        code=code,
        severity=Severity(table["severity"]),
        violates=table["example"]["violates"],
        conforms=table["example"]["conforms"],
        limits=MappingProxyType(dict(table.get("limits", {}))),
        path=path,
        **words,
    )


def explain(rule: Rule) -> str:
    """What a newcomer needs, as plain text: why, equation, limits, an example either way, how to mend it, how to
    accept it for a time, where to read on."""
    parts = [
        f"{rule.code} ({rule.severity}): {rule.title}",
        rule.why,
        f"Computed: {rule.equation}",
        f"Standard: {rule.clause}" if rule.clause else "",
        "\n".join([LIMITS, *limit_lines(rule)]) if rule.limits else "",
        f"Violates: {rule.violates}",
        f"Conforms: {rule.conforms}",
        f"What to do: {rule.advice}" if rule.advice else "",
        _accepting(rule),
        f"More: docs/rules/{rule.code}.md" if rule.packaged else "",
    ]
    return "\n\n".join(part for part in parts if part)


def limit_lines(rule: Rule) -> list[str]:
    """The limits of a rule as its sheet has them."""
    return [f"  {name} = {json.dumps(value)}" for name, value in rule.limits.items()]


def waiver_lines(rule: Rule) -> list[str]:
    """A waiver of a rule for a waiver file, as an example; pasted as it is, it has expired."""
    return [
        "[[waiver]]",
        f'rule = "{rule.code}"',
        'recordings = "T0001.csv"    # glob of file names or paths',
        'channels = ["a1y"]          # leave it out for all',
        "max_value = 1.0             # largest value that is accepted, in the unit of the report; leave it out for any",
        'reason = "why"',
        'approved_by = "who"',
        "approved_on = 2026-01-31",
        "expires = 2026-02-28        # the last day on which it holds",
    ]


def _accepting(rule: Rule) -> str:
    if rule.code == WAIVER_RULE:
        return "To accept a violation: not possible; waivers are not waived."
    head = "To accept a violation for a time, in a file for `check --waivers` (this example has expired):"
    return "\n".join([head, *(f"  {line}" for line in waiver_lines(rule))])


def rules_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a rule sheet, with descriptions for editors."""
    schema = schema_of(_KEYS, title="Rule sheet of nineaudit")
    schema["properties"]["code"] |= {"pattern": f"^{CODE.pattern}$"}
    schema["properties"]["example"] = schema_of(_EXAMPLE, description=_KEYS["example"].help)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | schema


def _load(folder: Path) -> list[Rule]:
    sheets = sorted(folder.glob("*.toml")) if folder.is_dir() else []
    if not sheets:
        raise ConfigurationError(
            "no rule sheets", file=folder, place="--rules", expected="a folder of sheets such as RQ202.toml"
        )
    return [parse_sheet(read_toml(path), path) for path in sheets]


def _matching(wanted: Iterable[str] | str, known: Iterable[str], option: str) -> set[str]:
    """Codes that begin with one of the `wanted`."""
    names = [n.strip() for n in (wanted.split(",") if isinstance(wanted, str) else wanted) if n.strip()]
    codes, out = list(known), set()
    for name in names:
        hits = {code for code in codes if code.startswith(name.upper())}
        if not hits:
            raise ConfigurationError("no such rule", place=option, found=name, advice=nearest(name.upper(), codes))
        out |= hits
    return out


def _sha256(rules: Iterable[Rule]) -> str:
    """Of the content, not of the bytes: line ends, comments and the order of keys do not matter."""
    content = [
        {name: getattr(rule, name) for name in ("code", "title", "severity", "why", "equation", "violates", "conforms")}
        | {"clause": rule.clause, "advice": rule.advice, "limits": dict(rule.limits)}
        for rule in rules
    ]
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()
