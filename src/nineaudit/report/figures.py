"""The figures of a report: which curves, in which units, with which words. Drawing is svg.py's.

Signals are in the rig's unit. Every figure says in its description what a reader who cannot see it would miss.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.finding import COVERAGE_FACTOR
from nineaudit.report import mended
from nineaudit.report.chart import Band, Chart, Line
from nineaudit.report.numbers import digits, edge, quantity, sensor_edge, spelled
from nineaudit.report.svg import draw
from nineaudit.report.zoom import Zoom

if TYPE_CHECKING:
    from nineaudit.auditing import Audit
    from nineaudit.reconstruct import Reconstruction

AXES = ("x", "y", "z")
_PRODUCTS = ("ωyωz", "ωzωx", "ωxωy")
ZOOM_MARGIN = 1.5
"""Width shown on either side of a replaced interval, in widths of the interval."""
MARK_AT_MOST = 0.5
"""Share of a record up to which replaced samples count as an interval worth a closer look."""


@dataclass(frozen=True)
class Figure:
    """`svg` (safe markup), `caption`, and (style, label) of what is drawn. `chart`: what it was drawn from, `zoom`: its
    samples for the page's script; None where it is no chart over time, or the page has no script."""

    svg: str
    caption: str
    legend: tuple[tuple[str, str], ...] = ()
    label: str = ""
    note: str = ""
    chart: Chart | None = None
    zoom: Zoom | None = None


def figure(chart: Chart, caption: str, label: str = "", note: str = "") -> Figure:
    """The chart with the legend that its own curves, bands and flags give."""
    keys = [(line.style, line.label) for line in chart.lines]
    keys += [(band.style, band.label) for band in chart.bands]
    keys += [("flag", flags.label) for flags in chart.flags if flags.mask.any()]
    return Figure(draw(chart), caption, tuple(k for k in keys if k[1]), label, note, chart)


def reconstruction_figures(audit: Audit) -> list[Figure]:
    """For each rebuilt channel: measured against rebuilt with its band, the replaced interval closer, difference."""
    rebuilt = audit.reconstruction
    if rebuilt is None:
        return []
    return [f for m in range(len(rebuilt.channels)) for f in _rebuilt_channel(audit, rebuilt, m)]


def _rebuilt_channel(audit: Audit, rebuilt: Reconstruction, m: int) -> list[Figure]:
    rig, time = audit.recording.rig, audit.recording.time
    name = rebuilt.channels[m]
    unit, one = sensor_edge(rig.array[name], rig)
    measured, new, u = (a[:, m] / one for a in (rebuilt.measured, rebuilt.rebuilt, rebuilt.u))
    around, now = COVERAGE_FACTOR * u, mended.words(rebuilt)["now"]
    whole = Chart(
        key=f"rebuilt-{m}",
        title=f"{name}: measured and {now}",
        description=f"Peak measured {_peak(measured, unit)}, {now} {_peak(new, unit)}; replaced samples shaded.",
        time=time,
        unit=spelled(unit),
        lines=(Line(new, "rebuilt", now), Line(measured, "measured", "measured")),
        bands=(Band(new - around, new + around, "band", f"{now} ± 2u"),),
        shaded=rebuilt.replaced[:, m],
        height=240,
    )
    figures = [figure(whole, f"{name} as measured, its zero taken off, and as {now}; replaced samples are shaded.")]
    if (close := _closer(whole, rebuilt.interval)) is not None:
        figures.append(figure(close, f"{name}, the replaced interval closer."))
    difference = replace(
        whole,
        key=f"difference-{m}",
        title=f"{name}: measured less {now}",
        description=f"Largest difference {_peak(measured - new, unit)}.",
        lines=(Line(measured - new, "difference", f"measured − {now}"),),
        bands=(Band(-around, around, "band", f"± 2u of the {now} channel"),),
        height=130,
    )
    return [*figures, figure(difference, f"{name}, measured less {now}. Inside the band the two agree.")]


def _closer(chart: Chart, interval: tuple[float, float]) -> Chart | None:
    """The chart around `interval`; None where that is most of the record anyway or too little to draw."""
    start, end = interval
    shown = (1.0 + 2.0 * ZOOM_MARGIN) * (end - start)
    if shown > MARK_AT_MOST * (chart.time[-1] - chart.time[0]):
        return None
    reach = ZOOM_MARGIN * (end - start)
    inside = (chart.time >= start - reach) & (chart.time <= end + reach)
    if inside.sum() < 5:
        return None
    return replace(
        chart,
        key=f"closer-{chart.key}",
        zooms=False,
        title=f"{chart.title}, the replaced interval closer",
        time=chart.time[inside],
        shaded=None if chart.shaded is None else chart.shaded[inside],
        lines=tuple(replace(line, values=line.values[inside]) for line in chart.lines),
        bands=tuple(replace(b, lower=b.lower[inside], upper=b.upper[inside]) for b in chart.bands),
    )


def constraint_figures(audit: Audit) -> list[Figure]:
    """The three constraint residuals of a 3-2-2-2 array, rad/s², each with its budget ±2u."""
    if audit.constraints is None:
        return []
    figures = []
    for axis, product in enumerate(_PRODUCTS):
        values = audit.constraints[:, axis]
        bands: tuple[Band, ...] = ()
        outside = ""
        if audit.constraints_u is not None:
            budget = COVERAGE_FACTOR * audit.constraints_u[:, axis]
            bands = (Band(-budget, budget, "band", "budget ± 2u"),)
            share = float(np.mean(np.abs(values) > budget))
            outside = f"outside its budget in {digits(100.0 * share, 2)} % of the samples"
            outside = f"; {outside if share > 0 else 'inside its budget throughout'}"
        chart = Chart(
            key=f"constraint-{axis}",
            title=f"Constraint residual of {product}",
            description=f"Largest residual {_peak(values, 'rad/s^2')}{outside}.",
            time=audit.recording.time,
            unit=spelled("rad/s^2"),
            lines=(Line(values, "measured", "residual"),),
            bands=bands,
            height=120,
        )
        figures.append(figure(chart, f"{product}: largest {_peak(values, 'rad/s^2')}{outside}."))
    return figures


def motion_figures(audit: Audit) -> list[Figure]:
    """ω, α and a0 of the body as reconstructed, body axes."""
    motion = audit.motion
    if motion is None:
        return []
    rig = audit.recording.rig
    quantities = (
        ("omega", "Angular velocity ω", "rad/s", motion.omega),
        ("alpha", "Angular acceleration α", "rad/s^2", motion.alpha),
        ("a0", "Acceleration of the origin a₀", "m/s^2", motion.a0),
    )
    figures = []
    for key, title, si, values in quantities:
        unit, one = edge(si, rig)
        shown = values / one
        largest = np.linalg.norm(shown, axis=1)
        told = f"largest magnitude {_peak(largest, unit)}"
        lines = tuple(Line(shown[:, i], f"axis-{a}", a, name_at_peak=True) for i, a in enumerate(AXES))
        chart = Chart(key, title, f"Components x, y, z; {told}.", audit.recording.time, spelled(unit), lines)
        figures.append(figure(chart, f"{title}, {spelled(unit)}; {told}."))
    return figures


def _peak(values: FloatArray, unit: str) -> str:
    """The value of the largest magnitude with its sign."""
    finite = values[np.isfinite(values)]
    return quantity(float(finite[np.argmax(np.abs(finite))]), unit) if finite.size else "no valid sample"
