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

from nineaudit.array import BoolArray, FloatArray
from nineaudit.errors import EstimationError
from nineaudit.units import counted

_RANK_TOLERANCE = 1e-10
"""Singular values below this share of the largest count as zero; columns are scaled to like size first."""


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
    is_accelerometer: BoolArray,
    a0: FloatArray,
    alpha: FloatArray,
    omega: FloatArray,
) -> FloatArray:
    """Ideal readings (n,k), m/s² or rad/s, of every channel for a motion (each (n,3)) in the body frame."""
    accelerations = np.hstack([a0, alpha]) @ design(positions, axes).T + centripetal(positions, axes, omega)
    return np.where(is_accelerometer, accelerations, omega @ axes.T)


def product_matrix(positions: FloatArray, axes: FloatArray) -> FloatArray:
    """Q (k,6) m, so that q(ω) = Q·[ωx², ωy², ωz², ωyωz, ωzωx, ωxωy] (`centripetal` by its coefficients)."""
    along = np.einsum("ki,ki->k", axes, positions)
    squares = positions * axes - along[:, None]
    y, z = [1, 2, 0], [2, 0, 1]
    return np.hstack([squares, positions[:, y] * axes[:, z] + positions[:, z] * axes[:, y]])


def product_free_alpha(positions: FloatArray, axes: FloatArray, leak: float = 1e-8) -> FloatArray:
    """L (3,k) 1/m with L·H = [0 I], L·Q = 0: α = L·y whatever ω is, so that it integrates without feedback.

        L = L₀ − L₀Q (NQ)⁺ N,   L₀ the α rows of H⁺,  N = parity(H)

    Minimum norm, so least white noise. For the 3-2-2-2 array the only one, Padgaonkar's [Takhounts09 eq 12].
    `leak`: largest entry of L·Q (rad/s² per (rad/s)²) that is let pass, for arrays whose seismic masses sit
    a little off the ideal points; L·H = [0 I] holds in any case. Raises EstimationError, naming the ranks,
    when the geometry has none: then α needs ω fed back, which diverges forward in time (METHODS.md 1.3).
    """
    length = float(np.abs(positions).max(initial=0.0)) or 1.0
    h, q = design(positions / length, axes), product_matrix(positions / length, axes)
    if len(axes) < 6 or _rank(h) < 6:
        raise EstimationError(
            "angular acceleration is not determined",
            found=f"{counted(len(axes), 'accelerometer')}, H of rank {_rank(h) if len(axes) else 0}",
            expected="rank 6",
        )
    rows, spare = np.linalg.pinv(h)[3:], parity(h)
    rows = rows - rows @ q @ np.linalg.pinv(spare @ q, rcond=max(leak, _RANK_TOLERANCE)) @ spare
    left = float(np.abs(rows @ q).max())
    if left > leak:
        raise EstimationError(
            "no angular acceleration free of products of angular velocity",
            found=f"{counted(len(axes), 'accelerometer')}, [H Q] of rank {_rank(np.hstack([h, q]))}, leak {left:.2g}",
            expected="rows in which α is separate from the products, as in a 3-2-2-2 array",
        )
    return np.asarray(rows / length)


def parity(design_matrix: FloatArray) -> FloatArray:
    """N (k − rank, k), orthonormal rows with N·H = 0: N·y = N·q(ω) whatever a0 and α are (METHODS.md 2)."""
    basis, rank = _left_basis(design_matrix)
    return np.asarray(basis[:, rank:].T)


def leverage(design_matrix: FloatArray) -> FloatArray:
    """(k,) h_kk = diag(H H⁺), 0 to 1; 1: the channel is not checked by any other.

    1 − h_kk is the share of a fault's square that the parity rows see (METHODS.md 3: 5/18 and 4/9).
    """
    basis, rank = _left_basis(design_matrix)
    return np.asarray(np.einsum("ij,ij->i", basis[:, :rank], basis[:, :rank]))


def missing_channel_bound(design_matrix: FloatArray) -> FloatArray:
    """(k,) √(h/(1−h)): least sd of a channel rebuilt from the others over the noise sd of one (METHODS.md 4).

    Infinite where the others do not determine it.
    """
    h = leverage(design_matrix)
    free = 1.0 - h
    return np.where(free > _RANK_TOLERANCE, np.sqrt(h / np.where(free > _RANK_TOLERANCE, free, 1.0)), np.inf)


def _rank(matrix: FloatArray) -> int:
    return int(np.linalg.matrix_rank(matrix, rtol=_RANK_TOLERANCE))


def _left_basis(matrix: FloatArray) -> tuple[FloatArray, int]:
    """Orthonormal columns (k,k), the first `rank` of which span the columns of `matrix`."""
    size = np.linalg.norm(matrix, axis=0)
    basis, singular, _ = np.linalg.svd(matrix / np.where(size > 0.0, size, 1.0))
    return basis, int(np.count_nonzero(singular > _RANK_TOLERANCE * singular.max(initial=0.0)))
