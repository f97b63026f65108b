"""The index of a campaign as one HTML file that needs no network: complete without script, which sorts and filters.

No curve of a recording is in it: those are in the reports that it links to. Names come from files: all is escaped.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final
from urllib.parse import quote

from nineaudit.campaign.index.index_rows import CHANNELS, DOUBLES, WORST, Index, Row, effect
from nineaudit.campaign.lake import report_name
from nineaudit.report.chart import Chart
from nineaudit.report.numbers import digits, probability, quantity
from nineaudit.report.text import fault_word

ROWS: Final = 10_000
"""Recordings in the table: the worst; how many more there are is said."""
REASON: Final = 160
"""Signs of a reason in the table."""
MARKS: Final = {"pass": "✓", "fail": "✕", "inconclusive": "?", "not_audited": "–"}


@dataclass(frozen=True)
class Section:
    """A part of the index that another module has to say: text, a table, charts over time."""

    key: str
    title: str
    text: Sequence[str] = ()
    headers: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    charts: Sequence[Chart] = field(default=())


def render(
    found: Index,
    name: str,
    *,
    said: Mapping[str, str],
    titles: Mapping[str, str],
    reports: Collection[str] = (),
    folder: str | None = None,
    sections: Sequence[Section] = (),
) -> str:
    """The page of a campaign called `name`. `said`: uri -> its worst finding; `titles`: rule -> title; `reports`: names
    of the reports that exist, below `folder` as seen from the page (None: they cannot be linked to)."""
    from nineaudit.report.page import script, template

    link = _Links(reports, folder)
    shown = found.recordings[:ROWS]
    return (
        template("campaign.html.j2").render(
            **script(("templates/campaign.js",), "templates/campaign.css"),
            name=name,
            edition=found.edition,
            total=len(found.recordings),
            hidden=len(found.recordings) - len(shown),
            marks=MARKS,
            tally=[(v, v.replace("_", " "), n, _share(n, len(found.recordings))) for v, n in found.verdicts.items()],
            worst=[_worst(row, said, link) for row in _failed(found)[:WORST]],
            rules=[(code, titles.get(code, ""), n, _share(n, len(found.recordings))) for code, n in found.rules],
            channels=[(rig, channel, n, _faults(f)) for rig, channel, n, f in found.channels[:CHANNELS]],
            doubles=[(group[0]["sha256"][:12], [row["uri"] for row in group]) for group in found.doubles[:DOUBLES]],
            more_doubles=max(len(found.doubles) - DOUBLES, 0),
            rows=[_row(row, link) for row in shown],
            choices={"rig": _choices(shown, "rig"), "fault": _choices(shown, "fault")},
            sections=[_section(one) for one in sections],
        )
        + "\n"
    )


@dataclass(frozen=True)
class _Links:
    reports: Collection[str]
    folder: str | None

    def of(self, row: Row) -> str:
        name = report_name(row["uri"], row["key"]).partition("/")[2]
        there = self.folder is not None and name in self.reports
        return quote(f"{self.folder}/{name}", safe="/.") if there else ""


def _failed(found: Index) -> list[Row]:
    return [row for row in found.recordings if row["verdict"] == "fail" and row["statistic"]]


def _row(row: Row, link: _Links) -> dict[str, Any]:
    """A recording of the table, as finished strings."""
    told = row["reason"] or ", ".join(row["rules_failed"])
    return {
        "uri": row["uri"],
        "link": link.of(row),
        "test": " ".join(part for part in (row["number"], row["item"]) if part),
        "date": row["date"].isoformat() if row["date"] else "",
        "rig": row["rig"] or "",
        "verdict": row["verdict"],
        "label": row["verdict"].replace("_", " "),
        "culprits": ", ".join(row["culprits"]),
        "fault": fault_word(row["fault"]) if row["fault"] else "",
        "statistic": digits(row["statistic"]) if row["statistic"] is not None else "",
        "value": "" if row["statistic"] is None else f"{row['statistic']:.4g}",
        "told": told if len(told) <= REASON else f"{told[:REASON]}…",
    }


def _worst(row: Row, said: Mapping[str, str], link: _Links) -> dict[str, str]:
    """One of the worst cases."""
    changed = effect(row)
    culprit = ", ".join(row["culprits"])
    sure = f", probability {probability(row['probability'])}" if row["probability"] is not None else ""
    return {
        "uri": row["uri"],
        "link": link.of(row),
        "statistic": digits(row["statistic"]),
        "diagnosis": f"{culprit}: {fault_word(row['fault'] or 'unknown')}{sure}" if culprit else row["status"] or "",
        "effect": "" if changed is None else _effect(*changed),
        "said": said.get(row["uri"], ""),
    }


def _effect(name: str, value: Mapping[str, Any]) -> str:
    after = quantity(value["after"], value["unit"])
    return f"{name} {digits(value['before'])} as recorded, {after} with the rebuilt channel"


def _choices(rows: Sequence[Row], column: str) -> list[str]:
    """What a filter offers, as the table shows it."""
    found = {row[column] for row in rows if row[column]}
    return sorted(fault_word(value) if column == "fault" else value for value in found)


def _faults(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{fault_word(fault)} {n}" for fault, n in counts.items())


def _share(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f}%" if whole else "0%"


def _section(one: Section) -> dict[str, Any]:
    from markupsafe import Markup

    from nineaudit.report.svg import draw

    charts = [{"title": c.title, "unit": c.unit, "svg": Markup(draw(c)), "lines": c.lines} for c in one.charts]
    return {
        "key": one.key,
        "title": one.title,
        "text": one.text,
        "headers": one.headers,
        "rows": one.rows,
        "charts": charts,
    }
