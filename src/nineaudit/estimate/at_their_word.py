"""Root sum of squares for channels taken at their word (GUM 5.1.2; Martin98 eq 22; METHODS 5).

What an error of any reading does to an output, through the estimator of motion.py, linear about the motion:

    product-free     δα = L δy,   δω = U δα,   U the rule of integration from rest            [Padgaonkar75]
    rate sensors     δω = W δy,   δα = K(δy − ∂q/∂ω δω), or dδω/dt
    fed back         δα = K(δy − ∂q/∂ω δω),   δω = ∫δα from rest (fed_back.py)                [Becker75; Alem77]
    all              δa0 = K₀(δy − (r × n)·δα − ∂q/∂ω δω)

Read backwards, from the gradient of the output to a coefficient for every reading: c (n,k). A calibration error of one
standard deviation, which changes a channel's readings by the column D (n,), then contributes Σ c D, and white noise
√Σ c²σ².
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.errors import EstimationError
from nineaudit.estimate import calibration, fed_back
from nineaudit.estimate.motion import OFF_IDEAL, Motion, bridge, estimate_motion, has_rates, product_free
from nineaudit.estimate.outputs import Gradient
from nineaudit.estimate.rate_smoother import Smoother, noise_of_rates, smoother
from nineaudit.physics import kinematics, rigid_body

Rule = Callable[[FloatArray], FloatArray]
"""Transposed rule of integration: from derivatives (n,3) by ω at every sample to those by the samples of dω/dt."""


@dataclass(frozen=True, eq=False)
class Integral:
    """∫α by kinematics.integrate on `time` (n,), from 0 at sample `rest`."""

    time: FloatArray
    rest: int

    def __call__(self, by_omega: FloatArray) -> FloatArray:
        return np.asarray(self._matrix.T @ by_omega)

    @cached_property
    def _matrix(self) -> FloatArray:
        turned = kinematics.integrate(np.eye(len(self.time)), self.time, 0.0)
        return np.asarray(turned - turned[self.rest])


@dataclass(frozen=True, eq=False)
class Word:
    """The estimator about a `motion` at `time` (n,): rows (3,k) of a0, α, ω (zero for channels that it does not use),
    the rule `in_time` by which ω follows from the samples of its rows (None: its own sample), whether ω is `fed_back`
    into α, and for α by differentiation the rule `slope` (n,n) from ω. `columns` (k,n,8) calibration errors of one
    standard deviation, `sigma` (k,) noise; `step` (n,3) error of ω (of α where it is a slope) by the finite step."""

    array: SensorArray
    time: FloatArray
    motion: Motion
    a0_rows: FloatArray
    alpha_rows: FloatArray
    omega_rows: FloatArray
    in_time: Rule | None
    slope: FloatArray | None
    fed_back: bool
    columns: FloatArray
    sigma: FloatArray

    def coefficients(self, gradient: Gradient) -> FloatArray:
        """(n,k) what one unit of each reading adds to an output with this gradient."""
        by_a0, by_alpha, by_omega = self._by_motion(gradient)
        out = by_a0 + (by_alpha @ self.alpha_rows if self.slope is None else 0.0)
        if self.slope is not None:
            by_omega = by_omega + self.slope.T @ by_alpha
        if self.in_time is not None:
            by_omega = self.in_time(by_omega)
        return np.asarray(out + by_omega @ self.omega_rows)

    def _by_motion(self, gradient: Gradient) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Derivatives by the readings through a0 (n,k), by α (n,3), and by ω (n,3) with what it does to both."""
        felt, lever = self._felt
        by_a0 = gradient.a0 @ self.a0_rows
        by_alpha = gradient.alpha - by_a0 @ lever
        direct = by_alpha @ self.alpha_rows if self.fed_back and self.slope is None else np.zeros_like(by_a0)
        return by_a0, by_alpha, gradient.omega - np.einsum("nk,nkj->nj", by_a0 + direct, felt)

    @cached_property
    def _felt(self) -> tuple[FloatArray, FloatArray]:
        """∂q/∂ω (n,k,3) and r × n (k,3), 0 for rate sensors."""
        positions, axes = self.array.positions, self.array.axes * self.array.is_accelerometer[:, None]
        return rigid_body.centripetal_jacobian(positions, axes, self.motion.omega), np.cross(positions, axes)

    @cached_property
    def step(self) -> FloatArray:
        """(n,3) error of ω by its rule of integration, or of α by its differences: from steps twice as long, of which
        it is a third (second order: the mean of a block stands for its middle)."""
        held = self.array.is_accelerometer
        if self.slope is not None:
            return _doubled(kinematics.differentiate, self._smooth_omega, self.time)
        if isinstance(self.in_time, Integral):
            off = _doubled(kinematics.integrate, self.motion.alpha, self.time)
            return np.asarray(off - off[self.in_time.rest])
        if isinstance(self.in_time, fed_back.Carried):
            rest, y = self.in_time.rest, perfect(self.array, self.motion)[:, held]
            off = _doubled(lambda v, t: _forward(self.array, t, v, rest * len(t) // len(y)), y, self.time)
            return np.asarray(off - off[rest])
        return np.zeros_like(self.motion.omega)

    @cached_property
    def smoother(self) -> Smoother:
        """The smoother that the rates ask for. EstimationError where the record is too short."""
        return smoother(self.motion.omega, noise_of_rates(self.array, self.sigma))

    def smooth(self, rule: Smoother) -> Word:
        """The same with the rates of the whole record smoothed before α is taken from them."""
        omega = rule(self.motion.omega)
        alpha = kinematics.differentiate(omega, self.time)
        there = Motion(omega, alpha, np.zeros_like(omega), "")
        off = perfect(self.array, replace(self.motion, a0=there.a0)) - perfect(self.array, there)
        moved = Motion(omega, alpha, self.motion.a0 + off @ self.a0_rows.T, "rates smoothed over the whole record")
        return replace(self, motion=moved, in_time=rule)

    @property
    def _smooth_omega(self) -> FloatArray:
        """(n,3) ω, without the noise that its differences would be made of."""
        own = self.motion.omega
        return own if isinstance(self.in_time, Smoother) else self.smoother(own)

    def step_error(self, gradient: Gradient) -> float:
        """What the finite step does to an output, absolute, and what a smoother takes away."""
        _, by_alpha, by_omega = self._by_motion(gradient)
        found = abs(float(((by_omega if self.slope is None else by_alpha) * self.step).sum()))
        if not isinstance(self.in_time, Smoother):
            return found
        through = by_omega if self.slope is None else by_omega + self.slope.T @ by_alpha
        return float(np.hypot(found, self.in_time.smoothed_away(through)))

    def by_channel(self, by_reading: FloatArray, _: Gradient) -> dict[str, FloatArray]:
        """(k,) standard uncertainty that each channel brings by each source, from the coefficients (n,k)."""
        parts = np.matmul(by_reading.T[:, None, :], self.columns)[:, 0]
        out = {
            source: np.linalg.norm(parts[:, [calibration.PARAMETERS.index(m) for m in members]], axis=1)
            for source, members in calibration.SOURCES.items()
        }
        return out | {"noise": np.linalg.norm(by_reading, axis=0) * self.sigma}


def at_their_word(
    array: SensorArray,
    time: FloatArray,
    readings: FloatArray,
    sigma: FloatArray,
    rest_index: int | None,
    about: Motion | None = None,
) -> Word:
    """The estimator of motion.py, or of fed_back.py where α needs ω, about the motion of `readings` (n,k) SI zeroed
    (`about`: about that one), `sigma` (k,) their noise.

    EstimationError where the array tells no motion, or the rest from which ω is integrated is not known.
    """
    motion = motion_at_their_word(array, time, readings, sigma, rest_index) if about is None else about
    count, held = len(array), array.is_accelerometer
    whole = spans(array)
    a0_rows, alpha_rows, omega_rows = (np.zeros((3, count)) for _ in range(3))
    in_time: Rule | None = None
    slope = None
    if held.any():
        h = rigid_body.design(array.positions[held], array.axes[held])
        solved = np.linalg.pinv(h) if whole else np.vstack([np.linalg.pinv(array.axes[held]), np.zeros((3, len(h)))])
        a0_rows[:, held], alpha_rows[:, held] = solved[:3], solved[3:]
    if has_rates(array):
        weight = sigma[~held]
        omega_rows[:, ~held] = np.linalg.pinv(array.axes[~held] / weight[:, None]) / weight
        slope = None if whole else kinematics.differentiate(np.eye(len(time)), time)
    elif product_free(array):
        alpha_rows[:, held] = rigid_body.product_free_alpha(array.positions[held], array.axes[held], leak=OFF_IDEAL)
        omega_rows, in_time = alpha_rows, Integral(time, _known(rest_index))
    else:
        felt = rigid_body.centripetal_jacobian(array.positions[held], array.axes[held], motion.omega)
        back = np.einsum("ia,nac->nic", alpha_rows[:, held], felt)
        omega_rows, in_time = alpha_rows, fed_back.Carried(back, time, _known(rest_index))
    columns = calibration.all_columns(array, bridge(readings, time), time, motion)
    if not np.isfinite(columns).all():
        raise EstimationError("the budget is not finite", advice="a position, an axis or a whole channel is missing")
    fed = not isinstance(in_time, Integral)
    return Word(array, time, motion, a0_rows, alpha_rows, omega_rows, in_time, slope, fed, columns, sigma)


def motion_at_their_word(
    array: SensorArray, time: FloatArray, readings: FloatArray, sigma: FloatArray, rest_index: int | None
) -> Motion:
    """The motion that at_their_word() is about. EstimationError as there."""
    if has_rates(array) or product_free(array) or not spans(array):
        return estimate_motion(array, time, readings, sigma, rest_index)
    held = array.is_accelerometer
    y = bridge(readings[:, held], time)
    omega, alpha = (v[:, 0] for v in fed_back.integrate(array, time, y[:, None], _known(rest_index)))
    return with_a0(array, y, omega, alpha)


def with_a0(array: SensorArray, readings: FloatArray, omega: FloatArray, alpha: FloatArray) -> Motion:
    """The motion of ω and α (n,3) with a0 from the `readings` (n,a) of accelerometers that span α."""
    held = array.is_accelerometer
    positions, axes = array.positions[held], array.axes[held]
    y = readings - rigid_body.centripetal(positions, axes, omega)
    a0 = y @ np.linalg.pinv(rigid_body.design(positions, axes))[:3].T
    return Motion(omega, alpha, a0, "least-squares α, ω fed back from rest")


def perfect(array: SensorArray, motion: Motion) -> FloatArray:
    """(n,k) readings of a perfect instrument in a motion; a0 counts as 0 where it is not known."""
    positions, axes, a0 = array.positions, array.axes, np.nan_to_num(motion.a0)
    return rigid_body.predict(positions, axes, array.is_accelerometer, a0, motion.alpha, motion.omega)


def spans(array: SensorArray) -> bool:
    """Whether the accelerometers tell α."""
    held = array.is_accelerometer
    h = rigid_body.design(array.positions[held], array.axes[held])
    return len(h) >= 6 and int(np.linalg.matrix_rank(h, tol=1e-6)) == 6


def _known(rest_index: int | None) -> int:
    if rest_index is None:
        raise EstimationError(
            "ω at the start is not known", advice="state [recording] pre_trigger with the body at rest"
        )
    return rest_index


def _forward(array: SensorArray, time: FloatArray, readings: FloatArray, rest: int) -> FloatArray:
    return fed_back.integrate(array, time, readings[:, None], rest)[0][:, 0]


def _doubled(rule: Callable[[FloatArray, FloatArray], FloatArray], values: FloatArray, time: FloatArray) -> FloatArray:
    """(n,m) error of a second-order rule of `values` (n,m): that of the means of pairs less that of the samples, over
    2² − 1 (Richardson)."""
    from scipy.interpolate import CubicSpline

    whole = len(time) // 2 * 2
    at, means = time[:whole].reshape(-1, 2).mean(axis=1), values[:whole].reshape(whole // 2, 2, -1).mean(axis=1)
    return np.asarray((CubicSpline(at, rule(means, at))(time) - rule(values, time)) / 3.0)
