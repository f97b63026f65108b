"""What would help most: the budget of the same motion with one thing better at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from nineaudit.array import FloatArray, Sensor, SensorArray, frozen
from nineaudit.estimate import budget, calibration, trajectory
from nineaudit.estimate.at_their_word import at_their_word, perfect
from nineaudit.estimate.budget import Beyond
from nineaudit.estimate.condense import Condensed
from nineaudit.estimate.functional import smoothed
from nineaudit.estimate.model import Data
from nineaudit.estimate.motion import Motion, has_rates
from nineaudit.estimate.outputs import Output
from nineaudit.estimate.rate_smoother import Smoother, noise_of_rates
from nineaudit.estimate.trajectory import Fit
from nineaudit.simulate.instrument import DEFAULT_NOISE

BETTER = 0.5
"""What is improved has half its standard uncertainty; arms are twice as long."""
NOTHING = 0.995
"""A change that leaves more of the uncertainty than this is not worth a line."""
ADDED_GAIN, ADDED_ALIGNMENT = 0.005, float(np.deg2rad(0.5))
"""Gain and alignment of a rate sensor that is added: those of [uncertainty] where a rig states none."""


@dataclass(frozen=True, eq=False)
class Present:
    """The array, the `motion`, the `fit` of the blocks (None: the accelerometers do not span α), the blocks, the block
    at rest, the errors `beyond` calibration and noise, and the smoother of the rates, which then stands for the fit."""

    array: SensorArray
    motion: Motion
    fit: Fit | None
    blocks: Condensed
    rest_index: int | None
    beyond: Beyond
    smoother: Smoother | None


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
    """Every change that is open to the rig, the most useful first; what changes nothing is left out."""
    now = _uncertainties(present, outputs)
    found = [
        Change(name, tuple(float(r) for r in _uncertainties(variant, outputs) / now))
        for name, variant in _variants(present)
    ]
    helps = (change for change in found if change.mean < NOTHING)
    return tuple(sorted(helps, key=lambda change: change.mean))


def _variants(now: Present) -> Iterator[tuple[str, Present]]:
    array, blocks, errors = now.array, now.blocks, now.beyond
    longer = _stretched(array, 1.0 / BETTER)
    if not np.allclose(longer.positions, array.positions, rtol=0.0, atol=1e-9):
        yield "arms twice as long", replace(now, array=longer)
    for name in ("gain", "zero", "alignment", "position", "timing"):
        key = f"u_{name}"
        better = tuple(replace(s, **{key: BETTER * getattr(s, key)}) for s in array.sensors)
        if array.values(key).any():
            yield f"{name} known twice as well", replace(now, array=SensorArray(better))
    yield "half the noise", replace(now, blocks=replace(blocks, sigma=BETTER * blocks.sigma))
    if errors.rounding.any():
        yield "one more bit", replace(now, beyond=replace(errors, rounding=BETTER * errors.rounding))
    if errors.mismatch.any():
        yield "one filter class for all", replace(now, beyond=replace(errors, mismatch=0.0 * errors.mismatch))
    if not has_rates(array):
        yield "three rate sensors added", _with_rates(now)


def _with_rates(now: Present) -> Present:
    noise, errors, count = DEFAULT_NOISE["gyroscope"], now.beyond, len(now.blocks.time)
    added = tuple(_rate_sensor(axis, noise) for axis in range(3))
    more = replace(
        errors,
        rounding=np.append(errors.rounding, np.zeros(3)),
        counted=np.append(errors.counted, np.zeros(3, dtype=np.bool_)),
        mismatch=np.hstack([errors.mismatch, np.zeros((count, 3))]),
    )
    sigma = np.append(now.blocks.sigma, np.full(3, noise / np.sqrt(now.blocks.length)))
    array = SensorArray(now.array.sensors + added)
    return replace(now, array=array, blocks=replace(now.blocks, sigma=sigma), beyond=more)


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


def _uncertainties(present: Present, outputs: Sequence[Output]) -> FloatArray:
    """(o,) standard uncertainty of each output for the exact readings of the array in the present motion."""
    way, time = _way(present), present.blocks.time
    found = [budget.rows(way, output.gradient(way.motion, time), present.beyond) for output in outputs]
    return np.array([budget.total(rows) for rows in found])


def _way(present: Present) -> budget.Way:
    array, blocks = present.array, present.blocks
    y = perfect(array, present.motion)
    if present.fit is None:
        word = at_their_word(array, blocks.time, y, blocks.sigma, present.rest_index)
        if present.smoother is None:
            return word
        return word.smooth(replace(present.smoother, sigma=noise_of_rates(array, blocks.sigma)))
    weight = np.broadcast_to(1.0 / blocks.sigma, y.shape).copy()
    data = Data(array, blocks.time, y, weight, calibration.prior_sds(array), present.fit.data.still)
    return smoothed(trajectory.fit(data, present.fit.omega, iterations=1))
