"""MF4: raw CAN frames, or else channels that were decoded when they were recorded, by name. A name that is in more
than one group is told apart as Group.Channel, by the group's acquisition name or number."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nineaudit.array import frozen
from nineaudit.errors import RecordingError
from nineaudit.identity import EARLIEST, Stated, began
from nineaudit.readers.can.mdf import frames_of, holds_frames, opened
from nineaudit.readers.can.reader import read_can
from nineaudit.readers.contents import Contents
from nineaudit.recording import Trace
from nineaudit.signals import suggestion

if TYPE_CHECKING:
    from nineaudit.rig import Rig


def read_mf4(path: Path, rig: Rig) -> Contents:
    """Signals of an MF4 file: of its raw CAN frames, if it has any, through the rig's databases; else its channels.

    Raises ConfigurationError and RecordingError as read_can does, and read_signals.
    """
    with opened(path) as log:
        if not holds_frames(log):
            return read_signals(log, path, rig)
        about, frames = _started(log, path), frames_of(log, path)
    return replace(read_can(path, rig, frames), stated=about)


def _started(log: Any, path: Path) -> tuple[Stated, ...]:
    """When the measurement began, by the header (HDBLOCK), with the zone that it states; () where it has no date."""
    moment = log.header.start_time
    return began(moment.isoformat(timespec="milliseconds"), path.name) if moment.year >= EARLIEST else ()


def read_signals(log: Any, path: Path, rig: Rig) -> Contents:
    """The rig's channels of an open measurement file, each on its group's clock, with the units the file states.

    Samples that the file marks as invalid, and those that are no finite number, are NaN and counted.
    Raises RecordingError: a channel that is missing, in several groups, or not of numbers.
    """
    traces, invalid = [], 0
    for sensor in rig.array.sensors:
        group, index = _place(log, sensor.signal, sensor.channel, path)
        signal = log.get(group=group, index=index, ignore_invalidation_bits=True)
        values = _numbers(signal, sensor.channel, path)
        invalid += int(np.count_nonzero(np.isnan(values)))
        time = np.asarray(signal.timestamps, dtype=np.float64)
        at = sensor.channel, signal.name, frozen(time), frozen(values)
        traces.append(Trace(*at, signal.unit or None, f"group {_title(log, group)}"))
    counts = {"groups": float(len(log.groups)), "invalid_values": float(invalid)}
    note = f"time counts from the start of the measurement, {log.header.start_time.isoformat()}"
    return Contents(tuple(traces), counts, (note,), stated=_started(log, path))


def _place(log: Any, name: str, channel: str, path: Path) -> tuple[int, int]:
    """(group, index) of a channel by its name, or by Group.Channel."""
    named = {place: f"{_title(log, place[0])}.{name}" for place in log.channels_db.get(name, ())}
    if not named and "." in name:
        title, _, inner = name.partition(".")
        named = {p: name for p in log.channels_db.get(inner, ()) if title in (_title(log, p[0]), str(p[0]))}
    if len(named) == 1:
        group, index = next(iter(named))
        return int(group), int(index)
    if named:
        raise RecordingError(
            f"channel {channel!r}: more than one group has {name!r}",
            file=path,
            expected="Group.Channel, one of " + ", ".join(sorted(named.values())),
        )
    raise RecordingError(
        f"missing channel {channel!r}",
        file=path,
        expected=f"a channel {name!r}",
        advice=suggestion(name, log.channels_db),
    )


def _title(log: Any, group: int) -> str:
    return str(log.groups[group].channel_group.acq_name or group)


def _numbers(signal: Any, channel: str, path: Path) -> Any:
    """(n,) float64, NaN where not valid."""
    if signal.samples.ndim != 1 or signal.samples.dtype.kind not in "iufb":
        raise RecordingError(
            f"channel {channel!r}: {signal.name!r} does not hold numbers",
            file=path,
            found=str(signal.samples.dtype),
            expected="one number a sample",
        )
    values = signal.samples.astype(np.float64)
    marked = signal.invalidation_bits
    valid = np.isfinite(values) & (True if marked is None else ~np.asarray(marked, dtype=bool))
    return np.where(valid, values, np.nan)
