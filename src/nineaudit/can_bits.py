"""Bits of whole columns of CAN payloads at once: signals taken from them, and put into them.

Bit numbers as in a DBC file: bit b of byte B is 8B + b; a little-endian (Intel) signal starts at its lowest bit, a
big-endian (Motorola) one at its highest. Signals are cantools' objects.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.array import BoolArray, FloatArray

ByteMatrix = NDArray[np.uint8]
_WORD: Final = 8
_BLOCK: Final = 1 << 14
"""Rows at a time: what is worked on stays in the cache."""
_EXACT: Final = 62
"""Bits of an integer product that int64 certainly holds."""


def bits(signal: Any) -> NDArray[np.intp]:
    """(length,) places of a signal's bits, lowest first, in a payload unpacked with the lowest bit of a byte first."""
    if signal.byte_order == "little_endian":
        return np.asarray(signal.start + np.arange(signal.length), dtype=np.intp)
    falling = _highest(signal) + np.arange(signal.length)
    return np.asarray(8 * (falling // 8) + 7 - falling % 8, dtype=np.intp)[::-1]


def bytes_needed(signal: Any) -> int:
    """Length of the shortest payload that holds the whole signal."""
    return _span(signal)[1] + 1


def decode(signal: Any, payload: ByteMatrix) -> FloatArray:
    """(n,) physical values, in the database's unit, of a signal in (n, bytes) payloads: raw·scale + offset, bit by bit
    what cantools computes up to 53 bits. Bytes beyond a payload's end are zeros."""
    out = np.empty(len(payload))
    for start, raw in _columns(signal, payload) if _whole(signal) else _blocks(signal, payload):
        there = out[start : start + len(raw)]
        if _exact(signal):
            there[:] = raw.astype(np.int64) * int(signal.scale) + int(signal.offset)
        else:
            with np.errstate(invalid="ignore", over="ignore"):  # any bits are a floating-point number, NaN too
                np.multiply(raw, np.float64(signal.scale), out=there)
                there += float(signal.offset)
    return out


def raw(signal: Any, payload: ByteMatrix) -> NDArray[Any]:
    """(n,) raw values: uint64, int64, or the floating-point numbers themselves."""
    parts = [part for _, part in _blocks(signal, payload)]
    return np.concatenate(parts) if parts else np.empty(0, dtype=np.int64 if signal.is_signed else np.uint64)


def carried(signal: Any, message: Any, payload: ByteMatrix) -> BoolArray:
    """(n,) true where a payload carries a signal: its multiplexer, itself carried, says one of the signal's numbers."""
    if signal.multiplexer_ids is None:
        return np.ones(len(payload), dtype=np.bool_)
    selector = message.get_signal_by_name(signal.multiplexer_signal)
    said = np.isin(raw(selector, payload), np.array(signal.multiplexer_ids, dtype=np.uint64))
    return np.asarray(said & carried(selector, message, payload))


def raw_limits(signal: Any) -> tuple[int, int]:
    """Smallest and largest raw integer a signal's bits can hold."""
    if signal.is_signed:
        return -(1 << (signal.length - 1)), (1 << (signal.length - 1)) - 1
    return 0, (1 << signal.length) - 1


def room(signal: Any) -> tuple[float, float]:
    """Smallest and largest value that a signal's bits can hold, in the database's unit."""
    if signal.is_float:
        most = float(np.finfo(f"f{signal.length // 8}").max)
        return -most, most
    ends = [raw * signal.scale + signal.offset for raw in raw_limits(signal)]
    return float(min(ends)), float(max(ends))


def stated_range(signal: Any) -> tuple[float, float] | None:
    """The range its database states, as far as that is one: some databases state raw values, or nothing."""
    low, high = room(signal)
    stated, slack = (signal.minimum, signal.maximum), abs(signal.scale)
    if None not in stated and low - slack <= stated[0] < stated[1] <= high + slack:
        return max(low, float(stated[0])), min(high, float(stated[1]))
    return None


def encode(signal: Any, values: FloatArray, payload: ByteMatrix) -> None:
    """Put (n,) physical values into the bits of (n, bytes) payloads, rounded to the nearest raw value.

    The caller has checked that the values fit (``raw_limits``): what does not is cut off here.
    """
    scaled = (values - signal.offset) / signal.scale
    if signal.is_float:
        width = signal.length // 8
        number = scaled.astype(f"f{width}").view(f"u{width}").astype(np.uint64)
    else:
        low, high = raw_limits(signal)
        whole = np.clip(np.rint(scaled), low, high)  # half a step beyond the last value belongs to it
        number = whole.astype(np.int64 if low < 0 else np.uint64).view(np.uint64)
    unpacked = np.unpackbits(payload, axis=1, bitorder="little")
    places = np.arange(signal.length, dtype=np.uint64)
    unpacked[:, bits(signal)] = (number[:, None] >> places) & np.uint64(1)
    payload[:] = np.packbits(unpacked, axis=1, bitorder="little")


def _highest(signal: Any) -> int:
    """Place of a big-endian signal's highest bit, counted with the highest bit of a byte first."""
    return int(8 * (signal.start // 8) + 7 - signal.start % 8)


def _span(signal: Any) -> tuple[int, int]:
    """First and last byte."""
    first = signal.start if signal.byte_order == "little_endian" else _highest(signal)
    return first // 8, (first + signal.length - 1) // 8


def _exact(signal: Any) -> bool:
    """Whole numbers throughout, as cantools keeps them until the end."""
    if signal.is_float or not (float(signal.scale).is_integer() and float(signal.offset).is_integer()):
        return False
    reach = max(signal.length + int(abs(signal.scale)).bit_length(), int(abs(signal.offset)).bit_length())
    return bool(reach < _EXACT)


def _whole(signal: Any) -> bool:
    """Whether a signal is a number of whole bytes, as a processor has it."""
    start = signal.start if signal.byte_order == "little_endian" else _highest(signal)
    return start % 8 == 0 and signal.length in (8, 16, 32, 64)


def _columns(signal: Any, payload: ByteMatrix) -> Any:
    """As _blocks, of a signal of whole bytes: its column of the payloads as it stands, integers of its own size."""
    first, last = _span(signal)
    payload = _wide(payload, last + 1)
    kind = "f" if signal.is_float else "i" if signal.is_signed else "u"
    order = "<" if signal.byte_order == "little_endian" else ">"
    dtype, (rows, width) = np.dtype(f"{order}{kind}{last + 1 - first}"), payload.shape
    for start in range(0, rows, _BLOCK):
        block = payload[start : start + _BLOCK]
        raw: NDArray[Any] = np.ndarray((len(block),), dtype=dtype, buffer=block, offset=first, strides=(width,))
        with np.errstate(invalid="ignore"):  # a signalling NaN
            yield start, raw.astype(np.float64) if signal.is_float else raw


def _blocks(signal: Any, payload: ByteMatrix) -> Any:
    """(first row, raw values) of one block of rows after the other."""
    first, last = _span(signal)
    payload = _wide(payload, max(last + 1, _WORD))
    take = _long if last - first >= _WORD else _word
    for start in range(0, len(payload), _BLOCK):
        unsigned = take(signal, payload[start : start + _BLOCK])
        spare = np.uint64(64 - signal.length)
        if signal.is_float:
            width = signal.length // 8
            with np.errstate(invalid="ignore"):  # a signalling NaN
                numbers = (unsigned >> spare).astype(f"u{width}").view(f"f{width}").astype(np.float64)
            yield start, numbers
        elif signal.is_signed:  # two's complement: the sign bit is bit 63, and comes down with the shift
            yield start, unsigned.view(np.int64) >> np.int64(spare)
        else:
            yield start, unsigned >> spare


def _wide(payload: ByteMatrix, width: int) -> ByteMatrix:
    if payload.shape[1] >= width:
        return np.ascontiguousarray(payload)
    return np.pad(payload, ((0, 0), (0, width - payload.shape[1])))


def _word(signal: Any, payload: ByteMatrix) -> NDArray[np.uint64]:
    """(n,) words with the signal in their highest bits, of a signal within eight bytes."""
    rows, width = payload.shape
    begin = min(_span(signal)[0], width - _WORD)
    if signal.byte_order == "little_endian":
        order, above = "<u8", 64 - (signal.start - 8 * begin) - signal.length
    else:
        order, above = ">u8", _highest(signal) - 8 * begin
    words = np.ndarray((rows,), dtype=order, buffer=payload, offset=begin, strides=(width,))
    return np.asarray(words << np.uint64(above), dtype=np.uint64)


def _long(signal: Any, payload: ByteMatrix) -> NDArray[np.uint64]:
    """The same of a signal that touches nine bytes, bit by bit."""
    places = bits(signal)
    weights = np.uint64(1) << np.arange(64 - signal.length, 64, dtype=np.uint64)
    unpacked = np.unpackbits(payload, axis=1, bitorder="little")[:, places]
    return np.asarray(unpacked.astype(np.uint64) @ weights)
