"""CAN logs: frames of the signals a rig names, decoded through its databases."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nineaudit import can_bits, can_database
from nineaudit.array import FloatArray, frozen
from nineaudit.can_bits import bytes_needed
from nineaudit.can_database import BusSignal
from nineaudit.errors import RecordingError
from nineaudit.readers import frames as frame_log
from nineaudit.readers import mdf
from nineaudit.readers.contents import Contents
from nineaudit.readers.frames import Frames, Series
from nineaudit.recording import Trace

if TYPE_CHECKING:
    from nineaudit.rig import Rig


def read_can(path: Path, rig: Rig) -> Contents:
    """Signals (Message.Signal, or Signal alone where it is unique) of a log, with the units of the database.

    A frame that is too short for its message or cannot be decoded is a reading that is not valid (NaN), and
    counted. Raises ConfigurationError: no database, unknown signal; RecordingError: damaged, empty, or without
    the message of a channel.
    """
    messages = can_database.load_databases(rig.dbc)
    found = [can_database.find_signal(messages, sensor.signal) for sensor in rig.array.sensors]
    keys = {signal.key for signal in found}
    reader = mdf.read_mdf if path.suffix.lower() == ".mf4" else frame_log.read_frames
    log = reader(path, keys)
    if not log.counts["frames"]:
        raise RecordingError("no CAN frames in this log", file=path)
    series, notes, dropped = _one_bus(log)
    known = {BusSignal(m, None).key for m in messages}
    counts: dict[str, float] = {
        **log.counts,
        "frames_used": sum(len(s.time) for s in series.values()),
        "frames_not_in_database": sum(n for key, n in log.ids.items() if key not in known),
        "frames_of_other_buses": dropped,
        "short_frames": 0,
        "undecodable_frames": 0,
    }
    traces = []
    bad: dict[int, tuple[int, int]] = {}
    for sensor, signal in zip(rig.array.sensors, found, strict=True):
        frames = _of(signal, series, sensor.channel, log, messages, path)
        time, values, short, undecodable = _decode(signal, frames)
        bad[signal.key] = max(bad.get(signal.key, (0, 0)), (short, undecodable))
        traces.append(Trace(sensor.channel, signal.name, frozen(time), frozen(values), signal.signal.unit))
    counts["short_frames"] = sum(short for short, _ in bad.values())
    counts["undecodable_frames"] = sum(undecodable for _, undecodable in bad.values())
    return Contents(tuple(traces), counts, (*log.notes, *notes))


def _of(
    signal: BusSignal,
    series: dict[int, Series],
    channel: str,
    log: Frames,
    messages: Sequence[Any],
    path: Path,
) -> Series:
    if signal.key in series:
        return series[signal.key]
    names = {BusSignal(m, None).key: m.name for m in messages}
    seen = [f"{names.get(key, '?')} 0x{key & 0x1FFFFFFF:X}" for key, _ in log.ids.most_common(5)]
    raise RecordingError(
        f"missing channel {channel!r}: no frame of message {signal.message.name}"
        f" (0x{signal.message.frame_id:X}) in this log",
        file=path,
        found=f"{int(log.counts['frames'])} frames, most of them {', '.join(seen) or 'error frames'}",
    )


def _one_bus(log: Frames) -> tuple[dict[int, Series], list[str], int]:
    """Each message from one bus only: from the one that carries most of it, with a note on what is left out."""
    series, notes, dropped = {}, [], 0
    for key, frames in log.series.items():
        buses = Counter(frames.bus)
        (bus, count), *others = buses.most_common()
        if others:
            rows = np.array([b == bus for b in frames.bus])
            frames = Series(frames.time[rows], frames.payload[rows], frames.length[rows], (bus,) * count)
            left = ", ".join(f"{n} on bus {name}" for name, n in others)
            notes.append(f"message 0x{key & 0x1FFFFFFF:X} is taken from bus {bus}; {left} are left out")
            dropped += sum(n for _, n in others)
        series[key] = frames
    return series, notes, dropped


def _decode(signal: BusSignal, frames: Series) -> tuple[FloatArray, FloatArray, int, int]:
    """(n,) s, (n,) values in the database's unit, NaN where a frame is too short or does not decode; counts of both.

    Of a multiplexed signal only the frames that carry it are samples.
    """
    needed = bytes_needed(signal.signal)
    whole = frames.length >= max(signal.message.length, needed)
    values, carried = np.full(frames.time.size, np.nan), np.ones_like(whole)
    if signal.plain:
        payload = np.pad(frames.payload, ((0, 0), (0, max(0, needed - frames.payload.shape[1]))))
        values[whole] = can_bits.decode(signal.signal, payload[whole])
    else:
        decoded = [_one(signal, bytes(p[:n])) for p, n in zip(frames.payload, frames.length, strict=True)]
        carried = np.array([value is not None for value in decoded])
        values = np.where(whole, np.array([np.nan if v is None else v for v in decoded]), np.nan)
    undecodable = np.isnan(values) & whole & carried
    return frames.time[carried], values[carried], int(np.sum(~whole)), int(np.sum(undecodable))


def _one(signal: BusSignal, data: bytes) -> float | None:
    """A multiplexed signal of one frame: None where the frame does not carry it, NaN where it does not decode."""
    from cantools.database.errors import DecodeError

    try:
        value = signal.message.decode(data, decode_choices=False).get(signal.signal.name)
    except (DecodeError, ValueError):
        return float("nan")
    return None if value is None else float(value)
