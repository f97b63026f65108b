"""Bytes of an MF4 file from its data blocks: asammdf finds the blocks, here they are read, inflated and put together.

Where a block does not inflate the bytes it states are missing, and what comes behind it keeps its place.
Source: ASAM MDF 4.3, data blocks: "DT", "SD", "DZ" (its data may be transposed: byte k of all records together).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.readers.can.losses import Losses
from nineaudit.readers.inflate import inflate

Bytes = NDArray[np.uint8]
_WINDOW: Final = 1 << 20
"""Bytes at a time of a block that is not compressed: they stay in the cache."""
_COMPRESSION: Final = {1: "deflate", 2: "deflate", 3: "lz4", 4: "lz4", 5: "zstd", 6: "zstd"}
"""By asammdf's number of the kind of block (`v4_constants`): even ones are transposed, 0 is not compressed."""
_IN_TEMPORARY: Final = 1
GONE: Final = "a compressed block of data that does not inflate as it states"


def records(mdf: Any, group: Any, losses: Losses) -> Iterator[tuple[int, Any]]:
    """(number of the first, bytes) of whole records of a group, as they stand in the file; what a damaged block
    cuts is left out."""
    size = group.channel_group.samples_byte_nr + group.channel_group.invalidation_bytes_nr
    held, place = b"", 0
    temporary = group.data_location == _IN_TEMPORARY
    for start, data in _pieces(mdf, group.get_data_blocks(), size, losses, temporary):
        if start != place + len(held):
            held, place = b"", start + -start % size
            data = data[-start % size :]
        joined = held + data if held else data
        whole = len(joined) // size * size
        if whole:
            yield place // size, joined
        held, place = bytes(joined[whole:]), place + whole


def room_for(group: Any) -> int:
    """Records that the blocks of a group can hold, at most as many as it states."""
    size = group.channel_group.samples_byte_nr + group.channel_group.invalidation_bytes_nr
    there = sum(min(int(b.original_size), 2**16 * (int(b.compressed_size) + 64)) for b in group.get_data_blocks())
    return min(int(group.channel_group.cycles_nr), there // int(size))


def stored(mdf: Any, group: Any, index: int, losses: Losses, spare: int) -> tuple[Bytes, list[tuple[int, int]]]:
    """Signal data of a channel of variable length, with `spare` zeros behind them; (begin, end) of what is missing
    in between, which is zeros too."""
    blocks = list(group.get_signal_data_blocks(index))
    sizes = [min(int(b.original_size), 2**16 * (int(b.compressed_size) + 64)) for b in blocks]
    out, at, gaps = np.zeros(sum(sizes) + spare, dtype=np.uint8), 0, []
    for start, data in _pieces(mdf, blocks, 1, losses, None):
        if start > at:
            gaps.append((at, start))
        if start + len(data) > len(out) - spare:
            break
        out[start : start + len(data)] = np.frombuffer(data, dtype=np.uint8)
        at = start + len(data)
    if at < len(out) - spare:
        gaps.append((at, len(out) - spare))
    return out, gaps


def _pieces(mdf: Any, blocks: Any, size: int, losses: Losses, temporary: bool | None) -> Iterator[tuple[int, Any]]:
    """(place among all bytes, bytes) of the blocks in order."""
    place = 0
    for block in blocks:
        elsewhere = block.location == _IN_TEMPORARY if temporary is None else temporary
        file = mdf._tempfile if elsewhere else mdf._file
        if block.block_type:
            data = _inflated(file, block, losses)
            yield from () if data is None else [(place, data)]
        else:
            yield from _windows(file, block, place, size)
        place += int(block.original_size)


def _windows(file: Any, block: Any, place: int, size: int) -> Iterator[tuple[int, bytes]]:
    window = max(_WINDOW // size, 1) * size
    limit = getattr(block, "block_limit", None)
    end = int(block.original_size) if limit is None else min(int(limit), int(block.original_size))
    for start in range(0, end, window):
        file.seek(block.address + start)
        data = file.read(min(window, end - start))
        yield place + start, data


def _inflated(file: Any, block: Any, losses: Losses) -> Any:
    """The data of a compressed block; None, and a loss, where they do not inflate."""
    file.seek(block.address)
    packed, limit = file.read(int(block.compressed_size)), getattr(block, "block_limit", None)
    try:
        data: Any = inflate(_COMPRESSION[block.block_type], packed, int(block.original_size))
        if block.block_type % 2 == 0:
            data = _in_rows(data, int(block.param))
    except (ValueError, KeyError):
        losses.add(GONE, f"byte {block.address}")
        return None
    return data if limit is None else data[: max(int(limit), 0)]


def _in_rows(data: bytes, width: int) -> bytes:
    """Transposed data in the order of their records of `width` bytes; what is no whole record is at the end as is."""
    if width <= 0:
        raise ValueError("no width of its records")
    rows = len(data) // width
    columns = np.frombuffer(data, dtype=np.uint8, count=rows * width).reshape(width, rows)
    return columns.T.tobytes() + data[rows * width :]
