"""The log of what was audited and repaired: one line each, and each holds the SHA-256 of the line before it.

A line that is changed, taken out or put in breaks the chain behind it. Lines cut off at the end leave a chain that
holds: so the number and hash of the last line stand in a second file, F.head. Nothing here is secret: who rewrites
everything leaves no trace, unless the last hash was also kept elsewhere.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from nineaudit.errors import ConfigurationError
from nineaudit.files import appending, write_whole

SCHEMA: Final = "nineaudit/log/1"
START: Final = "0" * 64
"""What stands for the hash before the first line."""


@dataclass(frozen=True)
class Broken:
    """A place where a log is not as it was written: `line` counts from 1, 0 is the whole file."""

    line: int
    what: str


def head_of(log: Path) -> Path:
    """Where the number and hash of the last line stand."""
    return log.with_name(log.name + ".head")


def append(log: Path, entries: Sequence[Mapping[str, Any]], now: datetime | None = None) -> None:
    """Add a line for each entry, chained to what is there, in one go: another process waits meanwhile.

    ConfigurationError: the log cannot be written, or it is not what its head says (then nothing is added to it).
    """
    utc = (datetime.now(UTC) if now is None else now).astimezone(UTC).isoformat(timespec="seconds")
    try:
        with appending(log) as file:
            file.seek(0)
            lines = file.read().splitlines()
            _require_head(log, lines)
            added = list(_chained(lines, entries, utc))
            file.seek(0, os.SEEK_END)
            file.write(b"".join(line + b"\n" for line in added))
            file.flush()
            os.fsync(file.fileno())
            write_whole(head_of(log), f"{len(lines) + len(added)} {_digest((lines + added)[-1])}\n")
    except OSError as error:
        raise ConfigurationError(f"cannot be written: {error.strerror or error}", file=log, place="--log") from error


def require_whole(log: Path) -> None:
    """ConfigurationError where a log that exists is not what its head says: nothing would be added to it."""
    if log.is_file():
        _require_head(log, log.read_bytes().splitlines())


def entries(log: Path) -> list[dict[str, Any]]:
    """What the lines say that can be read. OSError."""
    found = [_parsed(line) for line in log.read_bytes().splitlines()]
    return [entry for entry in found if entry is not None]


def broken(log: Path) -> list[Broken]:
    """Every place where the chain does not hold. OSError where the log cannot be read."""
    data = log.read_bytes()
    lines = data.splitlines()
    found = list(_faults(lines))
    if data and not data.endswith(b"\n"):
        found.append(Broken(len(lines), "it has no end: the line was cut off, or written by something else"))
    if head_of(log).is_file():
        found += _against_head(log, lines)
    return found


def _faults(lines: Sequence[bytes]) -> Iterator[Broken]:
    """What is wrong with lines: each is held against the hash that the one behind it has of it."""
    previous = START
    for number, line in enumerate(lines, 1):
        entry = _parsed(line)
        if entry is None:
            yield Broken(number, "is no line of a log")
        elif entry.get("previous") != previous and number == 1:
            yield Broken(1, "is not the first line of a log: lines before it are missing")
        elif entry.get("previous") != previous:
            yield Broken(number - 1, f"was altered, or lines behind it are missing: line {number} holds another hash")
        elif entry.get("line") != number:
            yield Broken(number, f"says that it is line {entry.get('line')!r}")
        previous = _digest(line)


def _against_head(log: Path, lines: Sequence[bytes]) -> Iterator[Broken]:
    """What is wrong between a log and its head. The head may be behind: it is written after the line."""
    words = head_of(log).read_text(encoding="utf-8", errors="replace").split()
    if len(words) != 2 or not words[0].isdecimal() or int(words[0]) < 1:
        yield Broken(0, f"{head_of(log).name} is not what was written")
    elif len(lines) < int(words[0]):
        yield Broken(0, f"lines {len(lines) + 1} to {words[0]} are missing at the end")
    elif _digest(lines[int(words[0]) - 1]) != words[1]:
        yield Broken(int(words[0]), f"was altered: {head_of(log).name} holds another hash")


def _require_head(log: Path, lines: Sequence[bytes]) -> None:
    if not head_of(log).is_file():
        wrong = f"{head_of(log).name} is not there" if lines else ""
    else:
        found = next(_against_head(log, lines), None)
        wrong = "" if found is None else f"line {found.line} {found.what}" if found.line else found.what
    if wrong:
        raise ConfigurationError(
            f"was altered since its last line: {wrong}",
            file=log,
            place="--log",
            advice="`nineaudit verify` tells where; keep it, and begin another log",
        )


def _chained(lines: Sequence[bytes], entries: Sequence[Mapping[str, Any]], utc: str) -> Iterator[bytes]:
    previous = _digest(lines[-1]) if lines else START
    for number, entry in enumerate(entries, len(lines) + 1):
        document = {"schema": SCHEMA, "line": number, "previous": previous, "utc": utc, **entry}
        line = json.dumps(document, ensure_ascii=True, allow_nan=False, separators=(",", ":")).encode()
        previous = _digest(line)
        yield line


def _parsed(line: bytes) -> dict[str, Any] | None:
    try:
        entry = json.loads(line)
    except ValueError:
        return None
    return entry if isinstance(entry, dict) and entry.get("schema") == SCHEMA else None


def _digest(line: bytes) -> str:
    return hashlib.sha256(line).hexdigest()
