"""Waivers: a known violation, accepted by someone, for a while, up to a ceiling. It stays visible.

A waiver is for the recordings its glob names. It changes the verdict of findings of its rule (and channels) to
WAIVED when their value is within its ceiling. One that is expired or not yet in force, that fits a recording and
finds nothing to waive there, or that fits no recording of a run, is itself a finding (WV001): forgotten waivers
hide the next fault.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from nineaudit.errors import ConfigurationError
from nineaudit.finding import Finding, Severity, Verdict
from nineaudit.rulebook import WAIVER_RULE
from nineaudit.tables import Key, check_table, nearest, read_toml, schema_of
from nineaudit.units import UnitNames, display, in_rig_units

CODE = WAIVER_RULE
WAIVABLE = frozenset({Verdict.FAIL, Verdict.WARN, Verdict.INCONCLUSIVE, Verdict.NOT_EVALUATED})

_KEYS = {
    "rule": Key(str, "code of the rule"),
    "recordings": Key(str, "glob of the recordings' file names or paths"),
    "channels": Key(list, "channels it speaks of; absent: all", required=False),
    "max_value": Key(float, "largest value it covers, in the unit of the report; absent: any", required=False),
    "reason": Key(str, "why the violation is accepted"),
    "approved_by": Key(str, "who accepted it"),
    "approved_on": Key(dt.date, "when"),
    "expires": Key(dt.date, "last day on which it holds"),
}


@dataclass(frozen=True)
class Waiver:
    """One ``[[waiver]]``. `max_value` in the rig's unit of the finding; `channels` empty: all."""

    rule: str
    recordings: str
    reason: str
    approved_by: str
    approved_on: dt.date
    expires: dt.date
    channels: tuple[str, ...] = ()
    max_value: float | None = None

    def fits(self, recording: Path) -> bool:
        """Whether it is for this recording, by file name or whole path."""
        return fnmatchcase(recording.name, self.recordings) or fnmatchcase(recording.as_posix(), self.recordings)

    def holds(self, today: dt.date) -> bool:
        """Whether it is in force on a day: from that of its approval to its last, both included."""
        return self.approved_on <= today <= self.expires

    def speaks_of(self, finding: Finding) -> bool:
        return self.rule == finding.rule and (
            not self.channels or (bool(finding.channels) and set(finding.channels) <= set(self.channels))
        )

    def __str__(self) -> str:
        return f"waiver of {' '.join((self.rule, *self.channels))} for {self.recordings} by {self.approved_by}"


def load_waivers(path: str | Path, known_rules: Iterable[str] | None = None) -> tuple[Waiver, ...]:
    """The waivers of a file. Raises ConfigurationError: file, number of the waiver, key, found, expected."""
    path = Path(path)
    return parse_waivers(read_toml(path), path, known_rules)


def parse_waivers(
    tables: Mapping[str, Any], path: Path | None = None, known_rules: Iterable[str] | None = None
) -> tuple[Waiver, ...]:
    """The waivers of the tables of a file; rules are checked against `known_rules` where given."""
    for name in tables:
        if name != "waiver":
            raise ConfigurationError("unknown key", file=path, found=name, expected="[[waiver]] tables only")
    entries = tables.get("waiver", [])
    if not isinstance(entries, list):
        raise ConfigurationError("one pair of brackets", file=path, place="[waiver]", expected="[[waiver]]")
    return tuple(
        _parse(entry, f"[[waiver]] {i}", path, None if known_rules is None else set(known_rules))
        for i, entry in enumerate(entries, 1)
    )


def _parse(entry: Mapping[str, Any], place: str, path: Path | None, known: set[str] | None) -> Waiver:
    check_table(entry, _KEYS, file=path, place=place)
    if known is not None and entry["rule"] not in known:
        advice = nearest(entry["rule"], known)
        raise ConfigurationError("no such rule", file=path, place=f"{place} rule", found=entry["rule"], advice=advice)
    if entry["expires"] < entry["approved_on"]:
        expected = f"{entry['approved_on']} (approved_on) or later"
        found = str(entry["expires"])
        raise ConfigurationError(
            "ends before it begins", file=path, place=f"{place} expires", found=found, expected=expected
        )
    return Waiver(**{**entry, "channels": tuple(entry.get("channels", ()))})


