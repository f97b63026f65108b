"""CAN logs as data: messages of fixtures/bus.dbc sent evenly, and what happened to some of their frames.

[[case.bus.send]]
id = 16                       # 16: IMU, whose counter, checksum and signal A are made; others: random data
cycle = 0.01                  # s
frames = 200
jitter = 0.001                # standard deviation of the stamps, s
skip = [50]                   # frames that are not in the log
twice = [50]                  # frames that are there twice
damage = [50]                 # frames with a flipped bit
short = [50]                  # frames of six bytes
unavailable = [50]            # frames whose signal A says SNA
peak = 90.0                   # of signal A, m/s²
constant = true               # the same data in all frames
restart = 100                 # frame at which the clock starts again
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nineaudit.bus import Bus
from nineaudit.can_bits import encode
from nineaudit.can_database import load_databases
from nineaudit.readers.can.bus_summary import bus_of
from nineaudit.readers.can.frames import Frames, frames, joined

DBC = Path(__file__).parents[1] / "fixtures" / "bus.dbc"
IMU = 16
KEYS = {"id", "cycle", "frames", "jitter", "skip", "twice", "damage", "short", "unavailable", "peak", "constant",
        "restart"}  # fmt: skip


def bus_from(case: Mapping[str, Any]) -> Bus:
    assert set(case) <= {"send", "bit_rate"}
    return bus_of(log_of(case["send"]), load_databases([DBC]), {IMU: 0}, case.get("bit_rate"))


def log_of(sent: Sequence[Mapping[str, Any]]) -> Frames:
    return joined([_sent(how, np.random.default_rng(i)) for i, how in enumerate(sent)], buses=("can0",))


def _sent(how: Mapping[str, Any], rng: np.random.Generator) -> Frames:
    assert set(how) <= KEYS, set(how) - KEYS
    count = how["frames"]
    time = how["cycle"] * np.arange(1, count + 1) + how.get("jitter", 0.0) * rng.standard_normal(count)
    if "restart" in how:
        time[how["restart"] :] -= time[how["restart"]]
    data = _imu(how, count, rng) if how["id"] == IMU else rng.integers(0, 256, (count, 8), dtype=np.uint8)
    if how.get("constant"):
        data[:] = data[0]
    data[how.get("damage", []), 5] ^= 0x10
    length = np.full(count, 8 if how["id"] == IMU else 2)
    length[how.get("short", [])] = 6
    rows = np.setdiff1d(np.arange(count), how.get("skip", []))
    rows = np.sort(np.concatenate([rows, np.array(how.get("twice", []), dtype=np.intp)]))
    log = frames(np.rint(time * 1e9), np.full(count, how["id"]), np.zeros(count), np.zeros(count), length, data)
    return log.take(rows)


def _imu(how: Mapping[str, Any], count: int, rng: np.random.Generator) -> np.ndarray[Any, np.dtype[np.uint8]]:
    a, counter, _ = load_databases([DBC])[0].signals
    data = np.zeros((count, 8), dtype=np.uint8)
    data[:, 3:7] = rng.integers(0, 256, (count, 4))
    values = np.array(how.get("peak", 50.0) * np.sin(np.linspace(0, 2 * np.pi, count)))
    values[how.get("unavailable", [])] = -327.68
    encode(a, values, data)
    encode(counter, np.arange(count) % 16.0, data)
    data[:, 7] = data[:, :7].sum(axis=1, dtype=np.int64) % 256
    return data
