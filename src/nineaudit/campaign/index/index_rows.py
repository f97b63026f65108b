"""What the index of a campaign says, from its tables: counts, recordings the worst first, rules, channels, doubles.

Columns that are read are few and short: a campaign of 100,000 recordings fits into memory.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from nineaudit.campaign.results.compact import Stored

Row = Mapping[str, Any]
VERDICTS: Final = ("fail", "not_audited", "inconclusive", "pass")
"""The weightiest first."""
COLUMNS: Final = (
    "uri", "key", "verdict", "reason", "status", "culprits", "fault", "probability", "statistic", "rules_failed",
    "number", "item", "date", "rig", "sha256", "impact",
)  # fmt: skip
WORST, CHANNELS, DOUBLES = 12, 20, 50
"""Rows of the tables of worst cases, channels and doubles."""


@dataclass(frozen=True)
class Index:
    """`recordings` of the campaign, the worst first, and what they come to: `verdicts`, `rules` (code, recordings that
    fail it), `channels` ((rig, channel), recordings, faults), `doubles` (recordings of equal content)."""

    edition: str
    recordings: Sequence[Row]
    verdicts: Mapping[str, int]
    rules: Sequence[tuple[str, int]]
    channels: Sequence[tuple[str, str, int, Mapping[str, int]]]
    doubles: Sequence[tuple[Row, ...]]


def index(stored: Stored) -> Index:
    """Read the index of a campaign from its tables."""
    table = stored.tables["recordings"].to_table(columns=list(COLUMNS))
    rows = sorted(table.to_pylist(maps_as_pydicts="strict"), key=weight)
    counts = Counter(row["verdict"] for row in rows)
    failed = Counter(rule for row in rows for rule in row["rules_failed"])
    return Index(
        stored.edition,
        rows,
        {verdict: counts[verdict] for verdict in VERDICTS if counts[verdict]},
        sorted(failed.items(), key=lambda item: (-item[1], item[0])),
        _channels(rows),
        _doubles(rows),
    )


def weight(row: Row) -> tuple[int, float, str]:
    """The order of the index: by verdict, then by how far the channels contradict each other, then by name."""
    return VERDICTS.index(row["verdict"]), -(row["statistic"] or 0.0), row["uri"]


def reasons(stored: Stored, rows: Iterable[Row]) -> dict[str, str]:
    """uri -> what its failed finding of the largest excess over its limit says."""
    import pyarrow.compute as pc

    uris = [row["uri"] for row in rows]
    wanted = (pc.field("verdict") == "fail") & pc.field("uri").isin(uris)
    columns = ["uri", "rule", "channels", "value", "limit_value", "reason"]
    found = stored.tables["findings"].to_table(columns=columns, filter=wanted).to_pylist()
    said: dict[str, str] = {}
    for finding in sorted(found, key=lambda f: (-_excess(f), f["rule"])):
        named = " ".join(part for part in (finding["rule"], ", ".join(finding["channels"])) if part)
        said.setdefault(finding["uri"], f"{named}: {finding['reason']}")
    return said


def effect(row: Row) -> tuple[str, Mapping[str, Any]] | None:
    """The reported value that the fault changes most, by the share of the value after the repair; None without."""
    known = {
        name: value
        for name, value in (row["impact"] or {}).items()
        if value["before"] is not None and value["after"] not in (None, 0.0)
    }
    if not known:
        return None
    return max(known.items(), key=lambda item: (abs(item[1]["before"] / item[1]["after"] - 1.0), item[0]))


def _excess(finding: Row) -> float:
    value, limit = finding["value"], finding["limit_value"]
    if value is None or limit is None:
        return 0.0
    return float("inf") if limit == 0 else abs(value / limit)


def _channels(rows: Sequence[Row]) -> list[tuple[str, str, int, Mapping[str, int]]]:
    """(rig, channel, recordings in which it alone or in a swap is at fault, faults), the most frequent first."""
    found: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    for row in rows:
        if row["status"] == "isolated":
            for channel in row["culprits"]:
                found[row["rig"] or "", channel][row["fault"] or "unknown"] += 1
    ranked = sorted(found.items(), key=lambda item: (-item[1].total(), item[0]))
    return [(rig, channel, faults.total(), dict(faults.most_common())) for (rig, channel), faults in ranked]


def _doubles(rows: Sequence[Row]) -> list[tuple[Row, ...]]:
    """Recordings of equal content, in the order of their names, the largest group first."""
    same: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        if row["sha256"]:
            same[row["sha256"]].append(row)
    groups = [tuple(sorted(group, key=lambda row: row["uri"])) for group in same.values() if len(group) > 1]
    return sorted(groups, key=lambda group: (-len(group), group[0]["uri"]))