def waivers_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a waiver file."""
    items = {"type": "array", "items": schema_of(_KEYS)}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Waivers of nineaudit",
        "type": "object",
        "properties": {"waiver": items},
        "additionalProperties": False,
    }


def apply_waivers(
    findings: Sequence[Finding], waivers: Sequence[Waiver], recording: Path, units: UnitNames, today: dt.date
) -> tuple[Finding, ...]:
    """The findings, those that a waiver in force covers with the verdict WAIVED and both reasons."""
    in_force = [w for w in waivers if w.fits(recording) and w.holds(today)]
    out = []
    for finding in findings:
        waiver = next((w for w in in_force if covers(w, finding, units)), None)
        out.append(finding if waiver is None else finding.with_verdict(Verdict.WAIVED, _waived(finding, waiver)))
    return tuple(out)


def covers(waiver: Waiver, finding: Finding, units: UnitNames) -> bool:
    """Whether a waiver covers a finding: rule, channels, a verdict to waive, a value within the ceiling."""
    if not waiver.speaks_of(finding) or finding.verdict not in WAIVABLE:
        return False
    if waiver.max_value is None:
        return True
    if finding.measure is None:
        return False
    return in_rig_units(finding.measure.value, finding.measure.unit, units)[0] <= waiver.max_value


def _waived(finding: Finding, waiver: Waiver) -> str:
    return (
        f"{finding.reason}; waived by {waiver.approved_by} on {waiver.approved_on} until {waiver.expires}: "
        f"{waiver.reason}"
    )


def judge_waivers(
    findings: Sequence[Finding],
    waivers: Sequence[Waiver] | None,
    severity: Severity,
    recording: Path,
    units: UnitNames,
    today: dt.date,
) -> tuple[Finding, ...]:
    """WV001: one finding for each waiver that is expired or has nothing to waive; else one PASS.

    `findings` before any is waived; `waivers` None where no file was given.
    """
    if waivers is None:
        return (Finding(CODE, Verdict.NOT_APPLICABLE, severity, "no waiver file was given"),)
    fitting = [w for w in waivers if w.fits(recording)]
    bad = [(w, fault) for w in fitting if (fault := _fault(w, findings, units, today))]
    if bad:
        return tuple(_violation(w, fault, severity) for w, fault in bad)
    if not fitting:
        return (Finding(CODE, Verdict.NOT_APPLICABLE, severity, "no waiver is for this recording"),)
    reason = f"{len(fitting)} waiver{'s' * (len(fitting) > 1)} for this recording, in force and needed"
    return (Finding(CODE, Verdict.PASS, severity, reason),)


def _violation(waiver: Waiver, fault: str, severity: Severity) -> Finding:
    verdict = {Severity.ERROR: Verdict.FAIL, Severity.WARNING: Verdict.WARN}.get(severity, Verdict.PASS)
    return Finding(CODE, verdict, severity, f"{waiver} {fault}", channels=waiver.channels)


def unmatched(waivers: Sequence[Waiver] | None, recordings: Iterable[Path]) -> tuple[Waiver, ...]:
    """The waivers that are for none of the recordings of a run."""
    paths = list(recordings)
    return tuple(w for w in waivers or () if not any(w.fits(path) for path in paths))


def with_unmatched(findings: Sequence[Finding], lost: Sequence[Waiver], severity: Severity) -> tuple[Finding, ...]:
    """The findings of a recording, and WV001 for each waiver that no recording of the run matched."""
    fault = "matches no recording of this run"
    kept = [f for f in findings if f.rule != CODE or f.verdict is not Verdict.NOT_APPLICABLE]
    return (*kept, *(_violation(waiver, fault, severity) for waiver in lost))


def _fault(waiver: Waiver, findings: Sequence[Finding], units: UnitNames, today: dt.date) -> str:
    """What is wrong with a waiver, empty when nothing is."""
    if today > waiver.expires:
        return f"expired on {waiver.expires}"
    if today < waiver.approved_on:
        return f"is approved on {waiver.approved_on}, which is yet to come"
    if any(covers(waiver, f, units) for f in findings):
        return ""
    over = [f for f in findings if waiver.speaks_of(f) and f.verdict in WAIVABLE]
    if over and over[0].measure is not None:
        value = display(over[0].measure.value, over[0].measure.unit, units)
        return f"ends at {waiver.max_value:g}, the value is {value}"
    return "has no finding to waive"
