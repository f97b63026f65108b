"""One chart as inline SVG: complete without script, legible at any width, in the dark and in print.

Curves live in a nested <svg> that stretches with the page (strokes keep their width); words and axes are placed
in per cent and keep their size. Colours come from the style sheet through class names. All text is escaped here.
"""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.report.axes import ticks, time_scale
from nineaudit.report.chart import Band, Chart, Flags, Level, Line
from nineaudit.report.decimate import IntArray, columns_of, envelope, runs, strokes
from nineaudit.report.numbers import digits, printable

SCALE = 10
"""Drawing units a pixel: coordinates are whole numbers, exact to a tenth of a pixel."""
ROOM = 10.0
"""Bands may widen the y range by so many ranges of the curves to either side; then they leave the picture."""


@dataclass(frozen=True, eq=False)
class _Frame:
    """The mapping from data to drawing units."""

    span: tuple[float, float]
    low: float
    high: float
    chart: Chart
    column: IntArray

    def x(self, time: FloatArray) -> IntArray:
        width = (self.span[1] - self.span[0]) or 1.0
        return np.rint((time - self.span[0]) / width * self.chart.columns * SCALE).astype(np.int64)

    def y(self, values: FloatArray) -> IntArray:
        share = (self.high - values) / (self.high - self.low)
        return np.rint(np.clip(share, -1.0, 2.0) * self.chart.height * SCALE).astype(np.int64)

    def left(self, time: float) -> str:
        """Per cent of the width."""
        return f"{100.0 * (time - self.span[0]) / ((self.span[1] - self.span[0]) or 1.0):.2f}%"

    def top(self, value: float) -> str:
        """Pixels from the top."""
        return f"{float(self.y(np.array(value))) / SCALE:.1f}"


def draw(chart: Chart) -> str:
    """The chart as one <svg> element."""
    frame = _frame(chart)
    wide, tall = chart.columns * SCALE, chart.height * SCALE
    named = f'role="img" aria-labelledby="{chart.key}-t {chart.key}-d"'
    stretched = f'viewBox="0 0 {wide} {tall}" preserveAspectRatio="none"'
    parts = [
        f'<svg class="chart" {named} height="{chart.height + 26}">',
        f'<title id="{chart.key}-t">{_text(chart.title)}</title>',
        f'<desc id="{chart.key}-d">{_text(chart.description)}</desc>',
        *_axes(frame),
        f'<svg y="0" width="100%" height="{chart.height}" {stretched}>',
        *_shade(frame),
        *(_band(frame, band) for band in chart.bands),
        *(f'<path class="level" d="M0 {int(frame.y(np.array(v.value)))}h{wide}"/>' for v in _levels(frame)),
        *(_line(frame, line) for line in chart.lines),
        *(_flags(frame, flags) for flags in chart.flags),
        "</svg>",
        *_names(frame),
        "</svg>",
    ]
    return "".join(parts)


def _frame(chart: Chart) -> _Frame:
    span = float(chart.time[0]), float(chart.time[-1])
    low, high = _range(chart)
    return _Frame(span, low, high, chart, columns_of(chart.time, span, chart.columns))


def _range(chart: Chart) -> tuple[float, float]:
    """The y range: all curves and flagged samples; bands and levels only while they leave the curves legible."""
    low, high = _extent([line.values for line in chart.lines] + [f.values[f.mask] for f in chart.flags])
    room = ROOM * max(high - low, 1e-12 * max(abs(low), abs(high), 1.0))
    wanted = [v for band in chart.bands for v in (band.lower, band.upper)]
    near = 0.5 * (high - low)
    wanted.append(np.array([v.value for v in chart.levels if low - near <= v.value <= high + near]))
    below, above = _extent(wanted) if any(np.isfinite(v).any() for v in wanted) else (low, high)
    low, high = min(low, max(below, low - room)), max(high, min(above, high + room))
    pad = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
    return low - pad, high + pad


def _extent(arrays: list[FloatArray]) -> tuple[float, float]:
    finite = np.concatenate([v[np.isfinite(v)] for v in arrays]) if arrays else np.empty(0)
    return (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)


def _levels(frame: _Frame) -> list[Level]:
    return [level for level in frame.chart.levels if frame.low <= level.value <= frame.high]


def _axes(frame: _Frame) -> list[str]:
    chart, bottom = frame.chart, frame.chart.height
    parts = []
    for value, word in _up(frame):
        top = frame.top(value)
        parts.append(f'<line class="{"zero" if word == "0" else "grid"}" x2="100%" y1="{top}" y2="{top}"/>')
        parts.append(f'<text class="tick" x="-8" y="{top}" dy=".35em" text-anchor="end">{word}</text>')
    label, across = _across(frame)
    for value, word in across:
        left = frame.left(value)
        parts.append(f'<line class="grid" x1="{left}" x2="{left}" y2="{bottom}"/>')
        anchor = "end" if value > frame.span[1] - 0.03 * (frame.span[1] - frame.span[0]) else "middle"
        place = f'x="{left}" y="{bottom + 15}" text-anchor="{anchor}"'
        parts.append(f'<text class="tick" {place}>{word}</text>')
    parts.append(f'<text class="unit" x="-8" y="-9" text-anchor="end">{_text(chart.unit)}</text>')
    parts.append(f'<text class="unit" x="100%" y="{bottom + 30}" text-anchor="end">{_text(label)}</text>')
    return parts


