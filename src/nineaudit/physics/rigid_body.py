"""Rigid-body model of an array of accelerometers and rate sensors (METHODS.md 1).

A point r of a rigid body has the specific force

    a(r) = a0 + α × r + ω × (ω × r)                                   [Becker75 eq 5, with eq 6 put right]

so an accelerometer i at r_i with sensitive axis n_i and a rate sensor with axis n_i read

    y_i = n_i·a(r_i) = h_i·[a0; α] + q_i(ω),    h_i = [n_i; r_i × n_i]
    q_i(ω) = (r_i·ω)(n_i·ω) − (n_i·r_i)|ω|²
    y_i = n_i·ω

Gravity is common to all accelerometers and belongs to a0. Body frame, SI.
"""

from __future__ import annotations

import numpy as np

from nineaudit.array import FloatArray


def design(positions: FloatArray, axes: FloatArray) -> FloatArray:
    """H (k,6) of the accelerometers: rows h_i = [n_i; r_i × n_i], so that y = H[a0; α] + q(ω).

    `positions` (k,3) m, `axes` (k,3) unit vectors.
    """
    return np.hstack([axes, np.cross(positions, axes)])


def centripetal(positions: FloatArray, axes: FloatArray, omega: FloatArray) -> FloatArray:
    """q (n,k) m/s²: q_i = (r_i·ω)(n_i·ω) − (n_i·r_i)|ω|², for `omega` (n,3) rad/s."""
    along = np.einsum("ki,ki->k", axes, positions)
    squared = np.einsum("ni,ni->n", omega, omega)
    return np.asarray((omega @ positions.T) * (omega @ axes.T) - squared[:, None] * along)


def centripetal_jacobian(positions: FloatArray, axes: FloatArray, omega: FloatArray) -> FloatArray:
    """∂q/∂ω (n,k,3): (r_i·ω)n_i + (n_i·ω)r_i − 2(n_i·r_i)ω."""
    along = np.einsum("ki,ki->k", axes, positions)
    return np.asarray(
        (omega @ positions.T)[:, :, None] * axes
        + (omega @ axes.T)[:, :, None] * positions
        - 2.0 * along[:, None] * omega[:, None, :]
    )


def acceleration_at(point: FloatArray, a0: FloatArray, alpha: FloatArray, omega: FloatArray) -> FloatArray:
    """a(r) (n,3) m/s² at `point` (3,) m from `a0`, `alpha`, `omega`, each (n,3)."""
    return a0 + np.cross(alpha, point) + np.cross(omega, np.cross(omega, point))


def predict(
    positions: FloatArray,
    axes: FloatArray,
    is_accelerometer: np.ndarray,
    a0: FloatArray,
    alpha: FloatArray,
    omega: FloatArray,
) -> FloatArray:
    """Ideal readings (n,k), m/s² or rad/s, of every channel for a motion (each (n,3)) in the body frame."""
    accelerations = np.hstack([a0, alpha]) @ design(positions, axes).T + centripetal(positions, axes, omega)
    return np.where(is_accelerometer, accelerations, omega @ axes.T)
