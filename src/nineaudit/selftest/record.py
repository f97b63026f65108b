"""The validation record: versions, date, every published number beside ours, and room for a signature.

ISO/IEC 17025 asks that software be validated; this is the evidence that one installation reproduces the published
numbers. What it means for a laboratory's own use of them, the laboratory has to say.
"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from datetime import UTC, date, datetime
from importlib.metadata import version
from typing import Any

from nineaudit.errors import ConfigurationError
from nineaudit.selftest.published import Published

SCHEMA = "nineaudit/selftest/1"
_PACKAGES = ("nineaudit", "numpy", "scipy")
_COLUMNS = ("quantity", "printed", "expected", "ours", "tolerance", "")


def day(text: str | None) -> str:
    """The date of the record, ISO 8601: as given, or now with the time, UTC. ConfigurationError for another form."""
    if text is None:
        return datetime.now(UTC).isoformat(timespec="seconds")
    try:
        return date.fromisoformat(text).isoformat()
    except ValueError as error:
        raise ConfigurationError("not a date", place="--date", found=text, expected="such as 2026-01-31") from error


def versions() -> dict[str, str]:
    """What computes: this package, what its numbers rest on, and the system."""
    found = {name: version(name) for name in _PACKAGES}
    return found | {"Python": platform.python_version(), "system": f"{platform.system()} {platform.machine()}"}


def lines(checks: Sequence[Published], when: str, absent: Sequence[str] = ()) -> list[str]:
    """The record as text, a block for each source. A tolerance's reason stands under the numbers it is for; `absent`:
    published numbers that cannot be reproduced by anybody, each with why."""
    rows = {check: _row(check) for check in checks}
    widths = [max(len(row[i]) for row in (*rows.values(), _COLUMNS)) for i in range(len(_COLUMNS))]
    head = [f"Validation record of nineaudit {version('nineaudit')}, {when}"]
    head += [", ".join(f"{name} {number}" for name, number in versions().items())]
    body: list[str] = []
    for source in dict.fromkeys(check.source for check in checks):
        body += ["", source, _line(_COLUMNS, widths)]
        of_source = [check for check in checks if check.source == source]
        for reason in dict.fromkeys(check.why for check in of_source):
            body += [_line(rows[check], widths) for check in of_source if check.why == reason]
            body.append(f"    tolerance: {reason}")
    body += ["", "Not reproducible from what is printed", *(f"  {text}" for text in absent)] if absent else []
    return [*head, *body, "", summary(checks), "", "Checked by: ____________________   Date: ____________"]


def summary(checks: Sequence[Published]) -> str:
    """One sentence: how many numbers came out, and which did not."""
    missed = [f"{check.source}: {check.quantity}" for check in checks if not check.passed]
    said = f"{len(checks) - len(missed)} of {len(checks)} published numbers reproduced within their tolerance"
    return f"{said}; not: {'; '.join(missed)}" if missed else said


def document(checks: Sequence[Published], when: str, absent: Sequence[str] = ()) -> dict[str, Any]:
    """The record for machines, every number at full precision."""
    names = ("source", "quantity", "printed", "expected", "ours", "tolerance", "why", "passed")
    return {
        "schema": SCHEMA,
        "date": when,
        "versions": versions(),
        "passed": all(check.passed for check in checks),
        "checks": [{name: getattr(check, name) for name in names} for check in checks],
        "not_reproducible": list(absent),
    }


def _row(check: Published) -> tuple[str, ...]:
    printed = check.printed if isinstance(check.printed, str) else f"{check.printed:.9g}"
    tolerance = f"{check.tolerance:.2g}"
    mark = "pass" if check.passed else "MISS"
    return check.quantity, printed, _digits(check.expected, check), _digits(check.ours, check), tolerance, mark


def _digits(value: float, check: Published) -> str:
    """As many digits as show a difference of a tenth of the tolerance, between 4 and 12."""
    from math import floor, log10

    size = max(abs(check.expected), check.tolerance, 1e-300)
    needed = floor(log10(size)) - floor(log10(check.tolerance)) + 2 if check.tolerance > 0 else 12
    return f"{value:.{min(max(needed, 4), 12)}g}"


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = (
        cell.ljust(w) if i == 0 else cell.rjust(w) for i, (cell, w) in enumerate(zip(cells, widths, strict=True))
    )
    return "  " + "  ".join([first, *others]).rstrip()
