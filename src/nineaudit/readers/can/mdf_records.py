"""CAN frames out of the records of an MF4 channel group, some thousand records at a time: all columns in one pass."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.array import BoolArray
from nineaudit.can_database import EXTENDED
from nineaudit.readers.can.frames import ERROR, IDENTIFIER, LONG, REMOTE, SENT, SHORT, Frames, frames
from nineaudit.readers.can.losses import Losses
from nineaudit.readers.can.mdf_blocks import records, room_for, stored
from nineaudit.readers.can.mdf_layout import FLAGS, Layout
from nineaudit.readers.can.mdf_payload import KEPT, KEPT_LONG, SPARE, InRecords, InStore, Store

LAST_STANDARD: Final = 0x7FF
STAMP: Final = "a time stamp that is no number or beyond the year 2262"
TOO_LONG: Final = "a length beyond the bytes that are there"
MARKED: Final = "a frame that the file itself marks as not valid"
NOT_STORED: Final = "data of a frame that are not where its record says"
FEWER: Final = "fewer records than the channel group states"
_ROWS: Final = 1 << 15
_LATEST: Final = float(2**63)
_OF_CODE: Final = np.array([*range(9), 12, 16, 20, 24, 32, 48, 64], dtype=np.int64)


@dataclass
class _Part:
    """Columns of a group while they are filled, `done` rows of them, `longs` of `long`; rows that are lost."""

    index: int
    kind: int
    layout: Layout
    losses: Losses
    time: NDArray[np.int64]
    key: NDArray[np.uint32]
    bus: NDArray[np.uint16]
    flags: NDArray[np.uint8]
    length: NDArray[np.uint8]
    data: NDArray[Any]
    long_rows: NDArray[np.intp]
    long: NDArray[Any]
    store: Store | None = None
    done: int = 0
    longs: int = 0
    lost: list[NDArray[np.intp]] = field(default_factory=list)

    def place(self, bad: BoolArray, first: int) -> str:
        """Of the first bad one of rows that begin with record `first`."""
        return f"record {first + int(bad.argmax()) + 1} of channel group {self.index}"


def read_group(mdf: Any, index: int, kind: int, layout: Layout, losses: Losses) -> Frames:
    """Frames of one group, in the order of the file; `kind` is 0, REMOTE or ERROR."""
    group = mdf.groups[index]
    part = _empty(room_for(group), index, kind, layout, losses)
    if layout.stored and not kind:
        part.store = Store(*stored(mdf, group, layout.stored_in, losses, SPARE))
    for first, data in records(mdf, group, losses):
        count = min(len(data) // layout.record, len(part.time) - part.done)
        for at in range(0, count, _ROWS):
            _fill(part, data, at, min(_ROWS, count - at), first + at)
    missing = int(group.channel_group.cycles_nr) - part.done
    if missing > 0:
        losses.add(FEWER, f"channel group {index}", lost=missing)
    return _finished(part)


def _empty(count: int, index: int, kind: int, layout: Layout, losses: Losses) -> _Part:
    most = 0 if kind or (layout.stored is None and layout.width <= SHORT) else count
    return _Part(
        index,
        kind,
        layout,
        losses,
        time=np.empty(count, dtype=np.int64),
        key=np.empty(count, dtype=np.uint32),
        bus=np.empty(count, dtype=np.uint16),
        flags=np.empty(count, dtype=np.uint8),
        length=np.empty(count, dtype=np.uint8),
        data=np.empty(count, dtype="<u8"),
        long_rows=np.empty(most, dtype=np.intp),
        long=np.empty((most, LONG), dtype=np.uint8),
    )


def _finished(part: _Part) -> Frames:
    n, m = part.done, part.longs
    part.long.resize((m, LONG), refcheck=False)  # memory that was not needed is given back
    part.long_rows.resize(m, refcheck=False)
    found = frames(
        part.time[:n],
        part.key[:n],
        part.bus[:n],
        part.flags[:n],
        part.length[:n],
        part.data[:n].view(np.uint8).reshape(n, SHORT),
        part.long_rows[:m],
        part.long[:m],
    )
    if not part.lost:
        return found
    keep = np.ones(n, dtype=np.bool_)
    keep[np.concatenate(part.lost)] = False
    return found.take(np.flatnonzero(keep))


def _fill(part: _Part, data: Any, at: int, count: int, first: int) -> None:
    """The next `count` rows, from records of `data` from number `at` on, which is number `first` of the group."""
    layout, rows = part.layout, slice(part.done, part.done + count)
    numbers = {name: field.of(data, layout.record, at, count) for name, field in layout.numbers.items()}
    clock = layout.clock.of(data, layout.record, at, count)
    lost = _times(part.time[rows], clock, layout.conversion)
    if lost is not None:
        part.losses.add(STAMP, part.place(lost, first), int(lost.sum()), int(lost.sum()))
    if layout.marks or layout.all_marked:
        marked = _marked(layout, data, at, count)
        if marked.any():
            part.losses.add(MARKED, part.place(marked, first), int(marked.sum()), int(marked.sum()))
            lost = marked if lost is None else lost | marked
    if lost is not None:
        part.lost.append(part.done + np.flatnonzero(lost))
    part.key[rows] = keys(part.kind, numbers, count)
    part.bus[rows] = numbers.get("BusChannel", 0)
    part.flags[rows] = flags(part.kind, numbers, count)
    _payload(part, data, at, count, first, numbers)
    part.done += count


def _times(out: NDArray[np.int64], clock: NDArray[Any], conversion: Any) -> BoolArray | None:
    """Whole nanoseconds; (n,) those that have none, which are 0, or None."""
    seconds = np.asarray(conversion.convert(clock) if conversion else clock, dtype=np.float64)
    return nanoseconds(seconds, out)


def nanoseconds(seconds: NDArray[np.float64], out: NDArray[np.int64]) -> BoolArray | None:
    """Seconds to whole nanoseconds in `out`; (n,) those that are no number or beyond int64, which become 0; or None."""
    with np.errstate(invalid="ignore", over="ignore"):
        whole = seconds * 1e9
        np.rint(whole, out=whole)
        if not len(whole) or (whole.max() < _LATEST and whole.min() > -_LATEST):
            out[:] = whole
            return None
        bad = ~(np.abs(whole) < _LATEST)
    out[:] = np.where(bad, 0.0, whole)
    return np.asarray(bad)


def _marked(layout: Layout, data: Any, at: int, count: int) -> BoolArray:
    marked = np.full(count, layout.all_marked)
    for mark in layout.marks:
        marked |= mark.of(data, layout.record, at, count) != 0
    return marked


def keys(kind: int, numbers: Any, count: int) -> Any:
    """Identifiers with the EXTENDED flag; where no field says which are extended, those of more than 11 bits are."""
    if kind == ERROR or "ID" not in numbers:
        return np.zeros(count, dtype=np.uint32)
    identifier = numbers["ID"].astype(np.uint32)
    extended = numbers["IDE"] != 0 if "IDE" in numbers else identifier > LAST_STANDARD
    identifier &= np.uint32(IDENTIFIER)
    if extended.any():
        identifier |= extended * np.uint32(EXTENDED)
    return identifier


def flags(kind: int, numbers: Any, count: int) -> NDArray[np.uint8]:
    """(count,) `kind` of frames with their flags."""
    out = np.full(count, kind, dtype=np.uint8)
    for name, bit in (*FLAGS, ("Dir", SENT)):
        if name in numbers and (found := numbers[name] != 0).any():
            out |= found.view(np.uint8) * np.uint8(bit)
    return out


def lengths(kind: int, numbers: Any, count: int) -> NDArray[Any]:
    """(count,) bytes that frames say they have; of remote frames at most 8, which are asked for."""
    if kind == ERROR:
        return np.zeros(count, dtype=np.int64)
    if kind == REMOTE:
        asked = numbers.get("DLC", numbers.get("DataLength", np.zeros(count, dtype=np.uint8)))
        return np.asarray(np.minimum(asked, SHORT))
    if "DataLength" in numbers:
        return np.asarray(numbers["DataLength"])
    code: Any = np.minimum(numbers.get("DLC", np.zeros(count, dtype=np.int64)), len(_OF_CODE) - 1)
    flexible = numbers["EDL"] != 0 if "EDL" in numbers else np.zeros(count, dtype=np.bool_)
    return np.asarray(np.where(flexible, _OF_CODE[code], np.minimum(code, SHORT)))


def _payload(part: _Part, data: Any, at: int, count: int, first: int, numbers: Any) -> None:
    """Lengths and data: `head` gives the first eight bytes of all rows, `tail` all 64 of some."""
    rows, said = slice(part.done, part.done + count), lengths(part.kind, numbers, count)
    if part.kind:
        part.length[rows], part.data[rows] = said, 0
        return
    if part.store is None or part.layout.stored is None:
        record, width = part.layout.record, part.layout.width
        source: Any = InRecords(data, at * record + part.layout.at, width, record, count)
    else:
        places = part.layout.stored.of(data, part.layout.record, at, count)
        source = InStore(part.store, places)
        if source.bad.any():
            part.losses.add(NOT_STORED, part.place(source.bad, first), int(source.bad.sum()))
    beyond = said > source.most
    if beyond.any():
        part.losses.add(TOO_LONG, part.place(beyond, first), int(beyond.sum()))
    length = np.minimum(said, source.most)
    part.length[rows] = length
    part.data[rows] = source.head()
    if count and length.min() < SHORT:
        part.data[rows] &= KEPT[np.minimum(length, SHORT)]
    long = np.flatnonzero(length > SHORT)
    if len(long):
        there = slice(part.longs, part.longs + len(long))
        part.long_rows[there] = part.done + long
        source.tail(long, part.long[there])
        part.long[there].view(np.uint64)[:] &= KEPT_LONG[length[long]]
        part.longs += len(long)