def _up(frame: _Frame) -> list[tuple[float, str]]:
    """(value, word) of the ticks of the y axis."""
    if frame.chart.up:
        return [(v, _text(word)) for v, word in frame.chart.up if frame.low <= v <= frame.high]
    return [(v, digits(v, 6)) for v in ticks(frame.low, frame.high, frame.chart.height // 26)]


def _across(frame: _Frame) -> tuple[str, list[tuple[float, str]]]:
    """Label of the x axis, and (value, word) of its ticks."""
    chart, (start, end) = frame.chart, frame.span
    if chart.across:
        return chart.across_label, [(v, _text(word)) for v, word in chart.across if start <= v <= end]
    origin, one, label = time_scale(chart.time)
    found = ticks((start - origin) / one, (end - origin) / one, 6)
    return label, [(v * one + origin, digits(v, 6)) for v in found]


def _line(frame: _Frame, line: Line) -> str:
    x, y = frame.x(frame.chart.time), frame.y(np.where(np.isfinite(line.values), line.values, 0.0))
    clock = np.arange(len(x), dtype=float) if frame.chart.across else frame.chart.time
    pieces = [_stroke(x[i], y[i]) for i in strokes(clock, line.values, frame.column)]
    return f'<path class="line {line.style}" d="{"".join(pieces)}"/>' if pieces else ""


def _stroke(x: IntArray, y: IntArray) -> str:
    """Relative path through whole-number points; a lone point is a stroke of no length with round caps."""
    steps = zip(np.diff(x).tolist(), np.diff(y).tolist(), strict=True)
    return f"M{x[0]} {y[0]}l" + (" ".join(f"{dx} {dy}" for dx, dy in steps) or "0 0")


def _band(frame: _Frame, band: Band) -> str:
    pieces = []
    for column, low, high in envelope(band.lower, band.upper, frame.column):
        x = column * SCALE + SCALE // 2
        there = [f"{a} {b}" for a, b in zip(x.tolist(), frame.y(high).tolist(), strict=True)]
        back = [f"{a} {b}" for a, b in zip(x[::-1].tolist(), frame.y(low)[::-1].tolist(), strict=True)]
        pieces.append(f"M{'L'.join(there + back)}z")
    return f'<path class="{band.style}" d="{"".join(pieces)}"/>' if pieces else ""


def _shade(frame: _Frame) -> list[str]:
    if frame.chart.shaded is None:
        return []
    height = frame.chart.height * SCALE
    stretches = _stretches(frame, frame.chart.shaded)
    return [f'<rect class="span" x="{x}" width="{w}" height="{height}"/>' for x, w in stretches]


def _stretches(frame: _Frame, mask: BoolArray) -> list[tuple[int, int]]:
    """(start, width) of the runs of pixel columns that hold a sample where `mask` (n,)."""
    hit = np.zeros(frame.chart.columns, dtype=np.bool_)
    hit[frame.column[mask]] = True
    if mask.size < frame.chart.columns:  # fewer samples than columns: neighbours belong together
        for first, last in runs(mask):
            hit[frame.column[first] : frame.column[last] + 1] = True
    return [(a * SCALE, (b - a + 1) * SCALE) for a, b in runs(hit)]


def _flags(frame: _Frame, flags: Flags) -> str:
    """Every flagged sample as a dot (those on one pixel once), and a rug of their times along the time axis."""
    at = np.flatnonzero(flags.mask & np.isfinite(flags.values))
    points = np.stack([frame.x(frame.chart.time)[at], frame.y(flags.values[at])], axis=1) // SCALE * SCALE
    dots = "".join(f"M{x} {y}h0" for x, y in np.unique(points, axis=0).tolist())
    rug = "".join(f"M{start} 0h{width}" for start, width in _stretches(frame, flags.mask))
    y = frame.chart.height * SCALE - 2 * SCALE
    return f'<path class="flag" d="{dots}"/><path class="rug" transform="translate(0 {y})" d="{rug}"/>'


def _names(frame: _Frame) -> list[str]:
    """Names of the levels at the right, and of the curves at their peaks, so that colour is not needed."""
    parts = [
        f'<text class="level-name" x="100%" dx="-4" y="{frame.top(v.value)}" dy="-4" text-anchor="end">'
        f"{_text(v.label)}</text>"
        for v in _levels(frame)
    ]
    for line in frame.chart.lines:
        size = np.where(np.isfinite(line.values), np.abs(line.values), -1.0)
        peak = int(np.argmax(size))
        if line.name_at_peak and size[peak] > 0.0:
            value = float(line.values[peak])
            where = f'x="{frame.left(float(frame.chart.time[peak]))}" y="{frame.top(value)}"'
            dy = "-5" if value > 0 else "13"
            side = 'dx="-6" text-anchor="end"' if peak > 0.9 * size.size else 'dx="6"'
            parts.append(f'<text class="name {line.style}" {where} dy="{dy}" {side}>{_text(line.label)}</text>')
    return parts


def _text(text: str) -> str:
    return escape(printable(text))
