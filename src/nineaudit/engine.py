"""Runs the rules: every sheet gives exactly one finding per subject, so that no check can forget a status."""

from __future__ import annotations

import datetime as dt
import inspect
import math
from collections.abc import Iterable, Sequence
from functools import partial

from nineaudit.case import Case
from nineaudit.checks import Check, all_checks
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.finding import COVERAGE_FACTOR, Finding, Measure, NotApplicable, Severity, Verdict, decide
from nineaudit.rulebook import Rule, Rulebook
from nineaudit.tables import is_a, name_of, nearest
from nineaudit.units import UnitNames, display
from nineaudit.waivers import CODE as WAIVER_CODE
from nineaudit.waivers import Waiver, apply_waivers, judge_waivers

ENGINE_CODES = frozenset({WAIVER_CODE})
"""Rules that speak of findings, not of recordings: their functions are not in CHECKS."""
_COMPARING = "RB"
"""Family of the rules that hold channels against each other."""


def run(
    case: Case,
    rulebook: Rulebook,
    *,
    waivers: Sequence[Waiver] | None = None,
    today: dt.date | None = None,
) -> tuple[Finding, ...]:
    """All findings of a recording, in the order of the rule codes; every rule of the book has one at least.

    `waivers` None where no file was given; `today` (default: the system's date) decides which are in force.
    Raises ConfigurationError when a sheet does not fit its check. A foreseen numerical failure (EstimationError)
    is a NOT_EVALUATED finding; any other error stops the run.
    """
    checks = bind(rulebook)
    units = case.recording.rig.units
    raw = [f for rule in rulebook.rules if rule.code in checks for f in _apply(rule, checks[rule.code], case, units)]
    raw = [_with_made(finding, case) for finding in raw]
    path, day = case.recording.source.path, today or dt.date.today()
    found = list(apply_waivers(raw, waivers or (), path, units, day))
    if WAIVER_CODE in rulebook:
        found += judge_waivers(raw, waivers, rulebook[WAIVER_CODE].severity, path, units, day)
    return tuple(found)


def bind(rulebook: Rulebook) -> dict[str, Check]:
    """Each rule's check with the limits of its sheet filled in.

    Raises ConfigurationError: a sheet without a check, a limit that the check does not know, lacks or that is
    of another type.
    """
    checks = all_checks()
    return {rule.code: _bind(rule, checks) for rule in rulebook.rules if rule.code not in ENGINE_CODES}


def _bind(rule: Rule, checks: dict[str, Check]) -> Check:
    if rule.code not in checks:
        raise ConfigurationError(
            "no check of this code is installed",
            file=rule.path,
            place="code",
            found=rule.code,
            advice="a package adds one by an entry point in the group nineaudit.checks; " + nearest(rule.code, checks),
        )
    wanted = parameters(checks[rule.code])
    for name, value in rule.limits.items():
        where = f"[limits] {name}"
        if name not in wanted:
            raise ConfigurationError(
                "unknown limit", file=rule.path, place=where, found=name, advice=nearest(name, wanted)
            )
        if not is_a(value, wanted[name]):
            expected = name_of(wanted[name])
            raise ConfigurationError("wrong type", file=rule.path, place=where, found=value, expected=expected)
    for name, kind in wanted.items():
        if name not in rule.limits:
            raise ConfigurationError("missing limit", file=rule.path, place=f"[limits] {name}", expected=name_of(kind))
    return partial(checks[rule.code], **rule.limits)


def parameters(check: Check) -> dict[str, type]:
    """Names and types of the keyword-only parameters of a check: the limits of its sheet."""
    found = inspect.signature(check, eval_str=True).parameters.values()
    return {p.name: p.annotation for p in found if p.kind is p.KEYWORD_ONLY}


def gate(findings: Iterable[Finding], fail_on: str = "error") -> bool:
    """Whether the findings pass. `fail_on` error: no FAIL, and no error-severity rule left undecided (inconclusive or
    not evaluated, which never counts as a pass: the verdict of such a recording is inconclusive); warning: also no
    WARN, no warning-severity rule left undecided; never: always True."""
    if fail_on == "never":
        return True
    if fail_on not in ("error", "warning"):
        raise ConfigurationError("bad gate", place="--fail-on", found=fail_on, expected="error, warning or never")
    return not any(_stops(f, fail_on) for f in findings)


def _stops(finding: Finding, fail_on: str) -> bool:
    undecided = finding.verdict in (Verdict.INCONCLUSIVE, Verdict.NOT_EVALUATED)
    if finding.verdict is Verdict.FAIL or (undecided and finding.severity is Severity.ERROR):
        return True
    doubtful = finding.verdict is Verdict.WARN or undecided
    return fail_on == "warning" and doubtful and finding.severity is not Severity.INFO


def _apply(rule: Rule, check: Check, case: Case, units: UnitNames) -> list[Finding]:
    try:
        result = check(case)
    except EstimationError as error:
        return [Finding(rule.code, Verdict.NOT_EVALUATED, rule.severity, str(error))]
    if isinstance(result, NotApplicable):
        return [Finding(rule.code, Verdict.NOT_APPLICABLE, rule.severity, result.reason)]
    measures = [result] if isinstance(result, Measure) else list(result)
    if not measures:
        nothing = "the recording has nothing that this rule speaks of"
        return [Finding(rule.code, Verdict.NOT_APPLICABLE, rule.severity, nothing)]
    return [_judge(rule, measure, units) for measure in measures]


def _with_made(finding: Finding, case: Case) -> Finding:
    """The finding; where it compares channels and one of them was made of the others, it says what is left out."""
    made = dict.fromkeys(made.channel for made in case.recording.remade if made.from_others)
    if not made or finding.measure is None or not finding.rule.startswith(_COMPARING):
        return finding
    said = f"{finding.reason}; samples of {', '.join(made)} that were made of the other channels are left out"
    return finding.with_verdict(finding.verdict, said)


def _judge(rule: Rule, measure: Measure, units: UnitNames) -> Finding:
    """A verdict with guard band; a number that is not one is no verdict."""
    if any(math.isnan(x) for x in (measure.value, measure.limit, measure.u)):
        reason = f"{measure.detail} could not be computed".strip()
        return Finding(rule.code, Verdict.NOT_EVALUATED, rule.severity, reason, channels=measure.channels)
    verdict = decide(measure, rule.severity)
    return Finding(rule.code, verdict, rule.severity, sentence(measure, verdict, units), measure, measure.channels)


def sentence(measure: Measure, verdict: Verdict, units: UnitNames) -> str:
    """``residual 12.4 g > 3.1 g (U 0.8 g, k=2)``; digits enough to tell value and limit apart."""
    value, limit = (display(x, measure.unit, units) for x in (measure.value, measure.limit))
    if value == limit and measure.value != measure.limit:
        value, limit = (display(x, measure.unit, units, 6) for x in (measure.value, measure.limit))
    sign = ">" if measure.value > measure.limit else "≤"
    expanded = display(COVERAGE_FACTOR * measure.u, measure.unit, units, 2)
    guard = f" (U {expanded}, k={COVERAGE_FACTOR:g})" if measure.u > 0 else ""
    doubt = ", within its uncertainty of the limit" if verdict is Verdict.INCONCLUSIVE else ""
    return f"{measure.detail} {value} {sign} {limit}{guard}{doubt}".strip()
