"""Vector ASC logs, many lines at once: header, frames, and the account of everything else.

    date Tue Nov 14 10:13:20.123 pm 2023
    base hex  timestamps absolute
    internal events logged
    // version 9.0.0
    Begin Triggerblock Tue Nov 14 10:13:20.123 pm 2023
       0.000000 Start of measurement
       0.015991 1  1A0             Rx   d 2 11 22
    End TriggerBlock

Time counts from the start of the measurement. `timestamps relative`: every stamp counts from the line before it,
whatever that line is. The date has no time zone, so it is told but not added to the stamps.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from nineaudit.errors import RecordingError
from nineaudit.readers.can import asc_lines, text_log
from nineaudit.readers.can import frames as can_frames
from nineaudit.readers.can.asc_dates import date_of
from nineaudit.readers.can.asc_lines import STAMP
from nineaudit.readers.can.frames import Frames
from nineaudit.readers.can.text_layouts import MOST_SECONDS, Columns, read_lines
from nineaudit.readers.can.text_log import NOT_READ, Account
from nineaudit.signals import can_origin

_BASE: Final = re.compile(rb"\s*base\s+(hex|dec)(?:\s+timestamps\s+(absolute|relative))?\s*", re.I)
_DATE: Final = re.compile(rb"\s*date\s+(.*)", re.I | re.S)
_BEGIN: Final = re.compile(rb"\s*begin\s+triggerblock\b(.*)", re.I | re.S)
_END: Final = re.compile(rb"\s*end\s+triggerblock\s*", re.I)
_INTERNAL: Final = re.compile(rb"\s*(no\s+)?internal\s+events\s+logged\s*", re.I)
_STAMP: Final = re.compile(STAMP)
_EVENTS: Final = (
    ("tx_requests", re.compile(rb"(\d+\s+[0-9A-Fa-f]+x?\s+TxRq\b|CANFD\s+\d+\s+TxRq\b)")),
    ("statistics_lines", re.compile(rb"(CAN\s+|CANFD\s+)?\d+\s+(BUS|CAN)?\s*Statistics?\b", re.I)),
    ("status_lines", re.compile(rb"(CAN\s+|CANFD\s+)?\d+\s+(HW\s+)?Status:", re.I)),
    ("j1939_lines", re.compile(rb"(\d+\s+)?(J1939\w*|\d+\s+[0-9A-Fa-f]+[xp]\s+J1939\w*)\b")),
    ("lin_lines", re.compile(rb"(Li|L\d+|LIN)\s")),
    ("flexray_lines", re.compile(rb"(Fr|FlexRay)\b")),
    ("ethernet_lines", re.compile(rb"(ETH|AFDX|WLAN|IP)\b")),
    ("other_bus_lines", re.compile(rb"(MOST\w*|MTN|M\d+|A429|KLINE|K-Line|CANXL|XL)\b", re.I)),
    (
        "event_lines",
        re.compile(
            rb"(Start of measurement|End of measurement|log\s|Trigger|SV:|::|GPS|TFS:|Test|Comment|Marker|GBL|EV:|//|"
            rb"System variable|Data lost|Environment|Diag|OBD|Video|IO:|DIO|VAR)",
            re.I,
        ),
    ),
)
"""Kinds of lines with a time stamp that are no CAN frames, by what follows the stamp."""


@dataclass(eq=False)
class _Log:
    """What is known of a log so far: how to read its lines, and what its header said."""

    path: Path
    line: int = 1
    base: int = 16
    relative: bool = False
    added: bool = False
    now: int = 0
    commas: bool = False
    headers: int = 0
    begun: int = 0
    ended: int = 0
    origin: int = 0
    dates: list[bytes] = field(default_factory=list)
    buses: dict[str, int] = field(default_factory=dict)
    account: Account = field(default_factory=Account)

    def changes(self, header: re.Match[bytes]) -> bool:
        """Whether lines behind a line `base` are read otherwise than those before it."""
        return self.relative or _numbers(header) != (self.base, self.relative)

    def begin(self, header: re.Match[bytes]) -> None:
        """From a line `base` on, its numbers and stamps hold."""
        self.headers += 1
        self.base, self.relative = _numbers(header)
        self.added |= self.relative
        self.now = 0


def _numbers(header: re.Match[bytes]) -> tuple[int, bool]:
    """Base of numbers, and whether stamps are relative."""
    return 16 if header[1].lower() == b"hex" else 10, (header[2] or b"").lower() == b"relative"


def read_asc(path: Path) -> Frames:
    """All frames of an ASC log, hexadecimal or decimal, absolute or relative stamps, decimal points or commas.

    Time in ns since the start of the measurement. Damage: lines that are neither frames nor of a known kind, a last
    line without line end. Raises RecordingError where there is not one frame.
    """
    log = _Log(path)
    parts: list[Frames] = []
    for block in text_log.blocks(path):
        if not block.endswith(b"\n") and _END.fullmatch(block):
            log.ended += 1
        elif not text_log.cut_off(block, log.line, log.account):
            parts += _parts(log, block)
    if not any(map(len, parts)):
        raise _nothing(path, log)
    return can_frames.joined(
        [part for part in parts if len(part)],
        buses=tuple(log.buses),
        counts=dict(log.account.counts),
        damage=log.account.damage,
        notes=tuple(_notes(log)),
        origin=log.origin,
        started=_started(log).replace(" ", "T"),
    )


def _parts(log: _Log, block: bytes) -> Iterator[Frames]:
    """Frames of a block, read anew in parts where lines `base` stand in it: how to read lines changes there."""
    read = _read(log, block)
    headers = [(row, header) for row, text in read[1] if (header := _BASE.fullmatch(text))]
    if not any(log.changes(header) for _, header in headers):
        log.headers += len(headers)
        yield _part(log, block, *read)
        return
    cuts = [row for row, _ in headers]
    lines, starts = block.split(b"\n"), sorted({0, *cuts})
    for start, end in zip(starts, [*starts[1:], len(lines) - 1], strict=True):
        if header := _BASE.fullmatch(lines[start]):
            log.begin(header)
        piece = b"\n".join(lines[start:end]) + b"\n"
        yield _part(log, piece, *_read(log, piece))


def _read(log: _Log, block: bytes) -> tuple[Columns, list[tuple[int, bytes]]]:
    return read_lines(block, partial(asc_lines.layout, base=log.base), log.buses)


def _part(log: _Log, block: bytes, columns: Columns, others: list[tuple[int, bytes]]) -> Frames:
    log.commas = log.commas or bool(columns.kept.any() and _comma(block, columns))
    stamped = columns.kept.copy() if log.relative else None
    for row, text in others:
        stamp = _STAMP.match(text)
        if stamped is not None and stamp:
            stamped[row], columns.time[row] = True, _nanoseconds(stamp)
        _other(log, text, stamp, log.line + row)
    if stamped is not None:
        _accumulate(log, columns, stamped)
    log.line += len(columns.kept)
    return columns.frames()


def _comma(text: bytes, columns: Columns) -> bool:
    """Whether the first frame of a block is stamped with a decimal comma."""
    row = int(np.argmax(columns.kept))
    return b"," in text.split(b"\n", row + 1)[row].split()[0]


def _nanoseconds(stamp: re.Match[bytes]) -> int:
    return int(stamp["s"]) * 10**9 + int(stamp["f"][:9].ljust(9, b"0"))


def _accumulate(log: _Log, columns: Columns, stamped: Any) -> None:
    """Stamps from line to line become stamps from the start, exactly."""
    rows = np.flatnonzero(stamped)
    if len(rows):
        if log.now / 1e9 + (columns.time[rows] / 1e9).sum() > MOST_SECONDS:
            raise RecordingError("time stamps from line to line add up to more than 285 years", file=log.path)
        columns.time[rows] = log.now + np.cumsum(columns.time[rows])
        log.now = int(columns.time[rows[-1]])


def _other(log: _Log, text: bytes, stamp: re.Match[bytes] | None, line: int) -> None:
    """Book a line that is no frame."""
    if stamp:
        event = text[stamp.end() :]
        kind = next((name for name, known in _EVENTS if known.match(event)), None)
    else:
        kind = _header(log, text)
    if kind is None:
        lost = "it is left out"
        if log.relative and not stamp:
            lost += ", and later times are too small by the time it stood for"
        log.account.damaged(NOT_READ, line, text, lost)
    else:
        log.account.counts[kind] += 1


def _header(log: _Log, text: bytes) -> str | None:
    """Kind of a line without time stamp, None where it is of no known kind."""
    if found := _DATE.fullmatch(text) or _BEGIN.fullmatch(text):
        log.dates.append(found[1].strip())
        log.begun += found.re is _BEGIN
    elif _END.fullmatch(text):
        log.ended += 1
    elif text.lstrip().startswith(b"//"):
        log.origin = log.origin or round(can_origin(text.decode("utf-8", errors="replace")) * 1e9)
        return "comment_lines"
    elif not _BASE.fullmatch(text) and not _INTERNAL.fullmatch(text):
        return None
    return "header_lines"


def _started(log: _Log) -> str:
    """The date of the measurement's start, "" where there is none that can be read."""
    began = date_of(log.dates[-1 if log.begun == 1 else 0]) if log.dates else ""
    return "" if began.startswith(("'", '"')) else began


