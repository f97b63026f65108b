"""Campaigns drawn from the model itself, without recordings: what thousands of them say of false alarms.

Sensors with a gain (and two tilts where wanted) each, in the seats of a few rigs. A tilt is fixed in the sensor's case,
which is rolled about its axis by some quarter turns in each seat. A test tells the errors of its rig's channels by a
likelihood in which a scale that all gains share is not seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.campaign.health.records import Record, Records, Row, family

TILTS = ("tilt_1", "tilt_2")


@dataclass(frozen=True)
class Plan:
    """`rigs` of `channels` each, `tests` one after the other round the rigs; sensors move on by a seat `swaps` times.
    `tell` sd of what a test tells of a gain, `scatter` from test to test, in 0.5 %; tilts too where `tilts`."""

    rigs: int = 4
    channels: int = 10
    tests: int = 200
    swaps: int = 0
    tell: float = 0.8
    scatter: float = 0.3
    tilts: bool = False


@dataclass(frozen=True, eq=False)
class Drawn:
    """A campaign and its truth: what lasts, by (parameter, owner), in records.UNIT. Owners: the sensor of a gain, the
    seat, and the sensor in a seat (sensor, *seat) of a tilt."""

    records: Records
    truth: dict[tuple[str, object], float]


def drawn(
    plan: Plan,
    seed: int,
    drift: float = 0.0,
    culprit: str = "",
    outlier: int | None = None,
    what: str = "gain",
    ramp: bool = False,
    since: float = 0.5,
) -> Drawn:
    """A campaign in which an error of one sensor is larger by `drift` (in UNIT) from `since` of its tests on (in parts
    of all), or by and by from there; a tilt in the direction that `what` is of in a case that is not rolled."""
    rng = np.random.default_rng([seed, 7])
    truth: dict[tuple[str, object], float] = {}
    records = [_test(i, plan, rng, truth, drift, culprit, what, outlier, ramp, since) for i in range(plan.tests)]
    names = frozenset(r.sensor for record in records for r in record.rows)
    return Drawn(Records(records, True, [], names), truth)


def sensor_in(plan: Plan, rig: int, channel: int, number: int) -> str:
    turn = (plan.swaps + 1) * number // plan.tests
    return f"S{plan.channels * rig + (channel + 3 * turn) % plan.channels:02d}"


def _test(
    number: int,
    plan: Plan,
    rng: np.random.Generator,
    truth: dict[tuple[str, object], float],
    drift: float,
    culprit: str,
    what: str,
    outlier: int | None,
    ramp: bool,
    since: float,
) -> Record:
    rig = number % plan.rigs
    rows = tuple(row for c in range(plan.channels) for row in _rows(plan, rig, c, number))
    theta = np.array([_lasting(row, truth, rng) for row in rows]) + plan.scatter * rng.standard_normal(len(rows))
    left = (number / plan.tests - since) / (1.0 - since)
    along = max(left, 0.0) if ramp else float(left >= 0.0)
    mine = np.array([_felt(row, what, truth) if row.sensor == culprit else 0.0 for row in rows])
    theta = theta + drift * along * mine
    if number == outlier:
        theta = theta + 20.0 * mine
    matrix = _told(rows, plan, rng)
    values, vectors = np.linalg.eigh(matrix)
    noise = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(len(rows)))
    label = f"2026-{1 + number // 28:02d}-{1 + number % 28:02d}"
    shock = {row.sensor: float(rng.uniform(500.0, 2000.0)) for row in rows}
    return Record(
        f"T{number:04d}",
        label,
        float(date.fromisoformat(label).toordinal()),
        rows,
        matrix @ theta + noise,
        matrix,
        shock,
    )


def _rows(plan: Plan, rig: int, channel: int, number: int) -> list[Row]:
    sensor, seat = sensor_in(plan, rig, channel, number), (f"rig {rig}", f"a{channel}")
    gain = Row(sensor, seat, "accelerometer", "gain", 1.0)
    tilts = [Row(sensor, seat, "accelerometer", name, 1.0) for name in TILTS]
    return [gain, *(tilts if plan.tilts else [])]


def _lasting(row: Row, truth: dict[tuple[str, object], float], rng: np.random.Generator) -> float:
    if family(row.parameter) == "gain":
        return _drawn(row.parameter, row.sensor, truth, rng, 1.0)
    seat = _drawn(row.parameter, row.seat, truth, rng, 0.5)
    stay = (row.sensor, *row.seat)
    if (row.parameter, stay) not in truth:
        case = [_drawn(name, row.sensor, truth, rng, 0.5) for name in TILTS]
        turns = truth.setdefault(("roll", stay), float(rng.integers(4)))
        truth[row.parameter, stay] = float(_rolled(turns)[TILTS.index(row.parameter)] @ case)
    return seat + truth[row.parameter, stay]


def _drawn(
    name: str, owner: object, truth: dict[tuple[str, object], float], rng: np.random.Generator, variance: float
) -> float:
    if (name, owner) not in truth:
        truth[name, owner] = float(np.sqrt(variance) * rng.standard_normal())
    return truth[name, owner]


def _rolled(turns: float) -> FloatArray:
    """(2,2) of quarter turns."""
    cos, sin = np.cos(0.5 * np.pi * turns), np.sin(0.5 * np.pi * turns)
    return np.array([[cos, -sin], [sin, cos]])


def _felt(row: Row, what: str, truth: dict[tuple[str, object], float]) -> float:
    """How much of an error `what` of a sensor a row has, as it is rolled."""
    if what not in TILTS or row.parameter not in TILTS:
        return float(row.parameter == what)
    turns = truth["roll", (row.sensor, *row.seat)]
    return float(_rolled(turns)[TILTS.index(row.parameter), TILTS.index(what)])


def _told(rows: tuple[Row, ...], plan: Plan, rng: np.random.Generator) -> FloatArray:
    """Λ: precision differs from test to test and channel to channel, errors are correlated, a common gain unseen."""
    size = len(rows)
    mix = np.eye(size) + 0.3 * rng.standard_normal((size, size)) / np.sqrt(size)
    gains = np.array([row.parameter == "gain" for row in rows], dtype=np.float64)
    mix = mix - np.outer(mix @ gains, gains) / gains.sum()
    precision = rng.uniform(0.3, 1.7, size) / plan.tell**2
    return np.asarray(mix.T @ (precision[:, None] * mix))
