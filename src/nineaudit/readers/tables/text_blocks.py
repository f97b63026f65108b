"""A text file as blocks of whole lines, whatever its encoding and line ends: memory is that of a block."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

from nineaudit.errors import RecordingError

BLOCK: Final = 4 * 2**20
LONGEST: Final = 16 * 2**20
"""Bytes that are read at once, and of the longest line that is kept whole."""
_KEPT: Final = 1024

# Byte order marks, the longer before the shorter that they begin with (The Unicode Standard, 23.8).
_MARKS: Final = {
    b"\xff\xfe\x00\x00": "UTF-32",
    b"\x00\x00\xfe\xff": "UTF-32",
    b"\xef\xbb\xbf": "utf-8",
    b"\xff\xfe": "utf-16-le",
    b"\xfe\xff": "utf-16-be",
}
_SPOKEN: Final = {"utf-16-le": "UTF-16 (little endian)", "utf-16-be": "UTF-16 (big endian)", "cp1252": "Windows-1252"}


@dataclass(frozen=True)
class Encoding:
    """`codec` of a file, its `mark` of so many bytes, and a note where it is not plain UTF-8. `inside` is the codec of
    its blocks: UTF-16 is turned into UTF-8 on the way."""

    codec: str
    mark: int = 0
    note: str = ""

    @property
    def inside(self) -> str:
        return "cp1252" if self.codec == "cp1252" else "utf-8"


def encoding_of(start: bytes, path: Path) -> Encoding:
    """Encoding by the first bytes of a file: its byte order mark, else UTF-8 where they are that, else Windows-1252.

    Raises RecordingError: UTF-32, UTF-16 without a mark, or no text at all.
    """
    mark = next((mark for mark in _MARKS if start.startswith(mark)), b"")
    codec = _MARKS.get(mark, "")
    if codec == "UTF-32":
        raise _not_text(path, 0, start, "a UTF-32 byte order mark")
    if codec:
        note = f"read as {_SPOKEN[codec]}, by its byte order mark" if codec in _SPOKEN else ""
        return Encoding(codec, len(mark), note)
    if _is_wide(start[:4096]):
        raise _not_text(path, start.find(0), start, "NUL bytes, as in UTF-16 without its byte order mark")
    return _eight_bit(start)


def _is_wide(start: bytes) -> bool:
    """Whether every other byte is mostly NUL, or all are."""
    few, many = sorted((start[::2].count(0), start[1::2].count(0)))
    return many > len(start) // 4 and (8 * few < many or few + many == len(start))


def _eight_bit(start: bytes) -> Encoding:
    try:
        codecs.getincrementaldecoder("utf-8")().decode(start)
    except UnicodeDecodeError as error:
        found = f"byte {error.start} is 0x{start[error.start]:02X}"
        return Encoding("cp1252", 0, f"not UTF-8 ({found}): read as {_SPOKEN['cp1252']}")
    return Encoding("utf-8")


def blocks(file: BinaryIO, encoding: Encoding) -> Iterator[bytes]:
    """Blocks of whole lines that end with a line feed; what follows the last line end is the last block.

    The carriage returns of old files become line feeds. A line of more than `LONGEST` bytes is cut to its beginning
    and ends with a NUL byte, so that no reader takes it for a row.
    """
    file.seek(encoding.mark)
    decoder = codecs.getincrementaldecoder(encoding.codec)("replace") if encoding.codec.startswith("utf-16") else None
    rest = b""
    old: bool | None = None
    while chunk := file.read(BLOCK):
        data = rest + (decoder.decode(chunk).encode() if decoder else chunk)
        if old is None and (b"\n" in data or b"\r" in data[:-1]):
            old = b"\n" not in data
        data = data.replace(b"\r", b"\n") if old else data
        end = data.rfind(b"\n") + 1
        if end:
            yield data[:end]
        rest = data[end:]
        if len(rest) > LONGEST:
            rest = rest[:_KEPT] + b"\0"
    rest += decoder.decode(b"", final=True).encode() if decoder else b""
    if rest:
        yield rest


def _not_text(path: Path, place: int, start: bytes, found: str) -> RecordingError:
    return RecordingError(
        "not text that can be read",
        file=path,
        place=f"byte {place}",
        found=found if start else "nothing",
        expected="UTF-8, UTF-16 with its byte order mark, or Windows-1252",
        advice="save the table as UTF-8 text",
    )
