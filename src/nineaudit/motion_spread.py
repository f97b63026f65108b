"""From ω, α, a0 to attitude, paths and reported values, and how far errors of the instrument spread them (JCGM 101).

By the whole-record fit: motions drawn from its posterior, on the blocks of the fit, and for a and α of a single sample
the white noise that a block's mean has not. By any other method: the instrument drawn from the rig's uncertainties and
noise (instrument_draws.py), the zero taken off again, and the method run on what it would have read. u is the root mean
square of what comes out less the motion itself, so that it holds the bias by which noise raises a peak.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.estimate.draws import draws
from nineaudit.estimate.motion import Motion, bridge
from nineaudit.estimate.samples import Samples, at_samples
from nineaudit.impact import reported
from nineaudit.instrument_draws import readings_drawn
from nineaudit.motion_methods import Start
from nineaudit.physics import kinematics, laboratory, rigid_body
from nineaudit.physics.laboratory import Path
from nineaudit.rig import Point
from nineaudit.units import G0

SEED: Final = 19770046
DOWN: Final = np.array([0.0, 0.0, G0])
"""Gravity in the laboratory, m/s²: +z is down (SAE J1733)."""
ORIGIN: Final = Point("origin", np.zeros(3))
THINNED: Final = 1000
"""Samples, about, on which the spread of attitude, paths and values by instruments is worked out."""
Spread = tuple[dict[str, FloatArray], dict[str, float]]
"""Standard uncertainties of the curves, (n,3) at every sample, and of the reported values, by name."""


@dataclass(frozen=True, eq=False)
class Chained:
    """`motion` with gravity put right, `attitude` (n,3,3), `paths` of the points, and reported `values`."""

    motion: Motion
    attitude: FloatArray
    paths: Mapping[str, Path]
    values: Mapping[str, float]


def points_of(case: Case) -> tuple[Point, ...]:
    """The points that the rig names, or the origin."""
    return case.recording.rig.points or (ORIGIN,)


def chained(case: Case, time: FloatArray, motion: Motion, start: Start, rest: int | None) -> Chained:
    """Attitude, acceleration less gravity, paths of the points, what is reported. `rest`: sample of the zero."""
    attitude = kinematics.orientation(motion.omega, time, laboratory.attitude_of(np.asarray(start.euler)))
    a0 = laboratory.without_gravity(motion.a0, attitude, DOWN, rest) if start.gravity else motion.a0
    origin = laboratory.origin_path(time, a0, attitude, np.asarray(start.velocity), np.asarray(start.position))
    paths = {
        point.name: laboratory.point_path(point.position, origin, motion.alpha, motion.omega, attitude)
        for point in points_of(case)
    }
    found = Motion(motion.omega, motion.alpha, a0, motion.method)
    return Chained(found, attitude, paths, reported(case, time, found))


def whole(motion: Motion, time: FloatArray) -> Motion:
    """The motion with the samples bridged at which the valid readings do not tell a0 or α."""
    return Motion(motion.omega, bridge(motion.alpha, time), bridge(motion.a0, time), motion.method)


def by_posterior(case: Case, at: Samples, start: Start, count: int) -> Spread:
    """Of the whole-record fit, from `count` draws of its posterior."""
    blocks, rng = case.condensed, np.random.default_rng(SEED)
    rest = None if case.rest is None else min(case.rest.start // blocks.length, len(blocks.time) - 1)

    def there(drawn: Samples) -> Chained:
        return chained(case, blocks.time, whole(drawn.motion, blocks.time), start, rest)

    def each() -> Iterator[Chained]:
        for drawn in draws(at.fit, count, rng):
            noisy = blocks.readings + blocks.sigma * rng.standard_normal(blocks.readings.shape)
            yield there(at_samples(drawn, blocks.time, noisy, blocks.sigma, at.fit))

    itself = there(at_samples(at.fit, blocks.time, blocks.readings, blocks.sigma, at.fit))
    squares, of_values = _mean_squares(itself, each(), count)
    white = _white(case, at)
    carried = {name: _carried(square, blocks.time, case.time) for name, square in squares.items()}
    return {name: np.sqrt(square + white.get(name, 0.0)) for name, square in carried.items()}, of_values


def by_instruments(
    case: Case, solve: Callable[[Case, Start], Motion], found: Motion, start: Start, count: int
) -> Spread:
    """Of any method `solve`, about the motion `found` by it, from `count` draws of the instrument; attitude, paths and
    values on every so many samples (THINNED).

    EstimationError where the method fails on readings changed within the rig's uncertainties.
    """
    stride = max(1, len(case.time) // THINNED)
    rest = None if case.rest is None else case.rest.start // stride
    rng, stated = np.random.default_rng(SEED), case.recording.rig
    if case.rest is not None:  # the zero of a drawn record is taken where that of the record was
        stated = replace(stated, pre_trigger=(case.rest.t_start, case.rest.t_end))

    def there(motion: Motion) -> Chained:
        some = Motion(motion.omega[::stride], motion.alpha[::stride], motion.a0[::stride], motion.method)
        return chained(case, case.time[::stride], some, start, rest)

    def each() -> Iterator[Chained]:
        for readings in readings_drawn(case, found, count, rng):
            yield there(solve(Case(replace(case.recording, readings=readings, rig=stated)), start))

    squares, of_values = _mean_squares(there(found), each(), count)
    carried = {name: _carried(square, case.time[::stride], case.time) for name, square in squares.items()}
    return {name: np.sqrt(square) for name, square in carried.items()}, of_values


def _mean_squares(itself: Chained, drawn: Iterable[Chained], count: int) -> Spread:
    squares = {name: np.zeros_like(difference) for name, difference in _differences(itself, itself)}
    of_values = dict.fromkeys(itself.values, 0.0)
    for one in drawn:
        for name, difference in _differences(itself, one):
            squares[name] += difference**2 / count
        for name, value in one.values.items():
            of_values[name] += (value - itself.values[name]) ** 2 / count
    return squares, {name: square**0.5 for name, square in of_values.items()}


def _differences(one: Chained, other: Chained) -> Iterator[tuple[str, FloatArray]]:
    """Each curve of `Kinematics.u`, other less one (n,3); of the attitude, the rotation vector in body axes."""
    from scipy.spatial.transform import Rotation

    turn = np.einsum("nji,njk->nik", one.attitude, other.attitude)
    yield "omega", other.motion.omega - one.motion.omega
    yield "alpha", other.motion.alpha - one.motion.alpha
    yield "attitude", np.asarray(Rotation.from_matrix(turn).as_rotvec())
    for name, path in one.paths.items():
        yield f"{name} a", other.paths[name].a_body - path.a_body
        yield f"{name} v", other.paths[name].v - path.v
        yield f"{name} x", other.paths[name].x - path.x


def _white(case: Case, at: Samples) -> dict[str, FloatArray]:
    """(n,3) variance of α and of a at each point that a single sample's noise has beyond that of a block's mean."""
    extra = np.maximum(case.sigma**2 - case.condensed.sigma**2, 0.0)
    out = {"alpha": ((at.solver[:, 3:] ** 2) @ extra)[at.which]}
    for point in points_of(case):
        rows = rigid_body.design(np.tile(point.position, (3, 1)), np.eye(3))
        out[f"{point.name} a"] = (((rows @ at.solver) ** 2) @ extra)[at.which]
    return out


def _carried(values: FloatArray, at: FloatArray, time: FloatArray) -> FloatArray:
    return np.stack([np.interp(time, at, values[:, i]) for i in range(values.shape[1])], axis=1)
