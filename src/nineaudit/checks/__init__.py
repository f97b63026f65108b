"""The checks: code -> function. A check computes a number and its limit; the engine gives the verdict.

``check(case, *, limits...)`` answers with a Measure, one Measure per subject, or NotApplicable with its reason.
The keyword-only parameters are the limits of the rule's sheet. A package adds a check by an entry point in the
group ``nineaudit.checks``: its name is the code, its object the function; the sheet comes with ``--rules``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from importlib.metadata import entry_points
from types import ModuleType

from nineaudit.checks import budget, bus, bus_messages, clock, file, noise, offset, record, rigid_body
from nineaudit.errors import ConfigurationError
from nineaudit.finding import Measure, NotApplicable

Check = Callable[..., Measure | Sequence[Measure] | NotApplicable]

_MODULES: tuple[ModuleType, ...] = (file, clock, record, noise, bus, bus_messages, offset, rigid_body, budget)
CHECKS: dict[str, Check] = {code: check for module in _MODULES for code, check in module.CHECKS.items()}
"""Of this package. Each module holds its own."""


@cache
def all_checks() -> dict[str, Check]:
    """CHECKS and those of installed packages. ConfigurationError when a package claims a code that is taken."""
    found = dict(CHECKS)
    for point in entry_points(group="nineaudit.checks"):
        if point.name in found:
            raise ConfigurationError("the code of this check is taken", place=point.value, found=point.name)
        found[point.name] = point.load()
    return found
