"""The result as data: ``nineaudit/result/1`` (INTERFACE.md; schema in result.schema.json beside this module).

Numbers are in the rig's units where the finding is in SI units, time stamps in seconds of the recording's clock.
NaN and infinity never appear: null. The same audit gives the same bytes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nineaudit.files import sealed
from nineaudit.finding import COVERAGE_FACTOR, Finding
from nineaudit.report.bus_document import bus_document
from nineaudit.report.findings import channels
from nineaudit.report.numbers import at_edge, edge, instant, plain, sensor_edge
from nineaudit.report.sensors import sensors_document

if TYPE_CHECKING:
    from nineaudit.auditing import Audit
    from nineaudit.diagnose import Diagnosis
    from nineaudit.errors import NineauditError
    from nineaudit.identity import Identity
    from nineaudit.recording import Recording, Source
    from nineaudit.rig import Rig

SCHEMA = "nineaudit/result/1"


def result_schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) that every result document meets."""
    text = files("nineaudit.report").joinpath("result.schema.json").read_text(encoding="utf-8")
    return dict(json.loads(text))


def result_document(audit: Audit) -> dict[str, Any]:
    """The audit as nineaudit/result/1: numbers, strings, lists and null only, keys in a fixed order."""
    rig = audit.recording.rig
    document = {
        "schema": SCHEMA,
        "tool": _tool(audit.tool),
        "recording": _recording(audit.recording),
        "test": audit.recording.test.document(),
        "rig": {"name": rig.name, "sha256": rig.sha256},
        "rulebook": {"sha256": audit.rulebook.sha256},
        "verdict": str(audit.verdict),
        "findings": [_finding(finding, rig) for finding in audit.findings],
        "diagnosis": _diagnosis(audit.diagnosis, rig),
        "reconstruction": _reconstruction(audit),
        "impact": {name: _impact(impact, rig) for name, impact in audit.impact.items()},
        "bus": bus_document(audit.recording),
        "sensors": sensors_document(audit.sensors, rig),
    }
    return sealed(document)


def failure_document(
    path: Path, error: NineauditError, tool: Mapping[str, str], test: Identity | None = None
) -> dict[str, Any]:
    """The document of a recording that could not be audited: verdict ``not_audited``, the reason, and what is known of
    the `test` without the recording."""
    about = test.document() if test is not None else {}
    document = {
        "schema": SCHEMA,
        "tool": _tool(tool),
        "recording": {"path": path.as_posix(), "format": path.suffix.lower().lstrip(".")},
        **({"test": about} if about else {}),
        "verdict": "not_audited",
        "reason": str(error),
        "findings": [],
    }
    return sealed(document)


def to_json(document: Mapping[str, Any]) -> str:
    """An indented document that ends with a newline."""
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def to_jsonl(document: Mapping[str, Any]) -> str:
    """The document on one line that ends with a newline."""
    return json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":")) + "\n"


def _tool(tool: Mapping[str, str]) -> dict[str, Any]:
    return {"version": str(tool["version"])} | {name: str(version) for name, version in tool.items()}


def _recording(recording: Recording) -> dict[str, Any]:
    source, time = recording.source, recording.time
    span = float(time[-1] - time[0]) if len(time) else 0.0
    return (
        {
            "path": source.path.as_posix(),
            "sha256": source.sha256,
            "bytes": source.size,
            "format": source.format,
            "samples": len(time),
            "duration_s": instant(span),
            "rate_hz": plain(recording.rate) if len(time) > 1 else None,
            "unchanged_after_read": source.unchanged_after_read,
        }
        | _reconstructed(recording)
        | ({"parts": [_file(part) for part in source.parts]} if source.parts else {})
    )


def _reconstructed(recording: Recording) -> dict[str, Any]:
    """The channels that are not as measured, by the record of their repair; nothing where all are."""
    rows = [
        {
            "channel": made.channel,
            "samples": made.samples,
            "interval": [instant(made.stretches[0][0]), instant(made.stretches[-1][1])] if made.stretches else None,
            "method": made.method,
            "independent": not made.from_others,
            "original_sha256": made.original,
        }
        for made in recording.remade
    ]
    return {"reconstructed": rows} if rows else {}


def _file(source: Source) -> dict[str, Any]:
    """One file of a recording that has several."""
    return {
        "path": source.path.as_posix(),
        "sha256": source.sha256,
        "bytes": source.size,
        "format": source.format,
        "unchanged_after_read": source.unchanged_after_read,
    }


def _finding(finding: Finding, rig: Rig) -> dict[str, Any]:
    measure = finding.measure
    start, end = measure.interval if measure and measure.interval else (float("nan"), float("nan"))
    value, limit, u, unit = at_edge(measure, rig) if measure else (None, None, None, "")
    return {
        "rule": finding.rule,
        "verdict": str(finding.verdict),
        "severity": str(finding.severity),
        "channels": list(channels(finding)),
        "t_start": instant(start),
        "t_end": instant(end),
        "value": plain(value),
        "limit": plain(limit),
        "unit": unit,
        "U": plain(None if u is None else COVERAGE_FACTOR * u),
        "k": int(COVERAGE_FACTOR),
        "reason": finding.reason,
    }


def _diagnosis(diagnosis: Diagnosis, rig: Rig) -> dict[str, Any]:
    return {
        "status": str(diagnosis.status),
        "channels": list(diagnosis.channels),
        "candidates": [
            {
                "channels": list(candidate.channels),
                "fault": candidate.fault,
                "probability": plain(candidate.probability),
                "statistic": plain(candidate.statistic),
                "parameters": plain(candidate.parameters),
            }
            for candidate in diagnosis.candidates
        ],
        "smallest_detectable": _per_channel(diagnosis.smallest_detectable, rig),
        "smallest_isolable": _per_channel(diagnosis.smallest_isolable, rig),
        "unit": edge("m/s^2", rig)[0],
        "angular_rate_unit": edge("rad/s", rig)[0],
        "reason": diagnosis.reason,
    }


def _per_channel(values: Mapping[str, float], rig: Rig) -> dict[str, float | None]:
    """Accelerometers in the acceleration unit, rate sensors in the angular-rate unit."""
    return {name: plain(value / sensor_edge(rig.array[name], rig)[1]) for name, value in values.items()}


def _reconstruction(audit: Audit) -> dict[str, Any] | None:
    rebuilt = audit.reconstruction
    if rebuilt is None:
        return None
    unit, one = sensor_edge(audit.recording.rig.array[rebuilt.channels[0]], audit.recording.rig)
    return {
        "channels": list(rebuilt.channels),
        "interval": [instant(end) for end in rebuilt.interval],
        "u_rms": plain(float(rebuilt.u_rms) / one),
        "bound_ratio": plain(rebuilt.bound_ratio),
        "unit": unit,
        "method": rebuilt.method,
        "donors": list(rebuilt.donors),
    }


def _impact(impact: Any, rig: Rig) -> dict[str, Any]:
    unit, one = edge(impact.unit, rig)
    numbers = {name: getattr(impact, name) for name in ("before", "after", "u")}
    return {name: None if v is None else plain(v / one) for name, v in numbers.items()} | {"unit": unit}
