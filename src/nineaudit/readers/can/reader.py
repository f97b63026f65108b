"""CAN logs: frames of the signals a rig names, decoded through its databases."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from nineaudit import can_bits, can_database
from nineaudit.array import BoolArray, FloatArray, read_only
from nineaudit.can_bits import bytes_needed
from nineaudit.can_database import EXTENDED, BusSignal, Databases
from nineaudit.errors import RecordingError
from nineaudit.identity import began, moment
from nineaudit.readers.can.asc import read_asc
from nineaudit.readers.can.blf import read_blf
from nineaudit.readers.can.bus_signals import unavailable
from nineaudit.readers.can.bus_summary import bus_of
from nineaudit.readers.can.by_python_can import read_by_python_can
from nineaudit.readers.can.candump import read_candump
from nineaudit.readers.can.frames import ERROR, IDENTIFIER, OVERLOAD, REMOTE, Frames, Rows, key_counts
from nineaudit.readers.can.mdf import read_mdf
from nineaudit.readers.contents import Contents
from nineaudit.recording import Damage, Trace

if TYPE_CHECKING:
    from nineaudit.rig import Rig

FRAME_READERS: Final[Mapping[str, Callable[[Path], Frames]]] = {
    ".blf": read_blf,
    ".asc": read_asc,
    ".log": read_candump,
    ".mf4": read_mdf,
    ".trc": read_by_python_can,
    ".csv": read_by_python_can,
    ".db": read_by_python_can,
}
_DATES: Final = 10**15
"""Nanoseconds (11 days): first stamps beyond are dates."""


def read_can(path: Path, rig: Rig, frames: Frames | None = None) -> Contents:
    """Signals (Message.Signal, or Signal alone where it is unique) of a log, with the units of the database. `frames`:
    what it holds, where that was read already.

    A frame that is too short for its message or cannot be decoded is a reading that is not valid (NaN), and
    counted. Raises ConfigurationError: no database, unknown signal; RecordingError: no frames, or none of the
    message of a channel.
    """
    databases = can_database.read_databases(rig.dbc)
    messages = databases.messages
    found = [can_database.find_signal(messages, sensor.signal) for sensor in rig.array.sensors]
    log = FRAME_READERS[path.suffix.lower()](path) if frames is None else frames
    if not len(log):
        why = f": {'; '.join(map(str, log.damage))}" if log.damage else ""
        raise RecordingError(f"no CAN frames in this log{why}", file=path)
    seen = key_counts(log)
    rows, notes, left_out = {}, list[str](), 0
    for sensor, signal in zip(rig.array.sensors, found, strict=True):
        if signal.key not in rows:
            _require_seen(signal, sensor.channel, seen, messages, len(log), path)
            rows[signal.key], others = _one_bus(log, signal.key)
            notes += others
            left_out += seen[signal.key] - len(rows[signal.key])
    base, dated = _base(log, rows)
    started = began(log.started or (moment((base + log.origin) / 1e9, _is_utc(path)) if dated else ""), path.name)
    traces, bad, silent = [], dict[int, tuple[int, int]](), 0
    for sensor, signal in zip(rig.array.sensors, found, strict=True):
        chosen = rows[signal.key]
        values, carried, lost = _decode(signal, log, chosen)
        bad[signal.key] = max(bad.get(signal.key, (0, 0)), (lost.short, lost.undecodable))
        silent += lost.unavailable
        if not carried.any():
            raise _never_carried(signal, sensor.channel, len(chosen), path)
        time = (log.time[chosen[carried]] - base) / 1e9
        at = sensor.channel, signal.name, read_only(time), read_only(values)
        traces.append(Trace(*at, signal.signal.unit, signal.message.name))
    known = {BusSignal(m, None).key for m in messages}
    counts = {
        **_counts(log),
        "frames_used": float(sum(len(r) for r in rows.values())),
        "frames_not_in_database": float(sum(n for key, n in seen.items() if key not in known)),
        "frames_of_other_buses": float(left_out),
        "short_frames": float(sum(short for short, _ in bad.values())),
        "undecodable_frames": float(sum(undecodable for _, undecodable in bad.values())),
        "unavailable_values": float(silent),
    }
    bus = bus_of(log, messages, {key: int(log.bus[r[0]]) for key, r in rows.items()}, databases.bit_rate)
    said = (*log.notes, *dated, *notes, *databases.notes)
    return Contents(tuple(traces), counts, said, (*log.damage, *_cut(databases)), bus, stated=started)


def _is_utc(path: Path) -> bool:
    """Whether dates of a log's stamps are UTC: python-can and candump count from 1970; BLF has the logger's clock."""
    return path.suffix.lower() in (".log", ".db", ".csv")


def _cut(databases: Databases) -> Iterator[Damage]:
    """What is missing of the databases: a finding like what is missing of the log."""
    for path, fault in databases.faults:
        yield Damage(fault.what, f"{path.name} line {fault.line}", fault.count, fault.lost)


def _counts(log: Frames) -> dict[str, float]:
    bits = {"error_frames": ERROR, "remote_frames": REMOTE, "overload_frames": OVERLOAD}
    kinds = {name: float(np.count_nonzero(log.kind & bit)) for name, bit in bits.items()}
    size = float(log.length[log.is_data].sum(dtype=np.int64))
    return {**log.counts, "frames": float(len(log)), **kinds, "bytes": size}


def _require_seen(
    signal: BusSignal, channel: str, seen: Mapping[int, int], messages: Sequence[Any], frames: int, path: Path
) -> None:
    if signal.key in seen:
        return
    names = {BusSignal(m, None).key: m.name for m in messages}
    most = sorted(seen, key=lambda key: -seen[key])[:5]
    shown = [f"{names.get(key, '?')} 0x{key & IDENTIFIER:X}" for key in most]
    raise RecordingError(
        f"missing channel {channel!r}: no frame of message {signal.message.name}"
        f" (0x{signal.message.frame_id:X}) in this log",
        file=path,
        found=f"{frames} frames, most of them {', '.join(shown) or 'error frames'}",
        advice=_like(signal.key, seen),
    )


def _never_carried(signal: BusSignal, channel: str, frames: int, path: Path) -> RecordingError:
    numbers = ", ".join(map(str, signal.signal.multiplexer_ids or ()))
    return RecordingError(
        f"missing channel {channel!r}: no frame of message {signal.message.name} carries {signal.signal.name}",
        file=path,
        found=f"{frames} frames of the message",
        expected=f"frames in which {signal.signal.multiplexer_signal} is {numbers}",
    )


def _like(key: int, seen: Mapping[int, int]) -> str | None:
    """What is in the log in place of a message: its number in the other format, or its J1939 parameter group."""
    if key ^ EXTENDED in seen:
        bits = 11 if key & EXTENDED else 29
        return f"frames of that number with {bits} bits are there: the database states {40 - bits}"
    others = [x for x in sorted(seen) if key & x & EXTENDED and _group(x) == _group(key)]
    if not others:
        return None
    shown = ", ".join(f"0x{x & IDENTIFIER:08X}" for x in others[:5])
    return f"of the same J1939 parameter group (PGN 0x{_group(key):X}) are there: {shown}; put that into the database"


def _group(key: int) -> int:
    """Parameter group number of a 29-bit identifier: without priority, source address and, below format 240,
    destination address [SAE J1939-21 5.1.2]."""
    return key >> 8 & (0x3FFFF if key >> 16 & 0xFF >= 240 else 0x3FF00)


def _one_bus(log: Frames, key: int) -> tuple[Rows, list[str]]:
    """Rows of a message on one bus only: the one that carries most of it, with a note on what is left out."""
    rows = log.rows_of(key)
    shares = np.bincount(log.bus[rows])
    bus = int(shares.argmax())
    others = [f"{n} on bus {log.buses[i]}" for i, n in enumerate(shares.tolist()) if n and i != bus]
    if not others:
        return rows, []
    name = f"message 0x{key & IDENTIFIER:X} is taken from bus {log.buses[bus]}"
    return rows[log.bus[rows] == bus], [f"{name}; {', '.join(others)} are left out"]


def _base(log: Frames, rows: Mapping[int, Rows]) -> tuple[int, list[str]]:
    """What is taken from the log's stamps, ns, and the note that says so: dates count from the first that is used."""
    first = min(int(log.time[r[0]]) for r in rows.values())
    if first + log.origin <= _DATES:
        return -log.origin, []
    return first, [f"time stamps are dates; they are counted from the first, {(first + log.origin) / 1e9!r} s"]


@dataclass(frozen=True)
class _Lost:
    """Frames without a reading: too `short` for the message, `undecodable`, or with a code for `unavailable`."""

    short: int
    undecodable: int
    unavailable: int


def _decode(signal: BusSignal, log: Frames, rows: Rows) -> tuple[FloatArray, BoolArray, _Lost]:
    """Values in the database's unit of the frames that carry a signal, NaN where one holds no reading; (len(rows),)
    which frames those are; and how many are lost how.

    Of a multiplexed signal only the frames that carry it are samples. A frame too short to say is one.
    """
    payload, length = log.payload(rows), log.length[rows]
    whole = length >= max(signal.message.length, bytes_needed(signal.signal))
    carried = can_bits.carried(signal.signal, signal.message, payload) | ~whole
    payload, whole = payload[carried], whole[carried]
    values = can_bits.decode(signal.signal, payload)
    silent = unavailable(signal.signal, payload) & whole
    undecodable = ~np.isfinite(values) & whole & ~silent
    values[~whole | silent | undecodable] = np.nan
    return values, carried, _Lost(*(int(np.count_nonzero(x)) for x in (~whole, undecodable, silent)))
