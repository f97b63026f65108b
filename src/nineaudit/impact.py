"""What a fault does to the numbers that a laboratory reports, before and after the repair."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.estimate import calibration
from nineaudit.estimate.motion import Motion, bridge, estimate_motion
from nineaudit.physics import injury, kinematics, rigid_body
from nineaudit.reconstruct import Reconstruction
from nineaudit.units import G0

DRAWS, SEED = 64, 20090402
"""Monte Carlo draws (JCGM 101) for the uncertainties, 9 % of each of them, and their seed."""


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
    out = {
        "peak α": injury.peak(motion.alpha, time)[0],
        "peak ω": injury.peak(motion.omega, time)[0],
        "BrIC": injury.bric(motion.omega),
    }
    points = [(p.name, p.position) for p in case.recording.rig.points] or [("", np.zeros(3))]
    for name, position in points:
        a = rigid_body.acceleration_at(position, motion.a0, motion.alpha, motion.omega)
        resultant = kinematics.resultant(a)
        suffix = f" {name}" if len(points) > 1 else ""
        out[f"peak a{suffix}"] = float(resultant.max()) / G0
        out[f"HIC15{suffix}"] = injury.hic(resultant, time, 0.015).value
        out[f"HIC36{suffix}"] = injury.hic(resultant, time, 0.036).value
        out[f"GSI{suffix}"] = injury.gsi(resultant, time)
        out[f"a3ms{suffix}"] = injury.a3ms(resultant, time) / G0
    return out


def unit_of(name: str) -> str:
    return UNITS.get(name) or next(u for head, u in _POINT_UNITS.items() if name.startswith(head))


def impact(case: Case, repair: Reconstruction) -> Mapping[str, Impact]:
    """Reported values with the channels as measured and as repaired. EstimationError where there is no motion."""
    fixed = case.readings.copy()
    fixed[:, [case.array.index(c) for c in repair.channels]] = repair.repaired
    start = None if case.rest is None else case.rest.start
    before = reported(case, case.time, case.motion)
    after = reported(case, case.time, estimate_motion(case.array, case.time, fixed, case.sigma, start))
    u = _scatter(case, fixed, repair)
    return {name: Impact(before[name], after[name], u[name], unit_of(name)) for name in after}


def _scatter(case: Case, fixed: FloatArray, repair: Reconstruction) -> dict[str, float]:
    """Standard deviation of the reported values over draws of every calibration error, the noise, and the
    rebuilt channel's uncertainty (one draw for its whole curve: it is calibration that dominates it)."""
    rng = np.random.default_rng(SEED)
    step = max(1, len(case.time) // 1000)
    time, readings = case.time[::step], bridge(fixed, case.time)[::step]
    start = None if case.rest is None else case.rest.start // step
    motion = estimate_motion(case.array, time, readings, case.sigma, start)
    patterns = calibration.all_columns(case.array, readings, time, motion)
    for j, channel in enumerate(repair.channels):
        i = case.array.index(channel)
        patterns[i] = np.where(repair.replaced[::step, [j]], 0.0, patterns[i])
        patterns[i, :, 0] += np.where(repair.replaced[::step, j], repair.u[::step, j], 0.0)
    draws = []
    for _ in range(DRAWS):
        theta = rng.standard_normal((len(case.array), patterns.shape[2]))
        drawn = readings + np.einsum("knp,kp->nk", patterns, theta)
        drawn += case.sigma / np.sqrt(step) * rng.standard_normal(readings.shape)
        draws.append(reported(case, time, estimate_motion(case.array, time, drawn, case.sigma, start)))
    return {name: float(np.std([d[name] for d in draws], ddof=1)) for name in draws[0]}
