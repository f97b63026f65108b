"""The published numbers of the source papers, standards and derivations, computed afresh (METHODS.md 7).

One module a source; each has `checks()`, a list of Published.
"""

from __future__ import annotations

from nineaudit.selftest import (
    alem77,
    becker75,
    constants,
    filters,
    hu77,
    injury,
    martin98,
    takhounts09,
    takhounts_misprints,
)
from nineaudit.selftest.published import Published

__all__ = ["PARTS", "Published", "all_checks", "not_reproducible"]

PARTS = (alem77, becker75, takhounts09, takhounts_misprints, hu77, martin98, constants, filters, injury)
"""The modules of the record, in its order."""


def all_checks() -> list[Published]:
    """Every published number with ours beside it, in the order of the sources."""
    return [check for part in PARTS for check in part.checks()]


def not_reproducible() -> list[str]:
    """Published numbers that do not follow from what their source prints, each with why."""
    return list(martin98.NOT_REPRODUCED)
