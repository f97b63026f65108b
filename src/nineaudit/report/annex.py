"""The tables behind the report: calibration, budget, waivers, deviations, CAN bus, damage. Finished strings only."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from nineaudit.finding import COVERAGE_FACTOR, Finding, Verdict
from nineaudit.report.findings import channels
from nineaudit.report.numbers import DASH, digits, edge, quantity, seconds, sensor_edge, spelled
from nineaudit.report.tables import Row
from nineaudit.units import counted
from nineaudit.waivers import CODE as WAIVERS

if TYPE_CHECKING:
    from nineaudit.array import Sensor
    from nineaudit.auditing import Audit
    from nineaudit.bus import Identifier, Load
    from nineaudit.estimate.budget import AlphaBudget
    from nineaudit.estimate.calibrated import Calibrated

_PULLED = 2.0
"""Standard deviations of the rig's own uncertainty beyond which a fitted calibration error stands out."""
CONTRIBUTORS = 10
"""Contributors to the uncertainty that are named; the others are summed up."""
_HEADS = {
    "gain": "Gain", "zero": "Zero left", "tilt_1": "Tilt 1", "tilt_2": "Tilt 2", "position_x": "Place x",
    "position_y": "Place y", "position_z": "Place z", "timing": "Time",
}  # fmt: skip
"""Calibration errors in the order of estimate.calibration.PARAMETERS."""
_POSITIONS = ("position_x", "position_y", "position_z")


def calibration(audit: Audit) -> dict[str, Any]:
    """Each channel's zero as taken off, and what the fit made of its calibration: value ± standard uncertainty."""
    found, rig = audit.calibration, audit.recording.rig
    length, metre = edge("m", rig)
    units = {
        "gain": (0.01, "%"),
        "tilt_1": (math.pi / 180, "°"),
        "tilt_2": (math.pi / 180, "°"),
        "timing": (1e-6, "µs"),
    }
    units |= dict.fromkeys(_POSITIONS, (metre, length))
    rows = []
    for k, sensor in enumerate(rig.array.sensors):
        unit, one = sensor_edge(sensor, rig)
        scale = [(units | {"zero": (one, unit)})[name][0] for name in _HEADS]
        cells = [] if found is None else [_fitted(found, k, p, one) for p, one in enumerate(scale)]
        rows.append({"channel": sensor.channel, "unit": spelled(unit), "zero": _zero(audit, k, sensor), "cells": cells})
    heads = [f"{title}, {units[name][1]}" if name in units else title for name, title in _HEADS.items()]
    return {"heads": [] if found is None else heads, "rows": rows}


def _fitted(found: Calibrated, k: int, p: int, one: float) -> str:
    """``+0.024 ± 0.029``, in units of `one`; a star where it is far beyond what the rig file states."""
    value, u, prior = (float(a[k, p]) for a in (found.value, found.u, found.prior))
    if not math.isfinite(value):
        return DASH
    decimals = max(1 - math.floor(math.log10(u / one)), 0) if u > 0 else 2
    star = " *" if abs(value) > _PULLED * prior else ""
    return f"{value / one:+z.{decimals}f} ± {u / one:.{decimals}f}{star}".replace("-", "−")


def _zero(audit: Audit, k: int, sensor: Sensor) -> str:
    unit, one = sensor_edge(sensor, audit.recording.rig)
    return quantity(float(audit.zero[k]) / one, unit) if audit.rest else DASH


def rest(audit: Audit) -> str:
    """Where the zeros come from, as a sentence."""
    if audit.rest is None:
        return "No quiet interval was found or stated: no zero was taken off."
    start, end = (seconds(t) for t in audit.rest)
    return f"The zero of each channel is its mean from {start} to {end} and was taken off before all that follows."


def budget(audit: Audit) -> dict[str, Any] | None:
    """The budget of the peak of α, the largest contributor first."""
    found = audit.budget
    if found is None or not found.total > 0:
        return None
    rows = sorted(found.rows.items(), key=lambda row: -row[1])
    share = {name: (u / found.total) ** 2 for name, u in rows}
    unit = "rad/s^2"
    return {
        "peak": quantity(found.peak, unit),
        "U": quantity(COVERAGE_FACTOR * found.total, unit, 2),
        "part": f"{digits(100.0 * COVERAGE_FACTOR * found.total / found.peak, 2)} %",
        "largest": " and ".join(name for name, u in rows[:2] if u > 0),
        "rows": [
            {
                "source": name,
                "u": quantity(u, unit, 2),
                "share": f"{digits(100.0 * share[name], 2)} %" if share[name] >= 5e-5 else "0 %",
                "bar": f"{100.0 * share[name]:.1f}%",
            }
            for name, u in rows
        ],
        "total": quantity(found.total, unit, 2),
        "contributors": _contributors(found, audit.recording.channels),
    }


