"""Causes that many channels share, each a change that undoes it: units, conventions of axes, the sampling interval.

    all accelerometers by f      f y_i = n_i·(a0 + α × r_i + ω × (ω × r_i))
    all rate sensors by f        f y_i = n_i·ω
    all time by f                α = dω/(f dt), where rate sensors tell ω
    axes reversed or exchanged   n_i → M n_i of all sensors of one kind, M a reflection or a permutation

With rate sensors lengths by 1/f are accelerations by f. Without, the sampling interval by √f is the same too: with
ω' = ω/f the first line reads  y_i = n_i·(a0/f + dω'/dt × r_i + f ω' × (ω' × r_i)),  which holds one number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import permutations

import numpy as np

from nineaudit.array import BoolArray, FloatArray, SensorArray, frozen
from nineaudit.estimate.calibration import PARAMETERS, features
from nineaudit.estimate.model import Data
from nineaudit.estimate.motion import has_rates
from nineaudit.estimate.shapes import GAIN_SD
from nineaudit.estimate.trajectory import Fit
from nineaudit.units import G0

ACCELERATIONS = {
    "g": G0, "m/s²": 1.0, "mm/s²": 1e-3, "ft/s²": 0.3048, "in/s²": 0.0254,
}  # fmt: skip
RATES = {"rad/s": 1.0, "deg/s": np.pi / 180.0, "rev/s": 2.0 * np.pi, "rev/min": np.pi / 30.0}
COMMON = {"g", "m/s²", "rad/s", "deg/s", "s"}
"""One of the two units of a mistake is one of these."""
ACCELEROMETERS, RATE_SENSORS = "accelerometers", "rate sensors"
LENGTHS, LENGTHS_AND_TIME = " (or that of all lengths)", " (or that of all lengths, or the sampling interval)"
TIMES = {"s": 1.0, "ms": 1e-3, "half of it": 0.5, "a tenth": 0.1}
"""Sampling intervals whose ratios to a second are tried."""
BESIDE = (2.0, 0.5)
"""Factors tried beside those of units, whence a free one finds any that is not far from 1."""
NEAR_UNIT = 0.03
"""A factor this near a ratio of units is that ratio: far beyond what calibration errors have in common."""
NEAREST_UNIT = 0.5
"""How far from a ratio (of its logarithm) that ratio is tried too."""
PLACE_SD = 25e-3
"""m, prior of each coordinate of a misplaced block."""
OCCAM = 10.0
"""Most that a common cause costs, nats, before what its fit says: as a gain far from 1."""
ALONG = 0.9
"""Cosine from which a sensor points along an axis of the body."""


@dataclass(frozen=True, eq=False)
class Cause:
    """`word` the fault word, `channels` (columns) all those it touches, `undo` Data -> Data, `price` in nats, `said` in
    words, and the `size` of it (m for a place, a factor otherwise). `factors` of a unit: "acceleration" and
    "angular_rate" -> what puts the readings right. Where it is free: `slope` Fit of undone data -> (c,k,n) change of
    the readings per prior standard deviation of each of c parameters, `step` (c,) of them -> the cause there, and
    `nearest` the cause at the nearest ratio of units, if one is near. `chance` nats that undoing it in Data may gain by
    chance."""

    word: str
    channels: tuple[int, ...]
    undo: Callable[[Data], Data]
    price: float
    said: str
    size: float = 1.0
    slope: Callable[[Fit], FloatArray] | None = None
    step: Callable[[FloatArray], Cause] | None = None
    nearest: Callable[[], Cause | None] | None = None
    factors: Mapping[str, float] = field(default_factory=dict)
    chance: Callable[[Data], float] = lambda _: 0.0


def tried(array: SensorArray) -> Iterator[Cause]:
    """Every common cause that may be far from none: factors, signs, axes, the sampling interval."""
    held, told = array.is_accelerometer, has_rates(array)
    for mask, kind, units in _kinds(array):
        for f in (*BESIDE, *ratios(units)):
            yield scaled(mask, kind, told, f)
        yield _opposite(mask, f"all {kind}")
        yield from _conventions(array, mask, kind)
    if told and held.any():
        for f in ratios(TIMES):
            yield timed(len(array), f)
        for one in ratios(_common(ACCELERATIONS)):
            for other in ratios(_common(RATES)):
                yield both(held, one, other)


def near(array: SensorArray) -> Iterator[Cause]:
    """The common causes whose size is free, from where there is nothing wrong."""
    for mask, kind, _ in _kinds(array):
        yield scaled(mask, kind, has_rates(array), 1.0)
    if has_rates(array) and array.is_accelerometer.any():
        yield timed(len(array), 1.0)
    for columns in blocks(array):
        yield misplaced(array, columns, np.zeros(3))


def _kinds(array: SensorArray) -> list[tuple[BoolArray, str, Mapping[str, float]]]:
    held = array.is_accelerometer
    kinds: list[tuple[BoolArray, str, Mapping[str, float]]] = []
    if held.any():
        kinds.append((held, ACCELEROMETERS, ACCELERATIONS))
    if has_rates(array):
        kinds.append((~held, RATE_SENSORS, RATES))
    return kinds


def blocks(array: SensorArray) -> list[tuple[int, ...]]:
    """Columns of the accelerometers of each place that holds several."""
    places: dict[tuple[float, ...], list[int]] = {}
    for k in np.flatnonzero(array.is_accelerometer).tolist():
        places.setdefault(tuple(np.round(array.positions[k], 6).tolist()), []).append(k)
    return [tuple(columns) for columns in places.values() if len(columns) > 1]


def ratios(units: Mapping[str, float]) -> list[float]:
    """Every ratio but 1 of two of `units`, one of them COMMON; those within NEAR_UNIT of another once."""
    found: list[float] = []
    for ratio in sorted({units[a] / units[b] for a in units for b in units if a != b and {a, b} & COMMON}):
        if not any(abs(np.log(ratio / f)) < NEAR_UNIT for f in found):
            found.append(ratio)
    return found


def scaled(mask: BoolArray, kind: str, told: bool, factor: float) -> Cause:
    """All sensors of a kind by a factor, their noise with them, so that its size tells nothing. `told`: rate sensors
    tell ω."""
    units = ACCELERATIONS if kind == ACCELEROMETERS else RATES
    pairs = unit_pairs(factor, units)
    read = f"by {factor:.4g}" + (f" (as {' or '.join(f'{b} and not {a}' for a, b in pairs)})" if pairs else "")
    also = "" if kind == RATE_SENSORS else LENGTHS if told else LENGTHS_AND_TIME
    said = f"all {kind} fit when multiplied {read}: a unit{also} is probably wrong in the rig"
    undo, by = partial(_scale, mask, factor), partial(scaled, mask, kind, told)
    return Cause(
        "unit", _columns(mask), undo, _price(factor), said, factor,
        slope=lambda at: GAIN_SD * np.where(mask[:, None], at.ideal.T, 0.0)[None],
        step=lambda c: by(factor / float(np.clip(1.0 + GAIN_SD * c[0], 0.5, 2.0))),
        nearest=lambda: None if (f := _nearest(factor, units)) is None else by(f),
        factors={"acceleration" if kind == ACCELEROMETERS else "angular_rate": factor},
    )  # fmt: skip


def both(held: BoolArray, one: float, other: float) -> Cause:
    """All accelerometers (`held`, (k,)) by `one` factor, and all rate sensors by an`other`: both units are wrong."""
    first, second = scaled(held, ACCELEROMETERS, True, one), scaled(~held, RATE_SENSORS, True, other)
    return Cause(
        "unit", tuple(range(len(held))), lambda data: second.undo(first.undo(data)), first.price + second.price,
        f"{first.said}; and {second.said}", one, factors={**first.factors, **second.factors},
    )  # fmt: skip


def _common(units: Mapping[str, float]) -> dict[str, float]:
    return {name: value for name, value in units.items() if name in COMMON}


def timed(count: int, factor: float) -> Cause:
    """The sampling interval by a factor."""
    said = f"the record fits with its sampling interval multiplied by {factor:.4g}: the time base is probably wrong"
    return Cause(
        "unknown", tuple(range(count)), partial(_stretch, factor), _price(factor), said, factor,
        slope=lambda at: -GAIN_SD * (at.point.instrument.lever @ at.point.alpha)[None],
        step=lambda c: timed(count, factor * float(np.exp(np.clip(GAIN_SD * c[0], -0.5, 0.5)))),
        nearest=lambda: None if (f := _nearest(factor, TIMES)) is None else timed(count, f),
    )  # fmt: skip


def _nearest(factor: float, units: Mapping[str, float]) -> float | None:
    """The ratio of units that a factor is nearest to, None where none is within NEAREST_UNIT."""
    near = min(ratios(units), key=lambda f: abs(np.log(factor / f)))
    return near if abs(np.log(factor / near)) < NEAREST_UNIT else None


def _price(factor: float) -> float:
    """Nats of a factor, as of the gain of one channel (refitted.py)."""
    return min(0.5 * (float(np.log(factor)) / GAIN_SD) ** 2, OCCAM)


def _opposite(mask: BoolArray, which: str) -> Cause:
    """The sensors of `mask` (k,) with the other sign."""
    said = f"{which} fit with the opposite sign: a convention of axes or signs is probably wrong in the rig"
    return Cause("polarity", _columns(mask), partial(_scale, mask, -1.0), OCCAM, said)


def _conventions(array: SensorArray, mask: BoolArray, kind: str) -> Iterator[Cause]:
    """Axes reversed, one at a time, or exchanged: left-handed or otherwise named axes of all sensors of a kind."""
    for axis, letter in enumerate("xyz"):
        along = mask & (np.abs(array.axes[:, axis]) > ALONG)
        if along.sum() > 1:
            yield _opposite(along, f"all {kind} along {letter}")
    for order in permutations(range(3)):
        if order != (0, 1, 2):
            names = ", ".join("xyz"[i] for i in order)
            said = f"all {kind} fit with axes {names} for x, y, z: their convention is probably wrong in the rig"
            yield Cause("swap", _columns(mask), partial(_turn, mask, order), OCCAM, said)


def misplaced(array: SensorArray, columns: tuple[int, ...], offset: FloatArray) -> Cause:
    """The sensors of `columns` elsewhere by `offset` (3,) m."""
    where = ", ".join(f"{1e3 * x:.3g}" for x in array.positions[columns[0]] + offset)
    names, size = ", ".join(array.channels[c] for c in columns), float(np.linalg.norm(offset))
    said = f"{names} fit together at ({where}) mm: the place of their block is probably wrong in the rig"
    price = 0.5 * (size / PLACE_SD) ** 2
    return Cause(
        "position", columns, partial(_move, columns, offset), price, said, size,
        slope=partial(_by_place, columns),
        step=lambda c: misplaced(array, columns, offset + PLACE_SD * c),
    )  # fmt: skip


def _by_place(columns: tuple[int, ...], at: Fit) -> FloatArray:
    """(3,k,n) change of the readings by PLACE_SD of each coordinate, n·(α × e + ω × (ω × e))."""
    here = at.point
    known = features(np.zeros_like(here.mean), here.alpha, here.mean)
    by = np.zeros((3, len(at.data.array), known.shape[0]))
    by[:, list(columns)] = here.instrument.sensitivities()[list(columns), 3:6].transpose(1, 0, 2)
    return np.asarray(PLACE_SD * (by @ known))


def _columns(mask: BoolArray) -> tuple[int, ...]:
    return tuple(np.flatnonzero(mask).tolist())


def _scale(mask: BoolArray, factor: float, data: Data) -> Data:
    """The readings by a factor, their noise with them, and the zeros that the rig states in the wrong unit."""
    by = np.where(mask, factor, 1.0)
    prior = data.prior_sd.copy()
    prior[:, PARAMETERS.index("zero")] *= np.maximum(np.abs(by), 1.0)
    return replace(data, readings=data.readings * by, weight=data.weight / np.abs(by), prior_sd=prior)


def _stretch(factor: float, data: Data) -> Data:
    return replace(data, time=data.time * factor)


def _turn(mask: BoolArray, order: tuple[int, ...], data: Data) -> Data:
    sensors = list(data.array.sensors)
    for k in _columns(mask):
        sensors[k] = replace(sensors[k], axis=frozen(sensors[k].axis[list(order)]))
    return replace(data, array=SensorArray(tuple(sensors)))


def _move(columns: tuple[int, ...], offset: FloatArray, data: Data) -> Data:
    sensors = list(data.array.sensors)
    for k in columns:
        sensors[k] = replace(sensors[k], position=frozen(sensors[k].position + offset))
    return replace(data, array=SensorArray(tuple(sensors)))


def unit_pairs(factor: float, units: Mapping[str, float]) -> tuple[tuple[str, str], ...]:
    """(as the rig reads it, as it fits) of every two units whose ratio a factor is."""
    return tuple(
        (a, b) for a in units for b in units if a != b and abs(np.log(factor * units[a] / units[b])) < NEAR_UNIT
    )
