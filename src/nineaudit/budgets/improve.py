"""What would help most: the budget of the same motion with one thing better at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from nineaudit.array import FloatArray, Sensor, SensorArray, frozen
from nineaudit.estimate import calibration, trajectory
from nineaudit.estimate.at_their_word import at_their_word, total
from nineaudit.estimate.condense import Condensed
from nineaudit.estimate.functional import smoothed
from nineaudit.estimate.model import Data
from nineaudit.estimate.motion import has_rates
from nineaudit.estimate.outputs import Output
from nineaudit.estimate.trajectory import Fit
from nineaudit.physics import rigid_body
from nineaudit.simulate.instrument import DEFAULT_NOISE

BETTER = 0.5
"""What is improved has half its standard uncertainty; arms are twice as long."""
ADDED_GAIN, ADDED_ALIGNMENT = 0.005, float(np.deg2rad(0.5))
"""Gain and alignment of a rate sensor that is added: those of [uncertainty] where a rig states none."""


@dataclass(frozen=True, eq=False)
class Present:
    """The array, the fit of its record, the blocks it was fitted to, the block at rest, and whether the accelerometers
    span α, so that the whole-record fit is the measure; else channels are taken at their word."""

    array: SensorArray
    fit: Fit
    blocks: Condensed
    rest_index: int | None
    spans: bool


@dataclass(frozen=True)
class Change:
    """A change of the rig, and the standard uncertainty of each output over the present one."""

    name: str
    ratios: tuple[float, ...]

    @property
    def mean(self) -> float:
        """Geometric mean of the ratios: what the changes are ranked by."""
        return float(np.exp(np.mean(np.log(np.maximum(self.ratios, 1e-12)))))


def changes(present: Present, outputs: Sequence[Output]) -> tuple[Change, ...]:
    """Every change that is open to the rig, the most useful first."""
    sigma = present.blocks.sigma
    now = _uncertainties(present, present.array, sigma, outputs)
    found = [
        Change(name, tuple(float(r) for r in _uncertainties(present, array, noise, outputs) / now))
        for name, array, noise in _variants(present.array, sigma, present.blocks.length)
    ]
    return tuple(sorted(found, key=lambda change: change.mean))


def _variants(array: SensorArray, sigma: FloatArray, length: int) -> Iterator[tuple[str, SensorArray, FloatArray]]:
    longer = _stretched(array, 1.0 / BETTER)
    if not np.array_equal(longer.positions, array.positions):
        yield "arms twice as long", longer, sigma
    for name in ("gain", "zero", "alignment", "position", "timing"):
        key = f"u_{name}"
        better = tuple(replace(s, **{key: BETTER * getattr(s, key)}) for s in array.sensors)
        if array.values(key).any():
            yield f"{name} known twice as well", SensorArray(better), sigma
    yield "half the noise", array, BETTER * sigma
    if not has_rates(array):
        noise = DEFAULT_NOISE["gyroscope"]
        added = tuple(_rate_sensor(axis, noise) for axis in range(3))
        more = np.append(sigma, np.full(3, noise / np.sqrt(length)))
        yield "three rate sensors added", SensorArray(array.sensors + added), more


def _stretched(array: SensorArray, by: float) -> SensorArray:
    """The accelerometers `by` times as far from the one nearest their middle."""
    held = array.positions[array.is_accelerometer]
    centre = held[np.argmin(np.linalg.norm(held - held.mean(axis=0), axis=1))] if len(held) else np.zeros(3)
    return SensorArray(tuple(replace(s, position=frozen(centre + by * (s.position - centre))) for s in array.sensors))


def _rate_sensor(axis: int, noise: float) -> Sensor:
    name = f"added g{'xyz'[axis]}"
    return Sensor(
        channel=name,
        kind="gyroscope",
        position=frozen(np.zeros(3)),
        axis=frozen(np.eye(3)[axis]),
        signal=name,
        unit="rad/s",
        u_gain=ADDED_GAIN,
        u_alignment=ADDED_ALIGNMENT,
        noise=noise,
    )


def _uncertainties(present: Present, array: SensorArray, sigma: FloatArray, outputs: Sequence[Output]) -> FloatArray:
    """(o,) standard uncertainty of each output for the exact readings of `array` in the present motion."""
    motion, time = present.fit.motion, present.blocks.time
    a0 = np.nan_to_num(motion.a0)
    y = rigid_body.predict(array.positions, array.axes, array.is_accelerometer, a0, motion.alpha, motion.omega)
    if not present.spans:
        word = at_their_word(array, time, y, sigma, present.rest_index)
        return np.array([total(word.rows(output.gradient(word.motion, time))) for output in outputs])
    weight = np.broadcast_to(1.0 / sigma, y.shape).copy()
    data = Data(array, time, y, weight, calibration.prior_sds(array), present.fit.data.still)
    known = smoothed(trajectory.fit(data, present.fit.omega, iterations=1))
    return np.array([total(known.rows(output.gradient(motion, time))) for output in outputs])
