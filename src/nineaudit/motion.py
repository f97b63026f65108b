"""A recording's motion, whole: ω, α, attitude; acceleration, velocity, position of points; injury values; their u.

The method gives ω, α and a0 (METHODS); the rest is the same for all of them (physics/laboratory.py). Uncertainties come
with the whole-record fit only: root mean square of what motions drawn from its posterior give (JCGM 101, as in
impact.py), on the blocks of the fit, and for a and α of a single sample the white noise that a block's mean has not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.estimate.draws import draws
from nineaudit.estimate.motion import Motion, bridge
from nineaudit.estimate.samples import Samples, at_samples
from nineaudit.estimate.trajectory import Fit
from nineaudit.impact import reported, unit_of
from nineaudit.motion_methods import AT_REST, Start, by_fit, method_named
from nineaudit.physics import kinematics, laboratory, rigid_body
from nineaudit.physics.laboratory import Path
from nineaudit.rig import Point
from nineaudit.schemes.requirements import require_readings
from nineaudit.units import G0

__all__ = ["Kinematics", "Start", "Value", "motion_of"]

DRAWS, SEED = 64, 19770046
"""Monte Carlo draws (JCGM 101) for the uncertainties, 9 % of each of them, and their seed."""
DOWN: Final = np.array([0.0, 0.0, G0])
"""Gravity in the laboratory, m/s²: +z is down (SAE J1733)."""
ORIGIN: Final = Point("origin", np.zeros(3))


@dataclass(frozen=True)
class Value:
    """A number that is reported, in `unit`, with its standard uncertainty `u`, None where the method gives none."""

    value: float
    unit: str
    u: float | None = None


@dataclass(frozen=True, eq=False)
class Kinematics:
    """`time` (n,) s; body-frame `omega`, `alpha`, and `a0`, the acceleration of the origin, (n,3) SI; `attitude` C
    (n,3,3) body to laboratory; `points` (3,) m of the body and their `paths`, by name; reported `values` by name;
    `method` in words.

    `u`: standard uncertainties (n,3) of "omega", "alpha", "attitude" (rad, about the body axes), and of every point
    "NAME a" (body axes), "NAME v" and "NAME x" (laboratory); empty where the method gives none. `notes` in words.
    """

    time: FloatArray
    omega: FloatArray
    alpha: FloatArray
    a0: FloatArray
    attitude: FloatArray
    points: Mapping[str, FloatArray]
    paths: Mapping[str, Path]
    values: Mapping[str, Value]
    method: str
    u: Mapping[str, FloatArray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @cached_property
    def euler(self) -> FloatArray:
        """Yaw, pitch, roll (n,3) rad."""
        return laboratory.euler_of(self.attitude)

    @cached_property
    def quaternion(self) -> FloatArray:
        """x, y, z, w (n,4)."""
        return laboratory.quaternion_of(self.attitude)


def motion_of(case: Case, method: str = "map", start: Start = AT_REST, count: int = DRAWS) -> Kinematics:
    """The motion by a method of motion_methods.METHODS, of the points that the rig names, else of the origin.

    `start`: what is known of the first sample. `count` draws for the uncertainties, 0 for none. Raises
    ConfigurationError: unknown method. EstimationError: the array or the recording does not give the motion.
    """
    solve = method_named(method)
    require_readings(case.array, case.recording.readings)
    at = by_fit(case, start) if method == "map" else None
    motion = _whole(at.motion, case.time) if at is not None else solve(case, start)
    rest = None if case.rest is None else case.rest.start
    found, paths = _chain(case, case.time, motion, start, rest)
    values = reported(case, case.time, found.motion)
    u, value_u = ({}, {}) if at is None or count < 1 else _uncertainty(case, at, start, count)
    return Kinematics(
        time=case.time,
        omega=motion.omega,
        alpha=motion.alpha,
        a0=found.motion.a0,
        attitude=found.attitude,
        points={point.name: point.position for point in points_of(case)},
        paths=paths,
        values={name: Value(value, unit_of(name), value_u.get(name)) for name, value in values.items()},
        method=motion.method,
        u=u,
        notes=_notes(case, start, at),
    )


@dataclass(frozen=True, eq=False)
class _Found:
    """Motion with gravity put right, and attitude."""

    motion: Motion
    attitude: FloatArray


def points_of(case: Case) -> tuple[Point, ...]:
    """The points that the rig names, or the origin."""
    return case.recording.rig.points or (ORIGIN,)


def _chain(
    case: Case, time: FloatArray, motion: Motion, start: Start, rest: int | None
) -> tuple[_Found, dict[str, Path]]:
    """Attitude, acceleration less gravity, and the path of every point."""
    attitude = kinematics.orientation(motion.omega, time, laboratory.attitude_of(np.asarray(start.euler)))
    a0 = laboratory.without_gravity(motion.a0, attitude, DOWN, rest) if start.gravity else motion.a0
    origin = laboratory.origin_path(time, a0, attitude, np.asarray(start.velocity), np.asarray(start.position))
    paths = {
        point.name: laboratory.point_path(point.position, origin, motion.alpha, motion.omega, attitude)
        for point in points_of(case)
    }
    return _Found(Motion(motion.omega, motion.alpha, a0, motion.method), attitude), paths


def _uncertainty(case: Case, at: Samples, start: Start, count: int) -> tuple[dict[str, FloatArray], dict[str, float]]:
    """Standard uncertainties of the curves, at every sample, and of the reported values."""
    blocks = case.condensed
    rest = None if case.rest is None else min(case.rest.start // blocks.length, len(blocks.time) - 1)

    def chain(fit: Fit, readings: FloatArray) -> tuple[_Found, dict[str, Path]]:
        there = at_samples(fit, blocks.time, readings, blocks.sigma, at.fit).motion
        return _chain(case, blocks.time, _whole(there, blocks.time), start, rest)

    def said(found: _Found) -> dict[str, float]:
        return reported(case, blocks.time, found.motion)

    rng, readings = np.random.default_rng(SEED), blocks.readings
    itself, its_paths = chain(at.fit, readings)
    its_values = said(itself)
    squares = {name: np.zeros((len(blocks.time), 3)) for name, _ in _differences(itself, its_paths, itself, its_paths)}
    of_values = dict.fromkeys(its_values, 0.0)
    for drawn in draws(at.fit, count, rng):
        found, paths = chain(drawn, readings + blocks.sigma * rng.standard_normal(readings.shape))
        for name, difference in _differences(itself, its_paths, found, paths):
            squares[name] += difference**2 / count
        for name, value in said(found).items():
            of_values[name] += (value - its_values[name]) ** 2 / count
    white = _white(case, at)
    carried = {name: _carried(square, blocks.time, case.time) for name, square in squares.items()}
    u = {name: np.sqrt(square + white.get(name, 0.0)) for name, square in carried.items()}
    return u, {name: square**0.5 for name, square in of_values.items()}


def _differences(
    one: _Found, paths: Mapping[str, Path], other: _Found, others: Mapping[str, Path]
) -> Iterator[tuple[str, FloatArray]]:
    """Each curve of `Kinematics.u`, other less one (n,3); of the attitude, the rotation vector in body axes."""
    from scipy.spatial.transform import Rotation

    turn = np.einsum("nji,njk->nik", one.attitude, other.attitude)
    yield "omega", other.motion.omega - one.motion.omega
    yield "alpha", other.motion.alpha - one.motion.alpha
    yield "attitude", np.asarray(Rotation.from_matrix(turn).as_rotvec())
    for name, path in paths.items():
        yield f"{name} a", others[name].a_body - path.a_body
        yield f"{name} v", others[name].v - path.v
        yield f"{name} x", others[name].x - path.x


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


def _whole(motion: Motion, time: FloatArray) -> Motion:
    """The motion with the samples bridged at which the valid readings do not tell a0 or α."""
    return Motion(motion.omega, bridge(motion.alpha, time), bridge(motion.a0, time), motion.method)


def _notes(case: Case, start: Start, at: Samples | None) -> tuple[str, ...]:
    """What a reader must know of how the numbers came about."""
    doubts = []
    if at is not None and at.fit.statistic > case.statistic_limit:
        cost = f"{at.fit.statistic:.3g} per degree of freedom, at most {case.statistic_limit:.3g} expected"
        doubts = [f"the channels contradict one another (cost {cost}): `nineaudit check` before these numbers are used"]
    if at is not None and not at.fit.converged:
        doubts.append("the whole-record fit has not settled: take these numbers with caution")
    rest = case.rest
    zero = (
        "no quiet interval: no zero was taken off"
        if rest is None
        else f"zero taken off over {case.time[rest.start]:.4g} to {case.time[rest.stop - 1]:.4g} s"
    )
    left = "as it is in the readings" if rest is None else "as the zero leaves it, up to 2 g when the body turns over"
    pull = "gravity put right by the initial orientation" if start.gravity else f"gravity left {left} (see --gravity)"
    return (*doubts, zero, pull)
