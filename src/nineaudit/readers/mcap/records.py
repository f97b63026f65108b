"""The data section of an MCAP log from its first byte to its last, chunk by chunk, and what is wrong with it.

Every length is held against what is there; every checksum is verified; after damage the walk goes on at the next chunk
that the summary names. Source: MCAP file format specification, mcap.dev/spec: "File Structure".
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from nineaudit.array import BoolArray
from nineaudit.readers.mcap import parse as parse
from nineaudit.readers.mcap.book import Book, define, other_record
from nineaudit.readers.mcap.chunk import Messages, inflated, messages, messages_at
from nineaudit.readers.mcap.parse import MAGIC, Channel, Data, Index, Int64, Malformed, Record
from nineaudit.readers.mcap.summary import Summary, crc32, summary

_LOOSE: Final = 4096
"""Messages outside chunks that are handed on together."""


@dataclass(frozen=True, eq=False)
class Batch:
    """n messages of one channel in the order of the file: their data are `data[starts[i]:ends[i]]`. `times` (n,) log
    times in ns; `order` (n,) grows through the file; `at` the byte of the file where their chunk begins."""

    channel: Channel
    data: Data
    starts: Int64
    ends: Int64
    times: Int64
    order: Int64
    at: int

    def __len__(self) -> int:
        return len(self.starts)


Wanted = Callable[[Channel], bool]


def batches(data: memoryview, book: Book, wanted: Wanted) -> Iterator[Batch]:
    """Messages of the channels that are wanted; those of others are counted. The whole file is read."""
    last = summary(data, book.damages)
    book.schemas |= last.schemas
    book.channels |= last.channels
    loose: list[int] = []
    for record in _data_section(data, last, book):
        if record.op == parse.MESSAGE and record.end - record.start >= parse.MESSAGE_HEAD:
            loose.append(record.at)
        if loose and (record.op in (parse.SCHEMA, parse.CHANNEL, parse.CHUNK) or len(loose) == _LOOSE):
            yield from _loose(data, loose, book, wanted)
            loose = []
        if record.op == parse.CHUNK:
            yield from _chunk(data, record, last, book, wanted)
        else:
            other_record(data, record, book)
    yield from _loose(data, loose, book, wanted)
    _compare(last, book)


def _data_section(data: memoryview, last: Summary, book: Book) -> Iterator[Record]:
    """Records of the data section. A record that cannot be, or that runs over the beginning of a chunk, is damage."""
    at = len(MAGIC)
    while at < last.end:
        behind = bisect_right(last.chunks, at)
        limit = last.chunks[behind] if behind < len(last.chunks) else last.end
        try:
            record = parse.record_at(data, at, limit)
            _require_possible(record, last, chunk=behind > 0 and last.chunks[behind - 1] == at)
        except Malformed as error:
            if limit == last.end and not last.whole:
                break
            book.damages.add(f"data section: {error}", at, lost=_indexed(data, at, limit))
            at = limit
            continue
        at = record.end
        if record.op in (parse.DATA_END, parse.FOOTER):
            _end(data, record, last, book)
            return
        yield record
    if last.whole:
        book.damages.add("the data section has no end record", at, words="its checksum is not there")
    else:
        book.damages.add(_CUT, at, lost=None)


_CUT: Final = "the file is cut short, or was never closed: it has no footer"


def _require_possible(record: Record, last: Summary, *, chunk: bool) -> None:
    if record.op == 0:
        raise Malformed("a record of opcode 0")
    if chunk and record.op != parse.CHUNK:
        raise Malformed("no chunk where the summary says that one begins")
    if last.whole and last.good and record.op in (parse.DATA_END, parse.FOOTER) and record.end != last.end:
        raise Malformed("its end record is not where the summary begins")


def _indexed(data: memoryview, at: int, end: int) -> int | None:
    """Messages that are lost with a damaged chunk at `at`, by the message indexes behind it; None where unknown."""
    try:
        record = parse.record_at(data, at, end)
        found = [parse.index(data, r) for r in parse.records(data, record.end, end) if r.op == parse.MESSAGE_INDEX]
    except Malformed:
        return None
    return sum(len(i.times) for i in found) or None


def _end(data: memoryview, record: Record, last: Summary, book: Book) -> None:
    """The end of the data section: its checksum, and that the summary follows at once."""
    if not last.whole:
        book.damages.add(_CUT, len(data), words="its data section is whole")
    if record.op == parse.FOOTER:
        book.damages.add("the data section has no end record", record.at, words="its checksum is not there")
        return
    try:
        crc = parse.data_end(data, record)
    except Malformed as error:
        book.damages.add(f"data section: {error}", record.at)
        return
    if crc and crc32(data, 0, record.at) != crc:
        words = "what stands in chunks with a checksum of their own is good"
        book.damages.add("the data section's checksum (CRC) does not hold", record.at, words=words)


def _chunk(data: memoryview, record: Record, last: Summary, book: Book, wanted: Wanted) -> Iterator[Batch]:
    book.chunks += 1
    indexes = list(_indexes(data, record.end, last.end, book))
    try:
        chunk = parse.chunk(data, record)
        raw = inflated(chunk, data)
    except Malformed as error:
        lost = sum(len(i.times) for i in indexes) or None
        book.damages.add(str(error), record.at, lost=lost)
        return
    book.unchecked += not chunk.crc
    found = messages(raw, indexes)
    if found.wrong:
        book.damages.add(found.wrong, record.at, lost=None)
    if not found.indexed:
        words = "the messages were read without it"
        book.damages.add("a message index that does not fit its chunk", record.at, words=words)
    for other in found.others:
        define(raw, other, book, record.at)
    yield from _by_channel(raw, found, record.at, book, wanted)


def _indexes(data: memoryview, at: int, end: int, book: Book) -> Iterator[Index]:
    """The message indexes that follow a chunk."""
    while at < end:
        try:
            record = parse.record_at(data, at, end)
            if record.op != parse.MESSAGE_INDEX:
                return
            yield parse.index(data, record)
        except Malformed as error:
            book.damages.add(f"message index: {error}", at)
            return
        at = record.end


def _loose(data: memoryview, offsets: Sequence[int], book: Book, wanted: Wanted) -> Iterator[Batch]:
    if offsets:
        found = messages_at(data, np.array(offsets, dtype=np.int64))
        yield from _by_channel(data, found, offsets[0], book, wanted)


def _by_channel(data: Data, found: Messages, at: int, book: Book, wanted: Wanted) -> Iterator[Batch]:
    """The messages of each wanted channel; all are counted."""
    order = book.seen + np.arange(len(found.channel))
    book.seen += len(found.channel)
    timed = found.times >= 0
    different = _different(found.channel)
    for number in different:
        rows, count = _rows(found.channel, number, len(different) == 1, timed)
        late = count - len(rows)
        if late:
            book.damages.add("a log time after the year 2262", at, count=late, lost=late)
        channel = book.channels.get(number)
        if channel is None:
            book.damages.add("a message of a channel that is not described", at, count=len(rows), lost=len(rows))
        book.messages[number] = book.messages.get(number, 0) + len(rows) + late
        if channel is not None and len(rows) and wanted(channel):
            every = len(rows) == len(order)  # then they stay as they are
            columns = (found.starts, found.ends, found.times, order)
            starts, ends, times, place = (c if every else c[rows] for c in columns)
            yield Batch(channel, data, starts, ends, times, place, at)


def _rows(channel: Any, number: int, alone: bool, timed: BoolArray) -> tuple[Int64, int]:
    """Rows of a channel's messages that have a time, and how many it has with or without; `alone`: all are its."""
    if alone:
        return np.flatnonzero(timed), len(channel)
    own = channel == number
    return np.flatnonzero(own & timed), int(np.count_nonzero(own))


def _different(numbers: Any) -> list[int]:
    """The different ones of (n,) numbers."""
    if len(numbers) and (numbers == numbers[0]).all():
        return [int(numbers[0])]
    return [int(n) for n in np.unique(numbers)]


def _compare(last: Summary, book: Book) -> None:
    """What was read against what the statistics state."""
    stated = last.statistics
    if stated is None:
        return
    if stated.messages != book.count:
        words = f"they state {stated.messages}, the file holds {book.count}"
        book.damages.add("the number of messages is not that of the statistics", last.end, words=words)
    elif stated.by_channel and dict(stated.by_channel) != {k: v for k, v in book.messages.items() if v}:
        book.damages.add("the numbers of messages by channel are not those of the statistics", last.end)
    pairs = (("chunks", stated.chunks, book.chunks), ("attachments", stated.attachments, book.attachments))
    for what, count, read in pairs:
        if count != read:
            words = f"they state {count}, the file holds {read}"
            book.damages.add(f"the number of {what} is not that of the statistics", last.end, words=words)
