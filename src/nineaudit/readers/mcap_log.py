"""MCAP logs with JSON or ROS 2 messages. A signal is /topic:field.path, or a field's name where it is unique.

Time is the log time of a message, unless the rig names a time signal that the topic's messages carry. Chunk and
data checksums are verified.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nineaudit.array import FloatArray, frozen
from nineaudit.errors import RecordingError
from nineaudit.readers.contents import Contents, cut_short, span
from nineaudit.readers.fields import MISSING, leaves, lookup
from nineaudit.recording import Trace
from nineaudit.signals import MCAP_ORIGIN, suggestion, time_unit
from nineaudit.units import factor

if TYPE_CHECKING:
    from nineaudit.rig import Rig

_EPOCH_NS = 10**15  # 1e6 s: larger log times are dates, and lose digits as floating-point seconds


@dataclass
class _Log:
    """Messages as they come out of the file: per topic (log times in ns, raw data), and how to decode them."""

    times: dict[str, list[int]] = field(default_factory=dict)
    data: dict[str, list[bytes]] = field(default_factory=dict)
    channels: dict[str, tuple[Any, Any]] = field(default_factory=dict)
    messages: int = 0
    origin: int = 0

    def said(self) -> str:
        stamps = [t for topic in self.times.values() for t in (min(topic), max(topic))]
        return span(self.messages, "message", min(stamps, default=0) * 1e-9, max(stamps, default=0) * 1e-9)


def read_mcap(path: Path, rig: Rig) -> Contents:
    """Signals of an MCAP log, each topic on its own clock.

    Values that are absent, null or no numbers are NaN and counted. Raises RecordingError: truncated, a checksum
    that does not hold, a missing topic or field, an encoding that is neither JSON nor ROS 2.
    """
    log = _messages(path)
    decoded = _Decoded(log, path)
    places = [_place(sensor.signal, sensor.channel, decoded, path) for sensor in rig.array.sensors]
    used = list(dict.fromkeys(topic for topic, _ in places))
    base = min(min(log.times[topic]) for topic in used)
    base = base if base > _EPOCH_NS else 0
    clocks = {topic: _clock(topic, rig, decoded, base) for topic in used}
    traces = []
    missing = 0
    for sensor, (topic, name) in zip(rig.array.sensors, places, strict=True):
        values = np.array([_number(lookup(message, name)) for message in decoded.all(topic)])
        missing += int(np.count_nonzero(np.isnan(values)))
        traces.append(Trace(sensor.channel, f"{topic}:{name}", clocks[topic], frozen(values)))
    counts = {
        "messages": log.messages,
        "topics": len(log.channels),
        "messages_used": sum(len(log.times[topic]) for topic in used),
        "undecodable_messages": decoded.undecodable,
        "invalid_values": missing,
    }
    notes = (f"time counts from log time {base} ns",) if base else ()
    return Contents(tuple(traces), counts, notes)


def _messages(path: Path) -> _Log:
    """All messages. The whole file is read, so that damage anywhere is found; what came before it is said."""
    import zstandard
    from mcap.exceptions import McapError
    from mcap.records import Channel, Message, Metadata, Schema, Statistics
    from mcap.stream_reader import CRCValidationError, StreamReader

    log, schemas, channels, stated = _Log(), dict[int, Any](), dict[int, Any](), None
    with path.open("rb") as file:
        try:
            for record in StreamReader(_Whole(file), validate_crcs=True).records:  # type: ignore[arg-type]
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Metadata) and MCAP_ORIGIN in record.metadata:
                    log.origin = int(record.metadata[MCAP_ORIGIN])
                elif isinstance(record, Statistics):
                    stated = record.message_count
                elif isinstance(record, Message):
                    channel = channels[record.channel_id]
                    log.channels[channel.topic] = (schemas.get(channel.schema_id), channel)
                    log.times.setdefault(channel.topic, []).append(record.log_time)
                    log.data.setdefault(channel.topic, []).append(record.data)
                    log.messages += 1
        except (CRCValidationError, McapError, struct.error, zstandard.ZstdError) as error:
            raise cut_short(path, _reason(error), log.said(), place=f"byte {file.tell()}") from error
        except (RuntimeError, KeyError, ValueError, EOFError) as error:  # LZ4 and records of damaged length
            raise cut_short(path, _reason(error), log.said(), place=f"byte {file.tell()}") from error
    if stated is not None and stated != log.messages:
        raise cut_short(path, f"its statistics count {stated} messages", log.said())
    return log


class _Whole:
    """A file that does not answer with less than it was asked for, as the MCAP reader takes for granted."""

    def __init__(self, file: Any) -> None:
        self.file = file

    def read(self, size: int) -> bytes:
        data: bytes = self.file.read(size)
        if len(data) < size:
            raise EOFError(f"it ends {size - len(data)} bytes too early")
        return data


class _Decoded:
    """Messages of a topic as dictionaries or ROS messages, each topic decoded once, when it is asked for."""

    def __init__(self, log: _Log, path: Path) -> None:
        self.log, self.path, self.undecodable = log, path, 0
        self._done: dict[str, list[Any]] = {}

    def first(self, topic: str) -> Any:
        return next((m for m in self.all(topic) if m is not None), None)

    def all(self, topic: str) -> list[Any]:
        if topic not in self._done:
            decode = self._decoder(topic)
            self._done[topic] = [self._try(decode, data) for data in self.log.data[topic]]
        return self._done[topic]

    def _try(self, decode: Callable[[bytes], Any], data: bytes) -> Any:
        try:
            return decode(data)
        except (ValueError, struct.error, IndexError):
            self.undecodable += 1
            return None

    def _decoder(self, topic: str) -> Callable[[bytes], Any]:
        schema, channel = self.log.channels[topic]
        if channel.message_encoding == "json":
            return json.loads
        if channel.message_encoding == "cdr" and schema is not None:
            from mcap_ros2.decoder import DecoderFactory

            found = DecoderFactory().decoder_for(channel.message_encoding, schema)
            if found is not None:
                return found
        raise RecordingError(
            "messages in an encoding that is not read",
            file=self.path,
            place=f"topic {topic}",
            found=f"{channel.message_encoding}, schema {schema.encoding if schema else 'none'}",
            expected="JSON or ROS 2 (cdr, ros2msg)",
        )


def _place(signal: str, channel: str, decoded: _Decoded, path: Path) -> tuple[str, str]:
    """(topic, field) of a signal."""
    topics = list(decoded.log.channels)
    topic, colon, name = signal.partition(":")
    what = f"missing channel {channel!r}"
    if not colon:
        hits = [t for t in _readable(decoded) if lookup(decoded.first(t), signal) is not MISSING]
        if len(hits) == 1:
            return hits[0], signal
        names = [f"{t}:{name}" for t in (hits or _readable(decoded)) for name in leaves(decoded.first(t))]
        advice = f"in more than one topic: {', '.join(hits)}" if hits else suggestion(signal, names)
        raise RecordingError(what, file=path, expected=f"/topic:{signal} for signal {signal!r}", advice=advice)
    if topic not in topics:
        raise RecordingError(what, file=path, expected=f"a topic {topic!r}", advice=suggestion(topic, topics))
    if all(lookup(m, name) is MISSING for m in decoded.all(topic)):
        raise RecordingError(
            what,
            file=path,
            place=f"topic {topic}",
            expected=f"a field {name!r}",
            advice=suggestion(name, leaves(decoded.first(topic))),
        )
    return topic, name


def _readable(decoded: _Decoded) -> list[str]:
    return [t for t, (_, channel) in decoded.log.channels.items() if channel.message_encoding in ("json", "cdr")]


def _clock(topic: str, rig: Rig, decoded: _Decoded, base: int) -> FloatArray:
    """(m,) s of a topic's messages: the rig's time signal where they carry it, else log time less `base` ns."""
    owner, colon, name = (rig.time_signal or "").rpartition(":")
    if name and (not colon or owner == topic) and lookup(decoded.first(topic), name) is not MISSING:
        values = np.array([_number(lookup(m, name)) for m in decoded.all(topic)])
        return frozen(values * factor(time_unit(name, rig.time_unit) or "s", "time"))
    return frozen([(t - base + decoded.log.origin) * 1e-9 for t in decoded.log.times[topic]])


def _number(value: Any) -> float:
    if isinstance(value, (int, float)) and not isinstance(value, bool) and np.isfinite(value):
        return float(value)
    return float("nan")


def _reason(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__
