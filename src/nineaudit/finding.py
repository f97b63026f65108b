"""What a check measured and what the engine made of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum


class Verdict(StrEnum):
    """Outcome of one rule on one subject (INTERFACE.md)."""

    PASS = "pass"
    WARN = "warn"
    FAIL = "fail"
    INCONCLUSIVE = "inconclusive"
    WAIVED = "waived"
    NOT_APPLICABLE = "not_applicable"
    NOT_EVALUATED = "not_evaluated"


class Severity(StrEnum):
    ERROR = "error"
    WARNING = "warning"
    INFO = "info"


@dataclass(frozen=True)
class Measure:
    """A number, its standard uncertainty `u` and its upper `limit`, all in `unit`.

    `channels` it speaks of, `interval` (s, s) where the worst of it lies, `detail` a clause for the reason.
    The value conforms when it does not exceed the limit: a check turns its quantity round if it must.
    """

    value: float
    limit: float
    unit: str
    u: float = 0.0
    channels: tuple[str, ...] = ()
    interval: tuple[float, float] | None = None
    detail: str = ""


@dataclass(frozen=True)
class NotApplicable:
    """Why a rule does not speak of this recording (no redundancy, no CAN bus, ...)."""

    reason: str


@dataclass(frozen=True)
class Finding:
    """One rule applied to one subject: exactly one verdict with its reason."""

    rule: str
    verdict: Verdict
    severity: Severity
    reason: str
    measure: Measure | None = None
    channels: tuple[str, ...] = ()

    def with_verdict(self, verdict: Verdict, reason: str) -> Finding:
        return replace(self, verdict=verdict, reason=reason)


COVERAGE_FACTOR = 2.0
"""k of the expanded uncertainty U = k u that guards every decision (JCGM 106, METHODS.md 5)."""


def decide(measure: Measure, severity: Severity) -> Verdict:
    """JCGM 106:2012 8.3 with guard band w = U: pass below limit − U, fail above limit + U, else inconclusive.

    A warning-severity violation is WARN. Info never fails: it is PASS.
    """
    expanded = COVERAGE_FACTOR * measure.u
    if not (measure.value > measure.limit - expanded):
        return Verdict.PASS
    if severity is Severity.INFO:
        return Verdict.PASS
    if measure.value > measure.limit + expanded:
        return Verdict.FAIL if severity is Severity.ERROR else Verdict.WARN
    return Verdict.INCONCLUSIVE
