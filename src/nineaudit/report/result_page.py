"""Result JSON -> HTML page. A result holds findings and diagnosis but no samples, so the page has no curves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from nineaudit.diagnose import Candidate, Diagnosis, Status
from nineaudit.errors import ConfigurationError
from nineaudit.finding import Severity, Verdict
from nineaudit.report.findings import WEIGHT
from nineaudit.report.machine import SCHEMA
from nineaudit.report.numbers import DASH, digits, probability, seconds, spelled
from nineaudit.report.page import LEAD, MARKS, headline, style, template
from nineaudit.report.tested import shown
from nineaudit.report.text import fault_word, joined


class FindingModel(BaseModel):
    """One finding of ``nineaudit/result/1``, numbers in the rig's units."""

    model_config = ConfigDict(allow_inf_nan=False)

    rule: str
    verdict: Verdict
    severity: Severity
    channels: list[str]
    t_start: float | None
    t_end: float | None
    value: float | None
    limit: float | None
    unit: str
    U: float | None
    reason: str


class CandidateModel(BaseModel):
    channels: list[str]
    fault: str
    probability: float | None


class DiagnosisModel(BaseModel):
    status: Status
    channels: list[str]
    candidates: list[CandidateModel]
    smallest_detectable: dict[str, float | None]
    smallest_isolable: dict[str, float | None]
    unit: str
    reason: str = ""


class ImpactModel(BaseModel):
    before: float | None
    after: float | None
    u: float | None
    unit: str = ""


class RepairModel(BaseModel):
    channels: list[str]
    method: str = ""


class TestModel(BaseModel):
    """Which test it was; keys of identity.KEYS, and "started"."""

    model_config = ConfigDict(extra="allow")

    sources: dict[str, str] = {}
    remarks: list[str] = []

    @property
    def known(self) -> dict[str, str]:
        """What is stated, but for what this version has no name for."""
        return {key: str(value) for key, value in (self.model_extra or {}).items() if isinstance(value, str)}


class ResultModel(BaseModel):
    """What the page shows of ``nineaudit/result/1``; what it does not know it leaves alone."""

    version: str = Field(alias="schema", pattern=f"^{SCHEMA}$")
    tool: dict[str, str]
    recording: dict[str, Any]
    rig: dict[str, str] = {}
    rulebook: dict[str, str] = {}
    verdict: str = Field(pattern=f"^({'|'.join(LEAD)})$")
    reason: str = ""
    findings: list[FindingModel]
    diagnosis: DiagnosisModel | None = None
    impact: dict[str, ImpactModel] = {}
    test: TestModel = TestModel()
    reconstruction: RepairModel | None = None


def load_result(path: Path) -> ResultModel:
    """A result document. ConfigurationError with the place of the first mistake."""
    try:
        return ResultModel.model_validate_json(path.read_bytes())
    except OSError as error:
        raise ConfigurationError(f"cannot be read: {error.strerror or error}", file=path) from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"]))
        expected = f"one document of {SCHEMA}, as `nineaudit check --json` writes it for one recording"
        raise ConfigurationError(
            f"is not a result: {first['msg']}", file=path, place=place or None, expected=expected
        ) from error


def render_result(path: Path) -> str:
    """The page of the result in `path`. ConfigurationError where it is none."""
    return template("result.html.j2").render(_context(load_result(path))) + "\n"


def _context(result: ResultModel) -> dict[str, Any]:
    """Everything that the template shows, as finished strings and lists of them."""
    order = {verdict: i for i, verdict in enumerate(WEIGHT)}
    return style() | {
        "marks": {str(verdict): mark for verdict, mark in MARKS.items()},
        "name": Path(str(result.recording.get("path", "recording"))).name,
        "rig": result.rig.get("name", ""),
        "test": shown(result.test.known, result.test.sources, result.test.remarks),
        "verdict": result.verdict,
        "label": result.verdict.replace("_", " "),
        "sentence": result.reason or _sentence(result.diagnosis),
        "lead": LEAD[result.verdict],
        "diagnosis": result.diagnosis,
        "repaired": _repaired(result.reconstruction),
        "candidates": _candidates(result.diagnosis),
        "sensitivity": _sensitivity(result.diagnosis),
        "impact": [_impact(name, row) for name, row in result.impact.items()],
        "findings": [_finding(f) for f in sorted(result.findings, key=lambda f: order[f.verdict])],
        "provenance": _provenance(result),
    }


def _sentence(diagnosis: DiagnosisModel | None) -> str:
    if diagnosis is None:
        return ""
    named = tuple(Candidate(tuple(c.channels), c.fault, c.probability or 0.0, 0.0, {}) for c in diagnosis.candidates)
    return headline(Diagnosis(diagnosis.status, tuple(diagnosis.channels), named, diagnosis.reason))


def _repaired(done: RepairModel | None) -> str:
    return "" if done is None else f"Repair: {joined(tuple(done.channels))}: {done.method}."


def _candidates(diagnosis: DiagnosisModel | None) -> list[tuple[str, str, str]]:
    found = diagnosis.candidates if diagnosis else []
    return [(joined(tuple(c.channels)), fault_word(c.fault), probability(c.probability)) for c in found]


def _sensitivity(diagnosis: DiagnosisModel | None) -> list[tuple[str, str, str]]:
    if diagnosis is None:
        return []
    isolable = diagnosis.smallest_isolable
    return [(c, digits(v), digits(isolable.get(c))) for c, v in diagnosis.smallest_detectable.items()]


def _impact(name: str, row: ImpactModel) -> tuple[str, str, str, str, str]:
    expanded = None if row.u is None else 2.0 * row.u
    return name, spelled(row.unit), digits(row.before), digits(row.after), digits(expanded, 2)


def _finding(finding: FindingModel) -> dict[str, str]:
    return {
        "rule": finding.rule,
        "verdict": str(finding.verdict),
        "label": str(finding.verdict).replace("_", " "),
        "channels": ", ".join(finding.channels),
        "when": DASH if finding.t_start is None else seconds(finding.t_start),
        "value": digits(finding.value),
        "limit": digits(finding.limit),
        "U": digits(finding.U, 2),
        "unit": spelled(finding.unit),
        "reason": finding.reason,
    }


def _words(value: Any) -> str:
    """A value of the document; lists and objects as people read them."""
    if isinstance(value, dict):
        return ", ".join(f"{name.replace('_', ' ')} {_words(one)}" for name, one in value.items())
    if isinstance(value, list):
        return ("; " if any(isinstance(one, dict) for one in value) else " to ").join(map(_words, value))
    return str(value)


def _provenance(result: ResultModel) -> list[tuple[str, str]]:
    return [
        *((f"Recording {name.replace('_', ' ')}", _words(value)) for name, value in result.recording.items()),
        *((f"Rig {name}", value) for name, value in result.rig.items()),
        *((f"Rulebook {name}", value) for name, value in result.rulebook.items()),
        *(("nineaudit" if name == "version" else name, version) for name, version in result.tool.items()),
    ]
