"""The whole-record motion where accelerometers do not tell α: rates smoothed, α their slope, a0 by the accelerometers.

ω̂ = F ω_rates,   α = dω̂/dt,   n·a0 = y − n·(α × r + ω̂ × (ω̂ × r))      [rate_smoother.py; Hu77; Becker75 eq 5]
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.errors import EstimationError
from nineaudit.estimate.motion import Motion, bridge, rates_omega, with_accelerations
from nineaudit.estimate.rate_smoother import noise_of_rates, smoother
from nineaudit.units import counted

METHOD = "whole-record smoother of the rates, α their slope"


def smoothed_rates(array: SensorArray, time: FloatArray, readings: FloatArray, sigma: FloatArray) -> Motion:
    """The motion of `readings` (n,k) SI zeroed, evenly sampled, noise `sigma` (k,), rate sensors on three axes.

    EstimationError: accelerometers on fewer than three axes, or a record too short to smooth.
    """
    held = array.is_accelerometer
    rank = int(np.linalg.matrix_rank(array.axes[held], tol=1e-3)) if held.any() else 0
    if rank < 3:
        raise EstimationError(
            "the acceleration of the origin is not known",
            found=f"{counted(int(held.sum()), 'accelerometer')}, axes of rank {rank}",
            expected="rank 3",
            advice="add accelerometers along the axes that have none",
        )
    measured = rates_omega(array.axes[~held], readings[:, ~held], sigma[~held], np.isfinite(readings[:, ~held]))
    rates = bridge(measured, time)
    omega = smoother(rates, noise_of_rates(array, sigma))(rates)
    return at_rates(array, time, readings, Motion(omega, omega, omega, METHOD), time)


def at_rates(array: SensorArray, time: FloatArray, readings: FloatArray, found: Motion, at: FloatArray) -> Motion:
    """The motion at `time` (n,) from `readings` (n,k) and the ω of `found`, (m,3) at times `at`, by a cubic spline."""
    from scipy.interpolate import CubicSpline

    held = array.is_accelerometer
    omega = np.asarray(CubicSpline(at, found.omega)(time))
    moved = with_accelerations(omega, array.positions[held], array.axes[held], readings[:, held], time)
    return replace(moved, method=METHOD)
