"""From entries of the lake to what each recording says of its sensors, in the order of time.

Rig files may restate a sensor (a new scale after a calibration, a position measured again). What is compared is the
sensor itself: every likelihood is moved to what the rig said of it first (anchors.py),

    θ_first = Q θ + c,    η → Q η + Q Λ Qᵀ c,    Λ → Q Λ Qᵀ

with c the restatement (ln of the scales' ratio, difference of positions, of axes), Q a turn of the tilts' directions.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import date
from typing import Any, Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.campaign.health.anchors import Anchors, Place, Scale, Seat
from nineaudit.campaign.health.identity import Names, names_of, tellers
from nineaudit.report.sensors import unpacked
from nineaudit.units import counted

UNIT: Final = {"gain": 0.005, "tilt": 0.01, "position": 5e-4}
"""What errors are counted in here: relative, rad, m."""


def family(parameter: str) -> str:
    """gain, tilt or position."""
    return parameter.partition("_")[0]


@dataclass(frozen=True, eq=False)
class Row:
    """One error of one channel: its `sensor` (serial number, or rig and channel where it has none), `seat`, `kind`,
    `parameter`, the rig's standard uncertainty `prior` in UNIT, and of a gain the `setting` that it is of."""

    sensor: str
    seat: Seat
    kind: str
    parameter: str
    prior: float
    setting: int = 0


@dataclass(frozen=True, eq=False)
class Record:
    """One recording: `rows` of `eta` (p,) and `matrix` (p,p), in UNIT; `when` in days or places of the order; `label`
    of it; `shock` by sensor, m/s²; `moved` (p,), what its rig file puts right of what was stated first, in UNIT (None:
    nothing)."""

    uri: str
    label: str
    when: float
    rows: tuple[Row, ...]
    eta: FloatArray
    matrix: FloatArray
    shock: Mapping[str, float]
    moved: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Stated:
    """Rows of a recording, UNIT over prior of each (`scale`), Q (`turn`, None: nothing restated) and c (`moved`); the
    `scales` of its sensors: what is stated, and what it is against."""

    rows: tuple[Row, ...]
    scale: FloatArray
    turn: FloatArray | None
    moved: FloatArray
    scales: Mapping[str, tuple[float, Scale]]


@dataclass(eq=False)
class First(Anchors):
    """What rigs said first of each sensor and seat; `stated`, what was made of each rig file."""

    stated: dict[str, Stated] = field(default_factory=dict)


@dataclass(eq=False)
class Records:
    """All that tell something, in order; `dated`, whether that is the order of dates; `notes` on what is left out."""

    records: list[Record]
    dated: bool
    notes: list[str]
    named: frozenset[str]
    """Sensors that have a serial number."""
    first: First = field(default_factory=First)
    names: Names = field(default_factory=Names)
    serials: Mapping[str, str] = field(default_factory=dict)
    """Their serial numbers, by sensor: several sensors may have one."""


def read_records(entries: Iterable[Mapping[str, Any]]) -> Records:
    """The recordings of `entries` that tell a calibration, in order of date, else of test number, else of uri."""
    kept, notes = tellers(entries)
    names, taken = names_of(kept)
    notes += taken
    days = [_day(one.known.get("date")) for one in kept]
    dated = 2 * sum(d is not None for d in days) > len(days)
    if dated and None in days:
        notes.append(f"left out for want of a date: {counted(days.count(None), 'recording')}")
    if not dated and kept:
        notes.append("most recordings have no date: they are in the order of their test numbers, else of their names")
    order = sorted(
        (i for i, d in enumerate(days) if d is not None or not dated),
        key=lambda i: (
            days[i] if dated else 0,
            _natural(str(kept[i].known.get("number") or "")),
            _natural(kept[i].uri),
        ),
    )
    first, serials, records = First(), dict[str, str](), []
    for place, i in enumerate(order):
        one, day = kept[i], days[i]
        when = float(day) if dated and day is not None else float(place)
        label = str(one.known["date"])[:10] if dated else str(one.known.get("number") or one.uri)
        rig = names.rig(one.rig_name, one.item)
        sensors = names.sensors(rig, one.block["channels"])
        records.append(_record(one.uri, label, when, rig, sensors, one.block, first))
        serials |= {sensors[c["channel"]]: str(c["serial"]) for c in one.block["channels"] if c["serial"]}
    several = sorted(sensor for sensor, count in first.settings.items() if count > 1)
    if several:
        across = "stated with another scale after a move, or in other units, and their gains not compared across it"
        notes.append(f"{across}: {', '.join(several)}")
    return Records(records, dated, notes, frozenset(serials), first, names, serials)


