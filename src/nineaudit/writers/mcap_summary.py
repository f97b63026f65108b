"""Adding to an MCAP log behind its data section: what its summary says, and a new one that says it of both.

Source: MCAP file format specification, mcap.dev/spec: "File Structure", "Summary Section".
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Final

MAGIC: Final = b"\x89MCAP0\r\n"
_HEAD: Final = struct.Struct("<BQ")
_DATA_END: Final = 15
_BLOCK: Final = 1 << 22


@dataclass
class Old:
    """What a log holds: the byte where its data section ends, its definitions and indexes, its statistics."""

    end: int
    schemas: list[Any] = field(default_factory=list)
    channels: list[Any] = field(default_factory=list)
    chunks: list[Any] = field(default_factory=list)
    attachments: list[Any] = field(default_factory=list)
    metadata: list[Any] = field(default_factory=list)
    statistics: Any = None


def read(path: Path) -> Old | None:
    """What a log holds, every checksum verified; None where it is not a whole MCAP log. OSError."""
    from mcap import records
    from mcap.exceptions import McapError
    from mcap.stream_reader import StreamReader

    end = _data_end(path)
    if end is None:
        return None
    found = Old(end)
    names = {records.Schema: "schemas", records.Channel: "channels", records.ChunkIndex: "chunks"}
    names |= {records.AttachmentIndex: "attachments", records.MetadataIndex: "metadata"}
    try:
        with path.open("rb") as file:
            for record in StreamReader(file, validate_crcs=True).records:
                place = names.get(type(record))
                if place is not None and record not in getattr(found, place):
                    getattr(found, place).append(record)
                elif isinstance(record, records.Statistics):
                    found.statistics = record
    except (McapError, struct.error, UnicodeDecodeError):
        return None
    return found


def _data_end(path: Path) -> int | None:
    """The byte where the data section ends; None where the file is cut short before."""
    size = path.stat().st_size
    with path.open("rb") as file:
        at = len(MAGIC) if file.read(len(MAGIC)) == MAGIC else size
        while at + _HEAD.size <= size:
            file.seek(at)
            op, length = _HEAD.unpack(file.read(_HEAD.size))
            if op == _DATA_END:
                return at
            at += _HEAD.size + length
    return None


class Appended:
    """A log copied byte by byte to the end of its data section, to which more is added."""

    def __init__(self, source: IO[bytes], file: IO[bytes], old: Old) -> None:
        self.file, self.old, self.at, self.crc = file, old, 0, 0
        source.seek(0)
        while self.at < old.end:
            self._put(source.read(min(_BLOCK, old.end - self.at)))
        self.counts: dict[int, int] = {}
        self.times: list[int] = []
        self.new_chunks = self.new_metadata = self.new_channels = 0
        self.chunked = bool(old.chunks) or not old.channels

    def channel(self, topic: str, schema_name: str, schema: bytes) -> int:
        """A topic of JSON messages; its id."""
        from mcap.records import Channel, Schema

        number = 1 + max((s.id for s in self.old.schemas), default=0)
        self.old.schemas.append(Schema(id=number, name=schema_name, encoding="jsonschema", data=schema))
        channel = 1 + max((c.id for c in self.old.channels), default=0)
        made = Channel(id=channel, topic=topic, message_encoding="json", metadata={}, schema_id=number)
        self.old.channels.append(made)
        self.new_channels += 1
        if not self.chunked:
            self._put(_bytes(self.old.schemas[-1]) + _bytes(made))
        return channel

    def messages(self, channel: int, times: Sequence[int], payloads: Sequence[bytes]) -> None:
        """Messages of a topic, as a chunk of their own (or as they are, where the log has no chunks)."""
        from mcap.records import Message

        base = self.counts.get(channel, 0)
        rows = [
            _bytes(Message(channel_id=channel, log_time=t, data=data, publish_time=t, sequence=base + i))
            for i, (t, data) in enumerate(zip(times, payloads, strict=True))
        ]
        self.counts[channel] = base + len(rows)
        self.times += [min(times), max(times)]
        if not self.chunked:
            self._put(b"".join(rows))
            return
        self._chunk(channel, times, rows)

    def _chunk(self, channel: int, times: Sequence[int], rows: Sequence[bytes]) -> None:
        import zstandard
        from mcap.records import Chunk, ChunkIndex, MessageIndex

        of = next(c for c in self.old.channels if c.id == channel)
        head = _bytes(next(s for s in self.old.schemas if s.id == of.schema_id)) + _bytes(of)
        offsets = [len(head)]
        for row in rows:
            offsets.append(offsets[-1] + len(row))
        whole = head + b"".join(rows)
        span = {"message_start_time": min(times), "message_end_time": max(times)}
        packed = zstandard.compress(whole)
        crc = zlib.crc32(whole)
        chunk = Chunk(compression="zstd", data=packed, uncompressed_crc=crc, uncompressed_size=len(whole), **span)
        start, data = self.at, _bytes(chunk)
        self._put(data)
        index = self.at
        self._put(_bytes(MessageIndex(channel_id=channel, records=list(zip(times, offsets, strict=False)))))
        made = ChunkIndex(
            chunk_length=len(data), chunk_start_offset=start, compression="zstd", compressed_size=len(packed),
            message_index_length=self.at - index, message_index_offsets={channel: index},
            uncompressed_size=len(whole), **span,
        )  # fmt: skip
        self.old.chunks.append(made)
        self.new_chunks += 1

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """A record of names and values."""
        from mcap.records import Metadata, MetadataIndex

        data = _bytes(Metadata(name=name, metadata=dict(values)))
        self.old.metadata.append(MetadataIndex(offset=self.at, length=len(data), name=name))
        self.new_metadata += 1
        self._put(data)

    def finish(self) -> None:
        """The end of the data section, the summary of old and new, and the footer."""
        from mcap.records import DataEnd, Footer

        indexed = self._statistics()
        self._put(_bytes(DataEnd(self.crc)))
        start, groups = self.at, self._groups() if indexed else []
        summary, offsets = self._summary(start, groups)
        behind = start + len(summary) - len(offsets)
        self.file.write(summary)
        foot = (start, behind) if summary else (0, 0)
        crc = zlib.crc32(struct.pack("<BQQQ", 2, 20, *foot), zlib.crc32(summary))
        self.file.write(_bytes(Footer(*foot, crc)) + MAGIC)

    def _statistics(self) -> bool:
        """Count what is new among the old. Whether the summary will find everything."""
        stats, old = self.old.statistics, self.old
        if stats is None or len(old.chunks) != stats.chunk_count + self.new_chunks:
            return False
        first = [stats.message_start_time, stats.message_end_time] if stats.message_count else []
        stats.message_start_time, stats.message_end_time = min(first + self.times), max(first + self.times)
        stats.message_count += sum(self.counts.values())
        stats.channel_message_counts.update(self.counts)
        stats.chunk_count += self.new_chunks
        stats.metadata_count += self.new_metadata
        stats.channel_count += self.new_channels
        stats.schema_count += self.new_channels
        return True

    def _groups(self) -> list[list[Any]]:
        old = self.old
        return [old.schemas, old.channels, [old.statistics], old.chunks, old.attachments, old.metadata]

    def _summary(self, start: int, groups: Sequence[Sequence[Any]]) -> tuple[bytes, bytes]:
        """(summary with its offsets behind it, the offsets)."""
        from mcap.records import SummaryOffset

        parts, offsets, at = [], b"", start
        for group in filter(None, groups):
            data = b"".join(map(_bytes, group))
            parts.append(data)
            offsets += _bytes(SummaryOffset(group_opcode=data[0], group_start=at, group_length=len(data)))
            at += len(data)
        return b"".join(parts) + offsets, offsets

    def _put(self, data: bytes) -> None:
        self.file.write(data)
        self.crc = zlib.crc32(data, self.crc)
        self.at += len(data)


def _bytes(record: Any) -> bytes:
    """A record as it stands in a file."""
    from mcap.data_stream import RecordBuilder

    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]
