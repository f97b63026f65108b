"""Root sum of squares for channels taken at their word (GUM 5.1.2; Martin98 eq 22; METHODS 5).

What an error of any reading does to an output, through the estimator of motion.py, linear about the motion:

    product-free     δα = L δy,   δω = U δα,   U the rule of integration from rest            [Padgaonkar75]
    rate sensors     δω = W δy,   δα = K(δy − ∂q/∂ω δω), or dδω/dt
    both             δa0 = K₀(δy − (r × n)·δα − ∂q/∂ω δω)

Read backwards, from the gradient of the output to a coefficient for every reading: c (n,k). A calibration error of one
standard deviation, which changes a channel's readings by the column D (n,), then contributes Σ c D, and white noise
√Σ c²σ².
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.errors import EstimationError
from nineaudit.estimate import calibration
from nineaudit.estimate.motion import OFF_IDEAL, Motion, bridge, estimate_motion, has_rates
from nineaudit.estimate.outputs import Gradient
from nineaudit.physics import kinematics, rigid_body


@dataclass(frozen=True, eq=False)
class Word:
    """The estimator about a `motion`: rows (3,k) of a0, α, ω (zero for channels that it does not use), the rule
    `in_time` (n,n) by which ω follows from the samples of its rows (None: its own sample), whether ω is `fed_back` into
    α, and for α by differentiation the rule `slope` (n,n) from ω."""

    array: SensorArray
    motion: Motion
    a0_rows: FloatArray
    alpha_rows: FloatArray
    omega_rows: FloatArray
    in_time: FloatArray | None
    slope: FloatArray | None
    fed_back: bool
    columns: FloatArray
    sigma: FloatArray

    def coefficients(self, gradient: Gradient) -> FloatArray:
        """(n,k) what one unit of each reading adds to an output with this gradient."""
        felt, lever = self._felt
        by_a0 = gradient.a0 @ self.a0_rows
        by_omega = gradient.omega - np.einsum("nk,nkj->nj", by_a0, felt)
        by_alpha = gradient.alpha - by_a0 @ lever
        out = by_a0
        if self.slope is None:
            direct = by_alpha @ self.alpha_rows
            out = out + direct
            if self.fed_back:
                by_omega = by_omega - np.einsum("nk,nkj->nj", direct, felt)
        else:
            by_omega = by_omega + self.slope.T @ by_alpha
        if self.in_time is not None:
            by_omega = self.in_time.T @ by_omega
        return np.asarray(out + by_omega @ self.omega_rows)

    @cached_property
    def _felt(self) -> tuple[FloatArray, FloatArray]:
        """∂q/∂ω (n,k,3) and r × n (k,3), 0 for rate sensors."""
        positions, axes = self.array.positions, self.array.axes * self.array.is_accelerometer[:, None]
        return rigid_body.centripetal_jacobian(positions, axes, self.motion.omega), np.cross(positions, axes)

    def rows(self, gradient: Gradient) -> dict[str, float]:
        """Standard uncertainty of an output with this gradient, by source."""
        by_reading = self.coefficients(gradient)
        parts = np.matmul(by_reading.T[:, None, :], self.columns)[:, 0]
        out = {
            source: float(np.linalg.norm(parts[:, [calibration.PARAMETERS.index(m) for m in members]]))
            for source, members in calibration.SOURCES.items()
        }
        return out | {"noise": float(np.sqrt((by_reading**2 @ self.sigma**2).sum()))}


def total(rows: dict[str, float]) -> float:
    """Root of the summed squares of a budget's rows."""
    return float(np.sqrt(sum(value**2 for value in rows.values())))


def at_their_word(
    array: SensorArray, time: FloatArray, readings: FloatArray, sigma: FloatArray, rest_index: int | None
) -> Word:
    """The estimator of motion.py about the motion of `readings` (n,k) SI zeroed, `sigma` (k,) their noise.

    EstimationError where the array has none: α would need ω fed back, which diverges (METHODS 1.3).
    """
    motion = estimate_motion(array, time, readings, sigma, rest_index)
    count, held = len(array), array.is_accelerometer
    h = rigid_body.design(array.positions[held], array.axes[held])
    whole = int(np.linalg.matrix_rank(h, tol=1e-6)) == 6 if len(h) else False
    a0_rows, alpha_rows, omega_rows = (np.zeros((3, count)) for _ in range(3))
    in_time = slope = None
    if len(h):
        solved = np.linalg.pinv(h) if whole else np.vstack([np.linalg.pinv(array.axes[held]), np.zeros((3, len(h)))])
        a0_rows[:, held], alpha_rows[:, held] = solved[:3], solved[3:]
    if has_rates(array):
        weight = sigma[~held]
        omega_rows[:, ~held] = np.linalg.pinv(array.axes[~held] / weight[:, None]) / weight
        slope = None if whole else kinematics.differentiate(np.eye(len(time)), time)
    else:
        alpha_rows[:, held] = rigid_body.product_free_alpha(array.positions[held], array.axes[held], leak=OFF_IDEAL)
        omega_rows = alpha_rows
        turned = kinematics.integrate(np.eye(len(time)), time, 0.0)
        in_time = turned - turned[rest_index or 0]
    columns = calibration.all_columns(array, bridge(readings, time), time, motion)
    if not np.isfinite(columns).all():
        raise EstimationError("the budget is not finite", advice="a position, an axis or a whole channel is missing")
    return Word(array, motion, a0_rows, alpha_rows, omega_rows, in_time, slope, has_rates(array), columns, sigma)
