"""A budget in words and columns: what the command line and the page show. Every number is formatted here."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from nineaudit.array import Sensor
from nineaudit.budgets.ambiguity import Groups
from nineaudit.budgets.compute import Budget, Line, Rows
from nineaudit.estimate.at_their_word import total
from nineaudit.estimate.calibration import SOURCES
from nineaudit.units import display

_SPELLED = {"rad/s^2": "rad/s²", "g_0": "g", "g_0^2.5 s": "", "1": ""}
_ROWS = (*SOURCES, "noise")
NOTHING = "–"


@dataclass(frozen=True)
class Table:
    """A `title`, a sentence on how to read it, and cells of text; the first column is what a row is of."""

    title: str
    about: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def tables(budget: Budget) -> tuple[Table, ...]:
    """Every table of a budget, in the order in which it is read."""
    word, fit, helps = _at_their_word(budget), _fit(budget), _changes(budget)
    return tuple(t for t in (word, fit, helps, _proof(budget)) if t.rows)


def notes(budget: Budget) -> list[str]:
    """What must be known to read the numbers."""
    blocks, rig = budget.case.condensed, budget.rig
    out = [f"standard uncertainties (k = 1) of {len(blocks.time)} block means of {blocks.length} samples"]
    unstated = [s for s in rig.array.sensors if s.noise is None]
    if unstated:
        level = ", ".join(sorted({display(n, _unit(s.kind), rig.units) for s, n in _noise(budget)}))
        out.append(
            f"the rig states no noise for {', '.join(s.channel for s in unstated)}: taken from the record, {level}"
        )
    if budget.word is None:
        out.append("no product-free angular acceleration and no rate sensors on three axes: only the whole-record fit")
    if budget.smoothed is None:
        out.append("the accelerometers do not span α, which is differentiated from the rates: no whole-record fit")
    if budget.filter_note is not None:
        out.append(budget.filter_note)
    bent = [line.name for line in budget.lines if not line.linear]
    if bent:
        out.append(
            f"not linear (*): {', '.join(bent)}; there the Monte Carlo value and bias hold, not the root sum of squares"
        )
    return out


def lines(budget: Budget) -> Iterator[str]:
    """The whole budget as text."""
    yield f"{budget.rig.name}: budget of {budget.subject}"
    yield from (f"  {note}" for note in notes(budget))
    for table in tables(budget):
        yield ""
        yield f"{table.title}: {table.about}"
        widths = [max(len(row[i]) for row in (table.columns, *table.rows)) for i in range(len(table.columns))]
        yield from (_padded(row, widths) for row in (table.columns, *table.rows))


def _padded(cells: Sequence[str], widths: Sequence[int]) -> str:
    first, *rest = zip(cells, widths, strict=True)
    return "  " + "  ".join([first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in rest)]).rstrip()


def _noise(budget: Budget) -> list[tuple[Sensor, float]]:
    sigma = budget.case.sigma
    return [(s, float(sigma[i])) for i, s in enumerate(budget.rig.array.sensors) if s.noise is None]


def _unit(kind: str) -> str:
    return "m/s^2" if kind == "accelerometer" else "rad/s"


def number(value: float) -> str:
    """Three digits, and no power of ten where it can be helped."""
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e7 else f"{value:.3g}"


def quantity(line: Line) -> str:
    """``peak α, rad/s²``"""
    unit = _SPELLED.get(line.unit, line.unit)
    return f"{line.name}, {unit}" if unit else line.name


def _cells(rows: Rows) -> tuple[str, ...]:
    return (*(number(rows[source]) for source in _ROWS), number(total(rows)))


def _at_their_word(budget: Budget) -> Table:
    rows = []
    for line in budget.lines:
        if line.at_their_word is not None and line.scatter is not None:
            name = quantity(line) + ("" if line.linear else " *")
            found = (number(line.scatter.sd), f"{line.scatter.bias:+.2g}")
            rows.append((name, number(line.value), *_cells(line.at_their_word), *found))
    about = f"root sum of squares, and Monte Carlo of {budget.draws} instruments"
    columns = ("output", "value", *_ROWS, "RSS", "MC", "bias")
    return Table("Channels taken at their word", about, columns, tuple(rows))


def _fit(budget: Budget) -> Table:
    rows = [(quantity(line), *_cells(line.fit)) for line in budget.lines if line.fit is not None]
    about = "covariance of the smoother, which holds channels against each other"
    return Table("Through the whole-record fit", about, ("output", *_ROWS, "u"), tuple(rows))


def _changes(budget: Budget) -> Table:
    rows = [(c.name, f"{c.mean:.0%}", *(f"{ratio:.0%}" for ratio in c.ratios)) for c in budget.changes]
    about = "uncertainty over the present one, best first"
    if budget.smoothed is None:
        about += " (channels taken at their word)"
    columns = ("change", "mean", *(line.name for line in budget.lines))
    return Table("What would help most", about, columns, tuple(rows))


def _proof(budget: Budget) -> Table:
    rows = [(motion, *said(groups, len(budget.rig.array))) for motion, groups in budget.groups.items()]
    about = "faults that no calibration or motion explains away, by the kind of motion"
    return Table(
        "What the layout can prove", about, ("motion", "never seen", "never told apart", "only faintly"), tuple(rows)
    )


def said(groups: Groups, count: int) -> tuple[str, str, str]:
    """Faults that are never seen, pairs that are never told apart, and those that are only faintly."""
    hidden = "every channel" if len(groups.hidden) == count else " ".join(groups.hidden) or "none"
    never = [" = ".join(pair) for pair in groups.pairs]
    if groups.cannot:
        never.append(f"{' '.join(groups.cannot)} (cannot be left out)")
    if len(groups.hidden) == count:
        never = [NOTHING]
    return hidden, ", ".join(never) or "none", ", ".join(" = ".join(pair) for pair in groups.faint) or "none"
