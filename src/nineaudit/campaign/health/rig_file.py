"""The improved calibration of a rig: what a campaign found of its sensors and seats, as numbers of the rig file.

Against what the rig file says now, with g, τ and e the posterior means of gain, tilts and position error, as they are
after the last change:

    scale (1 + g),    axis n + τ_1 u_1 + τ_2 u_2,    position r + e

and as uncertainties of a coming test those of the posterior, and the scatter from test to test, squares added. Only
what the tests tell is written: u at most TOLD of the rig's, and a value beyond k u; of a seat that no test was of, no
position and no axis.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from nineaudit.array import FloatArray, Sensor
from nineaudit.calibrating.changes import Keys
from nineaudit.campaign.health.anchors import Place, Scale
from nineaudit.campaign.health.assess import Health
from nineaudit.campaign.health.deviations import seat_name
from nineaudit.campaign.health.identity import of_rig_file
from nineaudit.campaign.health.model import Solution
from nineaudit.campaign.health.records import UNIT, Records, family
from nineaudit.errors import ConfigurationError
from nineaudit.estimate.calibration import perpendicular
from nineaudit.finding import COVERAGE_FACTOR
from nineaudit.report.numbers import plain
from nineaudit.report.sensors import stated_scale
from nineaudit.rig import Rig
from nineaudit.units import factor

TOLD: Final = 0.8
DIGITS, DIGITS_U = 9, 4
TILTS = ("tilt_1", "tilt_2")
PLACES = ("position_x", "position_y", "position_z")


@dataclass(frozen=True, eq=False)
class Told:
    """Errors of one channel against what its rig file says, SI: `value`, `u` (of a test to come), `told` (posterior u
    alone) and the rig's `prior`, by parameter; from `tests` recordings; `undecided` where a change may be another's."""

    channel: str
    sensor: str
    tests: int
    value: dict[str, float]
    u: dict[str, float]
    told: dict[str, float]
    prior: dict[str, float]
    undecided: bool

    def significant(self, parameter: str) -> bool:
        """Whether it is to be written."""
        known = parameter in self.value and self.told[parameter] <= TOLD * self.prior[parameter]
        return known and abs(self.value[parameter]) > COVERAGE_FACTOR * self.told[parameter]


def improved(health: Health, rig: Rig) -> tuple[dict[str, Keys], list[Told]]:
    """Channel -> keys of its [[sensor]] table that change, in the units of the file; and what they come from.

    ConfigurationError where no test of the campaign is of this rig's sensors.
    """
    known = health.known
    called, names = (rig.name, {}) if known is None else of_rig_file(known.names, rig)
    stands = [] if known is None else [(s, _stands(known, called, names[s.channel], s)) for s in rig.array.sensors]
    found = [told for sensor, one in stands if (told := _told(health, sensor, one)) is not None]
    if not found:
        rigs = sorted({seat[0] for member in health.seats for seat in member.seats})
        raise ConfigurationError(
            "no test of the lake tells of its sensors", file=rig.path, found=rig.name, expected=", ".join(rigs) or None
        )
    length = factor(rig.units.length, "length")
    keys = {one.channel: _keys(one, rig.array[one.channel], length) for one in found if not one.undecided}
    return {channel: mine for channel, mine in keys.items() if mine}, found


def evidence(found: Sequence[Told], changes: dict[str, Keys], health: Health, rig: Rig, lake: dict[str, Any]) -> Any:
    """The document beside the rig file: where every number comes from. SI, u at k = 1."""
    rows = [
        {
            "channel": one.channel,
            "sensor": one.sensor,
            "tests": one.tests,
            "changed": changes.get(one.channel, {}),
            "errors": {
                name: plain({"value": one.value[name], "u": one.u[name], "prior": one.prior[name]})
                for name in one.value
            },
        }
        for one in found
    ]
    about = {"schema": "nineaudit/rig-evidence/1", "rig": {"name": rig.name, "sha256": rig.sha256}, "lake": lake}
    return {**about, "tests": health.tests, "scatter": plain(health.scatter), "channels": rows}


def _keys(one: Told, sensor: Sensor, length: float) -> Keys:
    keys: Keys = {}
    if one.significant("gain"):
        keys["scale"] = _short(sensor.scale * (1.0 + one.value["gain"]), DIGITS)
        keys["gain"] = _short(one.u["gain"], DIGITS_U)
    if any(one.significant(name) for name in TILTS) and all(one.told[t] <= TOLD * one.prior[t] for t in TILTS):
        axis = sensor.axis + np.array([one.value[name] for name in TILTS]) @ perpendicular(sensor.axis)
        keys["axis"] = [round(float(v), DIGITS) + 0.0 for v in axis / np.linalg.norm(axis)]
        keys["alignment_deg"] = _short(math.degrees(max(one.u[name] for name in TILTS)), DIGITS_U)
    moved = [one.value[name] if one.significant(name) else 0.0 for name in PLACES]
    if any(moved):
        keys["position"] = [_short(float(v) / length, DIGITS) for v in sensor.position + moved]
        left = [one.u[n] if one.significant(n) else max(one.prior[n], one.u[n]) for n in PLACES]
        keys["position_u"] = _short(max(left) / length, DIGITS_U)
    return keys


@dataclass(frozen=True, eq=False)
class Stands:
    """What the records call a channel's `sensor`, and what its errors are against in them: the `place` of its seat and
    the `scale` of its gain, None where no recording is of it."""

    sensor: str
    place: Place | None
    scale: Scale | None


def _stands(known: Records, rig: str, name: str, sensor: Sensor) -> Stands:
    place = known.first.known_place(rig, sensor.channel, sensor.position.tolist(), sensor.axis.tolist())
    return Stands(
        name, place, known.first.known_scale(name, None if place is None else place.seat, stated_scale(sensor))
    )


def _told(health: Health, sensor: Sensor, stands: Stands) -> Told | None:
    """What is told of a channel; None where no test is of its sensor, or of its seat."""
    value: dict[str, float] = {}
    told: dict[str, float] = {}
    for solution in () if health.selection is None else health.selection.solutions:
        for parameter, at in _entries(solution, stands).items():
            value[parameter], told[parameter] = _posterior(solution, at, UNIT[family(parameter)])
    if not value:
        return None
    _as_stated(value, sensor, stands)
    scatter = {p: health.scatter.get(f"{sensor.kind} {family(p)}", 0.0) for p in value}
    seat = None if stands.place is None else seat_name(stands.place.seat)
    members = [m for m in (*health.sensors, *health.seats) if m.name == (seat if m.is_seat else stands.sensor)]
    return Told(
        channel=sensor.channel,
        sensor=stands.sensor,
        tests=max((m.tests for m in members), default=0),
        value=value,
        u={p: math.hypot(told[p], scatter[p]) for p in value},
        told=told,
        prior={p: _prior(sensor, p) for p in value},
        undecided=any(d.rivals for m in members for d in m.deviations),
    )


def _prior(sensor: Sensor, parameter: str) -> float:
    return {"gain": sensor.u_gain, "tilt": sensor.u_alignment, "position": sensor.u_position}[family(parameter)]


def _entries(solution: Solution, stands: Stands) -> dict[str, list[int]]:
    """By parameter the unknowns whose sum it is; only where all of them are there."""
    seat = None if stands.place is None else stands.place.seat
    setting = None if stands.scale is None else (stands.scale.setting,)
    out: dict[str, list[int]] = {}
    for i, unknown in enumerate(solution.part.unknowns):
        within = setting if unknown.parameter == "gain" else seat
        own = unknown.sensor == stands.sensor and unknown.within == within
        if own or (seat is not None and unknown.seat == seat):
            out.setdefault(unknown.parameter, []).append(i)
    wanted = {"gain": 1, "tilt": 2, "position": 1}
    return {p: at for p, at in out.items() if len(at) == wanted[family(p)]}


def _posterior(solution: Solution, at: Sequence[int], unit: float) -> tuple[float, float]:
    """Value and u of a sum of unknowns, after the last change."""
    by, n = np.zeros(len(solution.x)), len(solution.part.unknowns)
    by[list(at)] = 1.0
    for k, change in enumerate(solution.changes):
        by[n + k] = float(change.amount.max()) if change.unknown in at else 0.0
    return unit * float(by @ solution.x), unit * float(np.sqrt(by @ solution.cov @ by))


def _as_stated(value: dict[str, float], sensor: Sensor, stands: Stands) -> None:
    """From errors against what was stated first to those against this rig file (records.py), in place."""
    if "gain" in value and stands.scale is not None:
        value["gain"] -= stands.scale.restated(stated_scale(sensor))
    if stands.place is None:
        return
    for i, parameter in enumerate(PLACES):
        if parameter in value:
            value[parameter] -= float(sensor.position[i] - stands.place.position[i])
    if all(name in value for name in TILTS):
        turn, moved = stands.place.turned(sensor.axis)
        turned: FloatArray = turn.T @ (np.array([value[t] for t in TILTS]) - moved)
        value.update(zip(TILTS, turned.tolist(), strict=True))


def _short(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")
