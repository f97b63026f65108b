"""Fits drawn from the posterior of the whole-record fit (JCGM 101: propagation of distributions).

    θ = θ̂ + R⁻ᵀ z,   S = RRᵀ the posterior precision of θ
    ω = ω̂ − X (θ − θ̂) + U⁻¹ z,   Hωω = UᵀU, X = Hωω⁻¹ Hωθ               with each θ the ω that goes with it

z independent standard normal numbers. What follows from ω and θ, a0 and α of each sample, is in samples.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import EstimationError
from nineaudit.estimate.block_tridiagonal import Factor
from nineaudit.estimate.normal import eliminate, normal_equations
from nineaudit.estimate.trajectory import Fit


def draws(fit: Fit, count: int, rng: np.random.Generator) -> Iterator[Fit]:
    """`count` times `fit` with other ω and θ. EstimationError where the readings do not determine ω."""
    normal = normal_equations(fit.point)
    solved = eliminate(normal)
    root = np.linalg.cholesky(solved.schur)
    for _ in range(count):
        change = np.linalg.solve(root.T, rng.standard_normal(len(root)))
        free = _scattered(solved.factor, rng.standard_normal((fit.omega.size, 1)))
        along = solved.factor.solve(normal.coupled(change)[:, None])
        yield replace(fit, omega=fit.omega + (free - along).reshape(-1, 3), theta=fit.theta + change)


def _scattered(factor: Factor, z: FloatArray) -> FloatArray:
    """U⁻¹ z (3·nodes, q), of covariance A⁻¹ = (UᵀU)⁻¹."""
    from scipy.linalg.lapack import dtbtrs

    solution, info = dtbtrs(factor.banded, np.asfortranarray(z), uplo="U", trans="N")
    if info != 0:
        raise EstimationError(f"banded substitution failed (LAPACK dtbtrs info {info})")
    return np.asarray(solution)
