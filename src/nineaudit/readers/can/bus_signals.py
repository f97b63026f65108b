"""Signals by which a CAN message watches itself: counters, checksums, ranges, and codes for "not available"."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any, Final

import numpy as np

from nineaudit import can_bits
from nineaudit.array import BoolArray
from nineaudit.bus import Checksum, Counter, Outside
from nineaudit.can_bits import ByteMatrix

_COUNTER: Final = re.compile(
    r"(^|[_ ])(msg|message|frame|alive|rolling|roll|sequence|seq)?[_ ]?(count(er)?|ctr|cnt)$", re.I
)
_ALIVE: Final = re.compile(r"(alive|rolling|sequence)", re.I)
_CHECKSUM: Final = re.compile(r"(checksum|chksum|cksum|crc)", re.I)
_UNAVAILABLE: Final = re.compile(
    r"\b(sna|not[_ ]available|signal[_ ]not[_ ]available|invalid|error|unavailable)\b", re.I
)
_FOLLOWED: Final = 0.8
"""Part of the steps, or frames, that must be as a counter, or a checksum, has them, before it is taken for one."""
_LEAST: Final = 8
"""Frames below which nothing is taken for a counter or checksum."""


def counters(message: Any, payload: ByteMatrix) -> Iterator[Counter]:
    """Signals named as counters that mostly count by one: how many numbers are missing between frames, how many frames
    repeat the number before. `payload` (n,w), in the order of the log, of whole frames."""
    for signal in message.signals:
        if signal.is_float or signal.length > 16 or signal.multiplexer_ids or len(payload) < _LEAST:
            continue
        if not (_COUNTER.search(signal.name) or _ALIVE.search(signal.name)):
            continue
        numbers = can_bits.raw(signal, payload).astype(np.int64)
        modulus = _modulus(signal, numbers)
        steps = np.diff(numbers) % modulus
        if np.count_nonzero(steps == 1) >= _FOLLOWED * len(steps):
            leaps = steps[steps > 1]
            yield Counter(signal.name, int((leaps - 1).sum()), int(np.count_nonzero(steps == 0)))


def _modulus(signal: Any, numbers: Any) -> int:
    """Where it starts again: after all its bits, or (0 to 14 in four bits) after the largest number there is, if it
    mostly starts again right after that."""
    whole = 1 << int(signal.length)
    after = np.flatnonzero(numbers[:-1] == numbers.max())
    if numbers.max() + 1 < whole and len(after) and (numbers[after + 1] == 0).mean() >= _FOLLOWED:
        return int(numbers.max()) + 1
    return whole


def checksums(message: Any, key: int, payload: ByteMatrix, size: int) -> Iterator[Checksum]:
    """Signals named as checksums, with the method that most frames follow. `payload` (n,w) of frames of `size` bytes.

    Which method a message uses is not in its database: each known one is tried."""
    for signal in message.signals:
        if not _CHECKSUM.search(signal.name) or signal.multiplexer_ids:
            continue
        if signal.length != 8 or signal.start // 8 >= size or len(payload) < _LEAST:
            yield Checksum(signal.name, None)
            continue
        place = can_bits.bytes_needed(signal) - 1
        told = can_bits.raw(signal, payload).astype(np.uint8)
        others = np.delete(payload[:, :size], place, axis=1)
        right = {name: method(others, key & 0x1FFFFFFF, size) == told for name, method in _METHODS.items()}
        best = max(right, key=lambda name: int(right[name].sum()))
        wrong = int(np.count_nonzero(~right[best]))
        followed = wrong <= (1.0 - _FOLLOWED) * len(told) and len(np.unique(told)) > 1
        yield Checksum(signal.name, best, wrong) if followed else Checksum(signal.name, None)


def _sum(others: ByteMatrix, key: int, size: int) -> Any:
    del key, size
    return others.sum(axis=1, dtype=np.int64).astype(np.uint8)


def _toyota(others: ByteMatrix, key: int, size: int) -> Any:
    """Length, identifier and data, as Toyota's messages have it (opendbc)."""
    fixed = size + sum(key.to_bytes(4, "big"))
    return (others.sum(axis=1, dtype=np.int64) + fixed).astype(np.uint8)


def _xor(others: ByteMatrix, key: int, size: int) -> Any:
    del key, size
    return np.bitwise_xor.reduce(others, axis=1)


def _crc8(polynomial: int) -> Callable[[ByteMatrix, int, int], Any]:
    """CRC-8 with start value and final inversion 0xFF (SAE J1850: 0x1D; AUTOSAR E2E: 0x2F)."""
    table = np.arange(256, dtype=np.int64)
    for _ in range(8):
        table = np.where(table & 0x80, (table << 1) ^ polynomial, table << 1) & 0xFF
    table = table.astype(np.uint8)

    def crc(others: ByteMatrix, key: int, size: int) -> Any:
        del key, size
        value = np.full(len(others), 0xFF, dtype=np.uint8)
        for column in others.T:
            value = table[value ^ column]
        return value ^ np.uint8(0xFF)

    return crc


_METHODS: Final[dict[str, Callable[[ByteMatrix, int, int], Any]]] = {
    "sum of the bytes": _sum,
    "sum with identifier and length": _toyota,
    "exclusive or of the bytes": _xor,
    "CRC-8 SAE J1850": _crc8(0x1D),
    "CRC-8 AUTOSAR": _crc8(0x2F),
}


def unavailable(signal: Any, payload: ByteMatrix) -> BoolArray:
    """(n,) true where a signal says, by a number that its database names so, that it has no value."""
    if not signal.choices or signal.is_float:
        return np.zeros(len(payload), dtype=np.bool_)
    low, high = can_bits.raw_limits(signal)
    named = (int(number) for number, name in signal.choices.items() if _UNAVAILABLE.search(str(name)))
    codes = [number for number in named if low <= number <= high]
    if not codes:
        return np.zeros(len(payload), dtype=np.bool_)
    numbers = can_bits.raw(signal, payload)
    return np.asarray(np.isin(numbers, np.array(codes, dtype=numbers.dtype)))


def outside(message: Any, payload: ByteMatrix) -> Iterator[Outside]:
    """Signals with samples outside the range their database states, codes for no value aside."""
    for signal in message.signals:
        stated = can_bits.stated_range(signal)
        if stated is None:
            continue
        low, high = stated
        rows = payload[can_bits.carried(signal, message, payload) & ~unavailable(signal, payload)]
        values = can_bits.decode(signal, rows)
        slack = 0.5 * abs(float(signal.scale))
        beyond = values[(values < low - slack) | (values > high + slack)]
        if len(beyond):
            worst = float(beyond[np.argmax(np.maximum(low - beyond, beyond - high))])
            yield Outside(signal.name, len(beyond), low, high, worst, signal.unit or "")
