"""Files that appear whole or not at all, hashes, and one writer at a time."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

_WINDOWS = os.name == "nt"


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
    """Where a file is written before it takes its name: hidden, in the same folder, of the same suffix."""
    return path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")


def write_whole(path: Path, text: str) -> None:
    """Write a text in UTF-8: all of it is on the disk before it takes its name, and a failure leaves what was there.

    A link stays and what it points to is written; a device or a pipe is written to as it is. OSError where the folder
    cannot be written to.
    """
    path = path.resolve() if path.is_symlink() else path
    if path.exists() and not path.is_file():
        path.write_text(text, encoding="utf-8", newline="\n")
        return
    partial = partial_name(path)
    try:
        partial.write_text(text, encoding="utf-8", newline="\n")
        settle(partial, path)
    finally:
        partial.unlink(missing_ok=True)


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
