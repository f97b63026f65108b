"""What changed in a campaign, how much, since when, and whose it may be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from nineaudit.campaign.health.model import Solution, Unknown
from nineaudit.campaign.health.records import UNIT, Record, Seat, family
from nineaudit.campaign.health.scan import Found, excess
from nineaudit.campaign.health.select import Selected
from nineaudit.finding import COVERAGE_FACTOR

PLACE_TOLERANCE: Final = 1e-3
"""m: of a position error that came."""

Key = tuple[bool, str]
"""Whether it is a seat, and its name."""


@dataclass(frozen=True, eq=False)
class Deviation:
    """A significant change: `parameter` by `value` ± `U` (SI), in the way of `shape`, since the recording `since`, by
    the readings between `earliest` and `latest`; |Z| `z`; `rivals`, names of others that may be it."""

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


def name_of(unknown: Unknown) -> str:
    """The sensor, or the seat, that an unknown is of."""
    return unknown.sensor if unknown.sensor is not None else seat_name(unknown.seat or ("", ""))


def seat_name(seat: Seat) -> str:
    """a1y of head 1."""
    return f"{seat[1]} of {seat[0]}"


def deviations(
    selected: Sequence[Selected], solution: Solution, records: Sequence[Record], tolerance: float
) -> dict[Key, list[Deviation]]:
    """What changed, by whom it may be of: every rival has it too, with the others named."""
    unknowns, n = solution.part.unknowns, len(solution.part.unknowns)
    out: dict[Key, list[Deviation]] = {}
    for k, one in enumerate(selected):
        candidates = [one.found, *one.rivals]
        owners = list(dict.fromkeys(key_of(unknowns[f.unknown]) for f in candidates))
        for key in owners:
            found = next(f for f in candidates if key_of(unknowns[f.unknown]) == key)
            wider = excess(found.track)
            value, u = float(solution.x[n + k]), float(np.sqrt(solution.cov[n + k, n + k]))
            if found is not one.found:
                value, u = _alone(found)
            others = tuple(_spoken(other) for other in owners if other != key)
            made = _deviation(unknowns[found.unknown], found, value, u * wider, others, records, tolerance)
            out.setdefault(key, []).append(made)
    return out


def _alone(found: Found) -> tuple[float, float]:
    """Amount and standard uncertainty of a rival, in its place."""
    return found.size, abs(found.size / found.z) / excess(found.track) if found.z else 0.0


def key_of(unknown: Unknown) -> Key:
    return unknown.sensor is None, name_of(unknown)


def _spoken(key: Key) -> str:
    return f"the seat {key[1]}" if key[0] else key[1]


def _deviation(
    unknown: Unknown,
    found: Found,
    value: float,
    u: float,
    rivals: tuple[str, ...],
    records: Sequence[Record],
    tolerance: float,
) -> Deviation:
    unit = UNIT[family(unknown.parameter)]
    limit = PLACE_TOLERANCE if family(unknown.parameter) == "position" else tolerance
    size, spread = unit * value, COVERAGE_FACTOR * unit * u
    since, earliest, latest = (records[i].label for i in (found.first, found.earliest, found.latest))
    return Deviation(
        parameter=unknown.parameter,
        value=size,
        U=spread,
        shape=found.shape,
        since=since,
        earliest=earliest,
        latest=latest,
        z=abs(found.z),
        rivals=rivals,
        beyond=abs(size) > limit - spread,
    )
