"""MF4 files with CAN frames in any layout that ASAM MDF 4 allows, written block by block: fields at any bits, records
sorted or not, data in the records or beside them, blocks whole, in lists, compressed, transposed."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

DATA, REMOTE, ERROR = "CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame"
WIDTHS = {"ID": (29, 32), "IDE": (1, 8), "BusChannel": (2, 8), "Dir": (1, 8), "DLC": (4, 8), "DataLength": (7, 8)}
WIDTHS |= {"EDL": (1, 8), "BRS": (1, 8), "ESI": (1, 8)}
LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)
Row = dict[str, Any]


@dataclass
class Blocks:
    """Bytes of a file, its blocks one behind the other."""

    data: bytearray = field(default_factory=lambda: bytearray(64 + 104))

    def add(self, name: str, links: Sequence[int], content: bytes) -> int:
        """Put a block at the end; its place."""
        at = len(self.data)
        size = 24 + 8 * len(links) + len(content)
        self.data += struct.pack(f"<2s2s4xQQ{len(links)}Q", b"##", name.encode(), size, len(links), *links) + content
        self.data += bytes(-len(self.data) % 8)
        return at

    def text(self, text: str) -> int:
        return self.add("TX", (), text.encode() + b"\0")

    def bytes_of(self, kind: str, content: bytes, cuts: Sequence[int], compression: str, width: int) -> int:
        """Data in blocks that end at `cuts`, in a list if there are any."""
        edges = [0, *sorted(cuts), len(content)]
        blocks = [self._piece(kind, content[a:b], compression, width) for a, b in pairwise(edges)]
        if len(blocks) == 1:
            return blocks[0]
        about = struct.pack(f"<B3xI{len(blocks)}Q", 0, len(blocks), *edges[:-1])
        first = self.add("DL", (0, *blocks), about)
        zipped = {"": None, "deflate": 0, "transposed": 1}[compression]
        return first if zipped is None else self.add("HL", (first,), struct.pack("<HB5x", 0, zipped))

    def _piece(self, kind: str, content: bytes, compression: str, width: int) -> int:
        if not compression:
            return self.add(kind, (), content)
        turned = content
        if compression == "transposed":
            rows = len(content) // width
            whole = np.frombuffer(content[: rows * width], dtype=np.uint8).reshape(rows, width)
            turned = whole.T.tobytes() + content[rows * width :]
        packed = zlib.compress(turned)
        about = struct.pack("<2sBxIQQ", kind.encode(), compression == "transposed", width, len(content), len(packed))
        return self.add("DZ", (), about + packed)


@dataclass(frozen=True)
class Style:
    """How a group is written. `width`: bytes of data in a record, 0: beside it; `cuts` a block; `marks`: rows whose
    bit of invalidation is set; `states`: records more than there are."""

    seed: int = 0
    width: int = 8
    unsorted: bool = False
    clock: str = "f8"
    compression: str = ""
    cuts: int = 0
    marks: tuple[int, ...] = ()
    states: int = 0
    spoil: Callable[[Blocks, int, int], None] | None = None
    offset: int = 0


def random_rows(rng: np.random.Generator, count: int, width: int) -> list[Row]:
    """Frames of data: classic and FD as far as `width` bytes allow, or any where 0."""
    rows, time = [], 0
    for _ in range(count):
        time += int(rng.integers(0, 10**7))
        extended, flexible = int(rng.integers(2)), int(rng.integers(2))
        codes = [c for c in range(16 if flexible else 9) if LENGTHS[c] <= (width or 64)]
        code = int(rng.choice(codes))
        row = {"time": time, "ID": int(rng.integers(1 << (29 if extended else 11))), "IDE": extended, "DLC": code}
        row |= {"BusChannel": int(rng.integers(4)), "Dir": int(rng.integers(2)), "EDL": flexible}
        row |= {"BRS": int(rng.integers(2)), "ESI": int(rng.integers(2)), "DataLength": LENGTHS[code]}
        rows.append(row | {"bytes": rng.bytes(LENGTHS[code])})
    return rows


def write_mf4(path: Path, groups: Sequence[tuple[str, Sequence[Row], Style]]) -> Path:
    """A file of groups of frames, each with a data group of its own."""
    blocks, following = Blocks(), 0
    for name, rows, style in reversed(groups):
        following = _group(blocks, name, rows, style, following)
    start = struct.pack("<QhhBBBxdd", 1_700_000_000_000_000_000, 0, 0, 0, 0, 0, 0.0, 0.0)
    head = struct.pack("<4s4xQQ6Q", b"##HD", 104, 6, following, 0, 0, 0, 0, 0)
    blocks.data[:64] = struct.pack("<8s8s8s4xH30xHH", b"MDF     ", b"4.10    ", b"test    ", 410, 0, 0)
    blocks.data[64:168] = head + start
    path.write_bytes(blocks.data)
    return path


def _group(blocks: Blocks, name: str, rows: Sequence[Row], style: Style, following: int) -> int:
    rng = np.random.default_rng(style.seed)
    places, size = _places(rng, [key for key in WIDTHS if not rows or key in rows[0]], style.width or 8)
    beside, offsets, stored = style.width == 0 and name == DATA, [], b""
    for row in rows:
        offsets.append(len(stored) + style.offset)
        stored += struct.pack("<I", len(row.get("bytes", b""))) + row.get("bytes", b"")
    marks = 1 if style.marks else 0
    records = []
    for i, row in enumerate(rows):
        clock = struct.pack("<d", row["time"] / 1e9) if style.clock == "f8" else struct.pack("<Q", row["time"])
        word = int.from_bytes(clock, "little")
        for key, (at, _) in places.items():
            word |= row.get(key, 0) << at if key != "DataBytes" else 0
        payload = struct.pack("<Q", offsets[i]) if beside else row.get("bytes", b"").ljust(style.width or 8, b"\0")
        word |= int.from_bytes(payload, "little") << places["DataBytes"][0]
        records.append(word.to_bytes(size, "little") + bytes([1 << 3 if i in style.marks else 0] * marks))
    cg_stored, in_records = 0, style.unsorted
    if beside and in_records:
        cg_stored = blocks.add("CG", (0,) * 6, struct.pack("<QQHH4xQ", 2, len(rows), 1, 0, len(stored)))
        held = [b"\2" + struct.pack("<I", len(row["bytes"])) + row["bytes"] for row in rows]
        content = b"".join(x for i, r in enumerate(records) for x in (held[i], b"\1" + r))
    else:
        content = b"".join((b"\1" if in_records else b"") + r for r in records)
    data_link = cg_stored
    if beside and not in_records:
        data_link = _data(blocks, "SD", stored, style, rng, 1)
    first = _channels(blocks, name, places, style, data_link, bool(marks))
    counts = struct.pack("<QQHH4xII", in_records, len(rows) + style.states, 6, 0, size, marks)
    group = blocks.add("CG", (cg_stored, first, 0, 0, 0, 0), counts)
    data = _data(blocks, "DT", content, style, rng, size + marks + in_records)
    return blocks.add("DG", (following, group, data, 0), struct.pack("<B7x", in_records))


def _data(blocks: Blocks, kind: str, content: bytes, style: Style, rng: np.random.Generator, width: int) -> int:
    if not content:
        return 0 if kind == "DT" else blocks.add(kind, (), b"")
    cuts = rng.integers(1, len(content), style.cuts).tolist() if len(content) > 1 else []
    begin = len(blocks.data)
    at = blocks.bytes_of(kind, content, cuts, style.compression, width)
    if style.spoil and kind == "DT":
        style.spoil(blocks, begin, at)
    return at


def _places(rng: np.random.Generator, keys: Sequence[str], width: int) -> tuple[dict[str, tuple[int, int]], int]:
    """Lowest bit and number of bits of fields in any order behind the clock; bytes of a record."""
    places, at = {}, 64
    for key in rng.permutation([*keys, "DataBytes"]).tolist():
        bits = 8 * width if key == "DataBytes" else int(rng.choice(WIDTHS[key]))
        whole = bits % 8 == 0 or at % 8 + bits > 32
        at += -at % 8 if whole else 0
        places[key] = at, bits
        at += bits
    return places, -(-at // 8) + int(rng.integers(3))


def _channels(blocks: Blocks, name: str, places: Any, style: Style, stored: int, marks: bool) -> int:
    """The clock, the frame and the fields it is composed of."""
    following, low, high = 0, min(a for a, _ in places.values()), max(a + b for a, b in places.values())
    for key, (at, bits) in places.items():
        beside = key == "DataBytes" and style.width == 0 and name == DATA
        about = (1 if beside else 0, 0, 10 if key == "DataBytes" else 0, at, bits, 0)
        following = _channel(blocks, f"{name}.{key}", about, following, 0, stored if beside else 0)
    whole = (0, 0, 10, low // 8 * 8, -(-(high - low // 8 * 8) // 8) * 8, 2 if marks else 0)
    frame = _channel(blocks, name, whole, 0, following, 0)
    seconds = struct.pack("<BBHHHdddd", 1, 0, 0, 0, 2, 0.0, 0.0, 0.0, 1e-9)
    conversion = blocks.add("CC", (0,) * 4, seconds) if style.clock == "u8" else 0
    clock = (2, 1, 4 if style.clock == "f8" else 0, 0, 64, 0)
    return _channel(blocks, "Timestamp", clock, frame, 0, 0, conversion)


def _channel(
    blocks: Blocks, name: str, about: Sequence[int], following: int, parts: int, data: int, conversion: int = 0
) -> int:
    kind, sync, data_type, at, bits, flags = about
    links = (following, parts, blocks.text(name), 0, conversion, data, 0, 0)
    content = struct.pack("<BBBBIIIIBBH6d", kind, sync, data_type, at % 8, at // 8, bits, flags, 3, 0, 0, 0, *[0.0] * 6)
    return blocks.add("CN", links, content)
