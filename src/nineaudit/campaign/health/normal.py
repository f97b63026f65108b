"""The inverse of normal equations in which the seats of two rigs meet in no equation.

With D the block diagonal of the seats by rig, B what couples them with all else and C all else,

    S = C − Bᵀ D⁻¹ B,    [D B; Bᵀ C]⁻¹ = [D⁻¹ + X S⁻¹ Xᵀ, −X S⁻¹; −S⁻¹ Xᵀ, S⁻¹],    X = D⁻¹ B           (Schur)

and a rig couples with the few sensors that sat in it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nineaudit.array import FloatArray, IntArray


def inverse(normal: FloatArray, blocks: Sequence[IntArray]) -> FloatArray:
    """(n,n) the inverse of a symmetric matrix in which entries of two `blocks` (of indices) are zero."""
    if not blocks:
        return np.asarray(np.linalg.inv(normal))
    seats = np.concatenate(blocks)
    rest = np.setdiff1d(np.arange(len(normal)), seats)
    schur, gone = normal[np.ix_(rest, rest)], []
    for block in blocks:
        across = normal[np.ix_(block, rest)]
        near = np.flatnonzero(across.any(axis=0))
        own = np.linalg.inv(normal[np.ix_(block, block)])
        through = own @ across[:, near]
        schur[np.ix_(near, near)] -= across[:, near].T @ through
        gone.append((block, near, own, through))
    cov = np.zeros(normal.shape)
    left = np.linalg.inv(schur)
    to_rest = np.concatenate([-through @ left[near] for _, near, _, through in gone])
    cov[np.ix_(rest, rest)] = left
    cov[np.ix_(seats, rest)] = to_rest
    cov[np.ix_(rest, seats)] = to_rest.T
    for block, near, own, through in gone:
        cov[np.ix_(seats, block)] = -to_rest[:, near] @ through.T
        cov[np.ix_(block, block)] += own
    return cov
