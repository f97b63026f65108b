"""The normal equations solved by what connects them: gains go with sensors from rig to rig, all else stays in its rig.

    H = [A B; Bᵀ C],    W = A⁻¹ B,    S = C − Bᵀ W
    H⁻¹ = [A⁻¹ + W S⁻¹ Wᵀ, −W S⁻¹; −S⁻¹ Wᵀ, S⁻¹],    x_C = S⁻¹ (c − Wᵀ a),    x_A = A⁻¹ a − W x_C

for the right side (a, c), with the seats of a rig and the tilts of sensors in them as one block of A, and in C what is
joint, gains and changes. A tilt of a sensor and that of its seat are in one block: what they have in common, 10⁶ of the
prior, would be lost in a difference of S.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nineaudit.array import FloatArray, IntArray


def blocks(size: int, touched: Sequence[IntArray], joint: IntArray) -> list[IntArray]:
    """What of `size` unknowns `touched` together (each: of a group) connects, but by what is `joint`."""
    label, local = np.arange(size), np.zeros(size, dtype=np.bool_)
    for at in touched:
        local[at] = True
    local[joint[joint < size]] = False
    for at in touched:
        mine = np.unique(label[at[local[at]]])
        label[np.isin(label, mine)] = mine[0] if len(mine) else 0
    return [np.flatnonzero(local & (label == one)) for one in np.unique(label[local])]


def solved(
    normal: FloatArray, right: FloatArray, parts: Sequence[IntArray], joint: IntArray, across: bool
) -> tuple[FloatArray, FloatArray]:
    """(n,) H⁻¹ b and (n,n) H⁻¹; where not `across`, of blocks only each by itself and with what is joint. What is in no
    part has its own entry only."""
    from scipy.linalg import cho_factor, cho_solve

    schur, below = normal[np.ix_(joint, joint)], right[joint]
    roots = [cho_factor(normal[np.ix_(at, at)], lower=True) for at in parts]
    through = [cho_solve(root, normal[np.ix_(at, joint)]) for root, at in zip(roots, parts, strict=True)]
    for at, w in zip(parts, through, strict=True):
        schur = schur - normal[np.ix_(joint, at)] @ w
        below = below - w.T @ right[at]
    root = cho_factor(schur, lower=True)
    inner, own_entry = inverse(root[0]), np.diag(normal)
    x, cov = right / own_entry, np.zeros_like(normal)
    cov[np.arange(len(x)), np.arange(len(x))] = 1.0 / own_entry
    x[joint] = cho_solve(root, below)
    cov[np.ix_(joint, joint)] = inner
    whole, every = np.concatenate([*through, np.zeros((0, len(joint)))]), np.concatenate([*parts, joint[:0]])
    for own, at, w in zip(roots, parts, through, strict=True):
        x[at] = cho_solve(own, right[at]) - w @ x[joint]
        half = w @ inner
        cov[np.ix_(at, joint)], cov[np.ix_(joint, at)] = -half, -half.T
        if across:
            cov[np.ix_(at, every)] = half @ whole.T
            cov[np.ix_(at, at)] += inverse(own[0])
        else:
            cov[np.ix_(at, at)] = half @ w.T + inverse(own[0])
    return x, cov


def inverse(root: FloatArray) -> FloatArray:
    """(n,n) H⁻¹ from the lower Cholesky factor of H."""
    from scipy.linalg.lapack import dpotri

    half, _ = dpotri(root, lower=1)
    below = np.tril(half)
    return np.asarray(below + np.tril(below, -1).T)
