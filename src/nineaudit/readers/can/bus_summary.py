"""From the frames of a log to what they say of the bus (bus.py)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.bus import Bus, Identifier, Load
from nineaudit.can_bits import ByteMatrix
from nineaudit.can_database import EXTENDED, BusSignal
from nineaudit.readers.can import bus_signals
from nineaudit.readers.can.frames import ERROR, FD, OVERLOAD, Frames, Rows
from nineaudit.readers.clocks.clock import deviation

WINDOW: Final = 0.1
"""Seconds of the window in which the busiest load is looked for."""
_CYCLE: Final = 1e-3
_STANDARD: Final = 1 << 11


def bus_of(log: Frames, messages: Sequence[Any], used: Mapping[int, int], bit_rate: float | None = None) -> Bus:
    """Summary of all frames. `messages` of the databases, `used`: keys that the rig takes signals from,
    and from which of the log's buses each."""
    known = {BusSignal(m, None).key: m for m in messages}
    found = tuple(_identifier(log, rows, known, used) for rows in _groups(log))
    seen = {x.key for x in found}
    absent = (m.name for key, m in known.items() if key not in seen and (m.cycle_time or key in used))
    restarts, first = _restarts(log)
    return Bus(found, tuple(absent), restarts, first, tuple(_loads(log)), bit_rate, bool((log.kind & FD).any()))


def _groups(log: Frames) -> Iterator[Rows]:
    """Rows of the data frames of each identifier on each bus, in the order of the log."""
    for bus in np.unique(log.bus).tolist():
        rows = np.flatnonzero(log.is_data & (log.bus == bus))
        label = _numbered(log.key[rows])
        order = np.argsort(label, kind="stable")  # by radix, of 16 bits
        ends = np.flatnonzero(np.diff(label[order])) + 1
        if len(rows):
            yield from np.split(rows[order], ends)


def _numbered(key: NDArray[np.uint32]) -> NDArray[Any]:
    """(n,) numbers in place of keys, in the same order, as small as they can be."""
    standard = key < _STANDARD
    extended, place = np.unique(key[~standard], return_inverse=True)
    out = np.empty(len(key), dtype=np.uint16 if len(extended) + _STANDARD < 1 << 16 else np.uint32)
    out[standard] = key[standard]
    out[~standard] = place + _STANDARD
    return out


def _identifier(log: Frames, rows: Rows, known: Mapping[int, Any], used: Mapping[int, int]) -> Identifier:
    key, message = int(log.key[rows[0]]), known.get(int(log.key[rows[0]]))
    time, payload, length = log.time[rows], log.payload(rows), log.length[rows]
    steps = np.diff(time) / 1e9
    interval = float(np.median(steps)) if len(steps) > 1 else float("nan")
    told = {} if message is None else _of_message(message, key, payload, length)
    return Identifier(
        key=key,
        name=None if message is None else message.name,
        bus=log.buses[log.bus[rows[0]]],
        used=used.get(key) == int(log.bus[rows[0]]),
        frames=len(rows),
        first=(int(time.min()) + log.origin) / 1e9,
        last=(int(time.max()) + log.origin) / 1e9,
        interval=interval,
        jitter=deviation(steps, interval) if len(steps) > 1 else float("nan"),
        longest=float(steps.max()) if len(steps) > 1 else float("nan"),
        constant=bool((payload == payload[0]).all() and (length == length[0]).all()),
        **told,
    )


def _of_message(message: Any, key: int, payload: ByteMatrix, length: Any) -> dict[str, Any]:
    """What the database lets one check. Frames of another length than the message's are only counted."""
    size = int(message.length)
    whole = payload[length == size] if size <= payload.shape[1] else payload[:0]
    codes = ((s.name, int(np.count_nonzero(bus_signals.unavailable(s, whole)))) for s in message.signals)
    return {
        "cycle": message.cycle_time * _CYCLE if message.cycle_time else None,
        "length": size,
        "longer": int(np.count_nonzero(length > size)),
        "shorter": int(np.count_nonzero(length < size)),
        "counters": tuple(bus_signals.counters(message, whole)),
        "checksums": tuple(bus_signals.checksums(message, key, whole, size)),
        "outside": tuple(bus_signals.outside(message, whole)),
        "unavailable": tuple((name, n) for name, n in codes if n),
    }


def _restarts(log: Frames) -> tuple[int, float | None]:
    """Stamps that lie before the one before them in the log, bus by bus; and the first of those, s."""
    count, first = 0, None
    for bus in np.unique(log.bus).tolist():
        time = log.time[log.bus == bus]
        back = np.flatnonzero(np.diff(time) < 0)
        count += len(back)
        if len(back):
            at = (int(time[back[0] + 1]) + log.origin) / 1e9
            first = at if first is None else min(first, at)
    return count, first


def _loads(log: Frames) -> Iterator[Load]:
    """Bits of a classic frame of n bytes (ISO 11898-1:2015 10.4), interframe space included: 47 + 8n, 67 + 8n with a
    29-bit identifier; stuff bits at most ⌊(33 + 8n)/4⌋ and ⌊(53 + 8n)/4⌋ [Davis et al., Real-Time Systems 35 (2007)
    239, eq 1]. Data frames and remote frames; FD frames by the same count, which is not theirs."""
    extended = (log.key & np.uint32(EXTENDED)) != 0
    carried = np.where(log.is_data, log.length, 0).astype(np.int32) << 3
    least = np.where(extended, np.int32(67), np.int32(47)) + carried
    most = least + ((np.where(extended, np.int32(53), np.int32(33)) + carried) >> 2)
    sent = (log.kind & (ERROR | OVERLOAD)) == 0
    for bus in np.unique(log.bus[sent]).tolist():
        rows = np.flatnonzero(sent & (log.bus == bus))
        since = log.time[rows] - log.time[rows].min()
        windows = since // int(WINDOW * 1e9)
        if windows.max() > 4 * len(rows):  # a log may stand still for a year
            windows = np.unique(windows, return_inverse=True)[1]
        low, high = (np.bincount(windows, weights=bits[rows]) for bits in (least, most))
        yield Load(
            bus=log.buses[bus],
            duration=float(since.max()) / 1e9,
            least=float(low.sum()),
            most=float(high.sum()),
            window=WINDOW,
            peak_least=float(low.max()),
            peak_most=float(high.max()),
        )
