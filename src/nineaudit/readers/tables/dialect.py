"""How a text table is written: where its header row is, its separator and its decimal mark."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from math import isfinite, nan
from pathlib import Path
from typing import Final

from nineaudit.errors import RecordingError
from nineaudit.readers.tables.text_blocks import Encoding

SEPARATORS: Final = (",", ";", "\t", "|")
_HEAD: Final = 2**20
_DEEPEST: Final = 200
_LABELLED: Final = 5
"""Bytes of a file that are its head, and lines of it among which a header row is sought."""
_DECIMALS: Final = {mark: re.compile(rf"[-+]?\d*{mark}\d+(?:[eE][-+]?\d+)?") for mark in (r"\.", ",")}
THOUSANDS: Final = re.compile(r"[-+]?\d{1,3}(?:([,.'\u00a0\u202f ’])\d{3})(?:\1\d{3})*(?:[.,]\d+)?")
_EXPONENT: Final = re.compile(r"([\d.])[dD](?=[-+]?\d+\s*$)")
_SAID: Final = {",": "comma", ";": "semicolon", "\t": "tab", "|": "vertical bar"}


@dataclass(frozen=True)
class Dialect:
    """`lines` of the head of a table, of which number `header` (from 0) holds the `names` of the columns; `offsets` are
    the bytes before each line."""

    lines: tuple[str, ...]
    offsets: tuple[int, ...]
    header: int
    names: tuple[str, ...]
    separator: str
    decimal: str
    codec: str
    trailing: bool = False

    @property
    def header_place(self) -> str:
        return f"line {self.header + 1}"

    def cells(self, line: str) -> list[str]:
        """Cells of a line, without the blanks around them."""
        return cells_of(line, self.separator)

    @cached_property
    def note(self) -> str:
        """What was detected, "" for commas and decimal points."""
        if (self.separator, self.decimal) == (",", "."):
            return ""
        name = _SAID.get(self.separator, repr(self.separator))
        return f"cells are separated by {name}, with a decimal {'comma' if self.decimal == ',' else 'point'}"


def cells_of(line: str, separator: str) -> list[str]:
    """Cells of a line by RFC 4180, without the blanks around them; an unfinished quote ends with the line."""
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    cells: list[str] = []
    for piece in line.split(separator):
        if cells and cells[-1].count('"') % 2:
            cells[-1] += separator + piece
        else:
            cells.append(piece)
    return [_unquoted(cell.strip()) for cell in cells]


def _unquoted(cell: str) -> str:
    return cell[1:-1].replace('""', '"').strip() if len(cell) > 1 and cell[0] == cell[-1] == '"' else cell


def detect(
    head: bytes,
    encoding: Encoding,
    wanted: set[str],
    path: Path,
    separator: str | None = None,
    decimal: str | None = None,
) -> Dialect:
    """How a table is written, by the first bytes of it.

    The header row is the one that names most of the `wanted` columns (with or without a unit in brackets); where none
    does, the first that is neither blank nor a comment (#). The separator, unless given, is the one of , ; tab | with
    which it does. The decimal mark, unless given, is a comma where cells use one and none uses a point.
    Raises RecordingError: nothing but comments, no header row, no rows below it.
    """
    raw = head[:_HEAD].split(b"\n")
    lines = tuple(line.decode(encoding.inside, "replace").rstrip("\r") for line in raw)
    separator = separator or _stated_separator(lines)
    header, separator = _header(lines, wanted, separator, path)
    names = _without_label(cells_of(lines[header], separator), lines[header + 1 :], separator)
    trailing = len(names) > 1 and not names[-1]
    below = [line for line in lines[header + 1 : -1 if len(head) > _HEAD else None] if line.strip()]
    if all(is_number(name) for name in names):
        raise _no_header(path, header, lines[header])
    if not below:
        raise RecordingError("a header but no rows below it", file=path, place=f"line {header + 1}")
    return Dialect(
        lines=lines,
        offsets=tuple(accumulate((len(line) + 1 for line in raw), initial=0)),
        header=header,
        names=tuple(names[:-1] if trailing else names),
        separator=separator,
        decimal=decimal or _decimal(below[:1000], separator),
        codec=encoding.inside,
        trailing=trailing,
    )


def _without_label(names: list[str], below: Sequence[str], separator: str) -> list[str]:
    """The names without the label of their line, which rows do not have (Gulf Coast Data Concepts: `;Headers, t,x`)."""
    rows = [cells_of(line, separator) for line in below[:_LABELLED] if line.strip()]
    alike = bool(rows) and all(len(cells) == len(names) - 1 for cells in rows[:-1] or rows)
    return names[1:] if alike and re.fullmatch(r"[;#]?\s*headers?", names[0], re.IGNORECASE) else names


def base(name: str) -> str:
    """A name of a column without the unit in brackets that ends it."""
    return re.sub(r"\s*(\[[^\[\]]*\]|\([^()]*\))$", "", name)


def is_number(cell: str) -> bool:
    """Whether a cell is a finite or infinite number, with a decimal point or comma."""
    try:
        float(_EXPONENT.sub(r"\1e", cell.strip().replace(",", ".")))
    except ValueError:
        return False
    return "_" not in cell


def number(cell: str, decimal: str) -> float:
    """The finite number in a cell, NaN for anything else: Python's 1_000 is no number, Fortran's 1.5D+02 is."""
    if decimal == ",":
        cell = "" if "." in cell else cell.replace(",", ".")
    try:
        value = nan if "_" in cell or not cell.isascii() else float(_EXPONENT.sub(r"\1e", cell))
    except ValueError:
        return nan
    return value if isfinite(value) else nan


def _stated_separator(lines: Sequence[str]) -> str | None:
    """What a spreadsheet's first line `sep=;` says."""
    found = re.fullmatch(r'"?sep=(.)"?', lines[0].strip("\ufeff "), re.IGNORECASE)
    return found[1] if found else None


def _header(lines: Sequence[str], wanted: set[str], separator: str | None, path: Path) -> tuple[int, str]:
    """(index of the header row, separator): most wanted names, then most cells, then the first."""
    candidates = [i for i, line in enumerate(lines[:_DEEPEST]) if line.strip() and not line.lstrip().startswith("#")]
    candidates = [i for i in candidates if not (i == 0 and _stated_separator(lines))]
    if not candidates:
        raise RecordingError("nothing but blank lines and comments", file=path, expected="a header row and rows")
    separators = (separator,) if separator else SEPARATORS
    best, most = (candidates[0], separators[0]), (0, 0)
    for i in candidates:
        for s in separators:
            score = _score(lines[i], s, wanted)
            best, most = ((i, s), score) if score > most else (best, most)
        if most[0] == len(wanted):
            break
    return best if most[0] else _unknown_header(lines, candidates, separators)


def _score(line: str, separator: str, wanted: set[str]) -> tuple[int, int]:
    cells = cells_of(line, separator)
    return len(wanted.intersection(cells) | wanted.intersection(map(base, cells))), len(cells)


def _unknown_header(lines: Sequence[str], candidates: Sequence[int], separators: Sequence[str]) -> tuple[int, str]:
    """Where no name is known: the first line with as many cells as the first row of numbers has, else the first."""
    for i in candidates:
        for separator in separators:
            cells = cells_of(lines[i], separator)
            if len(cells) > 1 and all(is_number(cell) for cell in cells if cell):
                same = (j for j in candidates if len(cells_of(lines[j], separator)) == len(cells))
                return next(same), separator
    return candidates[0], max(separators, key=lambda s: len(cells_of(lines[candidates[0]], s)))


def _decimal(lines: Sequence[str], separator: str) -> str:
    """Comma only where some cell is a number with a comma and none is one with a point; between commas only where a
    quoted cell cannot be one with thousands separators."""
    cells = [cell for line in lines for cell in cells_of(line, separator)]
    commas = [cell for cell in cells if _DECIMALS[","].fullmatch(cell)]
    if separator == ",":
        commas = [cell for cell in commas if not THOUSANDS.fullmatch(cell)]
    points = any(_DECIMALS[r"\."].fullmatch(cell) for cell in cells)
    return "," if commas and not points else "."


def _no_header(path: Path, header: int, line: str) -> RecordingError:
    return RecordingError(
        "no header row: the first line holds numbers",
        file=path,
        place=f"line {header + 1}",
        found=line[:60],
        expected="the names of the columns",
    )
