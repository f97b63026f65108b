"""audit(recording) -> Audit: everything that can be said of one recording, the only input of every report."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from enum import StrEnum
from functools import cached_property
from importlib.metadata import version
from typing import TypeVar

import numpy as np

from nineaudit import engine
from nineaudit.array import BoolArray, FloatArray
from nineaudit.case import Case
from nineaudit.diagnose import Diagnosis, Status, diagnose
from nineaudit.errors import EstimationError
from nineaudit.estimate import closed_form
from nineaudit.estimate.budget import AlphaBudget
from nineaudit.estimate.calibrated import Calibrated, calibrated
from nineaudit.estimate.hypotheses import theta_for
from nineaudit.estimate.motion import Motion, bridge
from nineaudit.estimate.separation import apart
from nineaudit.estimate.trajectory import Fit
from nineaudit.finding import Finding, Severity, Verdict
from nineaudit.impact import Impact, impact
from nineaudit.physics import kinematics, nap
from nineaudit.reconstruct import Reconstruction, rebuild_channel
from nineaudit.recording import Recording
from nineaudit.rulebook import Rulebook, load_rulebook
from nineaudit.sensed import Sensed, sensed
from nineaudit.undo import undo
from nineaudit.waivers import Waiver


class AuditVerdict(StrEnum):
    PASS = "pass"
    FAIL = "fail"
    INCONCLUSIVE = "inconclusive"
    NOT_AUDITED = "not_audited"


T = TypeVar("T")
PACKAGES = ("numpy", "scipy", "pyarrow", "python-can", "cantools", "mcap")
"""What numbers of a recording pass through."""


@dataclass(frozen=True, eq=False)
class Audit:
    """`findings` of every rule, the `diagnosis`, the `reconstruction` where a channel was rebuilt, its `impact`
    on what is reported (before and after), the `verdict`, the versions of what computed it (`tool`), the `waivers` that
    are for this recording, and the `command` line if there was one."""

    recording: Recording
    case: Case
    rulebook: Rulebook
    findings: tuple[Finding, ...]
    diagnosis: Diagnosis
    reconstruction: Reconstruction | None
    impact: Mapping[str, Impact]
    verdict: AuditVerdict
    tool: Mapping[str, str] = field(default_factory=dict)
    waivers: tuple[Waiver, ...] = ()
    command: str = ""

    @cached_property
    def motion(self) -> Motion | None:
        """Motion with every channel as measured; None where the array cannot tell it."""
        return _or(lambda: self.case.motion, lambda _: None)

    @cached_property
    def constraints(self) -> FloatArray | None:
        """(n,3) residuals of the constraint equations, rad²/s²; None for another layout than 3-2-2-2."""
        return None if self._constraints is None else self._constraints[0]

    @cached_property
    def constraints_u(self) -> FloatArray | None:
        """(n,3) their standard deviation from noise and calibration."""
        return None if self._constraints is None else self._constraints[1]

    @cached_property
    def flagged(self) -> Mapping[str, BoolArray]:
        """Channel -> (n,) samples that their own trace shows to be wrong."""
        flagged = self.case.flagged
        return {c: flagged[:, i] for i, c in enumerate(self.recording.channels) if flagged[:, i].any()}

    @property
    def zero(self) -> FloatArray:
        """(k,) SI, what was taken off as the zero of each channel."""
        return self.case.zero

    @property
    def rest(self) -> tuple[float, float] | None:
        """Start and end (s) of the quiet interval over which the zeros were taken; None where there is none."""
        rest, time = self.case.rest, self.case.time
        return None if rest is None else (float(time[rest.start]), float(time[rest.stop - 1]))

    @property
    def budget(self) -> AlphaBudget | None:
        """Uncertainty of the peak of α by source; None where the array cannot tell it."""
        return _or(lambda: self.case.alpha_budget, lambda _: None)

    @cached_property
    def calibration(self) -> Calibrated | None:
        """The calibration as the fit behind the diagnosis has it; None where no whole record was fitted."""
        fitted = self._fit
        return None if fitted is None else _or(lambda: calibrated(fitted), lambda _: None)

    @cached_property
    def sensors(self) -> Sensed:
        """What the recording says of each sensor, for a campaign to combine."""
        return sensed(self.case, self.diagnosis, self.reconstruction)

    @cached_property
    def apart(self) -> FloatArray | None:
        """(k,k) how well each channel's fault is told from each other's (separation.apart), about the fit behind the
        diagnosis; None where no whole record was fitted."""
        fitted = self._fit
        if fitted is None:
            return None
        whole = self.case.healthy.data
        return apart(replace(fitted, data=whole, theta=theta_for(whole, fitted)), self.case.onset)

    @cached_property
    def attitude(self) -> FloatArray | None:
        """(n,3,3) body to where it was at the first sample, of `motion`; None where that is not known."""
        motion = self.motion
        if motion is None:
            return None
        return _or(lambda: kinematics.orientation(motion.omega, self.case.time), lambda _: None)

    @property
    def _fit(self) -> Fit | None:
        """The whole-record fit without the culprit, else with all channels, where the diagnosis is by such fits."""
        if not self.diagnosis.smallest_detectable:
            return None
        new = self.reconstruction
        return self.case.healthy if new is None or new.fit is None else new.fit

    @cached_property
    def _constraints(self) -> tuple[FloatArray, FloatArray] | None:
        problem = _or(lambda: self.case.nap_problem, lambda _: None)
        if problem is None or self.case.nap_layout is None:
            return None
        columns, arms = self.case.nap_layout
        index = list(columns)
        full = nap.constraint_residuals(bridge(self.case.readings[:, index], self.case.time), arms, self.case.time)
        _, noise, budget = closed_form.constraint_budget(problem)
        rows = nap.product_rows(arms) ** 2 @ self.case.sigma[index] ** 2
        time, calibration = self.case.time, np.maximum(budget**2 - noise**2, 0.0)
        spread = [np.interp(time, problem.time, calibration[:, axis]) + rows[axis] for axis in range(3)]
        return full, np.sqrt(np.stack(spread, axis=1))


def audit(
    recording: Recording,
    rulebook: Rulebook | None = None,
    *,
    waivers: Sequence[Waiver] | None = None,
    today: date | None = None,
) -> Audit:
    """Run every rule, diagnose, rebuild the culprit if one is isolated, and judge.

    `waivers` need `today`, the date they are held against. ConfigurationError from rules, waivers and rig.
    """
    rulebook = load_rulebook() if rulebook is None else rulebook
    case = Case(recording)
    findings = engine.run(case, rulebook, waivers=waivers, today=today)
    diagnosis = _or(lambda: diagnose(case, _words(case)), _undiagnosed)
    reconstruction = _repair(case, diagnosis)
    changes: Mapping[str, Impact] = {}
    if reconstruction is not None:
        rebuilt = reconstruction
        changes = _or(lambda: impact(case, rebuilt), lambda _: {})
    return Audit(
        recording=recording,
        case=case,
        rulebook=rulebook,
        findings=findings,
        diagnosis=diagnosis,
        reconstruction=reconstruction,
        impact=changes,
        verdict=judge(findings),
        tool=versions(),
        waivers=tuple(w for w in waivers or () if w.fits(recording.source.path)),
    )


def judge(findings: Iterable[Finding]) -> AuditVerdict:
    """FAIL when an error rule is violated; INCONCLUSIVE when one could not be decided or evaluated; else PASS."""
    errors = [f.verdict for f in findings if f.severity is Severity.ERROR]
    if Verdict.FAIL in errors:
        return AuditVerdict.FAIL
    if Verdict.INCONCLUSIVE in errors or Verdict.NOT_EVALUATED in errors:
        return AuditVerdict.INCONCLUSIVE
    return AuditVerdict.PASS


def versions() -> dict[str, str]:
    """Versions of nineaudit, of Python, and of the packages that read and compute, for the record."""
    packages = {name: version(name) for name in ("nineaudit", *PACKAGES)}
    return {"version": packages.pop("nineaudit"), "python": platform.python_version(), **packages}


def _words(case: Case) -> dict[str, str]:
    """Channel -> fault word, where its own trace, as far as it was measured, shows one."""
    made = case.recording.made_of_others
    only_made = np.logical_and((case.flagged & made).any(axis=0), ~(case.flagged & ~made).any(axis=0))
    return {
        x.channel: x.fault
        for x, of_made in zip(case.evidence, only_made.tolist(), strict=True)
        if x.fault is not None and not of_made
    }


def _repair(case: Case, diagnosis: Diagnosis) -> Reconstruction | None:
    if diagnosis.status is not Status.ISOLATED:
        return None
    best = next((c for c in diagnosis.candidates if set(c.channels) == set(diagnosis.channels)), None)
    undone = None if best is None else _or(lambda: undo(case, best), lambda _: None)
    if undone is not None or len(diagnosis.channels) != 1:
        return undone
    return _or(lambda: mend(case, diagnosis.channels[0]), lambda _: None)


def mend(case: Case, channel: str) -> Reconstruction:
    """Rebuild a channel where its own trace shows it wrong (a clipped top, a dropout) and keep the rest as it was
    measured, if that makes the record whole; else rebuild all of it. EstimationError as rebuild_channel."""
    seen = case.flagged[:, case.array.index(channel)]
    if seen.any():
        partly = rebuild_channel(case, channel, seen)
        mended = case.with_readings([channel], partly.repaired)
        if mended.statistic <= mended.statistic_limit:
            return partly
    return rebuild_channel(case, channel)


def _or(compute: Callable[[], T], otherwise: Callable[[EstimationError], T]) -> T:
    """The value, or what stands for it where it cannot be estimated; findings carry the reason."""
    try:
        return compute()
    except EstimationError as error:
        return otherwise(error)


def _undiagnosed(error: EstimationError) -> Diagnosis:
    return Diagnosis(Status.UNDIAGNOSED, (), (), str(error))
