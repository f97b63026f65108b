"""MCAP logs with JSON, protobuf, ROS 1 or ROS 2 messages. A signal is /topic:field.path, or a field's name where it is
unique.

Time is the log time of a message, unless the rig names a time signal that the topic's messages carry. What of a file
cannot be read is reported, what is good is kept (docs/readers.md).
"""

from __future__ import annotations

import mmap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from nineaudit.array import FloatArray, read_only
from nineaudit.errors import RecordingError
from nineaudit.identity import began, moment, stated
from nineaudit.provenance import parse
from nineaudit.readers.contents import Contents
from nineaudit.readers.mcap.book import Book
from nineaudit.readers.mcap.columns import Column
from nineaudit.readers.mcap.parse import MAGIC
from nineaudit.readers.mcap.records import batches
from nineaudit.readers.mcap.topics import Stream, Topics, unreadable
from nineaudit.recording import Trace
from nineaudit.signals import suggestion, time_unit
from nineaudit.units import factor

if TYPE_CHECKING:
    from nineaudit.rig import Rig

_EPOCH_NS: Final = 10**15
"""1e6 s: larger times are dates, and lose digits as floating-point seconds."""


def read_mcap(path: Path, rig: Rig) -> Contents:
    """Signals of an MCAP log, each topic on its own clock, and what of the file could not be read.

    Values that are absent, null or no numbers are NaN and counted. Raises RecordingError: not an MCAP file, no message
    that can be read, a missing topic or field, an encoding that is not read.
    """
    book = Book()
    topics = Topics(rig, path, book)
    for batch in batches(mapped(path), book, topics.wanted):
        topics.take(batch)
    if not book.count:
        raise _nothing(path, book)
    places = [_place(sensor.signal, sensor.channel, topics) for sensor in rig.array.sensors]
    used = {topic: _streams(topics, topic) for topic in dict.fromkeys(topic for topic, _ in places)}
    clocks, base, notes = _clocks(used, rig, book.origin)
    times = {topic: read_only(time[timed]) for topic, (time, timed) in clocks.items()}
    traces = []
    for sensor, (topic, name) in zip(rig.array.sensors, places, strict=True):
        timed, values = clocks[topic].there, _values(used[topic], name)
        values = read_only(values if timed.all() else values[timed])
        traces.append(Trace(sensor.channel, f"{topic}:{name}", times[topic], values, message=topic))
    counts = _counts(book, topics, used) | {
        "messages_without_time": sum(int(np.count_nonzero(~timed)) for _, timed in clocks.values()),
        "invalid_values": sum(int(np.count_nonzero(np.isnan(t.values))) for t in traces),
    }
    repair = None if book.repair is None else parse(book.repair, path)
    notes = (*notes, *_notes(book, rig, used))
    about = (*stated(book.test, f"metadata of {path.name}"), *began(moment(base / 1e9, True), path.name))
    return Contents(tuple(traces), counts, notes, book.damages.all(), provenance=repair, stated=about)


def mapped(path: Path) -> memoryview:
    """A file's bytes, read as they are needed. Raises RecordingError where it is no MCAP file."""
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise RecordingError("not an MCAP file", file=path, place="byte 0", expected="the magic bytes \\x89MCAP0")
        return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))


def _nothing(path: Path, book: Book) -> RecordingError:
    damage = "; ".join(str(d) for d in book.damages.all()[:3])
    return RecordingError(
        f"the file is cut short or damaged: {damage}" if damage else "there are no messages in this file",
        file=path,
        advice="no messages could be read; record or copy the file again" if damage else None,
    )


def _streams(topics: Topics, topic: str) -> list[Stream]:
    return [s for s in topics.streams.values() if s is not None and s.topic == topic and s.times]


def _place(signal: str, channel: str, topics: Topics) -> tuple[str, str]:
    """(topic, field) of a signal."""
    topic, colon, name = signal.partition(":")
    if not colon:
        return _owner(signal, channel, topics), signal
    streams = _streams(topics, topic)
    if not streams:
        raise _no_topic(topic, channel, topics)
    if not any(name in s.known or s.column(name).there.any() for s in streams):
        leaves = [leaf for s in streams for leaf in s.leaves]
        raise _missing(channel, topics, f"a field {name!r}", suggestion(name, leaves), f"topic {topic}")
    return topic, name


def _owner(signal: str, channel: str, topics: Topics) -> str:
    """The one topic that has a field."""
    streams = [s for s in topics.streams.values() if s is not None]
    hits = list(dict.fromkeys(s.topic for s in streams if signal in s.known))
    if len(hits) == 1:
        return hits[0]
    names = [f"{s.topic}:{leaf}" for s in streams for leaf in s.leaves]
    advice = f"in more than one topic: {', '.join(hits)}" if hits else suggestion(signal, names)
    raise _missing(channel, topics, f"/topic:{signal} for signal {signal!r}", advice)


