"""An MCAP log that was repaired: its topics are as measured, and the rebuilt channels stand on topics of their own.

The record of the repair, in the log's metadata, says which topic stands for which channel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nineaudit.array import frozen
from nineaudit.errors import RecordingError
from nineaudit.provenance import chain, parse
from nineaudit.readers.contents import Contents
from nineaudit.readers.mcap.book import Book
from nineaudit.readers.mcap.json import Json
from nineaudit.readers.mcap.reader import mapped, read_mcap
from nineaudit.readers.mcap.records import batches
from nineaudit.recording import Trace

if TYPE_CHECKING:
    from nineaudit.rig import Rig


def read_repaired(path: Path, rig: Rig) -> Contents:
    """Signals of an MCAP log, those that a repair rebuilt from the topics that it wrote, and the record of it.

    Raises RecordingError: as read_mcap, and where a topic that the record names is not there.
    """
    found = read_mcap(path, rig)
    if found.provenance is None:
        return found
    topics = _topics(found.provenance)
    rebuilt = {channel: topic for channel, topic in topics.items() if channel in rig.array.channels}
    columns = _columns(path, set(rebuilt.values()))
    traces = tuple(_trace(t, rebuilt, columns, path) for t in found.traces)
    notes = tuple(f"{c}: as repaired, from topic {topic}; its own topic is as measured" for c, topic in rebuilt.items())
    return replace(found, traces=traces, notes=(*found.notes, *notes))


def record_in(path: Path) -> Mapping[str, Any] | None:
    """The record of a repair that stands in an MCAP log; None in other files, and where there is none.

    RecordingError: no MCAP log in spite of its suffix, or no record.
    """
    if path.suffix.lower() != ".mcap" or not path.is_file():
        return None
    book = Book()
    for _ in batches(mapped(path), book, lambda _: False):
        pass
    return None if book.repair is None else parse(book.repair, path)


def _topics(document: Mapping[str, Any]) -> dict[str, str]:
    """Channel -> topic, of the newest repair that made it."""
    topics: dict[str, str] = {}
    for one in chain(document):
        inside = one.get("mcap")
        named = inside.get("topics") if isinstance(inside, dict) else None
        if isinstance(named, dict):
            topics = {str(c): str(topic) for c, topic in named.items()} | topics
    return topics


def _columns(path: Path, topics: set[str]) -> dict[str, tuple[list[Any], list[Any]]]:
    """Topic -> blocks of its times and of its values."""
    found: dict[str, tuple[list[Any], list[Any]]] = {topic: ([], []) for topic in topics}
    for batch in batches(mapped(path), Book(), lambda channel: channel.topic in topics):
        time, value = Json().read(batch, ["t", "value"]).columns
        found[batch.channel.topic][0].append(time.floats())
        found[batch.channel.topic][1].append(value.floats())
    return found


def _trace(
    trace: Trace, rebuilt: Mapping[str, str], columns: Mapping[str, tuple[list[Any], list[Any]]], path: Path
) -> Trace:
    topic = rebuilt.get(trace.channel)
    if topic is None:
        return trace
    times, values = columns[topic]
    if not times:
        raise RecordingError(
            f"the rebuilt channel {trace.channel!r} is not there",
            file=path,
            expected=f"topic {topic}, as the record of the repair says",
            advice="repair the original again",
        )
    time, value = frozen(np.concatenate(times)), frozen(np.concatenate(values))
    return replace(trace, signal=f"{topic}:value", time=time, values=value)
