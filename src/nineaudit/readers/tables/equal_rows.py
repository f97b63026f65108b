"""Blocks of a text table whose rows are all alike: found by their separators and quotes, read by Arrow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from nineaudit.array import FloatArray
from nineaudit.readers.tables import columns
from nineaudit.readers.tables.dialect import Dialect


def structure(block: bytes, table: Dialect) -> tuple[int, int]:
    """(cells of every row, rows) of a block; cells 0 where rows differ, or hold what only `_by_cell` reads."""
    separator = table.separator.encode()
    comment = block.startswith(b"#") or b"\n#" in block
    if comment or table.decimal == table.separator or len(table.names) < 2 or len(separator) != 1:
        return 0, 0
    marks = block.translate(None, _OTHERS.get(separator) or _others(separator))
    row = marks[: marks.index(b"\n") + 1]
    cells, rows = row.removesuffix(b"\n").removesuffix(b"\r").split(separator), len(marks) // len(row)
    plain = all(cell in (b"", b'""') for cell in cells)
    return (len(cells) if plain and row * rows == marks else 0), rows


def _others(separator: bytes) -> bytes:
    """All bytes but those that structure a table: separator, quote, line ends and NUL."""
    return bytes(set(range(256)).difference(separator + b'"\r\n\0'))


_OTHERS: Final = {mark: _others(mark) for mark in (b",", b";", b"\t", b"|")}


def parsed(block: bytes, table: Dialect, wanted: Sequence[int], cells: int) -> list[FloatArray] | None:
    """The `wanted` columns of a block of rows of so many cells, NaN where a cell is empty; None where Arrow finds one
    that holds no number. (pandas' C engine is no faster on blocks, and takes a second and a half to import.)"""
    import pyarrow as pa
    from pyarrow import csv

    names = [f"c{i}" for i in dict.fromkeys(wanted)]
    try:
        parsed = csv.read_csv(
            pa.BufferReader(block),
            read_options=csv.ReadOptions(
                column_names=[f"c{i}" for i in range(cells)], use_threads=False, block_size=len(block) + 1
            ),
            parse_options=csv.ParseOptions(
                delimiter=table.separator, quote_char='"' if b'"' in block else False, ignore_empty_lines=False
            ),
            convert_options=csv.ConvertOptions(
                include_columns=names, column_types=dict.fromkeys(names, pa.float64()), decimal_point=table.decimal
            ),
        )
    except pa.ArrowInvalid:
        return None
    return [columns.floats(parsed.column(f"c{i}")) for i in wanted]
