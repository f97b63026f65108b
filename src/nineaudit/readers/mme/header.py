"""What the header of a test says of it (the .mme file of ISO/TS 13499):

Laboratory name             :NOVALUE
Laboratory test ref. number :T0001
Title                       :NOVALUE
Date of the test            :2026-01-31
Name of test object 1       :head form
Ref. number of test object 1:4711
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePosixPath
from typing import Final

from nineaudit.identity import Stated, stated
from nineaudit.readers.mme.channel import CODE, Channel, parse_keys
from nineaudit.readers.mme.files import Test

HEADER_KEYS: Final = {
    "number": "Laboratory test ref. number",
    "title": "Title",
    "date": "Date of the test",
    "laboratory": "Laboratory name",
    "customer": "Customer name",
}
OBJECT_KEYS: Final = {"item": "Name of test object", "item_serial": "Ref. number of test object"}
"""Followed by the number of the object, of which a test may have several."""
_LARGEST: Final = 2**20


def statements(test: Test, channels: Sequence[Channel]) -> tuple[Stated, ...]:
    """What the header states of the test, and of the object on which all of the channels are; () without a header."""
    if test.header is None:
        return ()
    keys = parse_keys(test.store.read(test.header, _LARGEST)[0])
    number = _object(channels) or ("1" if keys.get("number of test objects", "1") == "1" else "")
    names = HEADER_KEYS | ({key: f"{name} {number}" for key, name in OBJECT_KEYS.items()} if number else {})
    found = Channel(test.header, keys)
    return stated({key: found.get(name.lower()) for key, name in names.items()}, f"header {_name(test.header)}")


def _name(header: str) -> str:
    return PurePosixPath(header).name


def _object(channels: Sequence[Channel]) -> str:
    """The number of the test object of the channels: as their headers say, else the first character of their codes;
    "" where that is not one."""
    numbers = {c.get("test object number") or (c.code[0] if CODE.fullmatch(c.code) else "") for c in channels}
    return numbers.pop() if len(numbers) == 1 else ""
