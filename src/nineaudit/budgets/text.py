"""A budget in words and columns: what the command line and the page show. Every number is formatted here."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from nineaudit.array import Sensor
from nineaudit.budgets.ambiguity import Groups
from nineaudit.budgets.compute import Budget, Line
from nineaudit.estimate.at_their_word import spans
from nineaudit.estimate.budget import ROWS, Rows, total
from nineaudit.units import display

_SPELLED = {"rad/s^2": "rad/s²", "g_0": "g", "g_0^2.5 s": "", "1": ""}
NOTHING = "–"
NEGLIGIBLE = 1e-3
"""Part of the uncertainty under which a source is shown as 0: it changes no third digit."""
_OPTIONAL = ("quantisation", "filters")
"""Columns that are left out, with a note, where there is no such error."""


@dataclass(frozen=True)
class Table:
    """A `title`, a sentence on how to read it, and cells of text; the first column is what a row is of. Numbers stand
    to the right, `words` to the left."""

    title: str
    about: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: bool = False


def tables(budget: Budget) -> tuple[Table, ...]:
    """Every table of a budget, in the order in which it is read."""
    found = (_short(budget), _at_their_word(budget), _fit(budget), _changes(budget), _proof(budget))
    return tuple(t for t in found if t.rows)


def notes(budget: Budget) -> list[str]:
    """What must be known to read the numbers."""
    blocks, rig = budget.blocks, budget.rig
    out = [f"standard uncertainties (k = 1) of {len(blocks.time)} block means of {blocks.length} samples"]
    unstated = [s for s in rig.array.sensors if s.noise is None]
    if unstated:
        level = ", ".join(sorted({display(n, _unit(s.kind), rig.units) for s, n in _noise(budget)}))
        out.append(
            f"the rig states no noise for {', '.join(s.channel for s in unstated)}: taken from the record, {level}"
        )
    return [*out, *_on_the_way(budget), *_on_filters(budget), *_on_bent(budget)]


def _on_the_way(budget: Budget) -> Iterator[str]:
    if budget.word is None:
        yield "no rest is known from which ω could be integrated: no channels at their word, only the whole-record fit"
    elif budget.fed_back:
        yield (
            "α of these accelerometers needs ω: at their word, ω is fed back from rest and errors grow with the angle"
            " turned; the fit does not"
        )
    if not budget.tells_acceleration:
        yield "no acceleration, HIC: it takes accelerometers on three axes"
    if not spans(budget.array):
        yield (
            "the accelerometers do not span α: it is differentiated from the rates, or taken from their whole-record"
            " smoother, which learns from the record how fast α changes"
        )


def _on_filters(budget: Budget) -> Iterator[str]:
    beyond = budget.beyond
    if not _counts(budget, "quantisation"):
        yield "quantisation: nothing to count, neither rig (resolution) nor recording shows a step that matters"
    if not beyond.mismatch.any():
        yield "filters: nothing to count, all channels are behind the same"
    else:
        most = max(set(beyond.classes), key=beyond.classes.count)
        others = [f"{c} ({_class(f)})" for c, f in zip(budget.array.channels, beyond.classes, strict=True) if f != most]
        yield f"filters: {', '.join(others)} not behind {_class(most)} as the others are"
    if budget.filter_note is not None:
        yield budget.filter_note


def _class(value: float | None) -> str:
    return "no filter" if value is None else f"CFC{value:g}"


def _on_bent(budget: Budget) -> Iterator[str]:
    bent = [line.name for line in budget.lines if not line.linear]
    if bent:
        yield (
            f"not linear (*): {', '.join(bent)}; there the Monte Carlo value and bias hold, not the root sum of squares"
        )


def lines(budget: Budget) -> Iterator[str]:
    """The whole budget as text."""
    yield f"{budget.rig.name}: budget of {budget.subject}"
    yield from (f"  {note}" for note in notes(budget))
    for table in tables(budget):
        yield ""
        yield f"{table.title}: {table.about}"
        widths = [max(len(row[i]) for row in (table.columns, *table.rows)) for i in range(len(table.columns))]
        yield from (_padded(row, widths, table.words) for row in (table.columns, *table.rows))


def _padded(cells: Sequence[str], widths: Sequence[int], words: bool) -> str:
    first, *rest = zip(cells, widths, strict=True)
    shown = [cell.ljust(width) if words else cell.rjust(width) for cell, width in rest]
    return ("  " + "  ".join([first[0].ljust(first[1]), *shown])).rstrip()


def _noise(budget: Budget) -> list[tuple[Sensor, float]]:
    sigma = budget.case.sigma
    return [(s, float(sigma[i])) for i, s in enumerate(budget.rig.array.sensors) if s.noise is None]


def _unit(kind: str) -> str:
    return "m/s^2" if kind == "accelerometer" else "rad/s"


def number(value: float) -> str:
    """Three digits, and no power of ten where it can be helped."""
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e7 else f"{value:.3g}"


def _signed(value: float) -> str:
    return f"{value:+.0f}" if abs(value) >= 100.0 else f"{value:+.2g}"


def quantity(line: Line) -> str:
    """``peak α, rad/s²``"""
    unit = _SPELLED.get(line.unit, line.unit)
    return f"{line.name}, {unit}" if unit else line.name


def _shown(budget: Budget) -> tuple[str, ...]:
    return tuple(source for source in ROWS if source not in _OPTIONAL or _counts(budget, source))


def _counts(budget: Budget, source: str) -> bool:
    """Whether a source adds to any output."""
    found = [rows for line in budget.lines for rows in (line.at_their_word, line.fit) if rows is not None]
    return any(rows[source] >= NEGLIGIBLE * total(rows) for rows in found if total(rows) > 0.0)


def _cells(rows: Rows, shown: Sequence[str]) -> tuple[str, ...]:
    least = NEGLIGIBLE * total(rows)
    return (*("0" if rows[source] < least else number(rows[source]) for source in shown), number(total(rows)))


def _short(budget: Budget) -> Table:
    rows = [_summary(line) for line in budget.lines]
    about = "expanded uncertainty U, k = 2, and what most of it comes from"
    columns = ("output", "value", "U at word", "most of it", "U by fit", "of value", "most of it")
    return Table("In short", about, columns, tuple(rows))


def _summary(line: Line) -> tuple[str, ...]:
    word = line.at_their_word
    at_word = (NOTHING, NOTHING) if word is None else (number(2.0 * total(word)), max(word, key=lambda s: word[s]))
    u = 2.0 * total(line.fit)
    part = f"{u / line.value:.1%}" if line.value > u else "> 100%"
    return (quantity(line), number(line.value), *at_word, number(u), part, max(line.fit, key=lambda s: line.fit[s]))


def _at_their_word(budget: Budget) -> Table:
    rows, shown = [], _shown(budget)
    for line in budget.lines:
        if line.at_their_word is not None and line.scatter is not None:
            name, found = quantity(line) + ("" if line.linear else " *"), line.scatter
            away = not np.isfinite(found.sd)
            drawn = ("runs away", NOTHING) if away else (number(found.sd), _signed(found.bias))
            rows.append((name, number(line.value), *_cells(line.at_their_word, shown), *drawn))
    about = f"by source, their root sum of squares RSS, and Monte Carlo MC of {budget.draws} instruments with its bias"
    columns = ("output", "value", *shown, "RSS", "MC", "bias")
    return Table("Channels taken at their word", about, columns, tuple(rows))


def _fit(budget: Budget) -> Table:
    shown = _shown(budget)
    rows = [(quantity(line), *_cells(line.fit, shown)) for line in budget.lines]
    columns = ("output", *shown, "u")
    if not spans(budget.array):
        about = "by source; integration is the smoothing itself, which `nineaudit motion --method rates` does not do"
        return Table("Through the smoother of the rates", about, columns, tuple(rows))
    about = "by source, covariance of the smoother, which holds channels against each other"
    return Table("Through the whole-record fit", about, columns, tuple(rows))


def _changes(budget: Budget) -> Table:
    rows = [(c.name, f"{c.mean:.0%}", *(f"{ratio:.0%}" for ratio in c.ratios)) for c in budget.changes]
    way = "the smoother of the rates" if not spans(budget.array) else "the whole-record fit"
    about = f"uncertainty by {way} over the present one, best first"
    columns = ("change", "mean", *(line.name for line in budget.lines))
    return Table("What would help most", about, columns, tuple(rows))


def _proof(budget: Budget) -> Table:
    rows = [(motion, *said(groups, len(budget.array))) for motion, groups in budget.groups.items()]
    about = "whose fault the other channels show, and whose cannot be told apart (=), by the kind of motion"
    columns = (
        "motion",
        "fault never seen in",
        "never told apart",
        "told apart if ten times as large",
        "no motion without",
    )
    keep = [i for i in range(len(columns)) if i < 3 or any(row[i] != "none" for row in rows)]
    cut = tuple(tuple(row[i] for i in keep) for row in rows)
    return Table("What the layout can prove", about, tuple(columns[i] for i in keep), cut, words=True)


def said(groups: Groups, count: int) -> tuple[str, str, str, str]:
    """Channels whose faults are never seen, groups that are never told apart, those that are only faintly, and channels
    without which the others do not tell the motion, so that they cannot be repaired."""
    if len(groups.hidden) == count:
        return "every channel", NOTHING, "none", "none"
    return (
        " ".join(groups.hidden) or "none",
        ", ".join(" = ".join(group) for group in merged(groups.pairs)) or "none",
        ", ".join(" = ".join(group) for group in merged(groups.faint)) or "none",
        " ".join(groups.cannot) or "none",
    )


def merged(pairs: Sequence[tuple[str, str]]) -> list[tuple[str, ...]]:
    """Pairs as the largest groups of which every two are a pair."""
    left, out = set(pairs), []
    for pair in pairs:
        if pair not in left:
            continue
        group = list(pair)
        for name in sorted({n for p in pairs for n in p} - set(pair)):
            if all((min(name, g), max(name, g)) in {(min(p), max(p)) for p in pairs} for g in group):
                group.append(name)
        left -= {p for p in pairs if p[0] in group and p[1] in group}
        out.append(tuple(sorted(group)))
    return out
