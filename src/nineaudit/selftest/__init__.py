"""The published numbers of the source papers, standards and derivations, computed afresh (METHODS.md 7).

One module a source; each has `checks()`, a list of Published.
"""

from __future__ import annotations

from nineaudit.selftest import alem77, becker75, constants, filters, hu77, injury, martin98, takhounts09
from nineaudit.selftest.published import Published

__all__ = ["PARTS", "Published", "all_checks"]

PARTS = (alem77, becker75, takhounts09, hu77, martin98, constants, filters, injury)
"""The modules of the record, in its order."""


def all_checks() -> list[Published]:
    """Every published number with ours beside it, in the order of the sources."""
    return [check for part in PARTS for check in part.checks()]
