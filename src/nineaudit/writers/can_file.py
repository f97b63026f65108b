"""CAN logs: one frame a message and sample, encoded by the databases. What they round off is reported."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from nineaudit import can_bits, can_database
from nineaudit.array import BoolArray, FloatArray, Sensor
from nineaudit.can_bits import ByteMatrix
from nineaudit.can_database import BusSignal
from nineaudit.errors import ConfigurationError
from nineaudit.recording import Recording
from nineaudit.signals import CAN_ORIGIN, si_factor
from nineaudit.writers.outcome import Outcome

_FD_LENGTHS = (12, 16, 20, 24, 32, 48, 64)
"""Bytes of CAN FD frames, ISO 11898-1, for the codes 9 and up."""


@dataclass(frozen=True, eq=False)
class _Frames:
    """Frames of one message: (n, bytes) payloads, and (n,) which of them are sent."""

    message: Any
    payload: ByteMatrix
    sent: BoolArray


def write_blf(recording: Recording, readings: FloatArray, path: Path, dbc: Sequence[Path]) -> Outcome:
    """Vector BLF through python-can, stamps in whole nanoseconds from the first sample."""
    import can

    frames, outcome = _encode(recording, readings, dbc)
    start = float(recording.time[0])
    with can.BLFWriter(path) as writer:
        if start:
            writer.log_event(CAN_ORIGIN.format(repr(start)), 0.0)
        for stamp, message, data in _in_time(frames, recording.time - start):
            writer.on_message_received(
                can.Message(
                    timestamp=(stamp + 0.5) * 1e-9,  # python-can cuts off parts of a nanosecond
                    arbitration_id=message.frame_id,
                    is_extended_id=message.is_extended_frame,
                    is_fd=len(data) > 8,
                    data=data,
                    channel=0,
                )
            )
    return outcome


def write_asc(recording: Recording, readings: FloatArray, path: Path, dbc: Sequence[Path]) -> Outcome:
    """Vector ASC, stamps in whole nanoseconds from the first sample (python-can's writer rounds to microseconds)."""
    frames, outcome = _encode(recording, readings, dbc)
    start = float(recording.time[0])
    with path.open("x", encoding="ascii", newline="\n") as file:
        file.write("date Thu Jan 01 00:00:00.000 1970\nbase hex  timestamps absolute\n")
        if start:
            file.write(f"// {CAN_ORIGIN.format(repr(start))}\n")
        file.write("no internal events logged\n")
        file.write("Begin Triggerblock Thu Jan 01 00:00:00.000 1970\n")
        for stamp, message, data in _in_time(frames, recording.time - start):
            name = f"{message.frame_id:X}{'x' if message.is_extended_frame else ''}"
            file.write(f"{stamp // 10**9:4d}.{stamp % 10**9:09d} {_asc(name, data)}\n")
        file.write("End TriggerBlock\n")
    return outcome


def _asc(name: str, data: bytes) -> str:
    octets = " ".join(f"{octet:02X}" for octet in data)
    if len(data) <= 8:
        return f"1  {name:<15} Rx   d {len(data):x} {octets}"
    code = _FD_LENGTHS.index(len(data)) + 9
    return f"CANFD   1 Rx   {name:>8}  {'':>32} 0 0 {code:x} {len(data):>2} {octets} 0 0 1000 0 0 0 0 0"


def _in_time(frames: Sequence[_Frames], time: FloatArray) -> Iterator[tuple[int, Any, bytes]]:
    """(ns, message, data) of every frame that is sent, sample after sample."""
    for i, stamp in enumerate(np.rint(time * 1e9).astype(np.int64).tolist()):
        for block in frames:
            if block.sent[i]:
                yield stamp, block.message, block.payload[i].tobytes()


def _encode(recording: Recording, readings: FloatArray, dbc: Sequence[Path]) -> tuple[list[_Frames], Outcome]:
    """Payloads of all messages and how far they are from the readings."""
    messages = can_database.load_databases(dbc)
    blocks: dict[int, list[tuple[Sensor, BusSignal, FloatArray]]] = {}
    for sensor, column in zip(recording.rig.array.sensors, readings.T, strict=True):
        signal = can_database.find_signal(messages, sensor.signal)
        values = (column + sensor.offset) / si_factor(sensor, signal.signal.unit)
        _require_room(signal, values, recording.time)
        blocks.setdefault(signal.key, []).append((sensor, signal, values))
    frames, error, notes = [], dict[str, float](), list[str]()
    for block in blocks.values():
        frames.append(_block(block, recording.time))
        for sensor, signal, values in block:
            held = can_bits.decode(signal.signal, frames[-1].payload)
            misses = np.abs(held - values)[np.isfinite(values)] * si_factor(sensor, signal.signal.unit)
            error[sensor.channel] = float(misses.max(initial=0.0))
        message = block[0][1].message
        others = {s.name for s in message.signals} - {signal.signal.name for _, signal, _ in block}
        if others:
            notes.append(f"message {message.name}: all bits of {', '.join(sorted(others))} are 0")
    worst = max(error, key=lambda channel: error[channel])
    notes.append(f"the database rounds readings by up to {error[worst]:.3g} (SI), most in {worst}")
    return frames, Outcome(error, tuple(notes))


def _block(block: Sequence[tuple[Sensor, BusSignal, FloatArray]], time: FloatArray) -> _Frames:
    """One message. A sample where none of its channels is valid is not sent; one that is not valid among others that
    are can only be written as a floating-point NaN."""
    message = block[0][1].message
    invalid = np.array([np.isnan(values) for _, _, values in block])
    sent = np.asarray(~invalid.all(axis=0), dtype=np.bool_)
    payload = np.zeros((time.size, _frame_length(message)), dtype=np.uint8)
    for (sensor, signal, values), lost in zip(block, invalid, strict=True):
        alone = np.flatnonzero(lost & sent)
        if alone.size and not signal.signal.is_float:
            raise ConfigurationError(
                f"channel {sensor.channel} has no valid reading where others of its message have,"
                " and its bits have no value for that",
                place=f"signal {signal.name} at {time[alone[0]]:.6g} s",
                expected="a floating-point signal, or a message of its own",
                advice="write .csv, .parquet or .mcap",
            )
        can_bits.encode(signal.signal, values if signal.signal.is_float else np.nan_to_num(values), payload)
    return _Frames(message, payload, sent)


def _frame_length(message: Any) -> int:
    """Bytes of a frame that holds the message: CAN FD knows only some lengths above 8."""
    if message.length <= 8:
        return int(message.length)
    return next(length for length in _FD_LENGTHS if length >= message.length)


def _require_room(signal: BusSignal, values: FloatArray, time: FloatArray) -> None:
    """No value may lie outside what the signal's bits can hold, nor outside the range its database states."""
    bits = signal.signal
    if not signal.plain:
        raise ConfigurationError("a multiplexed signal cannot be written", place=f"signal {signal.name}")
    low, high = can_bits.stated_range(bits) or can_bits.room(bits)
    slack = 0.5 * abs(bits.scale)
    outside = np.flatnonzero((values < low - slack) | (values > high + slack))
    if outside.size:
        i = int(outside[0])
        raise ConfigurationError(
            f"{outside.size} readings do not fit the signal",
            place=f"signal {signal.name} at {time[i]:.6g} s",
            found=float(values[i]),
            expected=f"{low:g} to {high:g} {bits.unit or ''}".rstrip(),
        )
