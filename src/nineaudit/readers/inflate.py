"""Compressed data to bytes, never more of them than are stated: no length field makes a reader fill the memory."""

from __future__ import annotations

import zlib
from typing import Any, Final

LARGEST: Final = 2**30
"""Bytes of the largest block that is inflated."""
_RATIO: Final = {"deflate": 2**11, "zstd": 2**16, "lz4": 2**9}
"""No data inflate to more than this many times their size: deflate codes 258 bytes by 2 bits or more, of zstd a block
of 128 KiB is 4 bytes or more, of LZ4 one byte stands for 255 or fewer."""


def room(compression: str, packed: int, stated: int) -> bool:
    """Whether `packed` bytes can inflate to as many as are stated."""
    return stated <= min(LARGEST, _RATIO[compression] * (packed + 64))


def inflate(compression: str, packed: Any, size: int) -> bytes:
    """Data that were compressed by deflate (zlib), zstd or LZ4 (frame).

    Raises ValueError: they do not inflate to `size` bytes, or cannot; their own checksum does not hold.
    """
    if not room(compression, len(packed), size):
        raise ValueError("states more bytes than it can hold")
    found = {"deflate": _deflate, "zstd": _zstd, "lz4": _lz4}[compression](packed, size)
    if len(found) != size:
        raise ValueError("is not of the size it states")
    return found


def _deflate(packed: Any, size: int) -> bytes:
    decoder = zlib.decompressobj()
    try:
        found = decoder.decompress(packed, size + 1)
    except (zlib.error, MemoryError) as error:
        raise ValueError("does not inflate") from error
    if not decoder.eof:
        raise ValueError("does not inflate")
    return found


def _zstd(packed: Any, size: int) -> bytes:
    import zstandard

    try:
        stated = zstandard.frame_content_size(packed)
        if stated not in (-1, size):
            raise ValueError("is not of the size it states")
        return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size) if size else b""
    except (zstandard.ZstdError, MemoryError) as error:
        raise ValueError("does not inflate") from error


def _lz4(packed: Any, size: int) -> bytes:
    import lz4.frame

    decoder = lz4.frame.LZ4FrameDecompressor()
    try:
        found = bytes(decoder.decompress(packed, max_length=size + 1))
    except (RuntimeError, MemoryError, EOFError) as error:  # the library has no error of its own
        raise ValueError("does not inflate") from error
    if not decoder.eof:
        raise ValueError("does not inflate")
    return found
