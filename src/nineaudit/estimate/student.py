"""The whole-record fit where knocks hit single samples harder than the budget says: multivariate Student errors.

A knock is in all accelerometers of a sample at once, and how hard it hits is not known. With a common scale λ for each
kind of sensor in each sample, ν/λ² drawn from χ² with ν degrees of freedom, the fit is a sequence of weighted ones,
σ² multiplied by

    λ² = (ν + χ²)/(ν + m),    χ² the cost of the sample and m its expectation

[Lange, Little & Taylor, J. Am. Stat. Assoc. 84 (1989) 881, who advise ν = 4 where it is not fitted]. The scale belongs
to all channels of the kind: it hides no fault of one channel from a fit that has that channel left out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.estimate.between_samples import coarse
from nineaudit.estimate.model import Data
from nineaudit.estimate.motion import Motion, bridge, estimate_motion
from nineaudit.estimate.point import Point
from nineaudit.estimate.start import first_omega
from nineaudit.estimate.trajectory import ROUGH, Tolerance, fit

FREEDOM = 4.0
SPENT = (4, 2)
"""Of the six readings of a sample that determine a0 and ω, those of the accelerometers and of the rate sensors."""
PASSES, STEPS, LAST_STEPS = 3, 3, 15
ON_THE_WAY = Tolerance(1e-3, 1e-4)


@dataclass(frozen=True, eq=False)
class StudentFit:
    """Where the fit of `data`, with the weights it ended at, came to (`at`); the factor `knock` (n,k) on each σ; the
    cost per degree of freedom of each sample and kind of sensor, `by_sample` (n,2), NaN where none is to spare; and
    whether it `converged`."""

    data: Data
    at: Point
    knock: FloatArray
    by_sample: FloatArray
    converged: bool

    @property
    def statistic(self) -> float:
        """Median cost per degree of freedom of a sample: knocks, in fewer than half of them, do not count."""
        return float(np.nanmedian(self.by_sample))


def first_fit(data: Data) -> StudentFit:
    """From the rate sensors, which must span three axes. EstimationError where ω cannot be told."""
    sigma = 1.0 / np.maximum(data.weight.max(axis=0), 1e-300)
    readings = np.where(data.weight > 0, data.readings, np.nan)
    used = np.flatnonzero(data.used)
    array = data.array.select(used.tolist())
    motion = estimate_motion(array, data.time, bridge(readings[:, used], data.time), sigma[used])
    return student_fit(data, first_omega(data), motion, np.zeros(len(data.channel)))


def refit(data: Data, near: StudentFit) -> StudentFit:
    """The fit of other `data` that begins where another ended, with its calibration errors where both have them."""
    known = zip(*(a.tolist() for a in near.data.active), strict=True)
    place = dict(zip(known, near.at.theta.tolist(), strict=False))
    theta = [place.get(pair, 0.0) for pair in zip(*(a.tolist() for a in data.active), strict=True)]
    return student_fit(data, near.at.omega, near.at.motion, np.array(theta), PASSES - 1)


def student_fit(data: Data, omega: FloatArray, motion: Motion, theta: FloatArray, passes: int = PASSES) -> StudentFit:
    """Fit of `data` from ω (n+1,3) at the nodes and θ (q,), what happens between samples about a first `motion`."""
    knock = np.ones_like(data.weight)
    for step in range(passes + 1):
        base, last = coarse(data, motion), step == passes
        weighted = replace(base, weight=base.weight / knock)
        found = fit(weighted, omega, theta, LAST_STEPS if last else STEPS, ROUGH if last else ON_THE_WAY)
        at = found.point
        omega, theta, motion = at.omega, at.theta, at.motion
        knock, by_sample = _scales(base, at)
    return StudentFit(weighted, at, knock, by_sample, found.converged)


def kinds(data: Data) -> tuple[BoolArray, BoolArray]:
    """Accelerometers, rate sensors."""
    held = data.array.is_accelerometer
    return held, ~held


def _scales(base: Data, at: Point) -> tuple[FloatArray, FloatArray]:
    """(n,k) λ and (n,2) χ²/m, with the weights before knocks."""
    off = (base.readings - at.correction - at.ideal) * base.weight
    knock, by_sample = np.ones_like(off), np.full((len(off), 2), np.nan)
    for i, (kind, spent) in enumerate(zip(kinds(base), SPENT, strict=True)):
        spare = np.maximum((base.weight[:, kind] > 0).sum(axis=1) - spent, 0).astype(np.float64)
        chi = (off[:, kind] ** 2).sum(axis=1)
        scale = np.where(spare > 0, (FREEDOM + chi) / (FREEDOM + spare), 1.0)
        knock[:, kind] = np.sqrt(scale)[:, None]
        by_sample[spare > 0, i] = chi[spare > 0] / spare[spare > 0]
    return knock, by_sample
