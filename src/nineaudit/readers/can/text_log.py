"""What the readers of text logs share: blocks of whole lines, and the account of what is no frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from nineaudit.errors import RecordingError
from nineaudit.recording import Damage

BLOCK: Final = 1 << 21
_SMALLEST_BLOCK: Final = 1 << 18
_BLOCKS: Final = 4
"""A file is read in so many blocks at least, if they are not small, so that little of it stands in memory twice."""
NOT_READ: Final = "neither a frame nor a line of a known kind"
_SHOWN: Final = 60
_UTF16: Final = (b"\xff\xfe", b"\xfe\xff")
_UTF8_MARK: Final = b"\xef\xbb\xbf"


@dataclass
class _Lost:
    line: int
    text: str
    lost: str
    count: int = 0


@dataclass(frozen=True, eq=False)
class Account:
    """What a log holds besides frames: `counts` by kind, and by kind the lines (or rows) that could not be read."""

    unit: str = "line"
    counts: Counter[str] = field(default_factory=Counter)
    lines: dict[str, _Lost] = field(default_factory=dict)

    def damaged(self, what: str, line: int, text: bytes = b"", lost: str = "it is left out") -> None:
        """One more line that could not be read: of each kind the first is kept, and how many there are."""
        self.lines.setdefault(what, _Lost(line, shown(text), lost)).count += 1

    @property
    def damage(self) -> tuple[Damage, ...]:
        return tuple(
            Damage(f"{what}: {x.text}" if x.text else what, f"{self.unit} {x.line}", x.count, x.lost)
            for what, x in self.lines.items()
        )


def shown(text: bytes) -> str:
    """The beginning of a line in quotes; what is no printable ASCII is escaped."""
    cut = text.strip()
    return f"{cut[:_SHOWN]!r}"[1:] + (" …" if len(cut) > _SHOWN else "") if cut else ""


def blocks(path: Path) -> Iterator[bytes]:
    """Whole lines of a file, some megabytes at a time; last, without line end, what stands behind the last of them.

    Of a line that goes on beyond its block only the beginning is kept: it is no frame. Raises RecordingError for
    UTF-16.
    """
    rest, first = b"", True
    size = min(BLOCK, max(_SMALLEST_BLOCK, path.stat().st_size // _BLOCKS))
    with path.open("rb") as file:
        while read := file.read(size):
            read, first = (_text(read, path) if first else read), False
            end = read.rfind(b"\n") + 1
            if not end:
                rest = (rest + read)[:BLOCK]
                continue
            yield rest + read[:end]
            rest = read[end:]
    if rest.strip():
        yield rest


def _text(start: bytes, path: Path) -> bytes:
    if start[:2] in _UTF16:
        raise RecordingError("not text in UTF-8, but in UTF-16", file=path, advice="save the log as UTF-8")
    return start.removeprefix(_UTF8_MARK)


def cut_off(block: bytes, line: int, account: Account) -> bool:
    """True, and damage, for a last line (of that number) without line end."""
    if block.endswith(b"\n"):
        return False
    account.damaged("the last line has no line end", line, block, "it may be cut and is left out")
    return True
