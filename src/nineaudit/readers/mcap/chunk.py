"""Chunks of an MCAP log: inflated within their stated size, checked, and taken apart into messages.

Source: MCAP file format specification, mcap.dev/spec: "Chunk (op=0x06)", "Message Index (op=0x07)".
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nineaudit.readers.inflate import inflate
from nineaudit.readers.mcap.parse import (
    MESSAGE,
    MESSAGE_HEAD,
    RECORD_HEAD,
    Chunk,
    Data,
    Index,
    Int64,
    Malformed,
    Record,
    records,
)


def inflated(chunk: Chunk, data: Data) -> Data:
    """The chunk's records, CRC verified. Raises Malformed: an unknown compression, a size that is not the stated one
    or cannot be, data that do not inflate, a CRC that does not hold."""
    packed = data[chunk.start : chunk.end]
    if chunk.compression == "":
        found = packed
    elif chunk.compression in ("zstd", "lz4"):
        try:
            found = inflate(chunk.compression, packed, chunk.size)
        except ValueError as error:
            raise Malformed(f"a chunk that {error}") from error
    else:
        raise Malformed("a chunk in an unknown compression")
    if len(found) != chunk.size:
        raise Malformed("a chunk that is not of the size it states")
    if chunk.crc and zlib.crc32(found) != chunk.crc:
        raise Malformed("a chunk whose checksum (CRC) does not hold")
    return found


class Messages(NamedTuple):
    """Messages of a chunk in its order: channel, log time in ns, begin and end of the data in it, (n,) each; the other
    records; what is wrong with them; whether the message indexes tell the same."""

    channel: NDArray[np.uint16]
    times: Int64
    starts: Int64
    ends: Int64
    others: tuple[Record, ...]
    wrong: str = ""
    indexed: bool = True


def messages(data: Data, indexes: Sequence[Index]) -> Messages:
    """What stands in an inflated chunk. With message indexes that account for every byte no record is walked; where
    they do not, all are, and `indexed` says so."""
    indexes = [i for i in indexes if len(i.offsets)]
    if indexes:
        told, times, offsets = _in_file_order(indexes)
        others = _between(data, offsets)
        if others is not None:
            found = messages_at(data, offsets, others)
            if np.array_equal(told, found.channel) and np.array_equal(times, found.times):
                return found
    return _walked(data)._replace(indexed=not indexes)


def _in_file_order(indexes: Sequence[Index]) -> tuple[NDArray[np.uint16], Int64, Int64]:
    """(n,) channels, log times and offsets of the message indexes of a chunk, by offset."""
    told = np.repeat(np.array([i.channel for i in indexes], dtype=np.uint16), [len(i.offsets) for i in indexes])
    times, offsets = (np.concatenate(column) for column in zip(*((i.times, i.offsets) for i in indexes), strict=True))
    if (offsets[1:] > offsets[:-1]).all():
        return told, times, offsets
    order = np.argsort(offsets, kind="stable")
    return told[order], times[order], offsets[order]


def _between(data: Data, offsets: Int64) -> tuple[Record, ...] | None:
    """Records other than messages, where messages at (n,) `offsets` and these fill the chunk; None where not."""
    size = len(data)
    if len(offsets) == 0 or offsets[0] < 0 or offsets[-1] > size - RECORD_HEAD - MESSAGE_HEAD:
        return None
    length = _view(data, "<u8")[offsets + 1]
    if (_view(data, "u1")[offsets] != MESSAGE).any() or (length < MESSAGE_HEAD).any() or (length > size).any():
        return None
    starts = np.concatenate([[0], offsets + RECORD_HEAD + length.astype(np.int64)])
    ends = np.concatenate([offsets, [size]])
    if (starts > ends).any():
        return None
    gaps = np.flatnonzero(starts < ends)
    try:
        others = [r for g in gaps for r in records(data, int(starts[g]), int(ends[g]))]
    except Malformed:
        return None
    return None if any(r.op == MESSAGE for r in others) else tuple(others)


def _walked(data: Data) -> Messages:
    offsets, others, wrong = [], [], ""
    try:
        for record in records(data, 0, len(data)):
            if record.op != MESSAGE:
                others.append(record)
            elif record.end - record.start < MESSAGE_HEAD:
                wrong = "a message shorter than its head"
            else:
                offsets.append(record.at)
    except Malformed as error:
        wrong = f"{error} in a chunk"
    return messages_at(data, np.array(offsets, dtype=np.int64), tuple(others))._replace(wrong=wrong)


def messages_at(data: Data, offsets: Int64, others: tuple[Record, ...] = ()) -> Messages:
    """The messages whose records begin at (n,) `offsets`."""
    if not len(offsets):
        none = np.empty(0, dtype=np.int64)
        return Messages(np.empty(0, dtype=np.uint16), none, none, none, others)
    starts = offsets + RECORD_HEAD
    ends = starts + _view(data, "<i8")[offsets + 1]
    channel = _view(data, "<u2")[starts]
    return Messages(channel, _view(data, "<i8")[starts + 6], starts + MESSAGE_HEAD, ends, others)


def _view(data: Data, dtype: str) -> NDArray[Any]:
    """Numbers that begin at each byte of the data."""
    size = np.dtype(dtype).itemsize
    return np.ndarray((max(0, len(data) - size + 1),), dtype=dtype, buffer=data, strides=(1,))