def _notes(log: _Log) -> Iterator[str]:
    if log.dates:
        began = date_of(log.dates[-1 if log.begun == 1 else 0])
        yield f"time counts from the start of the measurement, {began} in the logger's time zone (not stated)"
    if not log.headers:
        yield "the log has no line 'base': identifiers and bytes are taken as hexadecimal, time stamps as absolute"
    if log.added:
        yield "time stamps are from line to line and were added up"
    if log.commas:
        yield "time stamps have decimal commas"
    if log.headers > 1:
        yield f"{log.headers} logs stand one behind the other in this file: time restarts in it"
    if log.begun > log.ended:
        yield "the log has no 'End TriggerBlock': logging may have been broken off"
    if requests := log.account.counts["tx_requests"]:
        yield f"{requests} requests to send (TxRq) are no frames on the bus and are left out"


def _nothing(path: Path, log: _Log) -> RecordingError:
    first = next(iter(log.account.lines.values()), None)
    kinds = ", ".join(f"{count} {kind.replace('_', ' ')}" for kind, count in log.account.counts.most_common(4))
    return RecordingError(
        "no CAN frames in this log",
        file=path,
        place=f"line {first.line}" if first else None,
        found=(first.text.strip("'\"") if first else "") or kinds or "nothing but blank lines",
        expected="a Vector ASC log, with lines such as 0.015991 1  1A0  Rx  d 2 11 22",
    )
