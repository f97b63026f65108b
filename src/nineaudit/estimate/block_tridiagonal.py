"""Symmetric positive definite block-tridiagonal systems with 3×3 blocks: one block a node, linear in their number.

    diagonal (m,3,3), upper (m−1,3,3): block row t couples to t+1 with upper[t] and to t−1 with upper[t−1]ᵀ.

Solved by LAPACK's banded Cholesky (half bandwidth 5); the blocks of the inverse that lie on the tridiagonal come by
odd–even reduction, all nodes of a level at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import EstimationError

_HALF_BANDWIDTH = 5


@dataclass(frozen=True, eq=False)
class Factor:
    """Banded Cholesky factor of a block-tridiagonal matrix of `nodes` blocks."""

    banded: FloatArray
    nodes: int

    def solve(self, right: FloatArray) -> FloatArray:
        """A⁻¹ right for `right` (3·nodes, q)."""
        from scipy.linalg.lapack import dpbtrs

        solution, info = dpbtrs(self.banded, np.asfortranarray(right), lower=0)
        if info != 0:
            raise EstimationError(f"banded solution failed (LAPACK dpbtrs info {info})")
        return np.asarray(solution)

    def forward(self, right: FloatArray, first: int, last: FloatArray) -> FloatArray:
        """U⁻ᵀ right, A = UᵀU, of the nodes from `first` on: (q,3m) from `right` (q,m,3), with the solution `last` (q,3)
        of the node before. `right` is overwritten."""
        from scipy.linalg.lapack import dtbtrs

        count, nodes, _ = right.shape
        here = slice(3 * first, 3 * (first + nodes))
        if first:
            right[:, 0] -= last @ self._coupling(first)
        columns = right.reshape(count, 3 * nodes).T
        solution, info = dtbtrs(self.banded[:, here], columns, uplo="U", trans="T", overwrite_b=1)
        if info != 0:
            raise EstimationError(f"banded substitution failed (LAPACK dtbtrs info {info})")
        return np.asarray(solution.T)

    def _coupling(self, node: int) -> FloatArray:
        """(3,3) block of U between the node before and `node`."""
        above, column = np.mgrid[0:3, 0:3]
        return np.asarray(self.banded[_HALF_BANDWIDTH - 3 + above - column, 3 * node + column])

    def log_determinant(self) -> float:
        """ln det A, from the diagonal of the factor."""
        return 2.0 * float(np.log(self.banded[_HALF_BANDWIDTH]).sum())


def factor(diagonal: FloatArray, upper: FloatArray) -> Factor:
    """Cholesky factor. EstimationError when the matrix is not positive definite."""
    from scipy.linalg.lapack import dpbtrf

    nodes = len(diagonal)
    banded = np.zeros((_HALF_BANDWIDTH + 1, 3 * nodes))
    for i in range(3):
        for j in range(i, 3):
            banded[_HALF_BANDWIDTH + i - j, j::3] = diagonal[:, i, j]
        for j in range(3):
            banded[_HALF_BANDWIDTH + i - j - 3, 3 + j :: 3] = upper[:, i, j]
    cholesky, info = dpbtrf(banded, lower=0)
    if info != 0:
        raise EstimationError(
            "the trajectory is not determined by the readings: the normal matrix is singular",
            place=f"node {(info - 1) // 3} of {nodes}",
        )
    return Factor(np.asarray(cholesky), nodes)


def inverse_blocks(diagonal: FloatArray, upper: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Diagonal (m,3,3) and upper (m−1,3,3) blocks of the inverse.

    Odd–even reduction: with the odd nodes j eliminated between their even neighbours i and k, the even ones form
    a tridiagonal system of half the size; from the inverse there,

        Σ_jj = D_j⁻¹ + D_j⁻¹ [B_i B_k] Σ_(i,k) [B_i B_k]ᵀ D_j⁻¹,   Σ_j(i,k) = −D_j⁻¹ [B_i B_k] Σ_(i,k)
    """
    nodes = len(diagonal)
    if nodes == 1:
        return np.asarray(np.linalg.inv(diagonal)), np.zeros((0, 3, 3))
    if nodes == 2:
        whole = np.linalg.inv(np.block([[diagonal[0], upper[0]], [upper[0].T, diagonal[1]]]))
        return np.stack([whole[:3, :3], whole[3:, 3:]]), whole[None, :3, 3:]
    # a right end beyond the last node, coupled to nothing, gives every odd node two neighbours
    if nodes % 2 == 0:
        one = np.eye(3)[None]
        d, u = inverse_blocks(np.concatenate([diagonal, one]), np.concatenate([upper, np.zeros((1, 3, 3))]))
        return d[:nodes], u[: nodes - 1]
    inverse = np.linalg.inv(diagonal[1::2])
    left, right = upper[0::2].transpose(0, 2, 1), upper[1::2]  # couplings of j to i and to k
    gain_left, gain_right = inverse @ left, inverse @ right
    coarse = diagonal[0::2].copy()
    coarse[:-1] -= left.transpose(0, 2, 1) @ gain_left
    coarse[1:] -= right.transpose(0, 2, 1) @ gain_right
    between = -(left.transpose(0, 2, 1) @ gain_right)
    even, across = inverse_blocks(coarse, between)
    to_left = -(gain_left @ even[:-1] + gain_right @ across.transpose(0, 2, 1))  # Σ_ji
    to_right = -(gain_left @ across + gain_right @ even[1:])  # Σ_jk
    odd = inverse - to_left @ gain_left.transpose(0, 2, 1) - to_right @ gain_right.transpose(0, 2, 1)
    found, beside = np.empty_like(diagonal), np.empty_like(upper)
    found[0::2], found[1::2] = even, odd
    beside[0::2], beside[1::2] = to_left.transpose(0, 2, 1), to_right
    return found, beside
