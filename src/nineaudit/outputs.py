"""Where the files of a command go, and that none of them takes the place of an input."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

from nineaudit.errors import ConfigurationError
from nineaudit.files import written_whole

STEM: Final = "{stem}"


def each_its_own(pattern: str) -> bool:
    """Whether an output option names a file for each recording: a folder, or ``{stem}`` in the name."""
    return STEM in pattern or pattern.endswith(("/", "\\")) or os.path.isdir(pattern)


def places(pattern: str, recordings: Sequence[Path], option: str, suffix: str) -> tuple[Path, ...]:
    """Where the output of each recording goes. ConfigurationError when two would go to one file."""
    if not each_its_own(pattern):
        if len(recordings) > 1:
            raise ConfigurationError(
                "one file for several recordings",
                place=option,
                found=pattern,
                expected="a folder, or {stem} in the name",
                advice=f"for example {option} reports/{STEM}{suffix}",
            )
        return (Path(pattern),)
    name = pattern if STEM in pattern else str(Path(pattern) / f"{STEM}{suffix}")
    found = tuple(Path(name.replace(STEM, path.stem)) for path in recordings)
    for i, place in enumerate(found):
        if place in found[:i]:
            clash = f"{recordings[found.index(place)]} and {recordings[i]} would both be written to it"
            raise ConfigurationError(clash, file=place, place=option)
    return found


def protect(outputs: Iterable[Path | None], inputs: Iterable[Path | None]) -> None:
    """ConfigurationError when an output is one of the inputs, or another output."""
    originals = [path for path in inputs if path is not None]
    seen: list[Path] = []
    for place in (path for path in outputs if path is not None):
        if any(_same(place, original) for original in originals):
            raise ConfigurationError("an input is never written to", file=place, advice="choose another name")
        if any(_same(place, other) for other in seen):
            raise ConfigurationError("two outputs would be written to it", file=place, advice="choose two names")
        seen.append(place)


def require_absent(path: Path, force: bool) -> None:
    """ConfigurationError when the file exists and is not to be overwritten."""
    if path.exists() and not force:
        raise ConfigurationError(
            "the file exists", file=path, advice="choose another name, or overwrite it with --force"
        )


def make_folder(path: Path) -> None:
    """The folder of an output. ConfigurationError where it cannot be made."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(path, error) from error


def write_text(path: Path, text: str) -> None:
    """Write a text in UTF-8, whole or not at all; its folder is made. ConfigurationError where that cannot be."""
    with writing(path) as put:
        put(text)


@contextmanager
def writing(path: Path) -> Iterator[Callable[[str], None]]:
    """What takes a text in pieces, which becomes the file once it is whole; its folder is made. ConfigurationError if
    that cannot be; what the caller raises passes, and leaves what was there."""
    make_folder(path.parent)
    with ExitStack() as opened:
        with _told(path):
            put = opened.enter_context(written_whole(path))

        def take(text: str) -> None:
            with _told(path):
                put(text)

        yield take
        with _told(path):
            opened.close()


@contextmanager
def _told(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise unwritable(path, error) from error


def unwritable(path: Path, error: OSError) -> ConfigurationError:
    """The error of a place that the system does not let us write to."""
    return ConfigurationError(f"cannot be written: {error.strerror or error}", file=path)


def _same(a: Path, b: Path) -> bool:
    there = os.path.exists(a) and os.path.exists(b)
    return os.path.realpath(a) == os.path.realpath(b) or (there and a.samefile(b))
