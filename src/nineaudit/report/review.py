"""The reviewer's form: what is filled in after the audit, on screen or on paper. Its export names what was reviewed."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from nineaudit.report.origin import number
from nineaudit.report.tested import filled_in

if TYPE_CHECKING:
    from nineaudit.auditing import Audit

DECISIONS = (
    ("", "not decided"),
    ("accepted", "accepted as recorded"),
    ("accepted with repair", "accepted with the rebuilt channel"),
    ("accepted with deviation", "accepted with the deviation described below"),
    ("rejected", "rejected"),
)
FIELDS = (
    ("test", "Test number"),
    ("item", "Test item and its serial number"),
    ("tested_on", "Date of the test, YYYY-MM-DD"),
    ("laboratory", "Laboratory"),
    ("reviewer", "Reviewer"),
    ("reviewed_on", "Date of the review, YYYY-MM-DD"),
)
SIGNATURES = ("Test engineer", "Reviewer")


def form(audit: Audit) -> dict[str, Any]:
    """Fields, decisions and signature lines, and as JSON what the review is about."""
    source, known = audit.recording.source, filled_in(audit.recording.test)
    about = {
        "report": number(audit),
        "recording": source.path.name,
        "sha256": [file.sha256 for file in source.files],
        "verdict": str(audit.verdict),
        "channels": list(audit.diagnosis.channels),
    }
    return {
        "about": json.dumps(about, ensure_ascii=False, separators=(",", ":")),
        "fields": [(name, title, known.get(name, "")) for name, title in FIELDS],
        "decisions": DECISIONS,
        "signatures": SIGNATURES,
    }
