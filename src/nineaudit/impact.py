"""What a fault does to the numbers that a laboratory reports, before and after the repair."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.errors import EstimationError
from nineaudit.estimate.condense import block_means
from nineaudit.estimate.draws import draws
from nineaudit.estimate.motion import Motion, bridge
from nineaudit.estimate.samples import at_samples
from nineaudit.estimate.trajectory import Fit
from nineaudit.physics import injury, kinematics, rigid_body
from nineaudit.reconstruct import Reconstruction
from nineaudit.units import G0

DRAWS, SEED = 64, 20090402
"""Monte Carlo draws (JCGM 101) for the uncertainties, 9 % of each of them, and their seed."""
IN_THE_INSTRUMENT = ("cross_axis", "position")
"""Faults that the fit has as calibration errors of the channel."""


@dataclass(frozen=True)
class Impact:
    """`before` and `after` the repair in `unit`, with the standard uncertainty `u` of the value after it."""

    before: float
    after: float
    u: float
    unit: str


UNITS = {"peak α": "rad/s^2", "peak ω": "rad/s", "BrIC": "1"}
_POINT_UNITS = {
    "peak a": "g_0",
    "HIC15": "g_0^2.5 s",
    "HIC36": "g_0^2.5 s",
    "GSI": "g_0^2.5 s",
    "a3ms": "g_0",
}


def reported(case: Case, time: FloatArray, motion: Motion) -> dict[str, float]:
    """What a laboratory reports of a motion: peak α, ω, BrIC; peak a, HIC15, HIC36, GSI, a3ms at every point.

    At the array's origin where the rig names no point. A single point's values carry no name of it.
    """
    return {name: float(values[0]) for name, values in _of_each(case, time, [motion]).items()}


def _of_each(case: Case, time: FloatArray, motions: Sequence[Motion]) -> dict[str, FloatArray]:
    """The values (s,) of reported() for motions with one time base."""
    out = {
        "peak α": np.array([injury.peak(m.alpha, time)[0] for m in motions]),
        "peak ω": np.array([injury.peak(m.omega, time)[0] for m in motions]),
        "BrIC": np.array([injury.bric(m.omega) for m in motions]),
    }
    points = [(p.name, p.position) for p in case.recording.rig.points] or [("", np.zeros(3))]
    for name, position in points:
        at = [rigid_body.acceleration_at(position, m.a0, m.alpha, m.omega) for m in motions]
        resultants = np.array([kinematics.resultant(a) for a in at])
        suffix = f" {name}" if len(points) > 1 else ""
        out[f"peak a{suffix}"] = resultants.max(axis=1) / G0
        out[f"HIC15{suffix}"] = injury.hic_of_each(resultants, time, 0.015)
        out[f"HIC36{suffix}"] = injury.hic_of_each(resultants, time, 0.036)
        out[f"GSI{suffix}"] = np.array([injury.gsi(resultant, time) for resultant in resultants])
        out[f"a3ms{suffix}"] = injury.a3ms_of_each(resultants, time) / G0
    return out


def unit_of(name: str) -> str:
    return UNITS.get(name) or next(u for head, u in _POINT_UNITS.items() if name.startswith(head))


def impact(case: Case, repair: Reconstruction) -> Mapping[str, Impact]:
    """Reported values with all channels at their word, and after the repair: of the whole-record fit behind it, with a0
    and α from each sample. EstimationError where there is no motion, or the repair has no fit.

    `before` is what a laboratory would have computed from the recording as it is. u: root mean square of what motions
    drawn from the posterior give (ω and θ by draws.py: noise, calibration, fault; and the noise of each block),
    less what the fit itself gives; so that it holds the bias, too, by which noise raises the peak of a curve.
    """
    if repair.fit is None:
        raise EstimationError("the repair has no whole-record fit")
    readings, blocks = _as_fitted(case, repair), case.condensed
    before = reported(case, case.time, case.motion)
    after = reported(case, case.time, _motion(repair.fit, case.time, readings, case.sigma))
    means, rng = block_means(readings, blocks.length), np.random.default_rng(SEED)
    itself = reported(case, blocks.time, _motion(repair.fit, blocks.time, means, blocks.sigma))
    motions = []
    for drawn in draws(repair.fit, DRAWS, rng):
        noisy = means + blocks.sigma * rng.standard_normal(means.shape)
        motions.append(_motion(drawn, blocks.time, noisy, blocks.sigma, repair.fit))
    drawn_values = _of_each(case, blocks.time, motions)
    u = {name: float(np.sqrt(np.mean((drawn_values[name] - value) ** 2))) for name, value in itself.items()}
    return {name: Impact(before[name], after[name], u[name], unit_of(name)) for name in after}


def _as_fitted(case: Case, repair: Reconstruction) -> FloatArray:
    """(n,k) readings after the repair. A rebuilt sample tells nothing that its donors do not; a tilted or displaced
    sensor is used as it was measured, its tilt and place being in the fit."""
    readings = case.readings.copy()
    columns = [case.array.index(c) for c in repair.channels]
    if repair.fault is None:
        readings[:, columns] = np.where(repair.replaced, np.nan, repair.measured)
    elif repair.fault not in IN_THE_INSTRUMENT:
        readings[:, columns] = repair.repaired
    return readings


def _motion(found: Fit, time: FloatArray, readings: FloatArray, sigma: FloatArray, near: Fit | None = None) -> Motion:
    motion = at_samples(found, time, readings, sigma, near).motion
    return Motion(motion.omega, bridge(motion.alpha, time), bridge(motion.a0, time), motion.method)
