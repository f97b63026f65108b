"""Outputs that speak of all recordings of a run: what they need of a recording is taken when that is done.

An audit holds some megabytes; none is kept.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Final

from nineaudit.outcome import Outcome
from nineaudit.outputs import writing

Put = Callable[[str], None]
Take = Callable[[Outcome], None]


@contextmanager
def collecting(kinds: Sequence[tuple[str, Path | None]], fail_on: str, show: Put) -> Iterator[Take]:
    """What takes the outcomes one by one, for outputs of several `kinds` (json, junit, github, markdown), each into its
    file, or, where that is None, for `show`. The files are there at the end. ConfigurationError where one cannot be
    written."""
    with ExitStack() as opened:
        takes = [
            opened.enter_context(_KINDS[kind](show if file is None else opened.enter_context(writing(file)), fail_on))
            for kind, file in kinds
        ]

        def take(outcome: Outcome) -> None:
            for one in takes:
                one(outcome)

        yield take


@contextmanager
def _json(put: Put, _: str) -> Iterator[Take]:
    """A list of result documents."""
    from nineaudit.report import to_json

    before = "["

    def take(outcome: Outcome) -> None:
        nonlocal before
        put(before + "\n" + textwrap.indent(to_json(outcome.document()).rstrip(), "  "))
        before = ","

    yield take
    put("[]\n" if before == "[" else "\n]\n")


@contextmanager
def _junit(put: Put, fail_on: str) -> Iterator[Take]:
    """A suite for each recording."""
    from nineaudit.report import ci

    put(ci.JUNIT_HEAD)

    def take(outcome: Outcome) -> None:
        if outcome.audit is None:
            put(ci.unread_suite(outcome.path, str(outcome.error)))
        else:
            put(ci.junit_suite(outcome.audit, fail_on))

    yield take
    put(ci.JUNIT_TAIL)


@contextmanager
def _digested(kind: str, put: Put, _: str) -> Iterator[Take]:
    """Annotations or a summary: which findings are the worst of all recordings is known at the end only."""
    from nineaudit.report import ci

    kept: list[ci.Digest] = []

    def take(outcome: Outcome) -> None:
        if outcome.audit is None:
            kept.append(ci.unread_digest(outcome.path, str(outcome.error)))
        else:
            kept.append(ci.digest(outcome.audit))

    yield take
    put((ci.github_of if kind == "github" else ci.markdown_of)(kept))


_KINDS: Final[Mapping[str, Callable[[Put, str], AbstractContextManager[Take]]]] = {
    "json": _json,
    "junit": _junit,
    "github": partial(_digested, "github"),
    "markdown": partial(_digested, "markdown"),
}