def _no_topic(topic: str, channel: str, topics: Topics) -> RecordingError:
    if topic in topics.refused:
        return unreadable(topics.path, topic, topics.refused[topic])
    there = [c.topic for number, c in topics.book.channels.items() if topics.book.messages.get(number)]
    return _missing(channel, topics, f"a topic {topic!r}", suggestion(topic, there))


def _missing(
    channel: str, topics: Topics, expected: str, advice: str | None, place: str | None = None
) -> RecordingError:
    damage = [f"the file is damaged: {d}" for d in topics.book.damages.all()[:1]]
    said = "; ".join([*([advice] if advice else []), *damage])
    what = f"missing channel {channel!r}"
    return RecordingError(what, file=topics.path, place=place, expected=expected, advice=said or None)


def _in_order(streams: Sequence[Stream], columns: Sequence[Any]) -> Any:
    """Columns of the channels of a topic as one, in the order of the file."""
    if len(columns) == 1:
        return columns[0]
    return np.concatenate(columns)[np.argsort(np.concatenate([o for s in streams for o in s.order]))]


def _values(streams: Sequence[Stream], name: str) -> FloatArray:
    found: FloatArray = _in_order(streams, [s.column(name).floats() for s in streams])
    return found


def _clocks(used: dict[str, list[Stream]], rig: Rig, origin: int) -> tuple[dict[str, Column], int, tuple[str, ...]]:
    """(m,) s of each topic's messages, and which have a time. Dates count from the earliest, ns; the note says so."""
    stamps = {topic: _topic_stamps(streams, rig, origin) for topic, streams in used.items()}
    dates = {topic: _first_ns(stamp) for topic, stamp in stamps.items() if _first_ns(stamp) > _EPOCH_NS}
    base = min(dates.values(), default=0)
    clocks = {topic: _seconds(stamp, base if topic in dates else 0) for topic, stamp in stamps.items()}
    return clocks, base, (f"time counts from log time {base} ns",) if base else ()


def _topic_stamps(streams: Sequence[Stream], rig: Rig, origin: int) -> Column:
    columns = [_stamps(s, rig, origin) for s in streams]
    return Column(*(_in_order(streams, [c[k] for c in columns]) for k in range(2)))


def _stamps(stream: Stream, rig: Rig, origin: int) -> Column:
    """(m,) times of a channel's messages: int64 ns, or float64 s where its time signal is no integer."""
    if not stream.stamp:
        times = np.concatenate(stream.times) + origin
        return Column(times, np.ones(len(times), dtype=bool))
    columns = [stream.column(name) for name in stream.stamp]
    there = np.logical_and.reduce([c.there for c in columns])
    unit = "s" if len(columns) == 2 else time_unit(stream.stamp[0], rig.time_unit) or "s"
    scales = (round(factor(unit, "time") * 1e9), 1)[: len(columns)]
    parts = list(zip(columns, scales, strict=True))
    if all(_counts_ns(c, scale) for c, scale in parts):
        return Column(np.add.reduce([c.values.astype(np.int64) * scale for c, scale in parts]), there)
    return Column(np.add.reduce([c.floats() * (scale / 1e9) for c, scale in parts]), there)


def _counts_ns(column: Column, scale: int) -> bool:
    """Whether a column is of integers that stay exact in ns."""
    return column.values.dtype.kind in "iu" and bool(np.nanmax(np.abs(column.floats()), initial=0) * scale < 2**62)


def _first_ns(stamps: Column) -> int:
    """The earliest time in ns, 0 where there is none."""
    found = stamps.values[stamps.there]
    return int(found.min() * (1 if found.dtype.kind == "i" else 1e9)) if len(found) else 0


def _seconds(stamps: Column, base: int) -> Column:
    whole = stamps.values.dtype.kind == "i"
    return Column((stamps.values - base) * 1e-9 if whole else stamps.values - base * 1e-9, stamps.there)


def _counts(book: Book, topics: Topics, used: dict[str, list[Stream]]) -> dict[str, float]:
    with_messages = {book.channels[k].topic for k, n in book.messages.items() if n and k in book.channels}
    return {
        "messages": book.count,
        "topics": len(with_messages),
        "messages_used": sum(len(t) for streams in used.values() for s in streams for t in s.times),
        "undecodable_messages": topics.undecodable,
        "chunks": book.chunks,
        "attachments": book.attachments,
        "unknown_records": book.unknown,
    }


def _notes(book: Book, rig: Rig, used: dict[str, list[Stream]]) -> list[str]:
    notes = [f"topic {topic} comes on {len(s)} channels" for topic, s in used.items() if len(s) > 1]
    unstamped = [topic for topic, streams in used.items() if rig.time_signal and not all(s.stamp for s in streams)]
    if unstamped:
        notes.append(f"no time signal {rig.time_signal!r} in topic {', '.join(unstamped)}: the log times are taken")
    if book.unchecked:
        notes.append(f"{book.unchecked} of {book.chunks} chunks carry no checksum (CRC)")
    return notes
