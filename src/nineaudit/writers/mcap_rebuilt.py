"""Channels that were rebuilt, added to an MCAP log of which not a byte is changed.

The new file begins with the bytes of the log up to the end of its data section. Behind them come a topic for each
rebuilt channel, the record of the repair as metadata, and a summary that speaks of all. Source: MCAP file format
specification, mcap.dev/spec.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.provenance import MCAP_RECORD
from nineaudit.writers import mcap_summary

TOPIC: Final = "/nineaudit/{}"
CHUNK_BYTES: Final = 1 << 20


class NotWhole(Exception):
    """A log that nothing can be added to, for it is damaged, cut short or no MCAP file."""


@dataclass(frozen=True, eq=False)
class Column:
    """A rebuilt channel: (n,) `time` s, `values` and their standard uncertainty `u` in `unit`, and which samples are
    not as measured."""

    channel: str
    unit: str
    time: FloatArray
    values: FloatArray
    u: FloatArray
    replaced: BoolArray


def add_rebuilt(log: Path, target: Path, columns: Sequence[Column], document: Mapping[str, Any], start: int) -> None:
    """Write `log` with the columns and the record of the repair to `target`; `start` (ns) is the log time of 0 s.

    Raises NotWhole, and OSError.
    """
    old = mcap_summary.read(log)
    if old is None:
        raise NotWhole(str(log))
    topics = {c.channel: topic for c, topic in zip(columns, _topics(columns, old), strict=True)}
    text = json.dumps({**document, "mcap": {"topics": topics}}, ensure_ascii=False, allow_nan=False)
    with log.open("rb") as source, target.open("xb") as file:
        out = mcap_summary.Appended(source, file, old)
        for column in columns:
            channel = out.channel(topics[column.channel], f"nineaudit.rebuilt.{column.channel}", _schema(column))
            for times, payloads in _blocks(column, start):
                out.messages(channel, times, payloads)
        out.metadata(MCAP_RECORD, {"json": text})
        out.finish()


def log_time_of_zero(log: Path, topics: Sequence[str], first: float) -> int:
    """Log time, ns, at which the clock of a recording is 0: its `first` stamp, s, is that of the first message of the
    topics (none: of the log)."""
    from mcap.reader import make_reader

    with log.open("rb") as file:
        reader = make_reader(file)
        message = next((m for _, _, m in reader.iter_messages(topics=list(topics) or None)), None)
    return 0 if message is None else int(message.log_time) - round(first * 1e9)


def _topics(columns: Sequence[Column], old: mcap_summary.Old) -> Iterator[str]:
    """A name for each topic that no other has."""
    taken = {channel.topic for channel in old.channels}
    for column in columns:
        name, number = TOPIC.format(column.channel), 2
        while name in taken:
            name, number = f"{TOPIC.format(column.channel)}-{number}", number + 1
        taken.add(name)
        yield name


def _schema(column: Column) -> bytes:
    number = {"type": ["number", "null"]}
    schema = {
        "title": f"{column.channel}, repaired by nineaudit",
        "description": "An estimate where `replaced` is true; elsewhere as measured.",
        "type": "object",
        "properties": {
            "t": {"type": "number", "description": "time on the recording's common clock, s"},
            "value": {**number, "description": f"reading, {column.unit}"},
            "u": {**number, "description": f"standard uncertainty of a replaced reading, {column.unit}"},
            "replaced": {"type": "boolean", "description": "whether the reading is not as measured"},
        },
    }
    return json.dumps(schema, ensure_ascii=False).encode()


def _blocks(column: Column, start: int) -> Iterator[tuple[list[int], list[bytes]]]:
    """Log times and messages, about as many as a chunk holds."""
    stamps = np.rint(column.time * 1e9).astype(np.int64) + start
    step = CHUNK_BYTES // 96
    for first in range(0, len(stamps), step):
        part = slice(first, first + step)
        rows = zip(column.time[part].tolist(), column.values[part].tolist(), column.u[part].tolist(),
                   column.replaced[part].tolist(), strict=True)  # fmt: skip
        yield stamps[part].tolist(), [_message(*row) for row in rows]


def _message(t: float, value: float, u: float, replaced: bool) -> bytes:
    number = None if value != value else value
    return json.dumps({"t": t, "value": number, "u": u if replaced and u == u else None, "replaced": replaced}).encode()
