"""Does a triax more than needed read what the other channels predict for it? HIC and GSI decide [Alem77, sled test].

The paper's deviations, HIC 0.29 % and GSI 0.80 %, are the tolerance. The instrument's own uncertainty may be larger
than that; then a deviation beyond the tolerance proves nothing (JCGM 106: guard band U, k = 2), nor does one of which U
is not known. U has two parts: that of the prediction by its method (motion_spread.py), and that of the triax, from its
stated gain, alignment and position by Monte Carlo (its zero is taken off before the event).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.estimate.calibration import perpendiculars
from nineaudit.estimate.motion import Motion
from nineaudit.finding import COVERAGE_FACTOR, Verdict
from nineaudit.motion import DRAWS, Kinematics, Start, motion_of
from nineaudit.motion_spread import SEED
from nineaudit.physics import injury, kinematics, rigid_body
from nineaudit.recording import Recording
from nineaudit.rig import Point
from nineaudit.schemes.extra_triax import GSI_TOLERANCE, HIC_TOLERANCE, WINDOW, Prediction, check, triax_columns


@dataclass(frozen=True)
class Judged:
    """One deviation, predicted over measured less 1, with its expanded uncertainty `U` (k = 2; None: not known)."""

    name: str
    measured: float
    predicted: float
    tolerance: float
    U: float | None

    @property
    def deviation(self) -> float:
        return self.predicted / self.measured - 1.0

    @property
    def verdict(self) -> Verdict:
        """PASS within the tolerance, FAIL beyond tolerance and U, INCONCLUSIVE between, or where U is not known."""
        size = abs(self.deviation)
        if size <= self.tolerance:
            return Verdict.PASS
        return Verdict.INCONCLUSIVE if self.U is None or size <= self.tolerance + self.U else Verdict.FAIL


@dataclass(frozen=True)
class TriaxCheck:
    """HIC and GSI of the `channels`, judged, and the largest difference in acceleration over the peak, `worst`."""

    channels: tuple[str, ...]
    judged: tuple[Judged, ...]
    worst: float


def check_triax(case: Case, prefix: str, method: str = "map", start: Start | None = None) -> TriaxCheck:
    """The triax whose channels begin with `prefix` against the motion that the other channels give.

    Raises ConfigurationError: no such triax. EstimationError: the other channels do not give the motion.
    """
    columns = triax_columns(case.array, prefix)
    middle = case.array.positions[columns].mean(axis=0)
    others = motion_of(Case(_without(case.recording, columns, middle)), method, start or Start())
    motion = Motion(others.omega, others.alpha, others.a0, others.method)
    found = check(case.array, columns, case.time, case.readings, motion)
    u_hic, u_gsi = _uncertainties(case, columns, others, found)
    judged = (
        Judged("HIC36", found.hic_measured, found.hic_predicted, HIC_TOLERANCE, u_hic),
        Judged("GSI", found.gsi_measured, found.gsi_predicted, GSI_TOLERANCE, u_gsi),
    )
    return TriaxCheck(tuple(case.array.channels[c] for c in columns), judged, found.worst)


def _uncertainties(
    case: Case, columns: Sequence[int], others: Kinematics, found: Prediction
) -> tuple[float | None, float | None]:
    """U of the relative deviations of HIC and GSI; None where the method gives no uncertainty."""
    of_prediction = [others.values[name].u for name in ("HIC36", "GSI")]
    of_triax = _triax_u(case, columns, others)
    measured = (found.hic_measured, found.gsi_measured)
    hic, gsi = (
        None if u is None else COVERAGE_FACTOR * float(np.hypot(u / value, own))
        for u, own, value in zip(of_prediction, of_triax, measured, strict=True)
    )
    return hic, gsi


def _triax_u(case: Case, columns: Sequence[int], others: Kinematics) -> tuple[float, float]:
    """Relative standard uncertainty of the measured HIC and GSI, from what a triax of the stated uncertainties, drawn
    DRAWS times, would read in the motion of the others."""
    array, rng = case.array.select(columns), np.random.default_rng(SEED)
    sd = {name: array.values(f"u_{name}") for name in ("gain", "alignment", "position")}
    force = rigid_body.acceleration_at(array.positions.mean(axis=0), others.a0, others.alpha, others.omega)
    across, solve = perpendiculars(array), np.linalg.inv(array.axes).T
    ideal = force @ array.axes.T
    scores = []
    for draw in range(DRAWS + 1):
        z = rng.standard_normal((3, 6)) if draw else np.zeros((3, 6))
        tilts = np.einsum("it,itj->ij", sd["alignment"][:, None] * z[:, 1:3], across)
        y = ideal * (1.0 + sd["gain"] * z[:, 0]) + force @ tilts.T
        y += _displaced(others, array.axes, sd["position"][:, None] * z[:, 3:])
        size = kinematics.resultant(y @ solve)
        scores.append((injury.hic(size, case.time, WINDOW).value, injury.gsi(size, case.time)))
    relative = np.array(scores[1:]) / np.array(scores[0]) - 1.0
    hic, gsi = np.sqrt((relative**2).mean(axis=0))
    return float(hic), float(gsi)


def _displaced(motion: Kinematics, axes: FloatArray, errors: FloatArray) -> FloatArray:
    """(n,k) change of the readings along `axes` (k,3) of sensors displaced by `errors` (k,3) m."""
    at_rest = np.zeros_like(motion.omega)
    there = [
        rigid_body.acceleration_at(e, at_rest, motion.alpha, motion.omega) @ n
        for e, n in zip(errors, axes, strict=True)
    ]
    return np.stack(there, axis=1)


def _without(recording: Recording, columns: Sequence[int], point: FloatArray) -> Recording:
    """The recording less some channels, its rig with one point."""
    left = recording.only([k for k in range(len(recording.channels)) if k not in columns])
    return replace(left, rig=replace(left.rig, points=(Point("triax", point),)))
