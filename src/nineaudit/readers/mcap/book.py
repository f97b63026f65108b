"""What an MCAP log says of itself: definitions, metadata, attachments, and counts.

Source: MCAP file format specification, mcap.dev/spec: "Records".
"""

from __future__ import annotations

from dataclasses import dataclass, field

from nineaudit.identity import KEYS, METADATA
from nineaudit.provenance import MCAP_RECORD
from nineaudit.readers.mcap import parse as parse
from nineaudit.readers.mcap.damage import Damages
from nineaudit.readers.mcap.parse import Channel, Data, Malformed, Record, Schema
from nineaudit.readers.mcap.summary import crc32
from nineaudit.signals import MCAP_ORIGIN


@dataclass
class Book:
    """What a log says as it is read: definitions, messages by channel id, counts, ns to add to log times, damage; the
    `repair` that its metadata has the record of, and what that states of the `test`."""

    damages: Damages = field(default_factory=Damages)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    messages: dict[int, int] = field(default_factory=dict)
    chunks: int = 0
    attachments: int = 0
    unknown: int = 0
    unchecked: int = 0
    origin: int = 0
    repair: str | None = None
    test: dict[str, str] = field(default_factory=dict)
    seen: int = 0

    @property
    def count(self) -> int:
        return sum(self.messages.values())


def other_record(data: memoryview, record: Record, book: Book) -> None:
    """What a record outside chunks says that is neither message nor chunk."""
    if record.op in (parse.SCHEMA, parse.CHANNEL):
        define(data, record, book, record.at)
    elif record.op == parse.ATTACHMENT:
        _attachment(data, record, book)
    elif record.op == parse.METADATA:
        _metadata(data, record, book)
    elif record.op == parse.MESSAGE and record.end - record.start < parse.MESSAGE_HEAD:
        book.damages.add("a message shorter than its head", record.at, lost=1)
    elif record.op > parse.DATA_END:
        book.unknown += 1


def define(data: Data, record: Record, book: Book, at: int) -> None:
    """A schema or channel. One that differs from an earlier one of its id is damage; the later one counts."""
    try:
        if record.op == parse.SCHEMA:
            schema = parse.schema(data, record)
            old, book.schemas[schema.id] = book.schemas.get(schema.id, schema), schema
            same = old == schema
        elif record.op == parse.CHANNEL:
            channel = parse.channel(data, record)
            before, book.channels[channel.id] = book.channels.get(channel.id, channel), channel
            same = before == channel
        else:
            book.unknown += record.op > parse.DATA_END
            return
    except Malformed as error:
        book.damages.add(f"schema or channel: {error}", at)
        return
    if not same:
        book.damages.add("two definitions of one schema or channel id", at, words="each holds from where it stands")


def _attachment(data: memoryview, record: Record, book: Book) -> None:
    book.attachments += 1
    try:
        crc, end = parse.attachment(data, record)
    except Malformed as error:
        book.damages.add(f"attachment: {error}", record.at)
        return
    if crc and crc32(data, record.start, end) != crc:
        book.damages.add("an attachment whose checksum (CRC) does not hold", record.at)


def _metadata(data: memoryview, record: Record, book: Book) -> None:
    try:
        name, found = parse.metadata(data, record)
        if name == MCAP_RECORD:
            book.repair = found.get("json", "")
        if name == METADATA:
            book.test = {key: found[key] for key in KEYS if key in found}
        book.origin = int(found.get(MCAP_ORIGIN, book.origin))
    except (Malformed, ValueError) as error:
        book.damages.add(f"metadata: {error}", record.at)
