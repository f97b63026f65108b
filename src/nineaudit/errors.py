"""What can go wrong with what a user gives us, each with its place, its advice and its exit code.

One sentence reaches the user: ``file: place: what is wrong; found X; expected Y; what to do``.
"""

from __future__ import annotations

import errno
from pathlib import Path

_MISSING = object()
_LONGEST = 400


class NineauditError(Exception):
    """An error that a user can mend. ``exit_code`` is what the command line returns for it.

    Parameters: `what` is wrong; `file` and `place` (line, key, channel, byte) where; what was
    `found`; what was `expected`; and the `advice` that mends it. ``str()`` is the whole sentence.
    """

    exit_code = 3

    def __init__(
        self,
        what: str,
        *,
        file: str | Path | None = None,
        place: str | None = None,
        found: object = _MISSING,
        expected: str | None = None,
        advice: str | None = None,
    ) -> None:
        self.what, self.file, self.place = what, file, place
        self.found, self.expected, self.advice = found, expected, advice
        head = ": ".join(str(part) for part in (file, place, what) if part)
        tail = [
            "" if found is _MISSING else f"found {_short(repr(found))}",
            f"expected {expected}" if expected else "",
            advice or "",
        ]
        super().__init__("; ".join(part for part in (head, *tail) if part))


def _short(text: str) -> str:
    """What was found may be a file without a line end: its first _LONGEST characters tell enough."""
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]} …"


class ConfigurationError(NineauditError):
    """A rig file, rule sheet, waiver file, database or option is wrong (exit code 2)."""

    exit_code = 2


class RecordingError(NineauditError):
    """A recording cannot be read or does not carry what the rig asks for (exit code 3)."""

    exit_code = 3


class EstimationError(NineauditError):
    """A foreseen numerical failure: singular geometry, no rest interval, no convergence.

    The engine turns it into a NOT_EVALUATED finding with this reason; it never counts as a pass.
    """


DEFECT = 70
"""Exit code of an error that is not the user's (EX_SOFTWARE of sysexits.h)."""
REFUSALS = (errno.EACCES, errno.EPERM, errno.ENAMETOOLONG, errno.ELOOP, errno.ENOSPC, errno.EROFS)
"""What a system answers to a path that it does not let us use: no defect of ours."""


def last_words(error: Exception) -> tuple[str, int]:
    """What is said of an error that nothing else spoke of, and the exit code."""
    if isinstance(error, OSError) and error.errno in REFUSALS:
        return f"{error.filename}: {error.strerror}", ConfigurationError.exit_code
    said = f"a defect of nineaudit: {type(error).__name__}: {error}"
    return f"{said}; run it again with --debug, and report what it shows", DEFECT