def _record(
    uri: str, label: str, when: float, rig: str, sensors: Mapping[str, str], block: Mapping[str, Any], first: First
) -> Record:
    told = block["information"]
    stated = _stated(rig, sensors, block, first)
    first.last.update(stated.scales)
    eta, matrix = unpacked(told)
    eta, matrix = stated.scale * eta, stated.scale[:, None] * matrix * stated.scale
    if stated.turn is not None:
        matrix = stated.turn @ matrix @ stated.turn.T
        eta = stated.turn @ eta + matrix @ stated.moved
    shock = {sensors[c["channel"]]: float(c["shock"] or 0.0) for c in block["channels"]}
    return Record(uri, label, when, stated.rows, eta, matrix, shock, None if stated.turn is None else stated.moved)


def _stated(rig: str, sensors: Mapping[str, str], block: Mapping[str, Any], first: First) -> Stated:
    """What the rig file says of the rows of a recording: the same for most recordings of a rig, and made once."""
    told = block["information"]
    named = ("channel", "serial", "kind", "scale", "position", "axis")
    key = repr((rig, [[c[n] for n in named] for c in block["channels"]], told["parameters"], told["prior"]))
    if key not in first.stated:
        channels = {c["channel"]: c for c in block["channels"]}
        prior = np.array(told["prior"], dtype=np.float64)
        names = [(str(c), str(p)) for c, p in told["parameters"]]
        places = {c: first.place(rig, c, channels[c]["position"], channels[c]["axis"]) for c in dict(names)}
        gains = [(c, places[c].seat, float(channels[c]["scale"])) for c, p in names if p == "gain"]
        scales = {c: first.scale(sensors[c], seat, scale) for c, seat, scale in gains}
        rows = tuple(
            _row(sensors[c], channels[c], p, u, places[c], scales) for (c, p), u in zip(names, prior, strict=True)
        )
        scale = np.array([UNIT[family(row.parameter)] for row in rows]) / prior
        turn, moved = _restated(names, channels, places, scales)
        same = not moved.any() and np.array_equal(turn, np.eye(len(rows)))
        last = {sensors[c]: (scale, scales[c]) for c, _, scale in gains}
        first.stated[key] = Stated(rows, scale, None if same else turn, moved, last)
    return first.stated[key]


def _row(
    sensor: str, said: Mapping[str, Any], parameter: str, prior: float, place: Place, scales: Mapping[str, Scale]
) -> Row:
    setting = scales[str(said["channel"])].setting if parameter == "gain" else 0
    return Row(sensor, place.seat, said["kind"], parameter, float(prior) / UNIT[family(parameter)], setting)


def _restated(
    names: list[tuple[str, str]],
    channels: Mapping[str, Any],
    places: Mapping[str, Place],
    scales: Mapping[str, Scale],
) -> tuple[FloatArray, FloatArray]:
    """(p,p) Q and (p,) c of the module's equation, of the rows (channel, parameter) of `names`."""
    turn, moved = np.eye(len(names)), np.zeros(len(names))
    row = {name: i for i, name in enumerate(names)}
    for i, (channel, parameter) in enumerate(names):
        said, place = channels[channel], places[channel]
        if parameter == "gain":
            moved[i] = scales[channel].restated(float(said["scale"])) / UNIT["gain"]
        elif family(parameter) == "position":
            at = "xyz".index(parameter[-1])
            moved[i] = (said["position"][at] - place.position[at]) / UNIT["position"]
        elif parameter == "tilt_1" and (channel, "tilt_2") in row:
            pair = [i, row[channel, "tilt_2"]]
            by, far = place.turned(np.array(said["axis"], dtype=np.float64))
            turn[np.ix_(pair, pair)], moved[pair] = by, far / UNIT["tilt"]
    return turn, moved


def _day(text: object) -> int | None:
    try:
        return date.fromisoformat(str(text)[:10]).toordinal()
    except ValueError:
        return None


def _natural(text: str) -> tuple[tuple[int, int, str], ...]:
    """T9 before T10."""
    return tuple((0, int(p), "") if p.isdecimal() else (1, 0, p) for p in re.split(r"(\d+)", text) if p)
