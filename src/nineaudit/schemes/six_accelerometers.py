"""Six accelerometers on one body, 3-2-1 [Becker75]: calibrated sensitivity vectors, ω fed back step by step.

Channel i puts out, with its sensitivity vector S_i (output per m/s², along the direction it is most sensitive
to; its length is the sensitivity) and its offset V_i,

    v_i = S_i·(a0 + α×P_i + ω×(ω×P_i)) + V_i                                       [Becker75 eqs 4 to 6]

so that, with the rows h_i = [S_i; P_i×S_i] and Q_i = −S_i·(ω×(ω×P_i)) [eq 6 put right: METHODS 1.2],

    [a0; α] = H⁻¹ (v − V + Q(ω)),     dω/dt = α.                                   [Becker75 eqs 7, 8, 16]

As many unknowns as channels: nothing is left over to check the readings by, and ω, which α needs, comes from α.
What that does to an error is in growth.py. Body frame, SI.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray, SensorArray, frozen
from nineaudit.errors import EstimationError
from nineaudit.physics import rigid_body
from nineaudit.units import counted

CHANNELS = 6
WORST_CONDITION = 1e6
"""Largest condition number of H (lengths in units of the longest arm): beyond, readings decide nothing."""


@dataclass(frozen=True, eq=False)
class Package:
    """Six calibrated channels: `positions` (6,3) m, `sensitivity` (6,3) output per m/s², `offset` (6,) output."""

    positions: FloatArray
    sensitivity: FloatArray
    offset: FloatArray

    def __post_init__(self) -> None:
        for name in ("positions", "sensitivity", "offset"):
            object.__setattr__(self, name, frozen(getattr(self, name)))


@dataclass(frozen=True, eq=False)
class Solution:
    """Motion at the origin: `time` (n,) s; `a0`, `alpha`, `omega` (n,3), SI; `package` it is from."""

    time: FloatArray
    a0: FloatArray
    alpha: FloatArray
    omega: FloatArray
    package: Package


def package(array: SensorArray) -> Package:
    """The accelerometers of an array whose readings are m/s² already: S_i = n_i, V_i = 0.

    Raises EstimationError unless there are six.
    """
    chosen = array.select(np.flatnonzero(array.is_accelerometer))
    if len(chosen) != CHANNELS:
        raise EstimationError(
            "not an array of six accelerometers",
            found=counted(len(chosen), "accelerometer"),
            expected="6, as in the preset 3-2-1",
        )
    return Package(chosen.positions, chosen.axes, np.zeros(CHANNELS))


def inverse(six: Package) -> FloatArray:
    """H⁻¹ (6,6), so that [a0; α] = H⁻¹(v − V + Q(ω)).

    Raises EstimationError, naming rank and condition number, where the layout does not determine [a0; α].
    """
    length = float(np.abs(six.positions).max(initial=0.0)) or 1.0
    size = np.linalg.norm(six.sensitivity, axis=1, keepdims=True)
    if six.positions.shape != (CHANNELS, 3) or not np.all(size > 0.0):
        raise EstimationError(
            "the scheme needs six sensitivity vectors",
            found=f"{np.count_nonzero(size)} that are not zero",
            expected=f"{CHANNELS}",
        )
    h = rigid_body.design(six.positions / length, six.sensitivity / size)
    values = np.linalg.svd(h, compute_uv=False)
    if values[-1] * WORST_CONDITION < values[0]:
        rank = int(np.count_nonzero(values * WORST_CONDITION > values[0]))
        raise EstimationError(
            "six accelerometers do not determine the motion",
            found=f"H of rank {rank}, condition number {values[0] / max(values[-1], 1e-300):.3g}",
            expected=f"rank 6, condition number below {WORST_CONDITION:g}",
            advice="sensors in line see no rotation about that line: move one off it, as in the 3-2-1 layout",
        )
    scaled = np.linalg.inv(h) / size.T
    scaled[3:] /= length
    return np.asarray(scaled)


def solve(six: Package, outputs: FloatArray, time: FloatArray, initial: FloatArray | None = None) -> Solution:
    """Motion from `outputs` (n,6) of the channels at `time` (n,) s, from ω = `initial` (3,) (default: at rest).

    ω is fed back step by step: dω/dt = u(t) + B p(ω), u = [H⁻¹(v − V)]_α, p the six products of ω, by the
    classical Runge-Kutta rule with u halfway by cubic spline; error of order h⁴.
    Raises EstimationError: singular layout, readings or time base that are not finite or do not fit, divergence.
    """
    _require(outputs, time)
    rows = inverse(six)
    free = (outputs - six.offset) @ rows.T
    feedback = -rows @ rigid_body.product_matrix(six.positions, six.sensitivity)
    omega = _forward(free[:, 3:], feedback[3:], time, np.zeros(3) if initial is None else np.asarray(initial))
    total = free + products(omega) @ feedback.T
    return Solution(frozen(time), frozen(total[:, :3]), frozen(total[:, 3:]), frozen(omega), six)


def products(omega: FloatArray) -> FloatArray:
    """p (..., 6) = [ωx², ωy², ωz², ωyωz, ωzωx, ωxωy] of `omega` (..., 3)."""
    return np.concatenate([omega**2, np.roll(omega, -1, axis=-1) * np.roll(omega, -2, axis=-1)], axis=-1)


def _forward(free: FloatArray, feedback: FloatArray, time: FloatArray, initial: FloatArray) -> FloatArray:
    """(n,3) rad/s by classical Runge-Kutta, where dω/dt = u + B p(ω)."""
    from scipy.interpolate import CubicSpline

    half = CubicSpline(time, free)(0.5 * (time[1:] + time[:-1]))
    omega = np.empty((len(time), 3))
    omega[0] = now = initial

    def slope(drive: FloatArray, w: FloatArray) -> FloatArray:
        x, y, z = w
        return np.asarray(drive + feedback @ np.array([x * x, y * y, z * z, y * z, z * x, x * y]))

    for i, h in enumerate(np.diff(time)):
        k1 = slope(free[i], now)
        k2 = slope(half[i], now + 0.5 * h * k1)
        k3 = slope(half[i], now + 0.5 * h * k2)
        k4 = slope(free[i + 1], now + h * k3)
        now = now + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        if not np.abs(now).max() * h < 1.0:
            raise _diverged(float(time[i + 1]), now, float(h))
        omega[i + 1] = now
    return omega


def _diverged(at: float, omega: FloatArray, step: float) -> EstimationError:
    return EstimationError(
        "angular velocity fed back into six accelerometers has diverged",
        place=f"{at:.6g} s",
        found=f"{np.abs(omega).max():.3g} rad/s",
        expected=f"less than 1 rad in a sampling interval of {step:.3g} s",
        advice="cut the record to the first quarter turn, or add rate sensors",
    )


def _require(outputs: FloatArray, time: FloatArray) -> None:
    """EstimationError unless `outputs` (n,6) and `time` (n,) fit, are finite, and time increases."""
    if outputs.shape != (len(time), CHANNELS) or len(time) < 4:
        raise EstimationError(
            "readings do not fit the scheme",
            found=f"readings {outputs.shape}, time {time.shape}",
            expected=f"(n, {CHANNELS}) and (n,), 4 samples at least",
        )
    bad = np.flatnonzero(~np.isfinite(outputs).all(axis=0))
    if bad.size:
        raise EstimationError(
            "readings have gaps",
            place=f"channels {', '.join(str(b + 1) for b in bad)} of {CHANNELS}",
            found=f"{counted(int(np.count_nonzero(~np.isfinite(outputs))), 'value')} without a number",
            advice="six channels have no redundancy to fill them: cut the record before the gap",
        )
    if not (np.isfinite(time).all() and np.all(np.diff(time) > 0.0)):
        raise EstimationError("time base is not increasing", expected="finite, strictly increasing seconds")
