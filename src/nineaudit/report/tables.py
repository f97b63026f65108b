"""The tables of a report as rows of finished strings: every number is formatted here, once."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from nineaudit.finding import COVERAGE_FACTOR, Finding, Verdict
from nineaudit.report.findings import Group, by_rule, channels, family, family_title
from nineaudit.report.numbers import (
    DASH,
    at_edge,
    digits,
    edge,
    probability,
    quantity,
    seconds,
    sensor_edge,
    spelled,
    told_apart,
)
from nineaudit.report.text import fault_word, joined

if TYPE_CHECKING:
    from nineaudit.auditing import Audit
    from nineaudit.rig import Rig

Row = dict[str, Any]

CANDIDATES_SHOWN = 9
_ABOUT = (("Why", "why"), ("Computed", "equation"), ("What to do", "advice"))
_NUMBERS_SAY = frozenset({Verdict.PASS, Verdict.WARN, Verdict.FAIL, Verdict.INCONCLUSIVE})


def rule_families(audit: Audit) -> list[Row]:
    """Every rule that was run, by family: its worst finding, and one row a channel beneath."""
    sheets = {rule.code: rule for rule in audit.rulebook.rules}
    rows: dict[str, Row] = {}
    for group in by_rule(audit.findings):
        code = family(group.worst)
        entry = rows.setdefault(code, {"code": code, "title": family_title(code), "rules": []})
        entry["rules"].append(_rule(group, sheets.get(group.rule), audit.recording.rig))
    return list(rows.values())


def _rule(group: Group, sheet: Any, rig: Rig) -> Row:
    several = len(group.findings) > 1
    return {
        "code": group.rule,
        "title": sheet.title if sheet else "",
        "clause": getattr(sheet, "clause", ""),
        "severity": str(group.worst.severity),
        "about": [(name, getattr(sheet, key)) for name, key in _ABOUT if getattr(sheet, key, "")],
        "worst": finding_row(group.worst, rig),
        "each": [finding_row(f, rig) for f in group.findings] if several else [],
        "tally": _tally(group) if several else "",
    }


def _tally(group: Group) -> str:
    verdicts = [str(f.verdict) for f in group.findings]
    counted = (f"{verdicts.count(v)} {v.replace('_', ' ')}" for v in dict.fromkeys(verdicts))
    return f"{len(verdicts)} results: {', '.join(counted)}"


def finding_row(finding: Finding, rig: Rig) -> Row:
    """Channel, time, value, limit, U, verdict and reason of one finding."""
    row = {
        "rule": finding.rule,
        "channels": ", ".join(channels(finding)),
        "verdict": str(finding.verdict),
        "label": str(finding.verdict).replace("_", " "),
        "reason": _reason(finding),
        "value": DASH,
        "limit": DASH,
        "U": DASH,
        "unit": "",
        "when": "",
    }
    measure = finding.measure
    if measure is None:
        return row
    value, limit, u, unit = at_edge(measure, rig)
    row["value"], row["limit"] = told_apart(value, limit)
    row["U"] = digits(COVERAGE_FACTOR * u, 2) if u > 0 else "0"
    row["unit"] = spelled(unit)
    row["when"] = interval(measure.interval) if measure.interval else ""
    return row


def _reason(finding: Finding) -> str:
    """The reason; of a finding whose numbers stand beside it, only the words."""
    if finding.measure is None or finding.verdict not in _NUMBERS_SAY:
        return finding.reason
    doubt = "within its uncertainty of the limit" if finding.verdict is Verdict.INCONCLUSIVE else ""
    words = finding.measure.detail.rstrip(",; ")
    return ", ".join(part for part in (words, doubt) if part)


def interval(ends: tuple[float, float]) -> str:
    """``0.0312–0.0330 s``, or one time where both ends print alike."""
    first, last = (seconds(t) for t in ends)
    return first if first == last else f"{first.removesuffix('s').rstrip()} to {last}"


def candidates(audit: Audit) -> list[Row]:
    """The hypotheses, most probable first."""
    return [
        {
            "channels": joined(c.channels),
            "fault": fault_word(c.fault),
            "probability": probability(c.probability),
            "share": f"{100.0 * c.probability:.1f}%" if math.isfinite(c.probability) else "0%",
            "statistic": digits(c.statistic, full=True),
            "parameters": ", ".join(f"{name} {digits(v)}" for name, v in c.parameters.items()),
            "named": set(c.channels) <= set(audit.diagnosis.channels),
        }
        for c in audit.diagnosis.candidates[:CANDIDATES_SHOWN]
    ]


def sensitivity(audit: Audit) -> list[Row]:
    """What this recording could have shown, per channel, in the channel's unit; a dash: of no size."""
    found, pinned = audit.diagnosis.smallest_detectable, audit.diagnosis.smallest_isolable
    return [
        {
            "channel": sensor.channel,
            "detectable": _bounded(found.get(sensor.channel), sensor, audit.recording.rig),
            "isolable": _bounded(pinned.get(sensor.channel), sensor, audit.recording.rig),
        }
        for sensor in audit.recording.rig.array.sensors
        if sensor.channel in found or sensor.channel in pinned
    ]


