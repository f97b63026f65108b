"""The health of every sensor and seat of a campaign: its level, what changed, and what is to be done."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.campaign.health.anchors import Seat
from nineaudit.campaign.health.connect import parts
from nineaudit.campaign.health.crowd import LEAST_RECORDINGS, Track, tracks
from nineaudit.campaign.health.deviations import Deviation, Key, deviations, key_of, levels, seat_name
from nineaudit.campaign.health.model import Solution
from nineaudit.campaign.health.records import UNIT, Records, family, read_records
from nineaudit.campaign.health.scan import excess
from nineaudit.campaign.health.select import Selection, select
from nineaudit.campaign.health.standing import Standing, standing
from nineaudit.finding import COVERAGE_FACTOR

TOLERANCE: Final = 0.01
TOGETHER: Final = 0.9
"""Posterior over prior variance of the difference of a sensor's tilt and its seat's, above which they are not told
apart: their sum is all that a sensor which never moves shows."""


class State(StrEnum):
    """The worst first; `inspect` is of seats."""

    RECALIBRATE = "recalibrate"
    INSPECT = "inspect"
    UNDECIDED = "undecided"
    WATCH = "watch"
    TOO_FEW = "too few tests"
    IN_CONTROL = "in control"


ACTION: Final = (State.RECALIBRATE, State.INSPECT, State.UNDECIDED)
"""For which the exit code is 1."""


@dataclass(frozen=True, eq=False)
class Course:
    """The gain of a sensor test by test: `when` (J,), `value` and `u` (J,), relative, and as `fitted` (J,)."""

    when: FloatArray
    value: FloatArray
    u: FloatArray
    fitted: FloatArray


@dataclass(frozen=True, eq=False)
class Member:
    """A sensor (`serial` number where it has one, `seats` it sat in) or a seat: `tests` it was in, from `first` to
    `last`, the level of each error that lasts (value and U of the posterior, SI), what changed, and what is to be done
    (`state`)."""

    name: str
    is_seat: bool
    serial: str | None
    seats: tuple[Seat, ...]
    tests: int
    first: str
    last: str
    level: Mapping[str, tuple[float, float]]
    deviations: tuple[Deviation, ...]
    state: State
    apart: bool
    course: Course | None = None


@dataclass(frozen=True, eq=False)
class Health:
    """All `sensors` and `seats`, the worst first; `notes`; `scatter` from test to test (SI, by kind and family),
    `tests` used, `dated`; the `selection` and what was `known` behind it."""

    sensors: tuple[Member, ...]
    seats: tuple[Member, ...]
    notes: tuple[str, ...]
    scatter: Mapping[str, float]
    tests: int
    dated: bool
    tolerance: float
    selection: Selection | None = field(default=None, repr=False)
    known: Records | None = field(default=None, repr=False)

    @property
    def action(self) -> bool:
        """Whether anything is to be done."""
        return any(m.state in ACTION for m in (*self.sensors, *self.seats))


def assess(entries: Iterable[Mapping[str, Any]], tolerance: float = TOLERANCE) -> Health:
    """The health of the sensors of a campaign, from the entries of its lake. `tolerance` of a gain, relative."""
    return assess_records(read_records(entries), tolerance)


def assess_records(known: Records, tolerance: float = TOLERANCE) -> Health:
    """The same, from what was read of the entries."""
    if not known.records:
        return Health((), (), tuple(known.notes), {}, 0, known.dated, tolerance)
    chosen = select(parts(known.records), len(known.records))
    members = [m for i in range(len(chosen.parts)) for m in _members(i, chosen, known, tolerance)]
    members.sort(key=lambda m: (list(State).index(m.state), -max((d.z for d in m.deviations), default=0.0), m.name))
    scatter = {" ".join(k): float(np.sqrt(v)) * UNIT[k[1]] for k, v in sorted(chosen.scatter.items())}
    notes = [*known.notes, *(f"left out as unlike the tests about it: {known.records[i].uri}" for i in chosen.outlying)]
    sensors, seats = (tuple(m for m in members if m.is_seat is which) for which in (False, True))
    unnamed = sorted(m.name for m in sensors if not m.serial)
    if unnamed:
        notes.append(f"known by rig and channel, for want of a serial number: {', '.join(unnamed)}")
    return Health(
        sensors,
        seats,
        tuple(notes),
        scatter,
        len(known.records) - len(chosen.outlying),
        known.dated,
        tolerance,
        chosen,
        known,
    )


def _members(number: int, chosen: Selection, known: Records, tolerance: float) -> list[Member]:
    part, solution = chosen.parts[number], chosen.solutions[number]
    sat, used = _who(solution)
    all_tracks = {t.unknown: t for t in tracks(solution)}
    stands = standing(solution, known.records)
    changes = deviations(chosen.changes[number], stands, tolerance)
    off = levels(changes, stands, {i: excess(t) for i, t in all_tracks.items()}, tolerance)
    apart = _apart(solution)
    out = []
    owned: dict[tuple[bool, str], list[int]] = {}
    for i, unknown in enumerate(part.unknowns):
        owned.setdefault(key_of(unknown), []).append(i)
    for (is_seat, name), mine in owned.items():
        tests = sorted(used[is_seat, name])
        changed = (*changes.get((is_seat, name), ()), *off.get((is_seat, name), ()))
        mine.sort(key=lambda i: stands.last.get(i, (-1, 0)), reverse=True)
        gain = next((i for i in mine if part.unknowns[i].parameter == "gain"), None)
        out.append(
            Member(
                name=name,
                is_seat=is_seat,
                serial=known.serials.get(name, name) if name in known.named else None,
                seats=tuple(sorted(sat[is_seat, name])),
                tests=len(tests),
                first=known.records[tests[0]].label if tests else "",
                last=known.records[tests[-1]].label if tests else "",
                level=_levels(mine, stands),
                deviations=changed,
                state=_state(changed, is_seat, len(tests)),
                apart=apart.get((is_seat, name), True),
                course=None if gain is None or gain not in all_tracks else _course(all_tracks[gain], solution),
            )
        )
    return out


def _who(solution: Solution) -> tuple[dict[Key, set[Seat]], dict[Key, set[int]]]:
    """Seats of each sensor (and of each seat itself), and the recordings of each."""
    sat: dict[Key, set[Seat]] = {}
    used: dict[Key, set[int]] = {}
    for unknown in solution.part.unknowns:
        key = key_of(unknown)
        sat.setdefault(key, {unknown.seat} if unknown.seat else set())
        used.setdefault(key, set())
    for group in solution.part.groups:
        for row in group.rows:
            for key in ((False, row.sensor), (True, seat_name(row.seat))):
                if key in sat:
                    sat[key].add(row.seat)
                    used[key].update(int(i) for i in group.index)
    return sat, used


def _levels(mine: Sequence[int], stands: Standing) -> dict[str, tuple[float, float]]:
    """By parameter, of the seat or setting that it had last (`mine` begins with those): as it is now, gains and
    positions against the rig file in force."""
    out: dict[str, tuple[float, float]] = {}
    for i in mine:
        parameter = stands.solution.part.unknowns[i].parameter
        unit, (value, u) = UNIT[family(parameter)], stands.value(i)
        right = 0.0 if family(parameter) == "tilt" or i not in stands.last else stands.moved(i)
        out.setdefault(parameter, (unit * (value - right), COVERAGE_FACTOR * unit * u))
    return out


def _state(changed: Sequence[Deviation], is_seat: bool, tests: int) -> State:
    open_ = [d for d in changed if not d.restated]
    if not open_:
        return State.IN_CONTROL if tests >= LEAST_RECORDINGS else State.TOO_FEW
    beyond = [d for d in open_ if d.beyond]
    if not beyond:
        return State.WATCH
    if all(d.rivals for d in beyond):
        return State.UNDECIDED
    return State.INSPECT if is_seat else State.RECALIBRATE


def _apart(solution: Solution) -> dict[Key, bool]:
    """Whether the tilts of a sensor and of all its seats are told apart, by the posterior of their difference: only
    where others sat in the seat too."""
    unknowns = solution.part.unknowns
    prior, cov = solution.part.prior, solution.cov
    seat = {(u.parameter, u.seat): i for i, u in enumerate(unknowns) if u.seat}
    out: dict[Key, bool] = {}
    for i, unknown in enumerate(unknowns):
        if unknown.sensor is None or family(unknown.parameter) != "tilt":
            continue
        place = (str(unknown.within[0]), str(unknown.within[1]))
        j = seat[unknown.parameter, place]
        left = float((cov[i, i] + cov[j, j] - 2.0 * cov[i, j]) / (prior[i] ** 2 + prior[j] ** 2))
        for key in ((False, unknown.sensor), (True, seat_name(place))):
            out[key] = out.get(key, True) and left <= TOGETHER
    return out


def _course(track: Track, solution: Solution) -> Course:
    """Each test's own estimate about the model, x̂ + Σβf + r/Λ': a control chart."""
    unit, n = UNIT["gain"], len(solution.part.unknowns)
    fitted = np.full(len(track.index), float(solution.x[track.unknown]))
    for k, change in enumerate(solution.changes):
        if change.unknown == track.unknown:
            fitted += solution.x[n + k] * change.amount[track.index]
    told = np.maximum(track.weight, 1e-9)
    return Course(track.when, unit * (fitted + track.z / np.sqrt(told)), unit / np.sqrt(told), unit * fitted)
