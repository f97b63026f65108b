"""A comparison of schemes as lines of text and as a page, in the rig's units."""

from __future__ import annotations

from typing import Any

import numpy as np

from nineaudit.comparison import EXPLAINED, Comparison, Row
from nineaudit.recording import Recording
from nineaudit.report.chart import Chart, Line
from nineaudit.report.figures import Figure, figure
from nineaudit.report.numbers import digits, edge, spelled
from nineaudit.report.page import ZOOMS, script, template
from nineaudit.report.scheme_styles import classes, css, groups
from nineaudit.report.zoom import store, zoomable
from nineaudit.units import counted

HEADERS = (
    "scheme", "curve", "unit", "r", "r 2.5 ms", "ISO 18571", "grade", "peak", "difference", "U", "ratio", "budget",
)  # fmt: skip
_NAMES = {"alpha": "α", "omega": "ω", "a0": "a(origin)"}


def cells(row: Row, recording: Recording) -> tuple[str, ...]:
    """One row as strings, in the order of HEADERS; U is the expanded uncertainty of the difference, k = 2, rms."""
    unit, one = edge(row.unit, recording.rig)
    rated = row.rating
    sizes = (row.peak / one, row.difference / one, 2.0 * row.u / one)
    return (
        row.scheme,
        f"{_NAMES.get(row.quantity, row.quantity)} {row.axis}",
        spelled(unit),
        f"{row.pearson:.4f}" if np.isfinite(row.pearson) else digits(None),
        f"{row.lowest:.2f}" if np.isfinite(row.lowest) else digits(None),
        digits(None) if rated is None else f"{rated.overall:.3f}",
        digits(None) if rated is None else rated.grade,
        *(digits(size) for size in sizes),
        digits(row.ratio, 2),
        "explains it" if row.explained else "exceeded",
    )


def lines(comparison: Comparison, recording: Recording) -> list[str]:
    """The table with its heading, and the schemes that do not run with the reason."""
    table = [HEADERS, *(cells(row, recording) for row in comparison.rows)]
    widths = [max(len(line[i]) for line in table) for i in range(len(HEADERS))]
    out = [_heading(comparison, recording)]
    out += ["  ".join(f"{c:<{w}}" for c, w in zip(line, widths, strict=True)).rstrip() for line in table]
    out += comparison.remarks
    return out + [f"not run: {name}: {reason}" for name, reason in comparison.refused.items()]


def _heading(comparison: Comparison, recording: Recording) -> str:
    beyond = sum(not row.explained for row in comparison.rows)
    verdict = f"{beyond} of {len(comparison.rows)} differences exceed" if beyond else "every difference is within"
    return (
        f"{recording.source.path}: {counted(len(comparison.curves), 'scheme')}, against {comparison.reference} "
        f"({comparison.methods[comparison.reference]}); {verdict} {EXPLAINED:g} times what the rig's uncertainties "
        f"explain ({counted(comparison.draws, 'draw')} of the instrument; "
        f"{comparison.filter})"
    )


def render(comparison: Comparison, recording: Recording) -> str:
    """The page: the same table, and the curves of all schemes over each other."""
    drawn = zoomable(figures(comparison, recording))
    context: dict[str, Any] = script(ZOOMS, more=css()) | {
        "name": recording.source.path.name,
        "rig": recording.rig.name,
        "sentence": _heading(comparison, recording),
        "reference": comparison.reference,
        "remarks": comparison.remarks,
        "methods": list(comparison.methods.items()),
        "headers": HEADERS,
        "rows": [(row.explained, cells(row, recording)) for row in comparison.rows],
        "refused": list(comparison.refused.items()),
        "figures": drawn,
        "store": store(drawn),
    }
    return template("comparison.html.j2").render(context) + "\n"


def figures(comparison: Comparison, recording: Recording) -> list[Figure]:
    """Figures for each component of each quantity, a family of schemes over the reference, which is broad."""
    parts = groups(name for name in comparison.curves if name != comparison.reference)
    units = {row.quantity: row.unit for row in comparison.rows}
    return [
        _figure(comparison, recording, (quantity, axis, part), group, units[quantity])
        for quantity in comparison.curves[comparison.reference]
        for axis in range(3)
        for part, group in enumerate(parts, 1)
    ]


def _figure(
    comparison: Comparison, recording: Recording, which: tuple[str, int, int], names: list[str], si: str
) -> Figure:
    (quantity, axis, part), (unit, one) = which, edge(si, recording.rig)
    drawn = tuple(
        Line(comparison.curves[name][quantity][:, axis] / one, classes(name, name == comparison.reference), name)
        for name in (comparison.reference, *names)
    )
    title = f"{_NAMES.get(quantity, quantity)}, {'xyz'[axis]}"
    peak = f"peak of {comparison.reference} {digits(float(np.abs(drawn[0].values).max()))} {spelled(unit)}"
    told = f"{', '.join(line.label for line in drawn)}; {peak}."
    chart = Chart(f"{_key(quantity)}-{axis}-{part}", title, told, comparison.time, spelled(unit), drawn)
    return figure(chart, f"{title}, {spelled(unit)}; {peak}.")


def _key(quantity: str) -> str:
    return "".join(c if c.isalnum() and c.isascii() else f"-{ord(c):x}-" for c in quantity)
