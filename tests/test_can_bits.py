"""Signals out of columns of payloads: bit by bit what cantools decodes one frame at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cantools.database.can.message import Message
from cantools.database.can.signal import Signal
from cantools.database.conversion import BaseConversion
from hypothesis import given, settings
from hypothesis import strategies as st

from nineaudit.can_bits import bytes_needed, carried, decode, encode, raw

FRAMES = 12
EXACT_BITS = 53
SCALES = st.sampled_from([(1, 0), (2, -40), (0.25, -3.0), (0.1, 0), (1e-3, 1.5), (-0.5, 7), (10**6, 3)])


@st.composite
def layouts(draw: st.DrawFn, longest: int = EXACT_BITS) -> tuple[Signal, int]:
    """A signal anywhere in a message, and the message's length."""
    size = draw(st.sampled_from([1, 2, 3, 5, 8, 12, 64]))
    is_float = draw(st.booleans()) and size >= 2
    widths = [w for w in (16, 32, 64) if w <= 8 * size]
    length = draw(st.sampled_from(widths)) if is_float else draw(st.integers(1, min(longest, 8 * size)))
    place = draw(st.integers(0, 8 * size - length))
    order = draw(st.sampled_from(["little_endian", "big_endian"]))
    start = place if order == "little_endian" else 8 * (place // 8) + 7 - place % 8
    scale, offset = draw(SCALES)
    conversion = BaseConversion.factory(scale=scale, offset=offset, is_float=is_float)
    signed = draw(st.booleans())
    return Signal("s", start, length, order, signed and not is_float, conversion=conversion), size


def payloads(seed: int, size: int) -> np.ndarray[Any, np.dtype[np.uint8]]:
    return np.random.default_rng(seed).integers(0, 256, (FRAMES, size), dtype=np.uint8)


@settings(derandomize=True, max_examples=300, deadline=None)
@given(layouts(), st.integers(0, 10**6))
def test_any_signal_is_what_cantools_decodes(layout: tuple[Signal, int], seed: int) -> None:
    signal, size = layout
    rows = payloads(seed, size)
    message = Message(1, "m", size, [signal])
    expected = np.array([message.decode(row.tobytes())["s"] for row in rows], dtype=np.float64)
    np.testing.assert_array_equal(decode(signal, rows), expected)


@pytest.mark.parametrize("order", ["little_endian", "big_endian"])
@pytest.mark.parametrize(("length", "kind"), [(8, "iu"), (16, "iuf"), (32, "iuf"), (64, "f")])
@pytest.mark.parametrize("scale", [1, 0.1])
def test_numbers_of_whole_bytes_are_what_cantools_decodes(order: str, length: int, kind: str, scale: float) -> None:
    """Taken as they stand, wherever they stand; also in payloads shorter than themselves, and of no rows."""
    for one in kind:
        conversion = BaseConversion.factory(scale=scale, offset=0, is_float=one == "f")
        for first in (0, 3):
            start = 8 * first + (7 if order == "big_endian" else 0)
            signal = Signal("s", start, length, order, one == "i", conversion=conversion)
            rows = payloads(length, size := first + length // 8)
            message, cut = Message(1, "m", size, [signal]), rows.copy()
            cut[:, -1] = 0
            expected = np.array([message.decode(row.tobytes())["s"] for row in rows], dtype=np.float64)
            np.testing.assert_array_equal(decode(signal, rows), expected)
            np.testing.assert_array_equal(decode(signal, rows[:, :-1]), decode(signal, cut))
            assert decode(signal, rows[:0]).shape == (0,)


@settings(derandomize=True, max_examples=100, deadline=None)
@given(layouts(longest=64), st.integers(0, 10**6))
def test_raw_values_are_exact_up_to_64_bits(layout: tuple[Signal, int], seed: int) -> None:
    signal, size = layout
    rows = payloads(seed, size)
    message = Message(1, "m", size, [signal])
    expected = [message.decode(row.tobytes(), scaling=False)["s"] for row in rows]
    assert repr([float(x) if signal.is_float else x for x in expected]) == repr(raw(signal, rows).tolist())


@settings(derandomize=True, max_examples=100, deadline=None)
@given(layouts(), st.integers(0, 10**6))
def test_encoded_is_decoded_again_and_no_other_bit_moves(layout: tuple[Signal, int], seed: int) -> None:
    signal, size = layout
    rows = payloads(seed, size)
    if signal.is_float:  # most random bits are no numbers that scaling and rounding give back
        rows[:] = 0
    values, again = decode(signal, rows), rows.copy()
    encode(signal, values, again)
    np.testing.assert_array_equal(decode(signal, again), values)
    if not signal.is_float:
        np.testing.assert_array_equal(again, rows)


def test_a_payload_that_ends_early_is_read_as_zeros() -> None:
    signal = Signal("s", 40, 16, "little_endian", False)
    assert bytes_needed(signal) == 7
    np.testing.assert_array_equal(decode(signal, np.full((2, 6), 0xFF, dtype=np.uint8)), [255.0, 255.0])


@pytest.mark.parametrize("rows", [0, 1, 16384, 40001])
def test_every_row_is_decoded_however_many(rows: int) -> None:
    signal = Signal("s", 4, 20, "little_endian", True)
    numbers = np.arange(rows, dtype="<u4") << 4
    payload = np.zeros((rows, 8), dtype=np.uint8)
    payload[:, :4] = numbers.view(np.uint8).reshape(rows, 4)
    np.testing.assert_array_equal(decode(signal, payload), np.arange(rows))


def test_a_multiplexed_signal_is_in_the_frames_that_cantools_finds_it_in() -> None:
    """Two levels: b is in frames with M = 2, c in those of them with N = 1 or 3."""
    signals = [
        Signal("M", 0, 4, "little_endian", is_multiplexer=True),
        Signal("a", 8, 8, "little_endian", multiplexer_ids=[1], multiplexer_signal="M"),
        Signal("N", 4, 4, "little_endian", is_multiplexer=True, multiplexer_ids=[2], multiplexer_signal="M"),
        Signal("b", 16, 8, "little_endian", multiplexer_ids=[2], multiplexer_signal="M"),
        Signal("c", 8, 8, "little_endian", multiplexer_ids=[1, 3], multiplexer_signal="N"),
    ]
    message = Message(1, "m", 8, signals)
    rows = np.random.default_rng(3).integers(0, 256, (200, 8), dtype=np.uint8)
    rows[:, 0] = np.random.default_rng(4).choice([0x01, 0x12, 0x32], 200)
    decoded = [message.decode(row.tobytes()) for row in rows]
    for signal in signals:
        there = carried(signal, message, rows)
        np.testing.assert_array_equal(there, [signal.name in d for d in decoded])
        np.testing.assert_array_equal(
            decode(signal, rows)[there], [d[signal.name] for d in decoded if signal.name in d]
        )
