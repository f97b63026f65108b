"""ω of accelerometers whose α needs ω: fed back step by step, as the papers do it, and what an error does on the way.

    α = K(y − q(ω)),   dω/dt = α,   K the α rows of H⁺                          [Becker75 eq 16; Alem77; METHODS 1.3]

by the trapezoidal rule from the sample at rest, forwards and backwards, implicit (three corrections a step). Linear
about a motion, B_t = K ∂q/∂ω,

    (1 + ½h B_{t+1}) δω_{t+1} = (1 − ½h B_t) δω_t + ½h K(δy_t + δy_{t+1}),   δω = 0 at rest,

which grows with the angle turned: e^1.0 a radian for six accelerometers 3-2-1, e^0.5 for three triaxes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.physics import rigid_body

CORRECTIONS = 3
"""Of a step: ½h|B| is some hundredths, so the third leaves 1e-6 of what the first had to put right."""


def alpha_rows(array: SensorArray) -> FloatArray:
    """K (3,a), by least squares of the accelerometers."""
    held = array.is_accelerometer
    return np.asarray(np.linalg.pinv(rigid_body.design(array.positions[held], array.axes[held]))[3:])


def integrate(array: SensorArray, time: FloatArray, readings: FloatArray, rest: int) -> tuple[FloatArray, FloatArray]:
    """ω and α (n,d,3) of `d` records at once, `readings` (n,d,a) of the accelerometers, SI without gaps, ω = 0 at
    sample `rest`. What runs away is held at the rate that takes all of the readings: √(largest reading / arm)."""
    held, rows = array.is_accelerometer, alpha_rows(array)
    positions, axes = array.positions[held], array.axes[held]
    driven, leak = readings @ rows.T, rows @ rigid_body.product_matrix(positions, axes)
    omega, alpha = np.zeros_like(driven), driven.copy()
    fastest = fastest_rate(array, readings)
    for order in (range(rest, len(time) - 1), range(rest, 0, -1)):
        for t in order:
            to = t + order.step
            half = 0.5 * (time[to] - time[t])
            ahead = omega[t] + 2.0 * half * alpha[t]
            for _ in range(CORRECTIONS):
                here = driven[to] - products(ahead) @ leak.T
                ahead = np.clip(omega[t] + half * (alpha[t] + here), -fastest, fastest)
            omega[to], alpha[to] = ahead, driven[to] - products(ahead) @ leak.T
    return omega, alpha


def fastest_rate(array: SensorArray, readings: FloatArray) -> float:
    """rad/s that no motion with these readings exceeds: 2√(largest reading / width of the array)."""
    width = float(np.ptp(array.positions[array.is_accelerometer], axis=0).max())
    return 2.0 * float(np.sqrt(np.abs(readings).max() / max(width, 1e-9)))


def products(w: FloatArray) -> FloatArray:
    """(...,6) [ωx², ωy², ωz², ωyωz, ωzωx, ωxωy] of ω (...,3)."""
    return np.concatenate([w * w, w[..., [1, 2, 0]] * w[..., [2, 0, 1]]], axis=-1)


@dataclass(frozen=True, eq=False)
class Carried:
    """The linear rule about a motion: `back` (n,3,3) B, `time` (n,) s, `rest` the sample at which ω = 0."""

    back: FloatArray
    time: FloatArray
    rest: int

    def __call__(self, by_omega: FloatArray) -> FloatArray:
        """(n,3) derivative by Kδy at every sample of a number with derivative (n,3) by ω at every sample."""
        from scipy.linalg import solve_banded

        half, n = 0.5 * np.diff(self.time), len(self.time)
        one = np.eye(3)
        to = one + half[:, None, None] * self.back[1:]
        of = -(one - half[:, None, None] * self.back[:-1])
        row = np.arange(n - 1) + (np.arange(n - 1) >= self.rest)  # the row of rest itself is δω = 0
        matrix = np.zeros((11, 3 * n))
        for i in range(3):
            for j in range(3):
                for block, at in ((of, np.arange(n - 1)), (to, np.arange(1, n))):
                    into, out = 3 * row + i, 3 * at + j  # transposed: column `into` of the band, row `out`
                    matrix[5 + out - into, into] = block[:, i, j]
            matrix[5, 3 * self.rest + i] = 1.0
        pull = solve_banded((5, 5), matrix, by_omega.ravel()).reshape(n, 3)[row] * half[:, None]
        found = np.zeros_like(by_omega)
        found[:-1] += pull
        found[1:] += pull
        return found
