"""One recording drawn, audited and held against the truth."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from closed_forms import Answer, closed_form_answer, naive_answer, rebuilt, visibility
from draws import Draw, draw

import nineaudit as na
from nineaudit.array import FloatArray
from nineaudit.auditing import Audit
from nineaudit.case import Case
from nineaudit.errors import NineauditError
from nineaudit.physics import rigid_body

FAILURES = (NineauditError, ArithmeticError, LookupError, ValueError, AssertionError, np.linalg.LinAlgError)
"""What a broken diagnosis may raise: the recording counts as not diagnosed, and the report names it."""
WITHIN_95 = 1.959964
AUDIT, CLOSED_FORMS, NAIVE = "nineaudit", "closed forms", "naive"


class Outcome(StrEnum):
    """What an answer is worth. `OTHER`: a group without the culprit, or one of two that are swapped."""

    ALONE = "named alone"
    GROUP = "right group"
    WRONG = "wrong name"
    OTHER = "other"
    UNDIAGNOSED = "undiagnosed"
    MISSED = "healthy"


@dataclass(frozen=True)
class Rebuilt:
    """A reconstruction over the samples it replaces, after the event began: rms error over the Cramér–Rao bound of
    white noise and over the rms of the stated u, and the part of the samples in the stated 95 % interval: of what the
    rig at its word reads (`covered`), and of what the drawn instrument reads (`covered_own`)."""

    over_bound: float
    over_u: float
    covered: float
    covered_own: float


@dataclass(frozen=True)
class Trial:
    """`size`: injected fault over the stated smallest isolable size. `visible`: λ of closed_forms.visibility."""

    name: str
    kind: str
    severity: str
    motion: str
    noise_g: float
    fault: str
    culprits: tuple[str, ...]
    answers: dict[str, Answer]
    seconds: float
    word: str | None = None
    size: float = math.nan
    visible: float = math.nan
    statistic: float | None = None
    rebuilt: dict[str, Rebuilt] = field(default_factory=dict)
    error: str | None = None

    def outcome(self, method: str) -> Outcome | None:
        """None where the method does not apply to the array."""
        return judge(self.answers[method], self.culprits) if method in self.answers else None


def from_json(line: str) -> Trial:
    """The Trial of which ``json.dumps(asdict(trial))`` made a line."""
    found = json.loads(line)
    found["culprits"] = tuple(found["culprits"])
    found["answers"] = {method: (status, tuple(named)) for method, (status, named) in found["answers"].items()}
    found["rebuilt"] = {method: Rebuilt(**values) for method, values in found["rebuilt"].items()}
    return Trial(**found)


def judge(answer: Answer, culprits: Sequence[str]) -> Outcome:
    """What an answer is worth; with no culprits MISSED is the right one and every other a false alarm."""
    status, named, wanted = answer[0], set(answer[1]), set(culprits)
    if status in ("healthy", "undiagnosed"):
        return Outcome(status)
    if status == "isolated" and not (wanted and named <= wanted):
        return Outcome.WRONG
    if status == "isolated":
        return Outcome.ALONE if named == wanted else Outcome.OTHER
    return Outcome.GROUP if wanted and wanted <= named else Outcome.OTHER


def trial(name: str, seed: int = 0, preset: str = "naap-3222", least_signal: float = 0.25) -> Trial:
    """Draw the recording of that name, audit it, and ask the closed forms too."""
    drawn = draw(name, seed, preset, least_signal)
    start = time.perf_counter()
    try:
        audit = na.audit(drawn.simulation.recording)
    except FAILURES as error:
        answers: dict[str, Answer] = {AUDIT: ("undiagnosed", ())}
        seconds = time.perf_counter() - start
        return Trial(**_plan(drawn), answers=answers, seconds=seconds, error=f"{type(error).__name__}: {error}")
    seconds = time.perf_counter() - start
    diagnosis, error = audit.diagnosis, injected(drawn, audit.case)
    answers = {AUDIT: (str(diagnosis.status), diagnosis.channels)}
    for method, ask in ((CLOSED_FORMS, closed_form_answer), (NAIVE, naive_answer)):
        answer = ask(audit.case)
        answers |= {} if answer is None else {method: answer}
    healthy = _healthy(drawn)
    visible = visibility(healthy, error) if drawn.fault else math.nan
    named = judge(answers[AUDIT], drawn.culprits) is Outcome.ALONE
    return Trial(
        **_plan(drawn),
        answers=answers,
        seconds=seconds,
        word=diagnosis.candidates[0].fault if named and diagnosis.candidates else None,
        size=_size(drawn, audit, error, healthy, visible),
        visible=visible,
        statistic=diagnosis.healthy_statistic,
        rebuilt=_rebuilt(drawn, audit, answers),
    )


def _plan(drawn: Draw) -> dict[str, object]:
    """The part of a Trial that is known before the audit."""
    return {
        "name": drawn.name,
        "kind": drawn.kind,
        "severity": drawn.severity,
        "motion": drawn.motion,
        "noise_g": drawn.noise_g,
        "fault": "" if drawn.fault is None else str(drawn.fault),
        "culprits": drawn.culprits,
    }


def _healthy(drawn: Draw) -> Case:
    readings = drawn.simulation.healthy
    return Case(replace(drawn.simulation.recording, readings=readings, valid=np.isfinite(readings)))


def injected(drawn: Draw, case: Case) -> FloatArray:
    """(n,k) error that the fault put into the readings, SI: faulty less healthy, each with its own zero taken off."""
    healthy = drawn.simulation.healthy
    zero = healthy[case.rest.samples].mean(axis=0) if case.rest else np.zeros(healthy.shape[1])
    return np.asarray(np.nan_to_num(case.readings - (healthy - zero)))


def _size(drawn: Draw, audit: Audit, error: FloatArray, healthy: Case, visible: float) -> float:
    """The zero shift at the event that the injected error is worth, over the stated smallest isolable one; the smaller
    ratio of a swapped pair. It is worth its rms from t = 0 to the end, or, where that is less, the zero shift that
    stands out as far from calibration errors (λ). Both are exact for a zero shift."""
    event, sizes = audit.case.time >= 0.0, audit.diagnosis.smallest_isolable
    ratios = []
    for channel in drawn.culprits:
        column = audit.case.array.index(channel)
        step = np.zeros_like(error)
        step[event, column] = 1.0
        worth = float(np.sqrt(np.mean(error[event, column] ** 2)))
        alike = np.sqrt(visible / visibility(healthy, step))
        worth = min(worth, float(alike)) if np.isfinite(alike) else worth
        ratios.append(worth / sizes[channel] if sizes.get(channel) else 0.0)
    return min(ratios, default=math.nan)


def _rebuilt(drawn: Draw, audit: Audit, answers: dict[str, Answer]) -> dict[str, Rebuilt]:
    """How well the culprit was rebuilt, where it was named alone."""
    found, case = {}, audit.case
    rest = case.rest.samples if case.rest else slice(0)
    truth, own = (
        values - (values[rest].mean(axis=0) if case.rest else 0.0) for values in (drawn.simulation.ideal, drawn.own)
    )
    done = audit.reconstruction
    if done is not None and judge(answers[AUDIT], drawn.culprits) is Outcome.ALONE:
        columns = [case.array.index(c) for c in done.channels]
        inside = done.replaced & (case.time >= 0.0)[:, None]
        if inside.any():
            bound = np.broadcast_to(_bound(drawn, columns), inside.shape)[inside]
            found[AUDIT] = _compare(
                done.rebuilt[inside], done.u[inside], bound, truth[:, columns][inside], own[:, columns][inside]
            )
    answer = answers.get(CLOSED_FORMS)
    if answer is not None and judge(answer, drawn.culprits) is Outcome.ALONE and len(drawn.culprits) == 1:
        column, event = case.array.index(drawn.culprits[0]), case.time >= 0.0
        values, unknown = rebuilt(case, drawn.culprits[0])[event], np.full(int(event.sum()), math.nan)
        bound = np.broadcast_to(_bound(drawn, [column]), values.shape)
        found[CLOSED_FORMS] = _compare(values, unknown, bound, truth[event, column], own[event, column])
    return found


def _bound(drawn: Draw, columns: list[int]) -> FloatArray:
    """(m,) σ√(h/(1−h)) of accelerometers, SI (METHODS.md 4); NaN for rate sensors."""
    array = drawn.simulation.recording.rig.array
    bounds = np.full(len(array), math.nan)
    held = array.is_accelerometer
    design = rigid_body.design(array.positions[held], array.axes[held])
    bounds[held] = rigid_body.missing_channel_bound(design) * drawn.simulation.drawn["noise"][held]
    return np.asarray(bounds[columns])


def _compare(values: FloatArray, u: FloatArray, bound: FloatArray, truth: FloatArray, own: FloatArray) -> Rebuilt:
    """Rebuilt values (m,) with standard uncertainty u (m,) against what they should be (m,)."""
    error = values - truth

    def rms(x: FloatArray) -> float:
        return float(np.sqrt(np.mean(x**2)))

    return Rebuilt(
        over_bound=rms(error) / rms(bound),
        over_u=rms(error) / max(rms(u), 1e-300),
        covered=float(np.mean(np.abs(error) <= WITHIN_95 * u)),
        covered_own=float(np.mean(np.abs(values - own) <= WITHIN_95 * u)),
    )
