"""The published numbers of the source papers, standards and derivations, computed afresh (METHODS.md 7).

One module a source; each has `checks()`, a list of Published.
"""

from __future__ import annotations

from nineaudit.selftest import constants, filters, injury
from nineaudit.selftest.published import Published

__all__ = ["PARTS", "Published", "all_checks"]

PARTS = (constants, filters, injury)
"""The modules of the record, in its order."""


def all_checks() -> list[Published]:
    """Every published number with ours beside it, in the order of the sources."""
    return [check for part in PARTS for check in part.checks()]
