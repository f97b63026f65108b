"""What a CAN log says of its bus, as data: the counts of the container, and one row an identifier."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from nineaudit.bus import Bus, Identifier
from nineaudit.recording import Recording
from nineaudit.report.numbers import instant, plain

_FORMATS = frozenset({"blf", "asc", "log", "trc", "mf4", "db"})


def bus_document(recording: Recording) -> dict[str, Any]:
    """Empty where the recording is no CAN log."""
    counts, bus = recording.source.counts, recording.bus
    if bus is None and recording.source.format.lower() not in _FORMATS and "frames" not in counts:
        return {}
    return {**plain(counts), **({} if bus is None else _whole(bus))}


def _whole(bus: Bus) -> dict[str, Any]:
    return {
        "identifiers": [_identifier(x) for x in bus.identifiers],
        "absent": list(bus.absent),
        "restarts": bus.restarts,
        "first_restart": None if bus.first_restart is None else instant(bus.first_restart),
        "bit_rate": plain(bus.bit_rate),
        "loads": [{key: plain(value) for key, value in asdict(x).items()} for x in bus.loads],
    }


def _identifier(x: Identifier) -> dict[str, Any]:
    """Times in s. What the database does not know of it is null or empty."""
    row = {key: plain(value) for key, value in asdict(x).items() if key != "key"}
    row |= {"first": instant(x.first), "last": instant(x.last), "unavailable": dict(x.unavailable)}
    return {"id": x.number, **row}
