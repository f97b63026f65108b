"""Worst case of small errors of chosen channels in the six-accelerometer scheme [Becker75].

An error g_i of the gain and b_i of the offset of channel i act on α at once and, through ω that is fed back, later:

    d(∂ω/∂g_i)/dt = J(ω) ∂ω/∂g_i + K_i (v_i − V_i),    d(∂ω/∂b_i)/dt = J(ω) ∂ω/∂b_i + K_i,    both 0 at the start.

With errors of either sign up to δ_i the furthest ω can go is the envelope Σ_i |∂ω/∂g_i| δ_i: no statistics, every
sign the worst one.
"""

from __future__ import annotations

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import EstimationError
from nineaudit.schemes.growth import transition
from nineaudit.schemes.six_accelerometers import CHANNELS, Solution, inverse

BECKER_GAIN = 0.005
"""The ±0.5 % of [Becker75]."""


def gain_sensitivity(solution: Solution, outputs: FloatArray) -> FloatArray:
    """∂ω/∂g (n,3,6) rad/s per relative error of gain of each channel; `outputs` (n,6) as they were solved.

    Error of order h²: the implicit trapezoidal rule. Errors as six_accelerometers.inverse.
    """
    rows = inverse(solution.package)[3:]
    return transition(solution, rows * (outputs - solution.package.offset)[:, None, :])


def offset_sensitivity(solution: Solution) -> FloatArray:
    """∂ω/∂b (n,3,6) rad/s per unit of error of each channel's offset, in the unit of its output."""
    rows = inverse(solution.package)[3:]
    return transition(solution, np.broadcast_to(rows, (len(solution.time), 3, CHANNELS)))


def worst_case(sensitivity: FloatArray, limits: FloatArray) -> FloatArray:
    """(n,3) Σ_i |∂ω/∂p_i| δ_i of `sensitivity` (n,3,6) and `limits` δ (6,) ≥ 0; 0 for a channel that is not chosen.

    Raises EstimationError when the limits are not six numbers of 0 or more.
    """
    if limits.shape != sensitivity.shape[2:] or not np.all(limits >= 0.0):
        raise EstimationError(
            "limits of a worst case", found=limits.tolist(), expected=f"{sensitivity.shape[2]} numbers of 0 or more"
        )
    return np.asarray(np.abs(sensitivity) @ limits)
