"""The diagnosis as pictures: what each hypothesis leaves unexplained, and which channels are told from which."""

from __future__ import annotations

import math
from html import escape
from typing import TYPE_CHECKING, Any

from nineaudit.array import FloatArray
from nineaudit.report.figures import Figure
from nineaudit.report.numbers import digits, printable
from nineaudit.report.tables import CANDIDATES_SHOWN
from nineaudit.report.text import fault_word, joined

if TYPE_CHECKING:
    from nineaudit.auditing import Audit

ROW, LEFT = 24, 34.0
"""Height of a row in pixels, and the width of its name in per cent."""
GRADES = (1.5, 3.0, 10.0)
"""Factors at which the map changes its shade: as good as apart, with some loss, hardly, not."""
WORDS = ("told apart", "with a larger fault", "hardly", "not at all")


def residuals(audit: Audit) -> Figure | None:
    """Cost per degree of freedom of each hypothesis on a logarithmic scale, with the limit of a healthy record."""
    found, limit = audit.diagnosis, audit.diagnosis.limit
    rows = [] if found.healthy_statistic is None else [("no channel at fault", found.healthy_statistic, "measured")]
    for c in found.candidates[:CANDIDATES_SHOWN]:
        style = "rebuilt" if set(c.channels) <= set(found.channels) else "measured"
        rows.append((f"{joined(c.channels)}: {fault_word(c.fault)}", c.statistic, style))
    rows = [(name, value, style) for name, value, style in rows if math.isfinite(value) and value > 0]
    if len(rows) < 2:
        return None
    reach = [value for _, value, _ in rows] + [1.0] + ([limit] if limit else [])
    low, high = math.log10(min(reach)) - 0.15, math.log10(max(reach)) + 0.15
    best = min(rows, key=lambda row: row[1])
    told = f"least {digits(best[1], full=True)}, {best[0]}" + (f"; the limit is {digits(limit)}" if limit else "")
    caption = f"What each hypothesis leaves unexplained: {told}. A bar that ends left of the limit explains the record."
    return Figure(_bars(rows, limit, (low, high), told), caption)


def _bars(rows: list[tuple[str, float, str]], limit: float | None, span: tuple[float, float], told: str) -> str:
    height = ROW * len(rows)
    parts = [
        f'<svg class="bars" role="img" aria-labelledby="bars-t bars-d" width="100%" height="{height + 24}">',
        '<title id="bars-t">Cost per degree of freedom of each hypothesis</title>',
        f'<desc id="bars-d">{_text(told)}.</desc>',
    ]
    for value, name in [(1.0, "1"), *([(limit, f"limit {digits(limit)}")] if limit else [])]:
        x, style = _place(value, span), "zero" if name == "1" else "level"
        parts.append(f'<line class="{style}" x1="{x:.2f}%" x2="{x:.2f}%" y2="{height}"/>')
        if name != "1":
            parts.append(f'<text class="tick" x="{x:.2f}%" y="{height + 16}" text-anchor="middle">{name}</text>')
    for k, (name, value, style) in enumerate(rows):
        y, end = ROW * k, _place(value, span)
        parts.append(f'<text class="tick" x="{LEFT - 1:g}%" y="{y + 16}" text-anchor="end">{_text(name)}</text>')
        parts.append(f'<rect class="cost {style}" x="{LEFT:g}%" y="{y + 5}" width="{end - LEFT:.2f}%" height="14"/>')
        parts.append(f'<text class="tick" x="{end:.2f}%" dx="5" y="{y + 16}">{digits(value, full=True)}</text>')
    return "".join([*parts, "</svg>"])


def _place(value: float, span: tuple[float, float]) -> float:
    """Per cent of the width."""
    return LEFT + (92.0 - LEFT) * (math.log10(value) - span[0]) / (span[1] - span[0])


def ambiguity(audit: Audit) -> dict[str, Any] | None:
    """The map of which channel's fault is told from which other's, and the worst pairs of it in words."""
    found = audit.apart
    if found is None:
        return None
    names = audit.recording.channels
    rows = [(name, [_cell(float(v)) for v in found[i]]) for i, name in enumerate(names)]
    grades = [("apart-0", f"up to {GRADES[0]:g}: {WORDS[0]}")]
    grades += [(f"apart-{k}", f"above {GRADES[k - 1]:g}: {WORDS[k]}") for k in (1, 2, 3)]
    return {"names": names, "rows": rows, "grades": grades, "worst": _worst(found, names)}


def _cell(value: float) -> tuple[str, str]:
    """(style, number) of a pair."""
    if math.isnan(value):
        return "apart-none", ""
    return f"apart-{sum(value > grade for grade in GRADES)}", digits(value, 2, full=True)


def _worst(found: FloatArray, names: tuple[str, ...]) -> str:
    """The pairs that are hardest to tell apart, as a sentence."""
    pairs = {(i, j): max(found[i, j], found[j, i]) for i in range(len(names)) for j in range(i)}
    hard = sorted((p for p in pairs if pairs[p] > GRADES[1]), key=lambda p: -pairs[p])
    if not hard:
        return "This motion tells every channel of the array from every other."
    said = ", ".join(f"{names[j]} and {names[i]} ({_factor(float(pairs[i, j]))})" for i, j in hard[:4])
    more = f", and {len(hard) - 4} more pairs" if len(hard) > 4 else ""
    return f"Hardest to tell apart: {said}{more}."


def _factor(value: float) -> str:
    return f"{digits(value, 2)} times" if math.isfinite(value) else "never"


def _text(text: str) -> str:
    return escape(printable(text))
