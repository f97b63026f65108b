"""Findings in the order of their weight, and grouped by rule: what every output needs."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from nineaudit.finding import Finding, Verdict

WEIGHT = (
    Verdict.FAIL,
    Verdict.NOT_EVALUATED,
    Verdict.INCONCLUSIVE,
    Verdict.WARN,
    Verdict.WAIVED,
    Verdict.PASS,
    Verdict.NOT_APPLICABLE,
)
"""Verdicts, the weightiest first."""

NOTABLE = frozenset(WEIGHT[:5])
"""Verdicts a reader is told of without asking."""

FAMILIES = {
    "RQ": "Record quality",
    "CB": "CAN bus",
    "ZO": "Zero and bias",
    "RB": "Rigid body",
    "UB": "Uncertainty budget",
    "WV": "Waivers",
}


def excess(finding: Finding) -> float:
    """Value over limit; how far beyond its limit a finding lies. 0 without a measure."""
    measure = finding.measure
    if measure is None or math.isnan(measure.value):
        return 0.0
    if measure.limit == 0.0:
        return math.inf if measure.value > 0 else 0.0
    return measure.value / abs(measure.limit)


def by_weight(findings: Iterable[Finding]) -> list[Finding]:
    """The worst first: by verdict, by excess over the limit, then by rule and channel for a fixed order."""
    return sorted(findings, key=lambda f: (WEIGHT.index(f.verdict), -excess(f), f.rule, channels(f)))


def channels(finding: Finding) -> tuple[str, ...]:
    """The channels a finding speaks of."""
    return finding.channels or (finding.measure.channels if finding.measure else ())


def family(finding: Finding) -> str:
    """``RB`` of ``RB301``."""
    return finding.rule.rstrip("0123456789")


def family_title(code: str) -> str:
    return FAMILIES.get(code, f"{code} rules")


@dataclass(frozen=True)
class Group:
    """All findings of one rule, the worst first."""

    rule: str
    findings: tuple[Finding, ...]

    @property
    def worst(self) -> Finding:
        return self.findings[0]

    @property
    def verdict(self) -> Verdict:
        return self.worst.verdict


def by_rule(findings: Iterable[Finding]) -> list[Group]:
    """One group a rule, in the order in which the rules were run."""
    gathered: dict[str, list[Finding]] = {}
    for finding in findings:
        gathered.setdefault(finding.rule, []).append(finding)
    return [Group(rule, tuple(by_weight(members))) for rule, members in gathered.items()]


def by_family(findings: Iterable[Finding]) -> dict[str, list[Finding]]:
    """Findings of each rule family, families in the order in which they first appear."""
    gathered: dict[str, list[Finding]] = {}
    for finding in findings:
        gathered.setdefault(family(finding), []).append(finding)
    return gathered
