"""Rows of a text table as columns of numbers, block after block; and what was wrong with rows and cells.

The number of cells is checked on every row. A block whose rows all have the same separators and quotes goes through
Arrow's reader; any other, and one in which Arrow finds a cell that holds no number, goes through `_by_cell`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import isnan, nan
from pathlib import Path
from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import RecordingError
from nineaudit.readers.tables.dialect import THOUSANDS, Dialect, number
from nineaudit.readers.tables.equal_rows import parsed, structure
from nineaudit.recording import Damage
from nineaudit.units import counted

_TRAILING: Final = "rows end with a separator that the header does not have: it is left out"


@dataclass(eq=False)
class Rows:
    """Numbers of the `wanted` columns, NaN where a cell holds none. `line` is the number of the next line.

    `keep`: a row of the wrong length keeps its place, without readings (time is counted in rows). `whole` bytes of the
    file: by the first block, as many numbers find room as it may hold (in pages that nothing is written to until then,
    where many small arrays would be held twice when they are joined).
    """

    table: Dialect
    wanted: tuple[int, ...]
    path: Path
    line: int
    keep: bool = False
    whole: int = 0
    size: int = 0
    buffers: list[FloatArray] = field(default_factory=list)
    bad: Counter[int] = field(default_factory=Counter)
    first_bad: dict[int, str] = field(default_factory=dict)
    ragged: Counter[str] = field(default_factory=Counter)
    first_ragged: dict[str, tuple[int, str]] = field(default_factory=dict)
    comments: int = 0
    trailing: bool = False
    unfinished: int = 0

    def add(self, block: bytes) -> None:
        """Read one block of lines; only the last may end without a line end."""
        if not block.endswith(b"\n"):
            self.unfinished = self.line + block.count(b"\n")
            block += b"\n"
        cells, rows = structure(block, self.table)
        values = self._by_arrow(block, cells) if self._fits(block, cells, rows) else None
        if values is None:
            values, rows = self._by_cell(block), block.count(b"\n")
        self._keep(values, len(block))
        self.line += rows

    def column(self, index: int) -> FloatArray:
        """(n,) numbers of wanted column number `index`."""
        return self.buffers[index][: self.size] if self.buffers else np.empty(0)

    def _keep(self, values: Sequence[FloatArray], length: int) -> None:
        end = self.size + values[0].size
        if not self.buffers:
            room = int(1.05 * end * max(self.whole / length, 1.0))
            self.buffers = [np.empty(room) for _ in self.wanted]
        for i, numbers in enumerate(values):
            if end > self.buffers[i].size:
                larger = np.empty(end + end // 4)
                larger[: self.size] = self.buffers[i][: self.size]
                self.buffers[i] = larger
            self.buffers[i][self.size : end] = numbers
        self.size = end

    def notes(self) -> Iterator[str]:
        """What holds no number, by column, and what else was seen."""
        for column, count in self.bad.items():
            bad = f"{counted(count, 'cell')} without a number, {self.first_bad[column]}"
            yield f"column {self.table.names[column]!r}: {bad}"
        if self.trailing:
            yield _TRAILING
        if self.comments:
            yield f"{counted(self.comments, 'line')} of comment among the rows"

    def damage(self) -> Iterator[Damage]:
        """Rows that could not be read, one Damage a kind, and a last line without its end."""
        lost = "they are rows without readings" if self.keep else "these rows are left out"
        for what, count in self.ragged.items():
            line, found = self.first_ragged[what]
            yield Damage(what, f"line {line}", count, f"{found}; {lost}")
        if self.unfinished:
            what = "the last line has no line end: the file may be cut"
            yield Damage(what, f"line {self.unfinished}", lost="its last number may not be whole")

    def _fits(self, block: bytes, cells: int, rows: int) -> bool:
        """Whether rows of so many cells are as the header has them, or with one more that is empty."""
        surplus = cells - len(self.table.names)
        ends = self.table.separator.encode()
        if surplus == 1 and block.count(ends + b"\n") + block.count(ends + b"\r\n") == rows:
            self.trailing = self.trailing or not self.table.trailing
            return True
        return surplus == 0

    def _by_arrow(self, block: bytes, cells: int) -> list[FloatArray] | None:
        """The columns of a block of equal rows, None where cells hold what Arrow does not read."""
        values = parsed(block, self.table, self.wanted, cells)
        if values is None:
            values = parsed(self._without_words(block), self.table, self.wanted, cells)
        if values is None:
            return None
        lines: list[bytes] = []
        for column, numbers in zip(self.wanted, values, strict=True):
            gaps = np.flatnonzero(~np.isfinite(numbers))
            if gaps.size:
                numbers[gaps] = np.nan
                self.bad[column] += gaps.size
            if gaps.size and column not in self.first_bad:
                lines = lines or block.split(b"\n")
                row = int(gaps[0])
                self._first(column, self.line + row, self._cells(lines[row])[column])
        return values

    def _without_words(self, block: bytes) -> bytes:
        """The block with nothing in the cells that hold no number, and in those that are not wanted, of the lines that
        hold anything but numbers."""
        separator = self.table.separator
        numeric = b"0123456789+-eE \t\r" + (separator + self.table.decimal).encode()
        lines = block.split(b"\n")
        for i, line in enumerate(lines):
            if line.translate(None, numeric):
                cells = self._cells(line)
                kept = {column: self._numeric(cells[column], column, self.line + i) for column in self.wanted}
                lines[i] = separator.join(kept.get(column, "") for column in range(len(cells))).encode()
        return b"\n".join(lines)

    def _numeric(self, cell: str, column: int, line: int) -> str:
        if not isnan(number(cell, self.table.decimal)):
            return cell
        self._refuse_thousands(cell, column, line)
        return ""

    def _by_cell(self, block: bytes) -> list[FloatArray]:
        values: list[list[float]] = [[] for _ in self.wanted]
        for place, line in enumerate(block[:-1].split(b"\n"), self.line):
            if not line.strip():
                continue
            if line.lstrip().startswith((b"#", b"#" if self.table.separator == ";" else b";")):
                self.comments += 1
                continue
            for column, numbers in zip(values, self._row(line, place), strict=False):
                column.append(numbers)
        return [np.array(v) for v in values]

    def _row(self, line: bytes, number: int) -> Sequence[float]:
        """Numbers of the wanted cells; none of a row of the wrong length, unless it keeps its place."""
        cells = self._cells(line)
        surplus = len(cells) - len(self.table.names)
        if b"\0" in line:
            self._leave(number, "NUL bytes in a row", f"{line.count(0)} of them")
        elif surplus == 0 or (surplus == 1 and not cells[-1]):
            self.trailing = self.trailing or (surplus == 1 and not self.table.trailing)
            return [self._reading(cells[column], column, number) for column in self.wanted]
        else:
            held = f"{counted(len(cells), 'cell')} for {counted(len(self.table.names), 'column')}"
            self._leave(number, "a row of the wrong length", held)
        return [nan] * len(self.wanted) if self.keep else ()

    def _cells(self, line: bytes) -> list[str]:
        return self.table.cells(line.decode(self.table.codec, "replace"))

    def _reading(self, cell: str, column: int, line: int) -> float:
        value = number(cell, self.table.decimal)
        if value != value:
            self._refuse_thousands(cell, column, line)
            self.bad[column] += 1
            if column not in self.first_bad:
                self._first(column, line, cell)
        return value

    def _first(self, column: int, line: int, cell: str) -> None:
        self.first_bad[column] = f"first in line {line}: {cell[:40]!r}"

    def _leave(self, line: int, what: str, found: str) -> None:
        self.ragged[what] += 1
        self.first_ragged.setdefault(what, (line, found))

    def _refuse_thousands(self, cell: str, column: int, line: int) -> None:
        if THOUSANDS.fullmatch(cell):
            raise RecordingError(
                "a number with thousands separators, or with another decimal mark than the rest",
                file=self.path,
                place=f"line {line}, column {self.table.names[column]!r}",
                found=cell,
                expected=f"a number with a decimal {'comma' if self.table.decimal == ',' else 'point'} alone",
                advice="export without thousands separators, or set [recording] separator and decimal in the rig file",
            )
