"""The published numbers of the source papers, standards and derivations, computed afresh (METHODS.md 7), and what their
misprints do (METHODS.md 1.2).

One module a source, and one for its misprints; each has `checks()`, a list of Published.
"""

from __future__ import annotations

from nineaudit.selftest import (
    alem77,
    alem77_misprints,
    becker75,
    becker75_misprints,
    constants,
    filters,
    hu77,
    injury,
    martin98,
    martin98_misprints,
    takhounts09,
    takhounts_clipping,
    takhounts_misprints,
)
from nineaudit.selftest.misprints import Misprint
from nineaudit.selftest.published import Published

__all__ = ["PARTS", "Misprint", "Published", "all_checks", "all_misprints", "not_reproducible"]

PARTS = (
    alem77,
    alem77_misprints,
    becker75,
    becker75_misprints,
    takhounts09,
    takhounts_clipping,
    takhounts_misprints,
    hu77,
    martin98,
    martin98_misprints,
    constants,
    filters,
    injury,
)
"""The modules of the record, in its order."""


def all_checks() -> list[Published]:
    """Every published number with ours beside it, in the order of the sources."""
    return [check for part in PARTS for check in part.checks()]


def all_misprints() -> list[Misprint]:
    """Every misprinted equation with its printed and its right form, in the order of the sources."""
    parts = (takhounts_misprints, martin98_misprints, alem77_misprints, becker75_misprints, hu77)
    return [misprint for part in parts for misprint in part.misprints()]


def not_reproducible() -> list[str]:
    """Published numbers that do not follow from what their source prints, each with why."""
    return [*martin98.NOT_REPRODUCED, takhounts_clipping.not_reproduced()]
