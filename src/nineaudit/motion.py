"""A recording's motion, whole: ω, α, attitude; acceleration, velocity, position of points; injury values; their u.

The method gives ω, α and a0 (METHODS); the rest is the same for all of them (physics/laboratory.py). Uncertainties are
those of motion_spread.py: of the whole-record fit from its posterior, of any other method from the instrument.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.errors import EstimationError
from nineaudit.estimate import parity
from nineaudit.estimate.motion import Motion, has_rates
from nineaudit.estimate.samples import Samples
from nineaudit.gaps import Gaps, gaps, long, refused
from nineaudit.impact import unit_of
from nineaudit.motion_methods import ACCELEROMETERS_ONLY, AT_REST, Method, Start, by_fit, method_named
from nineaudit.motion_spread import Spread, by_instruments, by_posterior, chained, points_of, whole
from nineaudit.physics import laboratory
from nineaudit.physics.laboratory import Path
from nineaudit.schemes import ninacc
from nineaudit.schemes.requirements import require_readings
from nineaudit.wrong_unit import wrong_unit

__all__ = ["Kinematics", "Start", "Value", "motion_of"]

DRAWS = 64
"""Monte Carlo draws (JCGM 101) for the uncertainties, 9 % of each of them."""


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
    "NAME a" (body axes), "NAME v" and "NAME x" (laboratory); empty where none can be told. `notes` in words; those of
    them that make the numbers doubtful are `warnings`. `wrong_unit`: whether the first of these names a wrong unit.
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
    warnings: tuple[str, ...] = ()
    wrong_unit: bool = False

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
    at, used, motion, said = _solved(case, method, solve, start)
    found = chained(used, case.time, motion, start, None if used.rest is None else used.rest.start)
    (u, value_u), of_u = _spread(used, solve, at, motion, start, count)
    unit = None if at is None or at.fit.statistic <= case.statistic_limit else wrong_unit(case)
    warnings = () if at is None else _warnings(case, at, unit)
    return Kinematics(
        time=case.time,
        omega=motion.omega,
        alpha=motion.alpha,
        a0=found.motion.a0,
        attitude=found.attitude,
        points={point.name: point.position for point in points_of(case)},
        paths=found.paths,
        values={name: Value(value, unit_of(name), value_u.get(name)) for name, value in found.values.items()},
        method=motion.method,
        u=u,
        notes=(*warnings, *said, *_notes(used, start), *of_u),
        warnings=warnings,
        wrong_unit=unit is not None,
    )


def _solved(
    case: Case, method: str, solve: Method, start: Start
) -> tuple[Samples | None, Case, Motion, tuple[str, ...]]:
    """The motion, of the fit its samples, the case with the channels that were used, and what is to be said of gaps."""
    missing = gaps(case.recording)
    if method == "map" and (parity.tells_alpha(case.array) or not has_rates(case.array)):
        at = by_fit(case, start)
        return at, case, whole(at.motion, case.time), tuple(f"{one}; absent to the fit" for one in missing)
    if method in ACCELEROMETERS_ONLY:
        missing = tuple(one for one in missing if case.array[one.channel].kind == "accelerometer")
    torn = long(missing)
    if not torn:
        return None, case, solve(case, start), _bridged(missing)
    left = {one.channel for one in torn}
    used = Case(case.recording.only([k for k, c in enumerate(case.array.channels) if c not in left]))
    try:
        motion = solve(used, start)
    except EstimationError as error:
        raise refused(torn, str(error)) from error
    others = tuple(one for one in missing if one.channel not in left)
    return None, used, motion, (*(f"{one}; the channel is left out" for one in torn), *_bridged(others))


def _bridged(missing: tuple[Gaps, ...]) -> tuple[str, ...]:
    return tuple(f"{one}; bridged by a straight line" for one in missing if one.count < one.total)


def _spread(
    case: Case, solve: Method, at: Samples | None, found: Motion, start: Start, count: int
) -> tuple[Spread, tuple[str, ...]]:
    """The uncertainties, and what is to be said of them."""
    if count < 1:
        return ({}, {}), ()
    if at is not None:
        return by_posterior(case, at, start, count), ()
    try:
        spread = by_instruments(case, solve, found, start, count)
    except EstimationError as error:
        fails = "on readings changed within the rig's uncertainties the method fails"
        return ({}, {}), (f"no uncertainties: {fails}: {error}",)
    said = "gain, alignment, position, timing, noise, and zero where none is taken off; not of the method itself"
    return spread, (f"u: {count} instruments drawn from the rig's uncertainties of {said}",)


def _warnings(case: Case, at: Samples, unit: str | None) -> tuple[str, ...]:
    """What makes the numbers of the fit doubtful, the `unit` that is probably wrong before all."""
    said = []
    if at.fit.statistic > case.statistic_limit:
        cost = f"{at.fit.statistic:.3g} per degree of freedom, at most {case.statistic_limit:.3g} expected"
        said = [f"{unit}: all numbers below are wrong until it is put right"] if unit else []
        said.append(f"the channels contradict one another (cost {cost}): `nineaudit check` before numbers are used")
    held = case.array.is_accelerometer & case.valid.any(axis=0)
    poor = ninacc.poor(case.array.positions[held], case.array.axes[held]) if held.any() else ""
    if not at.fit.converged:
        why = f": {poor}" if poor else ": take these numbers with caution"
        said.append(f"the whole-record fit has not settled{why}")
    elif poor:
        said.append(poor)
    return tuple(said)


def _notes(case: Case, start: Start) -> tuple[str, ...]:
    """What a reader must know of how the numbers came about."""
    rest = case.rest
    zero = (
        "no quiet interval: no zero was taken off"
        if rest is None
        else f"zero taken off over {case.time[rest.start]:.4g} to {case.time[rest.stop - 1]:.4g} s"
    )
    left = "as it is in the readings" if rest is None else "as the zero leaves it, up to 2 g when the body turns over"
    pull = "gravity put right by the initial orientation" if start.gravity else f"gravity left {left} (see --gravity)"
    return (zero, pull)
