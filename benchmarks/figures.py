"""Figures of the benchmarks: what was measured beside what is asked, a line each, which `readers.py` gathers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

_LINE = re.compile(r"(?P<what>\S.*?)\s+(?P<measured>[\d.]+)  (?P<sense>[<>]=) (?P<asked>[\d.]+)  (pass|SHORT)")


class Figure(NamedTuple):
    """What was measured, and what is asked: at least (>=) or at most (<=)."""

    what: str
    measured: float
    sense: str
    asked: float

    @property
    def holds(self) -> bool:
        """Whether what is asked is reached."""
        return self.measured >= self.asked if self.sense == ">=" else self.measured <= self.asked


def table(figures: Sequence[Figure]) -> str:
    """Lines of figures."""
    return "\n".join(
        f"{f.what:<64} {f.measured:9.2f}  {f.sense} {f.asked:g}  {'pass' if f.holds else 'SHORT'}" for f in figures
    )


def figure(line: str) -> Figure | None:
    """The figure that a line holds, None where it holds none."""
    found = _LINE.fullmatch(line.strip())
    return Figure(found["what"], float(found["measured"]), found["sense"], float(found["asked"])) if found else None
