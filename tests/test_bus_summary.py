"""What a log says of its bus, against logs whose faults are known one by one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bus_logs import DBC, IMU, bus_from, log_of
from nineaudit.bus import Identifier
from nineaudit.can_database import EXTENDED, load_databases
from nineaudit.readers.can.bus_signals import _crc8, unavailable
from nineaudit.readers.can.bus_summary import bus_of
from nineaudit.readers.can.frames import ERROR, FD, Frames, frames, joined, key_counts

FRAMES = 200


def imu(**how: object) -> Identifier:
    found = bus_from({"send": [{"id": IMU, "cycle": 0.01, "frames": FRAMES, **how}]})
    return found.identifiers[0]


places = st.lists(st.integers(1, FRAMES - 2), max_size=5, unique=True)


@settings(derandomize=True, max_examples=40, deadline=None)
@given(places, places)
def test_frames_left_out_and_doubled_are_counted_by_the_counter(skip: list[int], twice: list[int]) -> None:
    twice = [i for i in twice if i not in skip]
    (counter,) = imu(skip=skip, twice=twice).counters
    assert (counter.missing, counter.repeated) == (len(skip), len(twice))


@settings(derandomize=True, max_examples=40, deadline=None)
@given(places)
def test_every_frame_with_a_flipped_bit_has_a_wrong_checksum(damage: list[int]) -> None:
    (checksum,) = imu(damage=damage).checksums
    assert (checksum.method, checksum.wrong) == ("sum of the bytes", len(damage))


def test_a_checksum_that_no_method_gives_is_not_judged() -> None:
    log = log_of([{"id": IMU, "cycle": 0.01, "frames": FRAMES}])
    log.data[:, 7] = np.random.default_rng(1).integers(0, 256, FRAMES)
    (found,) = bus_of(log, load_databases([DBC]), {IMU: 0}).identifiers[0].checksums
    assert found.method is None


@pytest.mark.parametrize(("polynomial", "check"), [(0x1D, 0x4B), (0x2F, 0xDF)])
def test_crc8_gives_the_published_check_values(polynomial: int, check: int) -> None:
    """CRC-8/SAE-J1850 and CRC-8/AUTOSAR of the digits 1 to 9 (AUTOSAR SWS CRC Library, 7.2.1)."""
    digits = np.frombuffer(b"123456789", dtype=np.uint8)[None, :]
    assert _crc8(polynomial)(digits, 0, 9).tolist() == [check]


def test_cycle_and_jitter_of_a_message() -> None:
    """Stamps with scatter σ have intervals with scatter √2 σ."""
    found = imu(jitter=2e-4)
    assert found.cycle == 0.01
    assert found.interval == pytest.approx(0.01, abs=3 * 2e-4 / np.sqrt(FRAMES) * 2)
    assert found.jitter == pytest.approx(np.sqrt(2) * 2e-4, rel=0.3)


def test_codes_for_no_value_and_values_out_of_range() -> None:
    found = imu(unavailable=[3, 4], peak=120.0)
    assert found.unavailable == (("A", 2),)
    (outside,) = found.outside
    values = np.round(120.0 * np.sin(np.linspace(0, 2 * np.pi, FRAMES)), 2)
    beyond = np.abs(np.delete(values, [3, 4])) > 100.005
    assert (outside.count, outside.low, outside.high) == (beyond.sum(), -100.0, 100.0)
    assert abs(outside.worst) == pytest.approx(np.abs(values).max(), abs=0.01)
    message = load_databases([DBC])[0]
    assert unavailable(message.signals[1], np.zeros((3, 8), dtype=np.uint8)).tolist() == [False] * 3


def test_bits_of_frames() -> None:
    """Eight bytes are 111 bits, 135 with all stuff bits; 29-bit identifiers 131 and 160 (Davis et al. 2007, 2.1)."""
    one = frames([0], [5], [0], [0], [8], np.zeros((1, 8), dtype=np.uint8))
    other = frames([0], [5 | EXTENDED], [1], [0], [8], np.zeros((1, 8), dtype=np.uint8))
    loads = bus_of(joined([one, other], buses=("a", "b")), (), {}).loads
    assert [(x.bus, x.least, x.most) for x in loads] == [("a", 111, 135), ("b", 131, 160)]


def test_restarts_are_of_one_bus() -> None:
    """Two buses may be logged one after the other in batches."""
    time, bus = np.array([0, 2, 4, 1, 3, 5, 2]), [0, 0, 0, 1, 1, 1, 1]
    log = frames(time * 10**9, np.full(7, 5), bus, np.zeros(7), np.full(7, 8), np.zeros((7, 8), dtype=np.uint8))
    found = bus_of(joined([log], buses=("a", "b")), (), {})
    assert (found.restarts, found.first_restart) == (1, 2.0)


def test_error_frames_are_no_identifier_and_no_load() -> None:
    log = frames([0, 1], [0, 7], [0, 0], [ERROR, FD], [0, 8], np.zeros((2, 8), dtype=np.uint8))
    found = bus_of(joined([log], buses=("a",)), (), {})
    assert [x.key for x in found.identifiers] == [7]
    assert found.loads[0].least == 111
    assert found.fd


@settings(derandomize=True, max_examples=60, deadline=None)
@given(st.integers(0, 40), st.integers(0, 10**6))
def test_columns_that_are_joined_and_taken_keep_every_payload(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    parts = [_random(rng, int(n)) for n in rng.multinomial(count, [0.5, 0.3, 0.2])]
    whole = joined(parts, buses=("a",))
    expected = [row for part in parts for row in _payloads(part)]
    assert _payloads(whole) == expected
    order = rng.integers(0, count, 2 * count) if count else np.empty(0, dtype=np.intp)
    assert _payloads(whole.take(order)) == [expected[i] for i in order]
    assert sum(key_counts(whole).values()) == count


def _random(rng: np.random.Generator, count: int) -> Frames:
    length = rng.choice([0, 3, 8, 12, 64], count)
    full = np.where(np.arange(64) < length[:, None], rng.integers(0, 256, (count, 64)), 0).astype(np.uint8)
    rows = np.flatnonzero(length > 8)
    key = rng.choice([3, 2047, 2048 | EXTENDED, 3 | EXTENDED], count)
    zero = np.zeros(count)
    return frames(np.arange(count), key, zero, zero, length, full[:, :8], rows, full[rows])


def _payloads(log: Frames) -> list[bytes]:
    rows = np.arange(len(log))
    return [bytes(p[:n]) for p, n in zip(log.payload(rows), log.length, strict=True)]
