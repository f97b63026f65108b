"""Lines of a Vector ASC log that are CAN frames, as Vector's "CAN, Log and Trigger ASC Format" describes them.

    0.000000 1  1A0             Rx   d 8 11 22 33 44 55 66 77 88  Length = 240000 BitCount = 124 ID = 416
    0.000000 1  18FEF100x       Tx   r 8                   x: 29 bits; r: remote, with or without length code
    0.000000 1  ErrorFrame  Flags = 0xe CodeExt = 0x20a2 Code = 0x82 ID = 0 DLC = 0 Position = 5 Length = 11300
    0.000000 CANFD   1 Rx  1A0  EngineData  1 0 9 12 11 22 33 44 55 66 77 88 99 AA BB CC  130000 130 303000 0 0 0 0 0 0

Of CAN FD: direction, identifier, name (from version 8.1 on; may be absent), bit-rate switch, error state, data length
code, bytes, duration, bits, flags (0x10 remote, 0x1000 FD frame, 0x2000, 0x4000 as before), and what is passed over.
`base dec`: identifiers and bytes are decimal.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from typing import Any, Final

from nineaudit.can_database import EXTENDED
from nineaudit.readers.can.frames import ERROR, ERROR_STATE, FD, OVERLOAD, RATE_SWITCH, REMOTE, SENT, SHORT
from nineaudit.readers.can.text_layouts import Layout

SIZES: Final = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Bytes of an FD frame by data length code, ISO 11898-1."""
STAMP: Final = rb"\s*(?P<s>\d{1,9})[.,](?P<f>\d{1,12})\s+"
_BYTE: Final = {16: rb"[0-9A-Fa-f]{2}", 10: rb"\d{1,3}"}
_FLAG_REMOTE: Final = 1 << 4
_FLAG_FD: Final = 1 << 12
_MOST: Final = {False: 0x7FF, True: 0x1FFFFFFF}

Lay = Callable[[re.Match[bytes], int], Layout | None]


@cache
def _head(base: int) -> re.Pattern[bytes]:
    identifier = rb"[0-9A-Fa-f]{1,8}" if base == 16 else rb"\d{1,9}"
    named = rb"(?P<id>" + identifier + rb")(?P<x>[xX]?)\s+"
    classic = rb"(?P<bus>\d{1,3})\s+" + named + rb"(?P<way>Rx|Tx)\s+(?P<type>[dr])(?P<code>\s+[0-9A-Fa-f]{1,2}(?!\S))?"
    flexible = (
        rb"CANFD\s+(?P<fd_bus>\d{1,3})\s+(?P<fd_way>Rx|Tx)\s+"
        + named.replace(b"<id>", b"<fd_id>").replace(b"<x>", b"<fd_x>")
        + rb"(?:(?![01]\s)(?P<name>\S+)\s+)?(?P<brs>[01])\s+(?P<esi>[01])\s+(?P<fd_code>[0-9A-Fa-f]{1,2})\s+"
        + rb"(?P<size>\d{1,2})(?!\S)"
    )
    error = (
        rb"(?:CANFD\s+)?(?P<error_bus>\d{1,3})\s+(?:(?P<error_way>Rx|Tx)\s+)?(?P<error>ErrorFrame|OverloadFrame)(?!\S)"
    )
    return re.compile(STAMP + rb"(?:" + classic + rb"|" + flexible + rb"|" + error + rb")")


@cache
def _data(base: int, count: int) -> re.Pattern[bytes]:
    """`count` bytes, and behind them nothing that could be one more."""
    byte = _BYTE[base]
    tail = rb"(?:\s+(?!" + byte + rb"(?!\S))\S+(?P<rest>.*))?\s*"
    return re.compile(rb"(?P<data>(?:\s+" + byte + rb"(?!\S)){%d})" % count + tail)


@cache
def _fd_data(base: int, count: int) -> re.Pattern[bytes]:
    """`count` bytes, and behind them nothing, or at least duration, bits and flags."""
    tail = rb"(?:\s+(?P<duration>\d+)\s+(?P<bits>\d+)\s+(?P<flags>[0-9A-Fa-f]{1,8})(?!\S)(?P<rest>.*))?\s*"
    return re.compile(rb"(?P<data>(?:\s+" + _BYTE[base] + rb"(?!\S)){%d})" % count + tail)


