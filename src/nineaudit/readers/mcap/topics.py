"""Which messages of an MCAP log carry a rig's signals, and their numbers collected channel by channel."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from nineaudit.errors import RecordingError
from nineaudit.readers.mcap.book import Book
from nineaudit.readers.mcap.cdr import Ros
from nineaudit.readers.mcap.columns import Column, Decoder, Undecodable
from nineaudit.readers.mcap.json import Json
from nineaudit.readers.mcap.parse import Channel, Int64, Schema
from nineaudit.readers.mcap.protobuf import Protobuf, message_class
from nineaudit.readers.mcap.records import Batch
from nineaudit.readers.mcap.ros import message_type

if TYPE_CHECKING:
    from nineaudit.rig import Rig

_SCHEMAS: Final = {"cdr": "ros2msg", "ros1": "ros1msg", "protobuf": "protobuf"}
READABLE: Final = ("json", *_SCHEMAS)
_STAMPS: Final = (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs"), ("seconds", "nanos"))
"""Fields of a time stamp: ROS 2, JSON of ROS, ROS 1, protobuf."""


def decoder(channel: Channel, schema: Schema | None) -> Decoder:
    """What reads a channel's messages. Raises Undecodable: an encoding or a schema that is not read."""
    if channel.encoding == "json":
        return Json()
    wanted = _SCHEMAS.get(channel.encoding)
    if wanted is None or schema is None or schema.encoding != wanted:
        raise Undecodable(f"{channel.encoding}, schema {schema.encoding if schema else 'none'}")
    if wanted == "protobuf":
        return Protobuf(message_class(schema))
    try:
        text = schema.data.decode()
    except UnicodeDecodeError as error:
        raise Undecodable(f"schema {schema.name} is not text") from error
    return Ros(message_type(schema.name, text, channel.encoding.replace("cdr", "ros2")), channel.encoding == "cdr")


@dataclass
class Stream:
    """One channel: the paths that are read, those of its time stamp if it has one, and what was read."""

    topic: str
    decoder: Decoder
    paths: list[str]
    stamp: tuple[str, ...] = ()
    known: frozenset[str] = frozenset()
    leaves: tuple[str, ...] = ()
    columns: dict[str, list[Column]] = field(default_factory=dict)
    times: list[Int64] = field(default_factory=list)
    order: list[Int64] = field(default_factory=list)

    @property
    def names(self) -> list[str]:
        """Every path that is read, each once."""
        return list(dict.fromkeys([*self.paths, *self.stamp]))

    def column(self, path: str) -> Column:
        """The numbers at a path, of all messages; none where another channel of the topic alone has it."""
        if path not in self.columns:
            count = sum(map(len, self.times))
            return Column(np.zeros(count), np.zeros(count, dtype=bool))
        values, there = zip(*self.columns[path], strict=True)
        return Column(np.concatenate(values), np.concatenate(there))


Key = tuple[Channel, Schema | None]


@dataclass
class Topics:
    """The streams of a log, by definition of their channel: those that a rig's signals are on hold numbers."""

    rig: Rig
    path: Path
    book: Book
    streams: dict[Key, Stream | None] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    undecodable: int = 0

    def wanted(self, channel: Channel) -> bool:
        """Whether messages of a channel are to be read: it is on a topic that is named, or a field is looked for."""
        if channel.topic in self.named:
            return True
        if not self.bare or channel.encoding not in READABLE:
            return False
        key = self.key(channel)
        stream = self.streams.get(key)
        return key not in self.streams or (stream is not None and bool(stream.paths))

    def key(self, channel: Channel) -> Key:
        """A channel with its schema: messages of an id that is defined anew are another stream."""
        return channel, self.book.schemas.get(channel.schema_id)

    @cached_property
    def named(self) -> frozenset[str]:
        """Topics that signals name."""
        return frozenset(s.signal.partition(":")[0] for s in self.rig.array.sensors if ":" in s.signal)

    @cached_property
    def bare(self) -> tuple[str, ...]:
        """Signals that name no topic."""
        return tuple(dict.fromkeys(s.signal for s in self.rig.array.sensors if ":" not in s.signal))

    def take(self, batch: Batch) -> None:
        """The numbers of a batch."""
        key = self.key(batch.channel)
        if key not in self.streams:
            self.streams[key] = self.opened(batch)
        stream = self.streams[key]
        if stream is None or not stream.paths:
            return
        found = stream.decoder.read(batch, stream.names)
        for path, column in zip(stream.names, found.columns, strict=True):
            stream.columns.setdefault(path, []).append(column)
        stream.times.append(batch.times)
        stream.order.append(batch.order)
        self.report(batch, len(batch) - int(np.count_nonzero(found.good)), found.longer)

    def report(self, batch: Batch, bad: int, longer: int) -> None:
        """Messages that do not fit their schema are damage."""
        self.undecodable += bad
        topic = batch.channel.topic
        if bad:
            what = f"topic {topic}: a message that cannot be decoded"
            self.book.damages.add(what, batch.at, count=bad, words="its values are invalid")
        if longer:
            what = f"topic {topic}: a message longer than its schema describes"
            self.book.damages.add(what, batch.at, count=longer, words="what the schema describes of it is read")

    def opened(self, batch: Batch) -> Stream | None:
        """The stream of a channel by its first messages; None where they cannot be decoded."""
        topic = batch.channel.topic
        try:
            reader = decoder(*self.key(batch.channel))
        except Undecodable as error:
            self.refused[topic] = str(error)
            return None
        named = [s.signal.partition(":")[2] for s in self.rig.array.sensors if s.signal.startswith(f"{topic}:")]
        bare = [name for name in self.bare if reader.has(name, batch)]
        paths = list(dict.fromkeys([*named, *bare]))
        known = frozenset(p for p in paths if reader.has(p, batch))
        leaves = tuple(reader.leaves(batch))
        stamp = self.stamp(topic, reader, batch) if paths else ()
        return Stream(topic, reader, paths, stamp, known, leaves)

    def stamp(self, topic: str, reader: Decoder, batch: Batch) -> tuple[str, ...]:
        """Paths of the rig's time signal in a topic's messages: one number, or seconds and nanoseconds; or none."""
        owner, colon, name = (self.rig.time_signal or "").rpartition(":")
        if not name or (colon and owner != topic):
            return ()
        if reader.has(name, batch) and not any(reader.has(f"{name}.{sec}", batch) for sec, _ in _STAMPS):
            return (name,)
        pairs = ((f"{name}.{sec}", f"{name}.{nano}") for sec, nano in _STAMPS)
        return next((pair for pair in pairs if all(reader.has(p, batch) for p in pair)), ())


def unreadable(path: Path, topic: str, found: str) -> RecordingError:
    """The error for a topic whose messages cannot be decoded."""
    return RecordingError(
        "messages in an encoding that is not read",
        file=path,
        place=f"topic {topic}",
        found=found,
        expected="JSON, protobuf, ROS 2 (cdr, ros2msg) or ROS 1 (ros1, ros1msg)",
    )