def power(audit: Audit) -> str:
    """What a pass means, in a sentence: the shift that would have shown in every accelerometer of the array."""
    rig, found = audit.recording.rig, audit.diagnosis.smallest_detectable
    sizes = [size for channel, size in found.items() if rig.array[channel].kind == "accelerometer"]
    if not sizes:
        return ""
    if not all(math.isfinite(size) for size in sizes):
        return "In some channels this recording could not have shown a fault of any size."
    unit, one = edge("m/s^2", rig)
    return f"A lasting shift of {quantity(max(sizes) / one, unit, 2)} in any channel would have shown."


def _bounded(value: float | None, sensor: Any, rig: Rig) -> str:
    if value is None or not math.isfinite(value):
        return "not possible"
    unit, one = sensor_edge(sensor, rig)
    return quantity(value / one, unit, 2, full=True)


def impact(audit: Audit) -> list[Row]:
    """Each result as recorded, with the rebuilt channel, its U and the change."""
    rows = []
    for name, effect in audit.impact.items():
        unit, one = edge(effect.unit, audit.recording.rig)
        before, after, u = (None if v is None else v / one for v in (effect.before, effect.after, effect.u))
        rows.append(
            {
                "name": name,
                "unit": spelled(unit),
                "before": digits(before, full=True),
                "after": digits(after, full=True),
                "U": digits(None if u is None else COVERAGE_FACTOR * u, 2, full=True),
                "change": _change(before, after),
            }
        )
    return rows


def methods(audit: Audit) -> str:
    """How the results before and after the repair were computed: two schemes, of which the names are given."""
    before = "" if audit.motion is None else f" ({audit.motion.method})"
    return (
        f"As recorded: every channel at its word{before}, as a laboratory would compute it from the recording. After "
        "the repair: by the whole-record fit behind the repair, with a0 and α from each sample; U is its expanded "
        "uncertainty (k = 2). The command nineaudit motion fits the recording as it is, fault and all, unless told "
        "otherwise: the fit shares the fault out among the channels, so that its numbers are neither of these."
    )


def _change(before: float | None, after: float | None) -> str:
    """Error of the value as recorded against the value with the rebuilt channel, per cent."""
    if before is None or after is None or not math.isfinite(before) or not math.isfinite(after) or after == 0:
        return DASH
    percent = 100.0 * (before - after) / abs(after)
    sign = "+" if percent > 0 else ""
    return f"{sign}{digits(percent, 2, full=True)} %"


def sensors(audit: Audit) -> list[Row]:
    """The rig: what each channel is, where it sits, what it senses, how well that is known."""
    return [_sensor(sensor, audit.recording.rig) for sensor in audit.recording.rig.array.sensors]


def _sensor(sensor: Any, rig: Rig) -> Row:
    unit, one = sensor_edge(sensor, rig)
    _, metre = edge("m", rig)
    return {
        "channel": sensor.channel,
        "kind": sensor.kind,
        "position": [digits(float(v) / metre) for v in sensor.position],
        "axis": [digits(float(v)) for v in sensor.axis],
        "range": quantity(sensor.full_scale / one, unit) if sensor.full_scale else DASH,
        "gain": f"{digits(100.0 * sensor.u_gain)} %",
        "zero": quantity(sensor.u_zero / one, unit),
        "alignment": f"{digits(math.degrees(sensor.u_alignment))}°",
        "placed": quantity(sensor.u_position / metre, edge("m", rig)[0]),
        "noise": quantity(sensor.noise / one, unit) if sensor.noise is not None else "measured",
        "serial": sensor.serial or DASH,
    }
