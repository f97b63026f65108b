"""MCAP with JSON messages: one message a topic and sample. Readings that are not valid are null."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.identity import KEYS, METADATA
from nineaudit.recording import Recording
from nineaudit.signals import MCAP_ORIGIN, in_unit, time_unit
from nineaudit.units import factor
from nineaudit.writers.outcome import Outcome

TOPIC = "/array"  # of signals that name no topic


def write_mcap(recording: Recording, readings: FloatArray, path: Path, _: Sequence[Path]) -> Outcome:
    """Signals named /topic:field.path go where they say, others to one topic under their own name.

    Log times are nanoseconds and cannot be negative: a recording that starts before 0 carries its origin.
    """
    from mcap.writer import Writer

    stamps = np.rint(recording.time * 1e9).astype(np.int64)
    origin = min(int(stamps[0]), 0)
    with path.open("xb") as file:
        writer = Writer(file, enable_data_crcs=True)
        writer.start()
        if origin:
            writer.add_metadata("nineaudit", {MCAP_ORIGIN: str(origin)})
        if about := {key: value for key, value in recording.test.known.items() if key in KEYS}:
            writer.add_metadata(METADATA, about)
        topics = _topics(recording, readings)
        channels = {topic: _channel(writer, topic) for topic in topics}
        for i, stamp in enumerate((stamps - origin).tolist()):
            for topic, fields in topics.items():
                data = json.dumps(_message(fields, i)).encode()
                writer.add_message(channels[topic], log_time=stamp, data=data, publish_time=stamp, sequence=i)
        writer.finish()  # type: ignore[no-untyped-call]
    return Outcome()


def _channel(writer: Any, topic: str) -> int:
    name = "nineaudit." + topic.strip("/").replace("/", ".")
    schema = writer.register_schema(name, "jsonschema", b'{"type": "object"}')
    return int(writer.register_channel(topic, "json", schema))


def _topics(recording: Recording, readings: FloatArray) -> dict[str, dict[tuple[str, ...], list[float]]]:
    """By topic and field path, the numbers in the rig's units. Messages carry the rig's time signal, if it has one."""
    rig = recording.rig
    topics: dict[str, dict[tuple[str, ...], list[float]]] = {}
    for sensor, column in zip(rig.array.sensors, readings.T, strict=True):
        topic, colon, name = sensor.signal.partition(":")
        place = (topic, tuple(name.split("."))) if colon else (TOPIC, (sensor.signal,))
        topics.setdefault(place[0], {})[place[1]] = in_unit(column, sensor.to_si, sensor.offset).tolist()
    owner, _, name = (rig.time_signal or "").rpartition(":")
    for topic, fields in topics.items():
        if name and owner in ("", topic):
            scale = factor(time_unit(name, rig.time_unit) or "s", "time")
            fields[tuple(name.split("."))] = in_unit(recording.time, scale).tolist()
    return topics


def _message(fields: dict[tuple[str, ...], list[float]], i: int) -> dict[str, Any]:
    message: dict[str, Any] = {}
    for (*folders, name), values in fields.items():
        place = message
        for folder in folders:
            place = place.setdefault(folder, {})
        place[name] = None if values[i] != values[i] else values[i]
    return message
