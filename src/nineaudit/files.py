"""Files that appear whole or not at all, hashes, and one writer at a time."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from io import FileIO
from pathlib import Path
from typing import IO, Any

_WINDOWS = os.name == "nt"
_LONG = 200
"""Bytes of a name to which a process id can be added."""


def sha256(path: Path) -> str:
    """SHA-256 of a file, as hexadecimal digits. OSError where it cannot be read."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sealed(document: Mapping[str, Any]) -> dict[str, Any]:
    """The document with the SHA-256 of its content in the key `seal`: a later change shows (is_sealed)."""
    return {**document, "seal": _content(document)}


def is_sealed(document: Mapping[str, Any]) -> bool:
    """Whether a document still has the content of its seal."""
    return document.get("seal") == _content(document)


def _content(document: Mapping[str, Any]) -> str:
    """Of the values, not of the bytes: spaces and the order of keys do not matter."""
    rest = {key: value for key, value in document.items() if key != "seal"}
    text = json.dumps(rest, sort_keys=True, ensure_ascii=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def partial_name(path: Path) -> Path:
    """Where a file is written before it takes its name: hidden, in the same folder, of the same suffix; a name that
    fills what systems allow (255 bytes) is told by its hash."""
    long = len(os.fsencode(path.name)) > _LONG
    stem = hashlib.sha256(os.fsencode(path.stem)).hexdigest()[:32] if long else path.stem
    return path.with_name(f".{stem}.{os.getpid()}{path.suffix}")


def write_whole(path: Path, text: str) -> None:
    """Write a text in UTF-8, as written_whole."""
    with written_whole(path) as put:
        put(text)


@contextmanager
def written_whole(path: Path) -> Iterator[Callable[[str], None]]:
    """What takes a text in pieces and writes it in UTF-8: all of it is on the disk before it takes its name, and a
    failure, of the caller too, leaves what was there.

    A link stays and what it points to is written; a device or a pipe is written to as it is. OSError where the folder
    cannot be written to.
    """
    path = Path(os.path.realpath(path)) if path.is_symlink() else path
    special = path.exists() and not path.is_file()
    partial = path if special else partial_name(path)
    try:
        with partial.open("wb", buffering=0) as file:  # without a buffer nothing is left to be written by close
            yield lambda text: _put(file, text)
        if not special:
            settle(partial, path)
    finally:
        if not special:
            partial.unlink(missing_ok=True)


def _put(file: FileIO, text: str) -> None:
    left = memoryview(text.encode())
    while left:
        left = left[file.write(left) :]


def settle(partial: Path, path: Path) -> None:
    """Give a written file its name, once its bytes are on the disk. OSError."""
    sync(partial)
    os.replace(partial, path)
    _sync_folder(path.parent)


def sync(path: Path) -> None:
    """Return when the bytes of a file are on the disk. OSError."""
    with path.open("r+b") as file:
        os.fsync(file.fileno())


def _sync_folder(folder: Path) -> None:
    """The same of the names in a folder, where a system can be asked to (Windows cannot)."""
    if _WINDOWS:
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def appending(path: Path) -> Iterator[IO[bytes]]:
    """A file, made where there is none, to be read and appended to by this process alone: others wait. OSError."""
    with path.open("a+b") as file:
        _lock(file)
        try:
            yield file
            file.flush()
            os.fsync(file.fileno())
        finally:
            _unlock(file)


if _WINDOWS:  # pragma: no cover
    import msvcrt
    import time

    _FAR = 2**62
    """Byte that is locked: beyond every end, so that the text stays readable."""

    def _lock(file: IO[bytes]) -> None:
        while True:
            file.seek(_FAR)
            try:
                msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
            except OSError:
                time.sleep(0.02)
            else:
                return

    def _unlock(file: IO[bytes]) -> None:
        file.seek(_FAR)
        msvcrt.locking(file.fileno(), msvcrt.LK_UNLCK, 1)  # type: ignore[attr-defined]

else:
    import fcntl

    def _lock(file: IO[bytes]) -> None:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX)

    def _unlock(file: IO[bytes]) -> None:
        fcntl.flock(file.fileno(), fcntl.LOCK_UN)
