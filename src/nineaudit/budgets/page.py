"""A budget as one HTML file that needs no network: tables, and the uncertainty over time by source."""

from __future__ import annotations

from nineaudit.array import FloatArray
from nineaudit.budgets.compute import Budget
from nineaudit.budgets.text import notes, tables
from nineaudit.report.chart import Chart, Line
from nineaudit.report.figures import Figure, figure
from nineaudit.report.page import ZOOMS, script, template
from nineaudit.report.zoom import store, zoomable

_QUANTITIES = {
    "α": ("angular acceleration", "rad/s²"),
    "ω": ("angular rate", "rad/s"),
    "a": ("acceleration", "g"),
}
_STYLES = ("rebuilt", "axis-x", "axis-y")


def render(budget: Budget) -> str:
    """The page."""
    drawn = zoomable(figures(budget))
    return template("budget.html.j2").render(
        **script(ZOOMS),
        name=budget.rig.name,
        subject=budget.subject,
        notes=notes(budget),
        tables=tables(budget),
        way=_way(budget),
        figures=drawn,
        store=store(drawn),
    )


def figures(budget: Budget) -> list[Figure]:
    """The charts with their captions and legends."""
    return [figure(chart, f"{chart.title}, {chart.unit}") for chart in charts(budget)]


def charts(budget: Budget) -> list[Chart]:
    """For α, ω and a: the total over time, and its two largest sources."""
    found = budget.over_time
    return [_chart(kind, found.time, rows, _way(budget)) for kind, rows in found.curves.items()]


def _way(budget: Budget) -> str:
    return "channels taken at their word" if budget.way is budget.word else "through the whole-record fit"


def _chart(kind: str, time: FloatArray, rows: dict[str, FloatArray], way: str) -> Chart:
    title, unit = _QUANTITIES[kind]
    whole = sum(curve**2 for curve in rows.values()) ** 0.5
    largest = sorted(rows, key=lambda source: -float((rows[source] ** 2).sum()))[:2]
    curves = [("all sources", whole), *((source, rows[source]) for source in largest)]
    lines = tuple(Line(curve, look, name) for look, (name, curve) in zip(_STYLES, curves, strict=True))
    said = (
        f"Standard uncertainty of the {title} over time, {way}: all sources together, {largest[0]}, and {largest[1]}."
    )
    return Chart(f"u-{('alpha', 'omega', 'a')['αωa'.index(kind)]}", f"Uncertainty of {title}", said, time, unit, lines)