def layout(line: bytes, base: int) -> Layout | None:
    """Layout of a line of an ASC log, None where it is no CAN frame. `base` 16 or 10 of identifiers and bytes."""
    head = _head(base).match(line)
    if head is None:
        return None
    if head["error"]:
        kind = ERROR if head["error"] == b"ErrorFrame" else OVERLOAD
        rest = (head.end(), len(line))
        return Layout(head["error_bus"].decode(), kind | _sent(head["error_way"]), 0, **_time(head), rest=rest)
    return _flexible(head, base) if head["fd_bus"] else _classic(head, base)


def _classic(head: re.Match[bytes], base: int) -> Layout | None:
    code = _code(head["code"] or b"0", base)
    if code is None or (head["type"] == b"d" and head["code"] is None):
        return None
    length = min(code, SHORT)
    tail = _data(base, length if head["type"] == b"d" else 0).fullmatch(head.string, head.end())
    if tail is None:
        return None
    kind = _sent(head["way"]) | (REMOTE if head["type"] == b"r" else 0)
    return _laid_out(head, "", kind, length, tail, base, {})


def _flexible(head: re.Match[bytes], base: int) -> Layout | None:
    code, size = _code(head["fd_code"], base), int(head["size"])
    tail = _fd_data(base, size).fullmatch(head.string, head.end()) if size in SIZES else None
    if code is None or tail is None:
        return None
    flags = _FLAG_FD if tail["flags"] is None else int(tail["flags"], 16)
    switched, state = head["brs"] == b"1", head["esi"] == b"1"
    fd = bool(flags & _FLAG_FD) or switched or size > SHORT
    remote = bool(flags & _FLAG_REMOTE) or (size == 0 and code > 0)
    asked = SIZES[code] if fd else min(code, SHORT)
    if size != (0 if remote else asked):
        return None
    kind = (FD if fd and not remote else 0) | (RATE_SWITCH if switched else 0) | (ERROR_STATE if state else 0)
    kind |= _sent(head["fd_way"]) | (REMOTE if remote else 0)
    words = [head.span("name")] if head["name"] else []
    words += [tail.span(name) for name in ("duration", "bits") if tail[name]]
    return _laid_out(head, "fd_", kind, min(asked, SHORT) if remote else asked, tail, base, {"words": tuple(words)})


def _laid_out(
    head: re.Match[bytes], prefix: str, kind: int, length: int, tail: re.Match[bytes], base: int, more: dict[str, Any]
) -> Layout | None:
    extended = bool(head[f"{prefix}x"])
    number = int(head[f"{prefix}id"], base)
    if number > _MOST[extended]:
        return None
    key, bus = EXTENDED if extended else 0, head[f"{prefix}bus"].decode()
    more |= _time(head) | {"rest": tail.span("rest") if tail["rest"] else (0, 0)}
    if base == 10:
        octets = [int(word) for word in tail["data"].split()]
        return Layout(bus, kind, length, key=key | number, octets=bytes(octets), **more) if _bytes(octets) else None
    columns = tuple(i for i in range(*tail.span("data")) if head.string[i] > ord(" "))
    return Layout(bus, kind, length, key=key, identifier=head.span(f"{prefix}id"), data=columns, **more)


def _bytes(octets: list[int]) -> bool:
    return all(octet <= 0xFF for octet in octets)


def _time(head: re.Match[bytes]) -> dict[str, Any]:
    return {"seconds": head.span("s"), "fraction": head.span("f")}


def _sent(way: bytes | None) -> int:
    return SENT if way == b"Tx" else 0


def _code(word: bytes, base: int) -> int | None:
    """A data length code: a hex digit, or with `base dec` a decimal number up to 15."""
    text = word.strip()
    if len(text) > 1 and (base == 16 or not text.isdigit()):
        return None
    number = int(text, 10 if text.isdigit() else 16)
    return number if number < len(SIZES) else None
