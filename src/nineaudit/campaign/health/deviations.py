"""What changed in a campaign, or is not as its rig file states: how much, since when, and whose it may be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from nineaudit.campaign.health.anchors import Seat
from nineaudit.campaign.health.model import Unknown
from nineaudit.campaign.health.records import UNIT, family
from nineaudit.campaign.health.scan import Found, excess
from nineaudit.campaign.health.select import Selected
from nineaudit.campaign.health.standing import Level, Standing, levels_beyond
from nineaudit.finding import COVERAGE_FACTOR

PLACE_TOLERANCE: Final = 1e-3
"""m: of a position error that came."""

Key = tuple[bool, str]
"""Whether it is a seat, and its name."""


@dataclass(frozen=True, eq=False)
class Deviation:
    """A significant change: `parameter` by `value` ± `U` (SI), in the way of `shape`, since the recording `since`, by
    the readings between `earliest` and `latest`; |Z| `z`; `rivals`, names of others that may be it; whether what is
    left of it is `beyond` the tolerance, or which recording is the first of a rig file that puts it right (`restated`).
    Of the shape `level`: a gain that is not what its rig file states. `now`: value and U (SI) of all changes together,
    where there are several of the same error."""

    parameter: str
    value: float
    U: float
    shape: str
    since: str
    earliest: str
    latest: str
    z: float
    rivals: tuple[str, ...]
    beyond: bool
    restated: str = ""
    now: tuple[float, float] | None = None


def name_of(unknown: Unknown) -> str:
    """The sensor, or the seat, that an unknown is of."""
    return unknown.sensor if unknown.sensor is not None else seat_name(unknown.seat or ("", ""))


def seat_name(seat: Seat) -> str:
    """a1y of head 1."""
    return f"{seat[1]} of {seat[0]}"


def deviations(selected: Sequence[Selected], mine: Standing, tolerance: float) -> dict[Key, list[Deviation]]:
    """What changed, in order of time, by whom it may be of: every rival has it too, with the others named."""
    unknowns = mine.solution.part.unknowns
    out: dict[Key, list[Deviation]] = {}
    for k, one in sorted(enumerate(selected), key=lambda numbered: numbered[1].found.first):
        group: dict[Key, Found] = {}
        for found in (one.found, *one.rivals):
            group.setdefault(key_of(unknowns[found.unknown]), found)
        for found in list(group.values()):
            group |= {(False, sensor): found for sensor in _newcomers(found, mine) if (False, sensor) not in group}
        made = {}
        for key, found in group.items():
            same = (other.found.earliest for other in selected if other.found.unknown == found.unknown)
            others = tuple(_spoken(other) for other in group if other != key)
            number = k if found is one.found else None
            made[key] = _change(found, number, min([found.earliest, *same]), others, mine, tolerance)
        answered = any(d.restated for d in made.values())
        for key, deviation in made.items():
            out.setdefault(key, []).append(replace(deviation, beyond=False) if answered else deviation)
    return out


def _newcomers(found: Found, mine: Standing) -> list[str]:
    """Sensors that came to a seat when its tilt changed: they may have more of it than their rig states."""
    seat, parameter = (getattr(mine.solution.part.unknowns[found.unknown], name) for name in ("seat", "parameter"))
    came = {
        one.sensor: int(mine.said(i)[0][0])
        for i, one in enumerate(mine.solution.part.unknowns)
        if seat is not None and one.sensor is not None and (one.parameter, one.within) == (parameter, seat)
    }
    return [sensor for sensor, at in came.items() if found.earliest <= at <= found.latest]


def levels(
    changed: Mapping[Key, Sequence[Deviation]], mine: Standing, scattered: Mapping[int, float], tolerance: float
) -> dict[Key, list[Deviation]]:
    """Gains that are not as stated, by whom they may be of, but those that a change which is told of explains."""
    unknowns = mine.solution.part.unknowns
    told = {key for key, found in changed.items() for d in found if d.parameter == "gain" and (d.beyond or d.rivals)}
    out: dict[Key, list[Deviation]] = {}
    for best, rivals in levels_beyond(mine, scattered, tolerance):
        if key_of(unknowns[best.unknown]) in told:
            continue
        group = {key_of(unknowns[one.unknown]): one for one in (best, *rivals)}
        for key, one in group.items():
            others = tuple(_spoken(other) for other in group if other != key)
            out.setdefault(key, []).append(_level(one, others, mine))
    return out


def key_of(unknown: Unknown) -> Key:
    return unknown.sensor is None, name_of(unknown)


def _spoken(key: Key) -> str:
    return f"the seat {key[1]}" if key[0] else key[1]


def _change(
    found: Found, number: int | None, before: int, rivals: tuple[str, ...], mine: Standing, tolerance: float
) -> Deviation:
    """`number` of the change in the solution; None: that of a rival, in its place. `before` that recording its unknown
    had not changed yet."""
    parameter = mine.solution.part.unknowns[found.unknown].parameter
    unit, wider = UNIT[family(parameter)], excess(found.track)
    limit = PLACE_TOLERANCE if family(parameter) == "position" else tolerance
    value, u = _alone(found) if number is None else _in_model(number, mine)
    gone, u_gone = mine.value(found.unknown, level=False)
    if number is None:
        gone, u_gone = gone + value, u
    left = unit * (gone - mine.put_right(found.unknown, before))
    e, u_e = mine.value(found.unknown)
    inside = [abs(left) <= limit - COVERAGE_FACTOR * unit * wider * u_gone, not mine.in_force(found.unknown)]
    if parameter == "gain" and number is not None:
        inside.append(abs(unit * (e - mine.moved(found.unknown))) <= limit - COVERAGE_FACTOR * unit * wider * u_e)
    since, earliest, latest = (mine.records[i].label for i in (found.first, found.earliest, found.latest))
    others = sum(c.unknown == found.unknown for c in mine.solution.changes) - (number is not None)
    return Deviation(
        parameter=parameter,
        value=unit * value,
        U=COVERAGE_FACTOR * unit * wider * u,
        shape=found.shape,
        since=since,
        earliest=earliest,
        latest=latest,
        z=abs(found.z),
        rivals=rivals,
        beyond=not any(inside),
        restated=_restated(found, mine) if any(inside) else "",
        now=(unit * gone, COVERAGE_FACTOR * unit * wider * u_gone) if others else None,
    )


def _alone(found: Found) -> tuple[float, float]:
    """Amount and standard uncertainty of a rival, in its place; in records.UNIT."""
    wider = excess(found.track)
    return found.size, abs(found.size / found.z) / wider if found.z else 0.0


def _in_model(number: int, mine: Standing) -> tuple[float, float]:
    at = len(mine.solution.part.unknowns) + number
    return float(mine.solution.x[at]), float(np.sqrt(mine.solution.cov[at, at]))


def _restated(found: Found, mine: Standing) -> str:
    """The first recording of the statement in force, where that is younger than a change."""
    current = mine.current(found.unknown)
    since = mine.restated(current) if current == found.unknown else int(mine.said(current)[0][0])
    return mine.records[since].label if since is not None and since >= found.earliest else ""


def _level(one: Level, rivals: tuple[str, ...], mine: Standing) -> Deviation:
    index, _ = mine.said(one.unknown)
    since = mine.restated(one.unknown)
    label = mine.records[int(index[0]) if since is None else since].label
    return Deviation("gain", one.e, one.U, "level", label, label, label, abs(one.z), rivals, beyond=True)
