"""BLF logs made by hand, object by object, also such as no writer makes."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence

NO_DATE = (0,) * 8


def obj(kind: int, body: bytes, ticks: int = 0, *, unit: int = 2, version: int = 1, size: int | None = None) -> bytes:
    """An object with its header (32 or 40 bytes), without padding; `size` other than its own to lie."""
    header = 32 if version == 1 else 40
    stated = header + len(body) if size is None else size
    first = struct.pack("<4sHHLL", b"LOBJ", header, version, stated, kind)
    status = struct.pack("<LHHQ", unit, 0, 0, ticks) + (bytes(8) if version == 2 else b"")
    return first + status + body


def classic(number: int, data: bytes = b"", *, dlc: int | None = None, flags: int = 0, channel: int = 1) -> bytes:
    """What CAN_MESSAGE holds."""
    code = len(data) if dlc is None else dlc
    return struct.pack("<HBBL8s", channel, flags, code, number, data)


def flexible(number: int, data: bytes, code: int, *, flags: int = 0, fd: int = 1, valid: int | None = None) -> bytes:
    """What CAN_FD_MESSAGE holds."""
    stated = len(data) if valid is None else valid
    return struct.pack("<HBBLLBBB5x64s", 1, flags, code, number, 0, 0, fd, stated, data)


def flexible64(
    number: int, data: bytes, code: int, *, flags: int = 0x1000, way: int = 0, valid: int | None = None, more: int = 0
) -> bytes:
    """What CAN_FD_MESSAGE_64 holds, with as many bytes as there are data."""
    stated = len(data) if valid is None else valid
    return struct.pack("<BBBBLLLLLLLHBBL", 2, code, stated, 0, number, 0, flags, 0, 0, 0, 0, 0, way, more, 0) + data


def padded(*objects: bytes) -> bytes:
    """Objects as Vector's writers put them: size % 4 bytes behind each."""
    return b"".join(o + bytes(len(o) % 4) for o in objects)


def container(content: bytes, *, method: int = 2, stated: int | None = None, size: int | None = None) -> bytes:
    """A container, without padding; `stated` and `size` to lie."""
    body = zlib.compress(content) if method == 2 else content
    held = len(content) if stated is None else stated
    whole = 32 + len(body) if size is None else size
    return struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, whole, 10, method, held) + body


def log(
    content: bytes,
    *,
    start: Sequence[int] = NO_DATE,
    objects: int = 0,
    size: int | None = None,
    header: int = 144,
) -> bytes:
    """A file with that content behind its header."""
    whole = 144 + len(content) if size is None else size
    head = struct.pack(
        "<4sL8BQQLL8H8H", b"LOGG", header, 5, 0, 0, 0, 2, 6, 8, 1, whole, 0, objects, 0, *start, *NO_DATE
    )
    return head.ljust(144, b"\0") + content
