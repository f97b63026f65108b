"""What every decoder of MCAP messages makes: the numbers at some paths of many messages, as columns."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from nineaudit.array import BoolArray, FloatArray
from nineaudit.readers.mcap.parse import Data
from nineaudit.readers.mcap.records import Batch

Numbers = NDArray[Any]


class Column(NamedTuple):
    """Numbers of n messages in the type of the field (float or integer), and (n,) whether the message has one."""

    values: Numbers
    there: BoolArray

    def floats(self) -> FloatArray:
        """(n,) float64, NaN where there is none; the column's own values, if they are that already."""
        if self.there.all():
            return self.values.astype(np.float64, copy=False)
        out = np.full(len(self.values), np.nan)
        out[self.there] = self.values[self.there]
        return out


class Decoded(NamedTuple):
    """Columns of n messages, one a path; (n,) messages that could be decoded; how many are longer than their schema
    describes."""

    columns: tuple[Column, ...]
    good: BoolArray
    longer: int = 0


class Decoder(Protocol):
    """Reads the messages of one channel."""

    def has(self, path: str, batch: Batch) -> bool:
        """Whether there is a number at a path: by the schema, or else by the first message."""

    def leaves(self, batch: Batch) -> list[str]:
        """Paths of numbers, for advice."""

    def read(self, batch: Batch, paths: Sequence[str]) -> Decoded:
        """The numbers at paths."""


class Undecodable(Exception):
    """Why the messages of a channel cannot be decoded at all; never leaves the MCAP reader."""


def numbers(found: Sequence[Any], dtype: str | None = None) -> Column:
    """A column of Python values: those that are finite numbers. Without a `dtype` integers stay integers where all
    are."""
    there = np.array([is_number(v) for v in found], dtype=bool)
    values = [v if ok else 0 for v, ok in zip(found, there.tolist(), strict=True)]
    whole = all(isinstance(v, int) and -(2**63) <= v < 2**63 for v in values)
    return Column(np.array(values, dtype=dtype or (np.int64 if whole else np.float64)), there)


def is_number(value: Any) -> bool:
    """Whether a decoded value is a finite number that a float can hold."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return abs(value) <= sys.float_info.max  # exact, where an integer has hundreds of digits


def number_at(data: Data, dtype: str) -> Numbers:
    """The number that begins at each byte of the data, as a view."""
    size = np.dtype(dtype).itemsize
    return np.ndarray((max(0, len(data) - size + 1),), dtype=dtype, buffer=data, strides=(1,))
