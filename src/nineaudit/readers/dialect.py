"""How a text table is written: encoding, comments, header, separator, decimal mark."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from nineaudit.errors import RecordingError

SEPARATORS = (",", ";", "\t", "|")
_BOM = b"\xef\xbb\xbf"


@dataclass(frozen=True)
class Dialect:
    """`names` of the columns; `header_line` counted from 1; `body` is what follows it, `lead` bytes before it."""

    names: tuple[str, ...]
    separator: str
    decimal: str
    header_line: int
    body: bytes

    def lines(self) -> Iterator[tuple[int, str]]:
        """(line number in the file, text) of every line of the body that is not blank."""
        for number, line in enumerate(self.body.splitlines(), self.header_line + 1):
            if line.strip():
                yield number, line.decode()

    def cells(self, line: str) -> list[str]:
        return next(csv.reader([line], delimiter=self.separator, skipinitialspace=True), [])


def detect(
    data: bytes, wanted: set[str], path: Path, separator: str | None = None, decimal: str | None = None
) -> Dialect:
    """Read the head of a table: UTF-8, with or without byte order mark; lines of # before the header are comments.

    The separator, unless given, is the one of , ; tab | that shows most of the `wanted` columns. The decimal mark,
    unless given, is a comma where cells use one and none uses a point.

    Raises RecordingError: not UTF-8 (names the byte), no header row, no rows below it.
    """
    _require_text(data, path)
    data = data.removeprefix(_BOM)
    line, number, end = _header(data, path)
    separator = separator or _separator(line, wanted)
    names = tuple(name.strip() for name in next(csv.reader([line], delimiter=separator, skipinitialspace=True)))
    if all(_is_number(name) for name in names):
        raise RecordingError(
            "no header row: the first line holds numbers",
            file=path,
            place=f"line {number}",
            found=line[:60],
            expected="the names of the columns",
        )
    body = data[end:]
    if not body.strip():
        raise RecordingError("a header but no rows below it", file=path, place=f"line {number}")
    return Dialect(names, separator, decimal or _decimal(body, separator), number, body)


def _require_text(data: bytes, path: Path) -> None:
    try:
        data.decode("utf-8")
        place = data.find(b"\0")
    except UnicodeDecodeError as error:
        place = error.start
    if place >= 0:
        raise RecordingError(
            "not text in UTF-8",
            file=path,
            place=f"byte {place}",
            found=f"0x{data[place]:02X}",
            advice="save the table as UTF-8 text",
        )


def _header(data: bytes, path: Path) -> tuple[str, int, int]:
    """(text, line number, offset behind it) of the first line that is neither blank nor a comment."""
    offset = 0
    for number, raw in enumerate(data.splitlines(keepends=True), 1):
        offset += len(raw)
        line = raw.decode().rstrip("\r\n")
        if line.strip() and not line.lstrip().startswith("#"):
            return line, number, offset
    raise RecordingError("nothing but blank lines and comments", file=path, expected="a header row and rows")


def _separator(header: str, wanted: set[str]) -> str:
    def score(separator: str) -> tuple[int, int]:
        cells = [cell.strip() for cell in next(csv.reader([header], delimiter=separator, skipinitialspace=True))]
        return len(wanted.intersection(cells)), len(cells)

    return max(SEPARATORS, key=score)


def _decimal(body: bytes, separator: str) -> str:
    """Comma only where some cell is a number with a comma and none is one with a point."""
    if separator == ",":
        return "."
    edge = re.escape(separator.encode()) + rb'\s"'
    number = rb"(?:^|(?<=[%s]))[-+]?\d*%s\d+(?:[eE][-+]?\d+)?(?=[%s]|$)"
    if not re.search(number % (edge, b",", edge), body):
        return "."
    return "." if re.search(number % (edge, rb"\.", edge), body) else ","


def _is_number(cell: str) -> bool:
    try:
        float(cell.strip().replace(",", "."))
    except ValueError:
        return False
    return True
