"""Logs of candump (can-utils), as its lib.h describes them, many lines at once.

    (1436509052.249713) vcan0 044#2A366C2BBA      candump -L: three hex digits, an 11-bit identifier; eight, 29 bits
    (1436509052.249713) vcan0 12345678#R8 T       remote frame that asks for 8 bytes; sent (R: received)
    (1436509052.249713) vcan0 123##3112233        CAN FD, one digit of flags: 1 bit-rate switch, 2 error state
    (1436509052.249713) vcan0 123#1122334455667788_9     its data length code was 9, though it has 8 bytes
    (1436509052.249713) vcan0 20000080#0000000000000000  error frame: bit 29 of the identifier
    (1436509052.249713) vcan0 00123#81:00:12345678#1122  CAN XL: counted

and as on the screen, with time stamps (-ta, -tz):

     (1436509052.249713)  vcan0  044   [5]  2A 36 6C 2B BA    '*6l+.'
     (1436509052.249713)  vcan0  TX B -  12345678  [08]  11 22 33 44 55 66 77 88     -x; CAN FD: two digits
     (1436509052.249713)  vcan0  123   [8]  remote request
     (1436509052.249713)  vcan0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

from nineaudit.can_database import EXTENDED
from nineaudit.errors import RecordingError
from nineaudit.readers.can import frames as can_frames
from nineaudit.readers.can import text_log
from nineaudit.readers.can.frames import ERROR, ERROR_STATE, FD, RATE_SWITCH, REMOTE, SENT, SHORT, Frames
from nineaudit.readers.can.text_layouts import Layout, read_lines
from nineaudit.readers.can.text_log import NOT_READ, Account

FD_SIZES: Final = frozenset((*range(9), 12, 16, 20, 24, 32, 48, 64))
"""Bytes that an FD frame can have, ISO 11898-1."""
_ERROR_FLAG: Final = 1 << 29
_STAMP: Final = rb"\((?P<s>\d{1,10})[.,](?P<f>\d{1,12})\)\s+(?P<bus>[!-~]{1,16})\s+"
_IDENTIFIER: Final = rb"(?P<id>[0-7][0-9A-Fa-f]{2}|[0-9A-Fa-f]{8})"
_COMPACT: Final = re.compile(
    _STAMP
    + _IDENTIFIER
    + rb"#(?:#(?P<flags>[0-9A-Fa-f])(?P<fd>(?:[0-9A-Fa-f]{2})*)"
    + rb"|(?P<data>(?:[0-9A-Fa-f]{2}){0,8})(?P<code>_[9A-Fa-f])?"
    + rb"|(?P<remote>[Rr])(?P<asked>[0-8]?)(?P<asked_code>_[9A-Fa-f])?)(?:\s+(?P<way>[RTrt]))?\s*"
)
_SCREEN: Final = re.compile(
    rb"\s*"
    + _STAMP
    + rb"(?:(?P<way>[RT])X\s+(?P<brs>[B-])\s+(?P<esi>[E-])\s+)?"
    + _IDENTIFIER
    + rb"\s+\[(?P<size>\d{1,2})\](?P<data>(?:\s+[0-9A-Fa-f]{2}(?!\S))*)"
    + rb"(?:\s+(?P<remote>remote request)|\s+ERRORFRAME|\s+'(?P<rest>.*'))?\s*"
)
_ON_THE_SCREEN: Final = (
    "lines of candump as on the screen: bit-rate switch, error state and direction are known only with -x, and stamps"
    " of -td, which count from frame to frame, cannot be told from those of -tz; candump -L keeps all of it"
)
_XL: Final = re.compile(rb"\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]{5}#[0-9A-Fa-f]{2}:[0-9A-Fa-f]{2}:[0-9A-Fa-f]{8}#")
_DETAIL: Final = re.compile(rb"[\t ]+[a-z][a-z-]+(\{|\s*$)")
_DATED: Final = re.compile(rb"\s*\(\d{4}-\d\d-\d\d")
_UNSTAMPED: Final = re.compile(rb"\s*\S+\s+[0-9A-Fa-f]{3,8}\s+\[\d+\]")


def read_candump(path: Path) -> Frames:
    """All frames of a log of candump, -L or as on the screen with time stamps (-ta, -tz).

    Time in ns as stamped: since 1970 for -L and -ta. Damage: lines that are no frames, among them those with bytes
    that no frame can have; a last line without line end. Raises RecordingError where there is not one frame.
    """
    account, buses, parts, line = Account(), dict[str, int](), [], 1
    screen: list[bytes] = []

    def parse(text: bytes) -> Layout | None:
        found = layout(text)
        if found and not screen and not _COMPACT.fullmatch(text):
            screen.append(text)
        return found

    for block in text_log.blocks(path):
        if text_log.cut_off(block, line, account):
            continue
        columns, others = read_lines(block, parse, buses)
        for row, text in others:
            _other(text, line + row, account)
        line += len(columns.kept)
        if columns.kept.any():
            parts.append(columns.frames())
    if not parts:
        raise _nothing(path, account)
    notes = (_ON_THE_SCREEN,) if screen else ()
    return can_frames.joined(parts, buses=tuple(buses), counts=dict(account.counts), damage=account.damage, notes=notes)


def layout(line: bytes) -> Layout | None:
    """Layout of a line of candump, None where it is no frame."""
    if match := _COMPACT.fullmatch(line):
        return _compact(match)
    match = _SCREEN.fullmatch(line)
    return _screen(match) if match else None


def _compact(match: re.Match[bytes]) -> Layout | None:
    way = SENT if match["way"] in (b"T", b"t") else 0
    if match["remote"]:
        code = REMOTE | way
        whole = match["asked_code"] is None or match["asked"] == b"8"
        return _laid_out(match, code, int(match["asked"] or 0), ()) if whole else None
    if match["flags"] is None:
        columns = tuple(range(*match.span("data")))
        whole = match["code"] is None or len(columns) == 2 * SHORT
        return _laid_out(match, way, len(columns) // 2, columns) if whole else None
    flags, columns = int(match["flags"], 16), tuple(range(*match.span("fd")))
    kind = FD | way | (RATE_SWITCH if flags & 1 else 0) | (ERROR_STATE if flags & 2 else 0)
    return _laid_out(match, kind, len(columns) // 2, columns) if len(columns) // 2 in FD_SIZES else None


def _screen(match: re.Match[bytes]) -> Layout | None:
    columns = tuple(i for i in range(*match.span("data")) if match.string[i] > ord(" "))
    size, flexible = int(match["size"]), len(match["size"]) == 2
    spoken = 0 if match["remote"] else size
    if len(columns) != 2 * spoken or (size not in FD_SIZES if flexible else size > SHORT):
        return None
    kind = (REMOTE if match["remote"] else 0) | (FD if flexible else 0) | (SENT if match["way"] == b"T" else 0)
    kind |= (RATE_SWITCH if match["brs"] == b"B" else 0) | (ERROR_STATE if match["esi"] == b"E" else 0)
    return _laid_out(match, kind, size, columns, match.span("rest") if match["rest"] else (0, 0))


def _laid_out(
    match: re.Match[bytes], kind: int, length: int, columns: tuple[int, ...], rest: tuple[int, int] = (0, 0)
) -> Layout | None:
    """An error frame's identifier says what went wrong: it is no identifier, and lines that have another one are
    another layout."""
    common: Any = {"seconds": match.span("s"), "fraction": match.span("f"), "data": columns, "rest": rest}
    number, bus = int(match["id"], 16), match["bus"].decode("ascii")
    if len(match["id"]) == 3:
        return Layout(bus, kind, length, identifier=match.span("id"), **common)
    if number & _ERROR_FLAG:
        return Layout(bus, (kind | ERROR) & ~FD, length, **common)
    if number >= _ERROR_FLAG:
        return None
    return Layout(bus, kind, length, key=EXTENDED, identifier=match.span("id"), **common)


def _other(text: bytes, line: int, account: Account) -> None:
    if text.lstrip().startswith((b"#", b"//")):
        account.counts["comment_lines"] += 1
    elif _XL.match(text):
        account.counts["xl_frames"] += 1
    elif _DETAIL.match(text):
        account.counts["error_detail_lines"] += 1
    else:
        account.damaged(NOT_READ, line, text)


def _nothing(path: Path, account: Account) -> RecordingError:
    """The error for a log without one frame: its first line, and what that looks like."""
    _, first = next(iter(account.lines.items()), (None, None))
    text = first.text.strip("'\"") if first else ""
    why = ""
    if _DATED.match(text.encode()):
        why = "its stamps are dates in some time zone (candump -tA): "
    elif _UNSTAMPED.match(text.encode()):
        why = "its lines have no time stamps: "
    return RecordingError(
        "no CAN frames in this log",
        file=path,
        place=f"line {first.line}" if first else None,
        found=text or "nothing but blank lines and comments",
        expected="a log of candump -L, such as (1436509052.249713) can0 024#0102",
        advice=f"{why}record with candump -L",
    )
