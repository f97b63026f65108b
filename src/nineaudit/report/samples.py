"""Samples inside a page: whole numbers of a step, differences, bytes by rank, gzip, base64. About a tenth of text.

    value = middle + code · step,    code in −32767 … 32767 (16 bits; 32 bits for time),    no value: −32768

Differences wrap around, so that a code that stands for no value costs nothing. The script of the page undoes it
(templates/zoom.js). `step` and `middle` have six digits, so that the last bits of a machine's arithmetic do not
reach the page.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import math
from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray, IntArray

NONE = -32768
"""Code of a sample without a value."""
RECORDED, COMPUTED = 65_000, 4_000
"""Steps in the range of a curve: as a 16-bit recorder has, and finer than a pixel."""
TICKS = 1000
"""Steps of a time axis in a sampling interval."""


@dataclass(frozen=True)
class Packed:
    """`text` in base64, its `key` (the same for the same samples), and what turns codes of `size` bytes into values."""

    key: str
    text: str
    size: int
    middle: float
    step: float


def packed(values: FloatArray, steps: int = RECORDED) -> Packed:
    """`values` (n,) with NaN where there is none, rounded to a step of its range over `steps` (at most 65 000)."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    middle = _short(0.5 * (low + high))
    reach = max(high - middle, middle - low)
    step = _short(2.0 * reach / steps * (1.0 + 1e-5)) or 1.0
    known = np.where(np.isfinite(values), values, middle)
    codes = np.where(np.isfinite(values), np.rint((known - middle) / step), NONE)
    return _packed(codes.astype("<i2"), middle, step)


def packed_time(time: FloatArray) -> Packed:
    """`time` (n,) s increasing, in steps of a thousandth of the sampling interval while the record is short enough."""
    span = float(time[-1] - time[0])
    interval = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    step = _short(max(interval / TICKS, span / 2.0**30)) or 1.0
    first = float(time[0])
    return _packed(np.rint((time - first) / step).astype("<i4"), first, step)


def unpacked(data: Packed) -> FloatArray:
    """(n,) the values again, as the script has them: within half a step, NaN where there was none."""
    raw = np.frombuffer(gzip.decompress(base64.b64decode(data.text)), dtype=np.uint8)
    kind = f"<i{data.size}"
    differences = np.ascontiguousarray(raw.reshape(data.size, -1).T).view(kind)[:, 0]
    codes = np.cumsum(differences, dtype=kind)
    values = data.middle + codes * data.step
    return np.where(codes == NONE, np.nan, values) if data.size == 2 else np.asarray(values)


def _packed(codes: IntArray, middle: float, step: float) -> Packed:
    differences = np.diff(codes, prepend=codes.dtype.type(0))
    shuffled = np.ascontiguousarray(differences[:, None].view(np.uint8).T)
    text = base64.b64encode(gzip.compress(shuffled.tobytes(), 6, mtime=0)).decode("ascii")
    return Packed(f"s{hashlib.sha256(text.encode()).hexdigest()[:12]}", text, codes.dtype.itemsize, middle, step)


def _short(value: float) -> float:
    """Six digits of a number."""
    return float(f"{value:.5e}") if math.isfinite(value) else 0.0
