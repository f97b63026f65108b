"""Data bytes of CAN frames in MF4: in the records themselves, or in signal data of variable length beside them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.array import BoolArray
from nineaudit.readers.can.frames import LONG, SHORT
from nineaudit.readers.can.mdf_blocks import Bytes

SPARE: Final = 4 + LONG
"""Bytes behind signal data: what begins at any of them can be looked at."""
KEPT: Final = np.array([(1 << 8 * n) - 1 for n in range(SHORT + 1)], dtype="<u8")
"""Of eight bytes the first n."""
KEPT_LONG: Final = np.where(np.arange(LONG) < np.arange(LONG + 1)[:, None], 255, 0).astype(np.uint8).view(np.uint64)
"""Of 64 bytes, as eight numbers, the first n."""


@dataclass(frozen=True)
class Store:
    """Signal data, and SPARE zeros behind them; (begin, end) of what is missing in between, which is zeros too."""

    data: Bytes
    gaps: list[tuple[int, int]]

    @property
    def end(self) -> int:
        """Number of bytes."""
        return len(self.data) - SPARE


class InRecords:
    """`width` bytes of data at byte `offset` of `data`, and again in each of the `count` records of `record` bytes."""

    def __init__(self, data: Any, offset: int, width: int, record: int, count: int) -> None:
        self.most = min(width, LONG)
        self.shape = {"buffer": data, "offset": offset}
        self.record, self.count = record, count

    def head(self) -> NDArray[Any]:
        """(count,) first eight bytes as numbers."""
        if self.most >= SHORT:
            return np.ndarray((self.count,), "<u8", strides=(self.record,), **self.shape)
        return _padded(self._bytes(), SHORT).view("<u8")[:, 0]

    def tail(self, rows: NDArray[np.intp], out: Bytes) -> None:
        """Put the bytes of some into (len(rows), 64), and zeros behind them."""
        out[:, self.most :] = 0
        out[:, : self.most] = self._bytes() if len(rows) == self.count else self._bytes()[rows]

    def _bytes(self) -> Bytes:
        return np.ndarray((self.count, self.most), np.uint8, strides=(self.record, 1), **self.shape)


class InStore:
    """Data of variable length at (n,) `places` of signal data: four bytes of their length, then they.

    `most`: (n,) bytes that are there; `bad`: (n,) where the place is beyond the end, or in what is missing.
    """

    def __init__(self, store: Store, places: NDArray[Any]) -> None:
        self.data = store.data
        bad = places > max(store.end - 4, 0)
        self.at = np.where(bad, 0, places).astype(np.int64)
        size = _each(self.data, "<u4")[self.at].astype(np.int64)
        self.at += 4
        bad |= self.at + size > store.end
        for begin, end in store.gaps:
            bad |= (self.at - 4 < end) & (self.at + size > begin)
        size[bad] = 0
        self.bad: BoolArray = bad
        self.most = np.minimum(size, LONG)

    def head(self) -> NDArray[Any]:
        """(n,) first eight bytes as numbers, and what stands behind the data."""
        return _each(self.data, "<u8")[self.at]

    def tail(self, rows: NDArray[np.intp], out: Bytes) -> None:
        """Put the bytes of some into (len(rows), 64), and what stands behind the data."""
        out.view(f"V{LONG}")[:, 0] = _each(self.data, f"V{LONG}")[self.at[rows]]


def _each(data: Bytes, dtype: str) -> NDArray[Any]:
    """What begins at each byte."""
    return np.ndarray((len(data) - np.dtype(dtype).itemsize + 1,), dtype, data, strides=(1,))


def _padded(data: Bytes, width: int) -> Bytes:
    out = np.zeros((len(data), width), dtype=np.uint8)
    out[:, : data.shape[1]] = data
    return out
