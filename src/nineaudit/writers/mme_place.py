"""How an ISO-MME test of several files takes its place: a header .mme and the folder Channel beside it, together.

It is written under its own names into a hidden folder. Then the old folder Channel moves into that, the new one out,
and the header follows; what fails on the way moves the old one back.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from nineaudit.errors import ConfigurationError
from nineaudit.files import settle, sync

CHANNEL: Final = "Channel"
_OF_A_TEST: Final = re.compile(r"\.(\d{3,}|chn)$", re.IGNORECASE)


def require_test_free(path: Path, sources: Sequence[Path], force: bool) -> None:
    """ConfigurationError where the files of a test `path` (.mme) would mix with those of another, or take the place of
    a test without `force`, or of the recording that it is made of. OSError."""
    if any(source.is_dir() and source.samefile(path.parent) for source in sources):
        what = "the original recording is never overwritten"
        raise ConfigurationError(what, file=path, advice="choose another folder for the output")
    loose = [p for p in path.parent.iterdir() if p.is_file() and _is_of(p, path)]
    if loose:
        what = "it is a channel of a test of this name, and would be read with the new ones"
        raise ConfigurationError(what, file=loose[0], advice="choose a folder of its own")
    for folder in _channel_folders(path.parent):
        other = next((p for p in sorted(folder.iterdir()) if not _is_of(p, path)), None)
        if other is not None:
            what = "the folder exists already, with files of another test"
            raise ConfigurationError(what, file=folder, found=other.name, advice="choose a folder of its own")
        if not force:
            advice = "choose a folder of its own, or overwrite it with --force"
            raise ConfigurationError("the folder exists already", file=folder, advice=advice)


@contextmanager
def folder_of_test(path: Path) -> Iterator[Path]:
    """Where a test is written before it takes its place: under its own names, in a hidden folder that goes. OSError."""
    folder = path.with_name(f".{path.stem}.{os.getpid()}")
    folder.mkdir()
    try:
        yield folder / path.name
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def settle_test(written: Path, path: Path) -> None:
    """Put a test in its place, in that of an older one where there is one. OSError: then the older one is back."""
    for file in (written.parent / CHANNEL).iterdir():
        sync(file)
    moves = [(old, written.parent / f"old-{old.name}") for old in _channel_folders(path.parent)]
    moves.append((written.parent / CHANNEL, path.parent / CHANNEL))
    undo: list[tuple[Path, Path]] = []
    try:
        for here, there in moves:
            here.rename(there)
            undo.append((there, here))
        settle(written, path)
        undo.clear()
    finally:
        for there, here in reversed(undo):
            there.rename(here)


def _channel_folders(folder: Path) -> list[Path]:
    """However their name is written: a reader takes each."""
    return [p for p in folder.iterdir() if p.is_dir() and p.name.lower() == CHANNEL.lower()]


def _is_of(file: Path, header: Path) -> bool:
    """Whether a file is a channel or the index of the test of a header."""
    return file.stem.lower() == header.stem.lower() and _OF_A_TEST.search(file.name) is not None
