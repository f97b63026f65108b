"""Frames of a CAN log, as columns: python-can reads the container, and what it drops or passes over is counted."""

from __future__ import annotations

import binascii
import io
import re
import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.can_bits import ByteMatrix
from nineaudit.can_database import EXTENDED
from nineaudit.errors import RecordingError
from nineaudit.readers.contents import cut_short, span
from nineaudit.signals import can_origin

_DAMAGE = (ValueError, IndexError, KeyError, TypeError, struct.error, zlib.error, binascii.Error, EOFError)
_EXPECTED = {
    ".asc": "a Vector ASC log",
    ".log": "a log of candump -L, such as (0.0) can0 024#0102",
    ".trc": "a PEAK TRC log",
    ".csv": "a CSV log of python-can",
}


@dataclass(frozen=True, eq=False)
class Series:
    """Frames of one identifier in the order of the log: (n,) s, (n, bytes) zero-filled, (n,) bytes, (n,) bus."""

    time: FloatArray
    payload: ByteMatrix
    length: np.ndarray[Any, np.dtype[np.intp]]
    bus: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Frames:
    """Series by key (identifier, with the EXTENDED flag), counts of the whole log, its time span, and notes."""

    series: dict[int, Series]
    counts: dict[str, float]
    first: float
    last: float
    notes: tuple[str, ...] = ()
    origin: float = 0.0
    ids: Counter[int] = field(default_factory=Counter)


class _Lines(io.StringIO):
    """Text that knows the line it is at, for messages."""

    at = 0

    def __next__(self) -> str:  # type: ignore[override]  # typeshed has bytes for every stream
        self.at += 1
        return super().__next__()


def read_frames(path: Path, wanted: Iterable[int]) -> Frames:
    """Frames of a log in a format of python-can (.blf, .asc, .log, .trc, .csv); only `wanted` keys are kept.

    Raises RecordingError where the log is truncated or damaged: it says which frames could be read.
    """
    if path.suffix.lower() == ".blf":
        return _read_blf(path, frozenset(wanted))
    text = path.read_bytes().decode("utf-8", errors="replace")
    lines = _Lines(_with_header_end(text) if path.suffix.lower() == ".asc" else text)
    collector = _Collector(frozenset(wanted))
    try:
        collector.take(_text_reader(path.suffix.lower(), lines))
    except _DAMAGE as error:
        if collector.counts["frames"]:
            raise cut_short(path, _reason(error), collector.said(), place=f"line {lines.at}") from error
        raise RecordingError(
            f"not a CAN log that python-can can read: {_reason(error)}",
            file=path,
            place=f"line {lines.at}",
            expected=_EXPECTED[path.suffix.lower()],
        ) from error
    if text and not text.endswith(("\n", "\r")):
        raise cut_short(path, "its last line has no line end", collector.said())
    if re.search(r"^begin triggerblock", text, re.I | re.M) and not re.search(r"^end triggerblock", text, re.I | re.M):
        collector.notes.append("the log has no 'End TriggerBlock': logging may have been broken off")
    if re.search(r"^base\s+\w+\s+timestamps\s+relative", text, re.I | re.M):
        raise RecordingError(
            "time stamps from frame to frame are not supported",
            file=path,
            expected="timestamps absolute",
            advice="export the log again with absolute time stamps",
        )
    written = sum(1 for line in text.splitlines() if line.strip())
    collector.counts["other_lines"] = written - collector.counts["frames"]
    return collector.frames(can_origin(text))


def _read_blf(path: Path, wanted: frozenset[int]) -> Frames:
    import can

    from nineaudit.readers import blf

    collector = _Collector(wanted)
    damage: str | None = None
    try:
        with can.BLFReader(path) as reader:
            collector.take(reader)
    except (*_DAMAGE, can.io.blf.BLFParseError) as error:
        damage = _reason(error)
    scan = blf.scan(path.read_bytes())
    if damage or scan.damage:
        raise cut_short(path, scan.damage or damage or "", collector.said(), place=scan.place)
    collector.counts["other_objects"] = scan.objects - collector.counts["frames"]
    collector.notes += scan.notes
    return collector.frames(can_origin("\n".join(scan.markers)))


def _text_reader(suffix: str, lines: _Lines) -> Iterator[Any]:
    import can

    reader = {
        ".asc": can.ASCReader,
        ".log": can.CanutilsLogReader,
        ".trc": can.TRCReader,
        ".csv": can.CSVReader,
    }[suffix]
    return iter(reader(lines))


def _with_header_end(text: str) -> str:
    """An ASC log with the line that ends its header: without it python-can takes the first frame for that line."""
    first = re.search(r"^[ \t]*\d", text, re.M)
    if first is None or re.search(r"internal\s+events\s+logged", text[: first.start()], re.I):
        return text
    return f"{text[: first.start()]}no internal events logged\n{text[first.start() :]}"


def _reason(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__


class _Collector:
    """Sorts frames by what they are while python-can reads them, so that what was read before damage is known."""

    def __init__(self, wanted: frozenset[int]) -> None:
        self.rows: dict[int, list[tuple[float, bytes, str]]] = {key: [] for key in wanted}
        self.counts: dict[str, float] = dict.fromkeys(("frames", "error_frames", "remote_frames", "bytes"), 0)
        self.ids: Counter[int] = Counter()
        self.notes: list[str] = []
        self.first, self.last = np.inf, -np.inf

    def take(self, messages: Iterable[Any]) -> None:
        frames = errors = remote = size = 0
        first, last = self.first, self.last
        try:
            for m in messages:
                frames += 1
                stamp = m.timestamp
                first, last = min(first, stamp), max(last, stamp)
                if m.is_error_frame:
                    errors += 1
                    continue
                key = m.arbitration_id | EXTENDED if m.is_extended_id else m.arbitration_id
                if m.is_remote_frame:
                    remote += 1
                    continue
                self.ids[key] += 1
                size += len(m.data)
                if key in self.rows:
                    self.rows[key].append((stamp, bytes(m.data), str(m.channel)))
        finally:
            self.first, self.last = first, last
            self.counts |= {
                "frames": frames,
                "error_frames": errors,
                "remote_frames": remote,
                "bytes": size,
            }

    def said(self) -> str:
        return span(int(self.counts["frames"]), "frame", self.first, self.last)

    def frames(self, origin: float) -> Frames:
        series = {key: _series(rows, origin) for key, rows in self.rows.items() if rows}
        return Frames(series, self.counts, self.first + origin, self.last + origin, tuple(self.notes), origin, self.ids)


def _series(rows: list[tuple[float, bytes, str]], origin: float) -> Series:
    times, data, buses = zip(*rows, strict=True)
    width = max(8, max(map(len, data)))
    packed = b"".join(d.ljust(width, b"\0") for d in data)
    return Series(
        np.array(times, dtype=np.float64) + origin,
        np.frombuffer(packed, dtype=np.uint8).reshape(len(data), width),
        np.array([len(d) for d in data], dtype=np.intp),
        buses,
    )
