"""Lines of a log handed to a reader of python-can, so that none is passed over without a word.

python-can stops at the first line that it cannot read and skips others in silence: here it is started anew behind a
bad line, and every line that gave no frame is given back.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

_RAISED: Final = (ValueError, IndexError, KeyError, TypeError, OverflowError, NotImplementedError, AssertionError)
"""What python-can raises for a line that it cannot read."""


class Fed:
    """The file that python-can believes to read: our lines, of which we know which gave a frame.

    `passed_over` is called with every line that gave none.
    """

    def __init__(self, lines: Iterator[tuple[int, str]], passed_over: Callable[[int, str], None]) -> None:
        self.lines, self.passed_over = lines, passed_over
        self.first: list[str] = []
        self.at: tuple[int, str] | None = None
        self.done = False

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        if self.first:
            return self.first.pop()
        self.drop()
        self.at = next(self.lines, None)
        if self.at is None:
            self.done = True
            raise StopIteration
        return self.at[1]

    def drop(self) -> None:
        """The line at hand gave no frame."""
        if self.at is not None:
            self.passed_over(*self.at)
            self.at = None

    def read(self) -> str:
        """Nothing: python-can asks only whether there is such a method."""
        return ""

    def close(self) -> None:
        """Nothing is open here."""


def messages(fed: Fed, reader: Any, first: list[str]) -> Iterator[tuple[int, str, Any]]:
    """(line, text, message) of every line that python-can can read. `first`: lines it wants before any other."""
    while not fed.done:
        fed.first = [*first]
        try:
            for message in reader:
                if fed.at is not None:
                    (number, text), fed.at = fed.at, None
                    yield number, text, message
        except _RAISED:
            fed.drop()


@contextmanager
def quiet(name: str) -> Iterator[None]:
    """Without the messages of a logger: what it would say becomes damage."""

    def refuse(_: logging.LogRecord) -> bool:
        return False

    logger = logging.getLogger(name)
    logger.addFilter(refuse)
    try:
        yield
    finally:
        logger.removeFilter(refuse)
