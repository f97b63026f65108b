"""A comparison as data: ``nineaudit/comparison/1``. Numbers are in the rig's units, NaN and infinity are null."""

from __future__ import annotations

from typing import Any, Final

from nineaudit.auditing import versions
from nineaudit.comparison import EXPLAINED, Comparison, Row
from nineaudit.finding import COVERAGE_FACTOR
from nineaudit.recording import Recording
from nineaudit.report.numbers import edge, plain
from nineaudit.rig import Rig

SCHEMA: Final = "nineaudit/comparison/1"


def document(comparison: Comparison, recording: Recording) -> dict[str, Any]:
    """What ran by which method, what did not and why, and every curve against the reference.

    `u` of a difference is its root mean square standard uncertainty from the rig's uncertainties, `U` = k u, `ratio`
    that of the rms difference to u; `explained` where it is at most `explained_up_to`.
    """
    source = recording.source
    return {
        "schema": SCHEMA,
        "tool": versions(),
        "recording": {
            "path": source.path.as_posix(),
            "sha256": source.sha256,
            "samples": len(recording.time),
            "rate_hz": plain(recording.rate),
        },
        "rig": {"name": recording.rig.name, "sha256": recording.rig.sha256},
        "reference": comparison.reference,
        "filter": comparison.filter,
        "filter_class": None if comparison.cfc is None else f"CFC{comparison.cfc:g}",
        "compared": {"samples": len(comparison.time), "rate_hz": plain(comparison.rate)},
        "draws": comparison.draws,
        "k": int(COVERAGE_FACTOR),
        "explained_up_to": EXPLAINED,
        "schemes": dict(comparison.methods),
        "not_run": dict(comparison.refused),
        "differences": [_difference(row, recording.rig) for row in comparison.rows],
        "remarks": list(comparison.remarks),
    }


def _difference(row: Row, rig: Rig) -> dict[str, Any]:
    unit, one = edge(row.unit, rig)
    rated = row.rating
    return {
        "scheme": row.scheme,
        "quantity": row.quantity,
        "axis": row.axis,
        "unit": unit,
        "pearson": plain(row.pearson),
        "pearson_lowest_2_5_ms": plain(row.lowest),
        "iso_18571": None if rated is None else plain(rated._asdict()) | {"grade": rated.grade},
        "reference_peak": plain(row.peak / one),
        "largest_difference": plain(row.difference / one),
        "u": plain(row.u / one),
        "U": plain(COVERAGE_FACTOR * row.u / one),
        "ratio": plain(row.ratio),
        "explained": row.explained,
    }
