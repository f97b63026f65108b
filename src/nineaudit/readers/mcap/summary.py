"""The end of an MCAP log: footer and summary, by which the data section is checked and found again after damage.

Source: MCAP file format specification, mcap.dev/spec: "Summary Section", "Footer (op=0x02)".
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from typing import Final

from nineaudit.readers.mcap import parse as parse
from nineaudit.readers.mcap.damage import Damages
from nineaudit.readers.mcap.parse import MAGIC, Channel, Malformed, Record, Schema, Statistics

_FOOTER_SIZE: Final = 20
_BLOCK: Final = 2**22


@dataclass(frozen=True)
class Summary:
    """What the summary says: copies of definitions, the statistics, the bytes where chunks begin (ascending). `end`:
    the byte where the data section must end; `whole`: there is a footer; `good`: and what it
    points to can be read."""

    end: int
    whole: bool = False
    good: bool = True
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    statistics: Statistics | None = None
    chunks: tuple[int, ...] = ()


def summary(data: memoryview, damages: Damages) -> Summary:
    """The summary of a file. One that is not there, or whose checksum does not hold, says nothing; the latter is
    damage."""
    size = len(data)
    foot = size - len(MAGIC) - _FOOTER_SIZE - parse.RECORD_HEAD
    whole = foot >= len(MAGIC) and bytes(data[size - len(MAGIC) :]) == MAGIC and data[foot] == parse.FOOTER
    if not whole:
        return Summary(size)
    try:
        footer = parse.footer(data, parse.record_at(data, foot, size))
        return _read(data, foot, footer)
    except Malformed as error:
        damages.add(f"summary: {error}", foot, words="its counts and copies are not used")
        return Summary(foot, whole=True, good=False)


def _read(data: memoryview, foot: int, footer: parse.Footer) -> Summary:
    start = footer.summary_start or foot
    if not len(MAGIC) <= start <= foot:
        raise Malformed("it begins outside the file")
    covered = foot + parse.RECORD_HEAD + _FOOTER_SIZE - 4
    if footer.crc and crc32(data, start, covered) != footer.crc:
        raise Malformed("its checksum (CRC) does not hold")
    found = list(parse.records(data, start, foot))
    stated = [parse.statistics(data, r) for r in found if r.op == parse.STATISTICS]
    chunks = sorted({parse.chunk_offset(data, r) for r in found if r.op == parse.CHUNK_INDEX})
    return Summary(
        end=start,
        whole=True,
        schemas={s.id: s for s in _all(data, found, parse.SCHEMA)},
        channels={c.id: c for c in (parse.channel(data, r) for r in found if r.op == parse.CHANNEL)},
        statistics=stated[0] if stated else None,
        chunks=tuple(c for c in chunks if len(MAGIC) <= c < start),
    )


def _all(data: memoryview, found: list[Record], op: int) -> list[Schema]:
    return [parse.schema(data, r) for r in found if r.op == op]


def crc32(data: memoryview, start: int, end: int) -> int:
    """CRC-32 of a part of a file, read in blocks."""
    crc = 0
    for at in range(start, end, _BLOCK):
        crc = zlib.crc32(data[at : min(end, at + _BLOCK)], crc)
    return crc
