"""ω and α of rate sensors alone, by a whole-record smoother: what a fit has where accelerometers do not tell α.

Rates at the samples leave α to whatever happens between them, so a fit needs to be told how fast a motion can change.
Prior: third differences of ω independent with standard deviation τ (α a twice integrated random walk), τ the likeliest
of the record itself,

    ω̂ = F y,   F = (1 + (σ/τ)² DᵀD)⁻¹,   D third differences                            [Whittaker 1923, Henderson 1924]
    Dy ~ N(0, τ² + σ² DDᵀ)                                                            marginal likelihood of τ

The covariance of ω̂ is σ²F, of which noise makes σ²FFᵀ and the prior, what is smoothed away, the rest. Banded, linear in
the length of the record.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.errors import EstimationError
from nineaudit.units import counted

ORDER = 3
_DIFFERENCE = np.array([-1.0, 3.0, -3.0, 1.0])
SMALLEST, LARGEST = 1e-5, 1e2
"""τ/σ that is looked through: a smoother over some 300 samples, which rounding still allows, to one of nothing."""


@dataclass(frozen=True, eq=False)
class Smoother:
    """F of `count` samples for three axes of noise `sigma` (3,) rad/s, third differences of
    `tau` (3,) rad/s."""

    count: int
    sigma: FloatArray
    tau: FloatArray

    def __call__(self, values: FloatArray) -> FloatArray:
        """F v (n,3) of `values` (n,3), an axis a column; F is its own transpose."""
        from scipy.linalg import cho_solve_banded

        return np.stack([cho_solve_banded((f, True), v) for f, v in zip(self._factors, values.T, strict=True)], axis=1)

    @cached_property
    def _factors(self) -> list[FloatArray]:
        from scipy.linalg import cholesky_banded

        inner = _gram(self.count)
        return [
            cholesky_banded(_plus(inner * (s / t) ** 2, 1.0), lower=True)
            for s, t in zip(self.sigma, self.tau, strict=True)
        ]

    def smoothed_away(self, by_omega: FloatArray) -> float:
        """Standard deviation, by the prior, of what a number with derivatives (n,3) loses: √σ²(v·Fv − |Fv|²)."""
        kept = self(by_omega)
        lost = (by_omega * kept).sum(axis=0) - (kept**2).sum(axis=0)
        return float(np.sqrt(max(float(self.sigma**2 @ lost), 0.0)))


def smoother(rates: FloatArray, sigma: FloatArray) -> Smoother:
    """The smoother of `rates` (n,3) rad/s of noise `sigma` (3,), τ of each axis by maximum likelihood, evenly sampled.

    EstimationError where the record is too short to tell τ.
    """
    if len(rates) < 4 * ORDER:
        raise EstimationError(
            "too short to smooth the rates", found=counted(len(rates), "sample"), expected=f"at least {4 * ORDER}"
        )
    differences = np.diff(rates, ORDER, axis=0)
    tau = [_likeliest(d, float(s)) for d, s in zip(differences.T, sigma, strict=True)]
    return Smoother(len(rates), sigma, np.array(tau))


def noise_of_rates(array: SensorArray, sigma: FloatArray) -> FloatArray:
    """(3,) noise of ω by weighted least squares of the rate sensors; `sigma` (k,)."""
    held = ~array.is_accelerometer
    weighted = array.axes[held] / sigma[held, None]
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(weighted.T @ weighted))))


def _likeliest(differences: FloatArray, sigma: float) -> float:
    """τ of third differences (m,) of rates of noise `sigma`."""
    from scipy.linalg import cho_solve_banded, cholesky_banded
    from scipy.optimize import minimize_scalar

    inner = _outer(len(differences)) * sigma**2

    def cost(log_tau: float) -> float:
        """−ln L up to a constant."""
        factor = cholesky_banded(_plus(inner, float(np.exp(2.0 * log_tau))), lower=True)
        return float(0.5 * differences @ cho_solve_banded((factor, True), differences) + np.log(factor[0]).sum())

    ends = np.log(SMALLEST * sigma), np.log(LARGEST * max(sigma, float(np.abs(differences).max())))
    found = minimize_scalar(cost, bounds=ends, method="bounded", options={"xatol": 1e-3})
    return float(np.exp(found.x))


def _plus(band: FloatArray, value: float) -> FloatArray:
    out = band.copy()
    out[0] += value
    return out


def _gram(count: int) -> FloatArray:
    """DᵀD (n,n) as a lower band (4,n)."""
    out = np.zeros((ORDER + 1, count))
    for lag in range(ORDER + 1):
        for i in range(ORDER + 1 - lag):  # row r of D holds _DIFFERENCE at r … r+3
            out[lag, i : count - ORDER + i] += _DIFFERENCE[i] * _DIFFERENCE[i + lag]
    return out


def _outer(count: int) -> FloatArray:
    """DDᵀ as a lower band (4,m), m third differences."""
    out = np.zeros((ORDER + 1, count))
    for lag in range(ORDER + 1):
        out[lag, : count - lag] = float(_DIFFERENCE[lag:] @ _DIFFERENCE[: ORDER + 1 - lag])
    return out
