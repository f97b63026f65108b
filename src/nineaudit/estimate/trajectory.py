"""The whole-record maximum a posteriori fit of a rigid motion to any set of accelerometers and rate sensors.

Gauss–Newton on the cost of point.py. The ω block of the normal equations is block-tridiagonal, θ a dense border (Schur
complement); everything is linear in the length of the record (METHODS.md 2). Readings that are not valid are simply
absent.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.estimate.model import Data
from nineaudit.estimate.motion import Motion
from nineaudit.estimate.normal import eliminate, normal_equations
from nineaudit.estimate.point import Point, point

ITERATIONS, SMALLEST_STEP, ROUNDING = 25, 1e-3, 1e-10
NOTHING, IDLE = 1.0, 3
"""Of twice the negative log posterior, and steps: the normal equations leave out that the slope on which a time skew
acts moves with ω. Where skews are large they promise, step after step, a little that is not there; a promise below
NOTHING that IDLE steps did not keep, or none can, is not waited for."""


class Tolerance(NamedTuple):
    """A step is the last when the normal equations promise it less than `gain` of the cost, or when it gains what they
    promised to `promise` of it: the cost is then quadratic about here, and the next would gain less than what is
    missing. What it gained alone says nothing: a step cut short in a bent valley gains little far from the bottom."""

    gain: float
    promise: float


EXACT = Tolerance(1e-5, 1e-7)
ROUGH = Tolerance(1e-4, 3e-5)
"""Of a fit that is only compared: a wrong hypothesis need not settle to be worse."""


@dataclass(frozen=True, eq=False)
class Fit:
    """The maximum a posteriori motion: `omega` (n+1,3) at the nodes, `theta` (q,) in prior standard deviations, the
    `cost` (expectation `data.dof`), whether it `converged`, the `iterations`, and `log_det` of the posterior precision
    of θ, as of the last step."""

    data: Data
    omega: FloatArray
    theta: FloatArray
    cost: float
    converged: bool
    iterations: int
    log_det: float

    @property
    def statistic(self) -> float:
        """Cost per degree of freedom."""
        return self.cost / max(self.data.dof, 1)

    @property
    def point(self) -> Point:
        """Where the fit ended, with all that follows from it."""
        return point(self.data, self.omega, self.theta)

    @cached_property
    def correction(self) -> FloatArray:
        """(n,k) what the fitted calibration errors and fault shapes add to the readings."""
        return self.point.correction

    @cached_property
    def motion(self) -> Motion:
        """ω, α and a0 at the samples."""
        return self.point.motion

    @cached_property
    def ideal(self) -> FloatArray:
        """(n,k) readings of a perfect instrument in the fitted motion."""
        return self.point.ideal


def fit(
    data: Data,
    start: FloatArray,
    theta: FloatArray | None = None,
    iterations: int = ITERATIONS,
    tolerance: Tolerance = EXACT,
    hopeless: float = np.inf,
) -> Fit:
    """Minimise the cost from ω `start` (n+1,3) until it settles to `tolerance`.

    A fit that has not settled within `iterations`, or after three neither costs nor is promised less than `hopeless`,
    says so: `converged`. EstimationError where ω is not determined.
    """
    here, idle = point(data, start, np.zeros(len(data.channel)) if theta is None else theta), 0
    for iteration in range(1, iterations + 1):
        solved = eliminate(normal_equations(here))
        step_theta = np.asarray(np.linalg.solve(solved.schur, solved.pull), dtype=np.float64)
        promised = solved.fall + float(solved.pull @ step_theta)
        previous, here = _descended(here, solved.step(step_theta), step_theta)
        stuck, size = here.cost > previous * (1.0 + ROUNDING), here.cost + data.dof
        missed = abs(previous - promised - here.cost)
        idle = idle + 1 if promised <= NOTHING and abs(previous - here.cost) <= tolerance.gain * size else 0
        converged = promised <= tolerance.gain * size or missed <= tolerance.promise * size
        converged = converged or idle >= IDLE or (stuck and promised <= NOTHING)
        lost = iteration >= 3 and min(previous - promised, here.cost) > hopeless
        if converged or stuck or lost:
            break
    return Fit(data, here.omega, here.theta, here.cost, converged, iteration, log_determinant(solved.schur))


def _descended(here: Point, step_omega: FloatArray, step_theta: FloatArray) -> tuple[float, Point]:
    """(cost before, where the largest part of a step leads that does not cost more).

    What time skews do is told by the columns of the point before (point()), so that a point that is looked at again
    with its own may cost more than it seemed to: a step is held against that cost.
    """
    scale, previous = 1.0, here.cost
    while True:
        trial = point(here.data, here.omega + scale * step_omega, here.theta + scale * step_theta, here.columns)
        if trial.cost > previous * (1.0 + ROUNDING) and scale == 1.0:
            previous = max(previous, point(here.data, here.omega, here.theta, here.columns).cost)
        if trial.cost <= previous * (1.0 + ROUNDING) or scale < SMALLEST_STEP:
            return previous, trial
        scale *= 0.25


def log_determinant(matrix: FloatArray) -> float:
    """ln |det| of a symmetric positive definite matrix."""
    return float(np.linalg.slogdet(matrix)[1])
