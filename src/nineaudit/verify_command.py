"""The command `verify`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nineaudit.options import example

EXAMPLE = example("nineaudit verify result.json")


def verify(
    paths: Annotated[
        list[Path],
        typer.Argument(metavar="PATH...", help="Logs, results, records of repairs, repaired files, folders of them."),
    ],
) -> tuple[list[str], int]:
    """Find what was changed since it was written: files, results, records of repairs, lines of a log.

    Exit codes: 0 nothing changed; 1 something did, and is named; 3 something could not be verified. It finds mistakes
    and careless changes; a forger who rewrites every hash is found only if the last hash was kept elsewhere.
    """
    from nineaudit import verify as verifying
    from nineaudit.report.numbers import printable

    answers = verifying.verify(paths)
    return [printable(str(answer)) for answer in answers], verifying.exit_code(answers)
