"""Which test it was, as a report shows it: what is known and where it was stated, what is not, what contradicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from nineaudit.identity import KEYS, STARTED, Identity

EXPECTED = ("number", "item", "date", "laboratory")
"""What a report on a test must say (ISO/IEC 17025 7.8.2.1); the reviewer fills in what is not known."""


def section(test: Identity) -> dict[str, Any]:
    """Rows (what, value, source) of what is known; in words what of EXPECTED is not; and the remarks."""
    return shown(test.known, test.sources, test.remarks)


def shown(known: Mapping[str, str], sources: Mapping[str, str], remarks: Sequence[str]) -> dict[str, Any]:
    """As `section`, of what a result document holds."""
    titles = {**KEYS, "started": STARTED}
    lacking = [KEYS[key] for key in EXPECTED if not known.get(key)]
    return {
        "rows": [(title, known[key], sources.get(key, "")) for key, title in titles.items() if known.get(key)],
        "unknown": ", ".join((lacking[0], *(word[0].lower() + word[1:] for word in lacking[1:]))) if lacking else "",
        "remarks": list(remarks),
        "short": ", ".join(known[key] for key in ("number", "item") if known.get(key)),
    }


def filled_in(test: Identity) -> dict[str, str]:
    """Field of the reviewer's form -> what is known for it."""
    item = ", ".join(word for word in (test.item, test.item_serial) if word)
    return {"test": test.number, "item": item, "tested_on": test.date, "laboratory": test.laboratory}
