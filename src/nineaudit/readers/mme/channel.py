"""A channel file of ISO/TS 13499: lines `Key :value`, then one sample a line.

    Channel code                :11HEAD0000H3ACXA       object, position, main location (4), fine locations (2+2+2),
    Reference channel           :implicit               dimension (2), direction, filter class
    Unit                        :m/(s*s)
    Sampling interval           :0.0001
    Time of first sample        :-0.02
    Number of samples           :6000
    Data status                 :ok
    1.234560E+00

A value that is not known is NOVALUE.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.readers.tables.dialect import number
from nineaudit.recording import Damage
from nineaudit.units import counted

HEADER: Final = 64 * 2**10
"""Bytes of a channel file among which its header must be."""
MOST: Final = 8 * 2**20
"""Samples of a channel that are read: seven minutes at 20 kHz."""
_SLICE: Final = 2**20
_LINES: Final = 500
_SAMPLE: Final = re.compile(rb"[-+]?(\d|\.\d|nan\b|inf)[^:]*$|novalue$", re.IGNORECASE)
_MISSING: Final = ("", "NOVALUE", "NAN")
CODE: Final = re.compile(r"[0-9A-Z?]{16}")
FILTER_CLASSES: Final = {"0": "none", "A": "CFC1000", "B": "CFC600", "C": "CFC180", "D": "CFC60"}
"""Last character of a channel code."""


@dataclass(frozen=True)
class Channel:
    """Header of a channel file `name`: `keys` in lower case; `start` bytes and `line` lines are before the samples."""

    name: str
    keys: Mapping[str, str]
    start: int = 0
    line: int = 0
    damage: tuple[Damage, ...] = ()

    def get(self, key: str) -> str:
        """What the header says, "" for nothing and NOVALUE."""
        value = self.keys.get(key, "")
        return "" if value.upper() in ("NOVALUE", "NONE") else value

    def number(self, key: str) -> float:
        """The number that the header gives, NaN for none."""
        return number(self.get(key), ".")

    @property
    def code(self) -> str:
        return self.get("channel code")

    @property
    def short(self) -> str:
        """The name of the file without its folders."""
        return PurePosixPath(self.name).name


def parse_keys(data: bytes) -> dict[str, str]:
    """`Key :value` of every line that has a colon; of keys that come again the first."""
    keys: dict[str, str] = {}
    for line in decoded(data).splitlines()[:100_000]:
        key, colon, value = line.partition(":")
        if colon:
            keys.setdefault(" ".join(key.lower().split()), value.strip())
    return keys


def parse_header(name: str, data: bytes) -> Channel:
    """The header of a channel file from its first bytes: all lines before the first that is a sample."""
    at, lines, odd = 0, 0, list[int]()
    for line in data.splitlines(keepends=True)[:_LINES]:
        text = line.strip()
        if _SAMPLE.match(text) or not line.endswith((b"\n", b"\r")):
            break
        if text and b":" not in text:
            odd.append(lines + 1)
        at, lines = at + len(line), lines + 1
    what = "a line of the header without a colon"
    damage = (Damage(what, f"{PurePosixPath(name).name} line {odd[0]}", len(odd)),) if odd else ()
    return Channel(name, parse_keys(data[:at]), at, lines, damage)


def samples(channel: Channel, data: bytes) -> tuple[FloatArray, int, list[Damage]]:
    """(n,) samples of a whole file, NaN where there is none; how many are missing; and what is wrong with them.

    A line that is no number keeps its place as a sample that is missing. No more than `MOST` are read.
    """
    body = data[channel.start :].rstrip(b"\0 \t\r\n")
    damage = _tail(channel, data, channel.start + len(body))
    parts: list[FloatArray] = []
    odd: list[int] = []
    start, count = 0, 0
    while start < len(body) and count < MOST:
        end = body.find(b"\n", start + _SLICE)
        values, wrong = _values(body[start : end if end >= 0 else len(body)].split(b"\n"))
        odd += [count + i for i in wrong]
        parts.append(values)
        start, count = (end + 1 if end >= 0 else len(body)), count + values.size
    values = np.concatenate(parts)[:MOST] if parts else np.empty(0)
    if odd:
        damage.append(_damage(channel, "a sample that is no number", odd[0], len(odd), "they are missing"))
    if start < len(body) or count > MOST:
        damage.append(Damage(f"more than {MOST} samples in a channel", channel.short, lost="the rest is not read"))
    else:
        damage += _miscounted(channel, values.size)
    return values, int(np.count_nonzero(np.isnan(values))), damage


def _tail(channel: Channel, data: bytes, end: int) -> list[Damage]:
    """What is wrong with what stands behind the last sample."""
    tail = data[end:]
    row = data.count(b"\n", channel.start, end + max(tail.find(b"\0"), 0))
    if b"\0" in tail:
        return [_damage(channel, "NUL bytes after the samples", row)]
    whole = not data[channel.start :] or b"\n" in tail
    return [] if whole else [_damage(channel, "the last line has no line end: the file may be cut", row)]


def decoded(data: bytes) -> str:
    """Text of a file: UTF-8, else Windows-1252 (which has ISO 8859-1 in it)."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", "replace")


def _values(lines: list[bytes]) -> tuple[FloatArray, list[int]]:
    """Numbers of lines, and which are neither that nor a word for a missing one."""
    try:
        values = np.array([float(line) for line in lines])
    except ValueError:
        return _slow(lines)
    return (values, []) if np.isfinite(values).all() and not any(b"_" in line for line in lines) else _slow(lines)


def _slow(lines: list[bytes]) -> tuple[FloatArray, list[int]]:
    texts = [line.decode("ascii", "replace").strip() for line in lines]
    values = np.array([number(text, ".") for text in texts])
    return values, [int(i) for i in np.flatnonzero(np.isnan(values)) if texts[i].upper() not in _MISSING]


def _miscounted(channel: Channel, found: int) -> list[Damage]:
    stated = channel.number("number of samples")
    if np.isnan(stated) or stated == found:
        return []
    what = f"{counted(found, 'sample')} for the {stated:.0f} that its header states"
    return [Damage(what, channel.short, lost="the rest is missing" if found < stated else "all of them are read")]


def _damage(channel: Channel, what: str, row: int, count: int = 1, lost: str = "") -> Damage:
    return Damage(what, f"{channel.short} line {channel.line + row + 1}", count, lost)
