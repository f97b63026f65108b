"""ω of a scheme beside a rate gyro that answers more slowly: both through the same second-order response [Becker75].

    G(s) = ωn²/(s² + 2ζωn s + ωn²),    ωn = 2π·37 Hz, ζ = 0.5 for the gyros of [Becker75],

started at rest in the first sample, ω a straight line between samples (first-order hold: exact for that).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.units import counted

NATURAL_HZ = 37.0
DAMPING = 0.5
_UNEVEN = 1e-3


@dataclass(frozen=True)
class Agreement:
    """Scheme less gyro, one number an axis (3,): `rms` and `largest` in rad/s, `of_peak` = largest over the
    largest |rate| that the gyro read about any axis."""

    rms: tuple[float, float, float]
    largest: tuple[float, float, float]
    of_peak: tuple[float, float, float]


def second_order(
    values: FloatArray, time: FloatArray, natural_hz: float = NATURAL_HZ, damping: float = DAMPING
) -> FloatArray:
    """`values` (n,) or (n,m) as an instrument of that natural frequency and damping ratio shows them, same unit.

    Raises ConfigurationError unless both are positive, EstimationError for an uneven time base or gaps.
    """
    from scipy.signal import cont2discrete, lfilter

    for name, value in (("natural frequency, Hz", natural_hz), ("damping ratio", damping)):
        if not (math.isfinite(value) and value > 0.0):
            raise ConfigurationError(name, found=value, expected="a positive number")
    steps = np.diff(time)
    step = float(steps.mean()) if steps.size else 0.0
    if step <= 0.0 or np.abs(steps - step).max() > _UNEVEN * step or not np.isfinite(values).all():
        raise EstimationError(
            "not to be put through an instrument's response",
            found=f"{counted(int(np.count_nonzero(~np.isfinite(values))), 'gap')}, steps "
            f"{steps.min(initial=0.0):.3g} s to {steps.max(initial=0.0):.3g} s",
            expected="finite values on an even time base",
        )
    natural = 2.0 * math.pi * natural_hz
    system = np.array([natural**2]), np.array([1.0, 2.0 * damping * natural, natural**2])
    above, below, _ = cont2discrete(system, step, method="foh")
    return np.asarray(values[0] + lfilter(np.ravel(above), below, values - values[0], axis=0))


def compare(
    omega: FloatArray,
    gyro: FloatArray,
    time: FloatArray,
    natural_hz: float = NATURAL_HZ,
    damping: float = DAMPING,
) -> Agreement:
    """`omega` (n,3) of a scheme through the response of the gyro, against what it read, `gyro` (n,3), rad/s.

    Raises as second_order, and EstimationError when the shapes differ or the gyro read nothing but 0.
    """
    peak = float(np.abs(gyro).max(initial=0.0))
    if omega.shape != gyro.shape or omega.shape[1:] != (3,) or not peak > 0.0:
        raise EstimationError(
            "nothing to compare",
            found=f"ω {omega.shape}, gyro {gyro.shape}, largest rate {peak:g} rad/s",
            expected="(n, 3) both, a gyro that moved",
        )
    apart = second_order(omega, time, natural_hz, damping) - gyro
    rms, largest = np.sqrt((apart**2).mean(axis=0)), np.abs(apart).max(axis=0)
    return Agreement(_three(rms), _three(largest), _three(largest / peak))


def _three(values: FloatArray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
