"""A bar on the terminal for a run over several recordings, which steps aside while results are shown."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from rich.progress import Progress

T = TypeVar("T")
Show = Callable[[str], None]


def wanted(total: int, terminal: bool, environment: Mapping[str, str] = os.environ) -> bool:
    """Whether a bar helps: several recordings and someone who watches; not in a pipe, in CI, on a dumb terminal."""
    return total > 1 and terminal and not environment.get("CI") and environment.get("TERM") != "dumb"


def along(
    items: Iterable[T], total: int, shows: Sequence[Show], *, rate: bool = False
) -> tuple[Iterable[T], list[Show]]:
    """The items with a bar on standard error that counts them, and each of `shows` so that the bar is away meanwhile.
    With `rate` it says how many there are in a second.

    Colours follow NO_COLOR. The bar is gone at the end, and after Ctrl-C.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns: list[Any] = [TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()]
    if rate:
        columns.insert(3, TextColumn("{task.fields[rate]}"))
    bar = Progress(*columns, console=console, transient=True, redirect_stdout=False, redirect_stderr=False)

    return _counted(items, total, bar), [partial(_aside, bar, show) for show in shows]


def _aside(bar: Progress, show: Show, text: str) -> None:
    with _hidden(bar):
        show(text)


def _counted(items: Iterable[T], total: int, bar: Progress) -> Iterator[T]:
    task = bar.add_task("recordings", total=total, rate="")
    with bar:
        for item in items:
            yield item
            bar.advance(task)
            speed = bar.tasks[0].speed
            bar.update(task, rate="" if speed is None else f"{speed:.3g}/s")


@contextmanager
def _hidden(bar: Progress) -> Iterator[None]:
    """The bar taken away, and put back if it was there."""
    was = bar.live.is_started
    if was:
        bar.stop()
    yield
    if was:
        bar.start()
