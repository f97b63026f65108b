"""An entry of the lake -> its rows in the tables. Pure: the same entry gives the same rows."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from datetime import date
from typing import Any, Final

from nineaudit.campaign.results.schema import ERRORS

Row = dict[str, Any]
FIT: Final = "RB303"
"""The rule of the whole-record fit: what it says of a recording is comparable between recordings."""


def rows(entry: Mapping[str, Any]) -> dict[str, list[Row]]:
    """Rows of every table of schema.TABLES for one entry. KeyError, TypeError: it is not an entry."""
    which = {"uri": entry["uri"], "edition": entry["edition"]}
    result = entry["result"]
    return {
        "recordings": [which | recording(entry)],
        "findings": [which | row for row in _findings(result)],
        "candidates": [which | row for row in _candidates(result)],
        "sensors": [which | row for row in _sensors(result)],
        "provenance": [which | _provenance(entry)],
    }


def recording(entry: Mapping[str, Any]) -> Row:
    """What the table of recordings says of one."""
    result = entry["result"]
    source, rig, known = result["recording"], result.get("rig") or {}, test_of(entry)
    return {
        "key": entry["key"],
        "verdict": result["verdict"],
        "reason": result.get("reason"),
        "transient": bool(entry.get("transient", False)),
        **_diagnosis(result),
        **_counts(result["findings"]),
        "number": known.get("number"),
        "item": known.get("item"),
        "date": day(known.get("date")),
        "laboratory": known.get("laboratory"),
        "test": sorted(known.items()),
        "rig": rig.get("name"),
        "rig_sha256": rig.get("sha256"),
        "format": source.get("format"),
        "sha256": source.get("sha256"),
        "bytes": sum(part["bytes"] for part in source.get("parts") or [source] if "bytes" in part)
        if "bytes" in source
        else None,
        "samples": source.get("samples"),
        "duration_s": _number(source.get("duration_s")),
        "rate_hz": _number(source.get("rate_hz")),
        "reconstructed": [made["channel"] for made in source.get("reconstructed", ())],
        "impact": [(name, _impact(value)) for name, value in result.get("impact", {}).items()],
    }


def test_of(entry: Mapping[str, Any]) -> dict[str, str]:
    """What is known of the test, as text by name: the table of recordings before what the recording says."""
    said = {**(entry["result"].get("test") or {}), **(entry.get("test") or {})}
    return {
        str(name): str(value) for name, value in said.items() if isinstance(value, str | int | float) and value != ""
    }


def day(text: str | None) -> date | None:
    """A date of ISO 8601, YYYY-MM-DD; None of anything else, which stays in the column `test`."""
    try:
        return date.fromisoformat(text[:10]) if text else None
    except ValueError:
        return None


def verdicts(result: Mapping[str, Any]) -> dict[str, str]:
    """Rule -> its weightiest verdict."""
    from nineaudit.report.findings import WEIGHT

    heavy = [str(verdict) for verdict in WEIGHT]
    found: dict[str, str] = {}
    for finding in result["findings"]:
        rule, verdict = finding["rule"], finding["verdict"]
        if rule not in found or heavy.index(verdict) < heavy.index(found[rule]):
            found[rule] = verdict
    return found


def _diagnosis(result: Mapping[str, Any]) -> Row:
    diagnosis = result.get("diagnosis") or {}
    culprits = list(diagnosis.get("channels", ()))
    best: Mapping[str, Any] = next(iter(diagnosis.get("candidates", ())), {}) if culprits else {}
    return {
        "status": diagnosis.get("status"),
        "culprits": culprits,
        "fault": best.get("fault"),
        "probability": _number(best.get("probability")),
        "statistic": statistic(result),
    }


def statistic(result: Mapping[str, Any]) -> float | None:
    """The largest value over limit of the whole-record fit's rule; None where it was not evaluated."""
    found = [
        finding["value"] / finding["limit"]
        for finding in result["findings"]
        if finding["rule"] == FIT and finding["value"] is not None and (finding["limit"] or 0) > 0
    ]
    return float(max(found)) if found else None


def _counts(findings: list[Mapping[str, Any]]) -> Row:
    number = Counter(finding["verdict"] for finding in findings)
    return {
        "rules_failed": sorted({finding["rule"] for finding in findings if finding["verdict"] == "fail"}),
        "findings_failed": number["fail"],
        "findings_warned": number["warn"],
        "findings_open": number["inconclusive"] + number["not_evaluated"],
        "findings_waived": number["waived"],
    }


def _findings(result: Mapping[str, Any]) -> Iterator[Row]:
    for place, finding in enumerate(result["findings"]):
        numbers = {name: _number(finding[name]) for name in ("t_start", "t_end", "value", "U")}
        words = {name: finding[name] for name in ("rule", "verdict", "severity", "channels", "unit", "reason")}
        yield {"place": place, **numbers, **words, "limit_value": _number(finding["limit"])}


def _candidates(result: Mapping[str, Any]) -> Iterator[Row]:
    for rank, candidate in enumerate((result.get("diagnosis") or {}).get("candidates", ()), 1):
        yield {
            "rank": rank,
            "channels": candidate["channels"],
            "fault": candidate["fault"],
            "probability": _number(candidate["probability"]),
            "statistic": _number(candidate.get("statistic")),
            "parameters": json.dumps(candidate["parameters"], ensure_ascii=False, sort_keys=True),
        }


def _sensors(result: Mapping[str, Any]) -> Iterator[Row]:
    for place, sensor in enumerate((result.get("sensors") or {}).get("channels", ())):
        told = sensor["calibration"] or {}
        yield {
            "place": place,
            **{name: sensor[name] for name in ("channel", "serial", "kind", "unit", "position", "axis")},
            **{name: _number(sensor[name]) for name in ("peak", "shock", "scale")},
            **{name: _number(value) for name, value in zip(ERRORS, told.get("value", ()), strict=bool(told))},
            **{f"{name}_u": _number(value) for name, value in zip(ERRORS, told.get("u", ()), strict=bool(told))},
            **{f"{name}_prior": _number(v) for name, v in zip(ERRORS, told.get("prior", ()), strict=bool(told))},
        }


def _provenance(entry: Mapping[str, Any]) -> Row:
    result = entry["result"]
    source = result["recording"]
    parts = [part for part in source.get("parts") or [source] if "sha256" in part]
    return {
        "key": entry["key"],
        "tool_version": result["tool"]["version"],
        "tool": sorted(result["tool"].items()),
        "rulebook_sha256": (result.get("rulebook") or {}).get("sha256"),
        "rig_sha256": (result.get("rig") or {}).get("sha256"),
        "files": [f"{part['sha256']} {part['path']}" for part in parts],
        "seal": result.get("seal"),
    }


def _impact(value: Mapping[str, Any]) -> Row:
    numbers = {name: _number(value.get(name)) for name in ("before", "after", "u")}
    return {**numbers, "unit": value.get("unit", "")}


def _number(value: Any) -> float | None:
    return None if value is None else float(value)
