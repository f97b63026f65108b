"""What the page's script needs to draw a chart again at any zoom: its samples, and what each curve is.

Names of channels come from files. They travel as JSON in an attribute, escaped by the template, and the script writes
them as text only.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nineaudit.array import BoolArray
from nineaudit.report.axes import time_scale
from nineaudit.report.chart import Chart
from nineaudit.report.decimate import runs
from nineaudit.report.numbers import printable, quantity
from nineaudit.report.samples import COMPUTED, RECORDED, Packed, packed, packed_time

if TYPE_CHECKING:
    from nineaudit.report.figures import Figure


@dataclass(frozen=True)
class Zoom:
    """`plot`: JSON of what is drawn; `data`: its samples; `steps`: in words, how finely they are kept."""

    plot: str
    data: tuple[Packed, ...]
    steps: str


def zoomable(figures: Iterable[Figure]) -> list[Figure]:
    """The figures, with the samples of those that the script can draw."""
    return [replace(f, zoom=zoom(f.chart)) if f.chart is not None and f.chart.zooms else f for f in figures]


def store(figures: Iterable[Figure]) -> dict[str, str]:
    """Key -> text of all samples of a page, each once."""
    return {data.key: data.text for figure in figures if figure.zoom is not None for data in figure.zoom.data}


def zoom(chart: Chart) -> Zoom:
    """The samples of a chart's time axis, curves and bands."""
    origin, one, label = time_scale(chart.time)
    time = packed_time(chart.time)
    curves = [packed(line.values, RECORDED if chart.recorded else COMPUTED) for line in chart.lines]
    edges = [(packed(b.upper, COMPUTED), packed(b.lower, COMPUTED)) for b in chart.bands]
    plot = {
        "title": printable(chart.title),
        "unit": printable(chart.unit),
        "height": chart.height,
        "time": {**_series(time), "origin": origin, "one": one, "label": label},
        "lines": [
            {**_series(data), "style": line.style, "label": printable(line.label)}
            for data, line in zip(curves, chart.lines, strict=True)
        ],
        "bands": [{"upper": _series(upper), "lower": _series(lower)} for upper, lower in edges],
        "flags": [run for flags in chart.flags for run in runs(flags.mask & np.isfinite(flags.values))],
        "shaded": [] if chart.shaded is None else runs(_mask(chart.shaded)),
        "levels": [level.value for level in chart.levels],
    }
    data = (time, *curves, *(edge for pair in edges for edge in pair))
    return Zoom(json.dumps(plot, ensure_ascii=False, separators=(",", ":")), data, _steps(chart, curves))


def _series(data: Packed) -> dict[str, Any]:
    return {"key": data.key, "size": data.size, "middle": data.middle, "step": data.step}


def _mask(mask: BoolArray) -> BoolArray:
    return np.asarray(mask, dtype=np.bool_)


def _steps(chart: Chart, curves: list[Packed]) -> str:
    """The largest rounding step of the curves, as the caption says it."""
    return quantity(max(data.step for data in curves), chart.unit, 2) if curves else ""