def _contributors(found: AlphaBudget, names: Sequence[str]) -> list[Row]:
    """The largest contributors to the variance, a channel and a source each, and what all others are together; filters
    and the finite step are of the array as a whole."""
    each = [(names[k], source, float(u)) for source, parts in found.parts.items() for k, u in enumerate(parts)]
    if not each:
        return []
    each += [("whole array", source, u) for source, u in found.rows.items() if source not in found.parts]
    each = sorted((row for row in each if row[2] > 0), key=lambda row: -row[2])
    shown, others = each[:CONTRIBUTORS], [u for *_, u in each[CONTRIBUTORS:]]
    if others:
        shown.append(("all others", f"{len(others)} of them", math.hypot(*others)))
    return [
        {
            "channel": channel,
            "source": source,
            "u": quantity(u, "rad/s^2", 2),
            "share": f"{digits(100.0 * (u / found.total) ** 2, 2)} %",
            "bar": f"{100.0 * (u / found.total) ** 2:.1f}%",
        }
        for channel, source, u in shown
    ]


def waivers(audit: Audit) -> list[Row]:
    """The waivers for this recording: what, up to where, why, who, until when."""
    return [
        {
            "rule": w.rule,
            "channels": ", ".join(w.channels) or "all",
            "ceiling": DASH if w.max_value is None else f"{w.max_value:g}",
            "reason": w.reason,
            "by": f"{w.approved_by}, {w.approved_on}",
            "expires": str(w.expires),
        }
        for w in audit.waivers
    ]


def deviations(audit: Audit) -> list[tuple[str, str]]:
    """(what, in words): whatever a reader must know that was not as the method has it."""
    source, recording = audit.recording.source, audit.recording
    told = [("waived", f) for f in audit.findings if f.verdict is Verdict.WAIVED]
    told += [("waiver", f) for f in audit.findings if f.rule == WAIVERS and f.verdict in (Verdict.FAIL, Verdict.WARN)]
    told += [("not evaluated", f) for f in audit.findings if f.verdict is Verdict.NOT_EVALUATED]
    rows = [(f"{f.rule} {word}", _said(f)) for word, f in told]
    rows += [("identification", remark) for remark in recording.test.remarks]
    if not source.unchanged_after_read:
        rows.append(("file", "the recording changed while it was read"))
    if recording.resampled:
        rows.append(("time base", f"interpolated onto the common time base: {', '.join(recording.resampled)}"))
    return rows


def _said(finding: Finding) -> str:
    names = ", ".join(channels(finding))
    return f"{names}: {finding.reason}" if names else finding.reason


def damage(audit: Audit) -> list[Row]:
    """What of the files could not be read."""
    return [
        {"file": file.path.name, "place": d.place, "what": d.what, "count": str(d.count), "lost": d.lost or DASH}
        for file in audit.recording.source.files
        for d in file.damage
    ]


def bus(audit: Audit) -> dict[str, Any] | None:
    """The CAN bus: an identifier a row, the loads, and the messages that never came."""
    found = audit.recording.bus
    if found is None:
        return None
    return {
        "identifiers": [_identifier(x) for x in found.identifiers],
        "loads": [_load(x, found.bit_rate) for x in found.loads],
        "absent": ", ".join(found.absent),
        "restarts": str(found.restarts) if found.restarts else "",
    }


def _identifier(x: Identifier) -> Row:
    wrong = [f"{c.signal}: {c.missing} numbers missing" for c in x.counters if c.missing]
    wrong += [f"{c.signal}: {c.repeated} numbers repeated" for c in x.counters if c.repeated]
    wrong += [f"{c.signal}: {c.wrong} checksums wrong" for c in x.checksums if c.wrong]
    wrong += [
        f"{o.signal}: {counted(o.count, 'value')} outside {o.low:g} to {o.high:g} {o.unit}".rstrip() for o in x.outside
    ]
    wrong += [f"{signal}: {counted(frames, 'time')} not available" for signal, frames in x.unavailable]
    wrong += [f"{counted(n, 'frame')} {word} than the database has them" for n, word in _lengths(x) if n]
    wrong += ["no byte ever changes"] if x.constant and x.frames > 1 else []
    return {
        "id": x.number,
        "name": x.name or "not in the database",
        "bus": x.bus,
        "used": "yes" if x.used else "",
        "frames": str(x.frames),
        "interval": _milliseconds(x.interval),
        "jitter": _milliseconds(x.jitter),
        "longest": _milliseconds(x.longest),
        "cycle": _milliseconds(x.cycle),
        "remarks": "; ".join(wrong),
    }


def _lengths(x: Identifier) -> tuple[tuple[int, str], tuple[int, str]]:
    return (x.longer, "longer"), (x.shorter, "shorter")


def _milliseconds(value: float | None) -> str:
    return DASH if value is None or not math.isfinite(value) else quantity(1e3 * value, "ms")


def _load(x: Load, rate: float | None) -> Row:
    def part(bits: float, duration: float) -> str:
        if duration <= 0:
            return f"{digits(bits)} bit"
        if rate is None:
            return quantity(1e-3 * bits / duration, "kbit/s", 4)
        return f"{digits(100.0 * bits / (rate * duration), 2)} %"

    return {
        "bus": x.bus,
        "whole": f"{part(x.least, x.duration)} to {part(x.most, x.duration)}",
        "peak": f"{part(x.peak_least, x.window)} to {part(x.peak_most, x.window)}",
        "window": quantity(x.window, spelled("s")),
    }
