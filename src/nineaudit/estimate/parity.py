"""Parity of a redundant array: what must vanish whatever the body does (METHODS.md 2).

With N H = 0, the accelerometers give r_a = N (y − q(ω)), free of a0 and α; rate sensors beyond three axes give
r_g = M y_g with M G = 0. For a 3-2-2-2 array r_a are the three constraint equations of Takhounts09 eq 14 in an
orthonormal mixture. The residual of a channel is its share of the projection, e = Nᵀ r.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import BoolArray, FloatArray, SensorArray
from nineaudit.errors import EstimationError
from nineaudit.estimate import calibration
from nineaudit.estimate.motion import OFF_IDEAL, Motion, bridge, has_rates
from nineaudit.physics import kinematics, rigid_body

NOTHING = 1e-9
"""Part of a channel that others contradict, below which it is rounding."""


def redundancy(array: SensorArray) -> tuple[int, int]:
    """Number of parity rows of the accelerometers and of the rate sensors; (0, 0): nothing can be tested."""
    accelerometers = array.is_accelerometer
    design = rigid_body.design(array.positions[accelerometers], array.axes[accelerometers])
    spare = len(rigid_body.parity(design)) if len(design) else 0
    return spare, int((~accelerometers).sum()) - 3 if has_rates(array) else 0


def tells_alpha(array: SensorArray) -> bool:
    """Whether the accelerometers tell α and a0 at one instant, ω being known: rank 6 of H."""
    held = array.is_accelerometer
    design = rigid_body.design(array.positions[held], array.axes[held])
    return len(design) > 0 and int(np.linalg.matrix_rank(design, tol=1e-6)) == 6


def redundant(array: SensorArray) -> bool:
    """Whether a record can contradict itself: at one instant, or over time, by dω/dt = α of rate sensors on three axes
    and accelerometers that tell α."""
    return sum(redundancy(array)) > 0 or (has_rates(array) and tells_alpha(array))


@dataclass(frozen=True, eq=False)
class Residual:
    """Per channel: `value` (n,k) the disagreement, `noise` (n,k) its standard deviation from noise alone, and
    `budget` (n,k) its standard deviation from noise and calibration together; SI, NaN where not evaluated."""

    value: FloatArray
    noise: FloatArray
    budget: FloatArray


def measured_residuals(
    array: SensorArray, time: FloatArray, readings: FloatArray, sigma: FloatArray, motion: Motion, made: BoolArray
) -> Residual:
    """As channel_residuals, of what was measured: where readings are `made` (n,k) of other channels, the rest of the
    array is held against itself, and they have no residual."""
    patterns, which = np.unique(made, axis=0, return_inverse=True)
    found = channel_residuals(array, time, readings, sigma, motion, ~patterns[0])
    for p, pattern in enumerate(patterns[1:], 1):
        rows = (which.ravel() == p)[:, None]
        other = channel_residuals(array, time, readings, sigma, motion, ~pattern)
        found = Residual(
            np.where(rows, other.value, found.value),
            np.where(rows, other.noise, found.noise),
            np.where(rows, other.budget, found.budget),
        )
    return found


def channel_residuals(
    array: SensorArray,
    time: FloatArray,
    readings: FloatArray,
    sigma: FloatArray,
    motion: Motion,
    used: BoolArray | None = None,
) -> Residual:
    """Residual of every channel against the whole array, or of the `used` (k,) ones against each other, with its error
    budget.

    `readings` (n,k) SI zeroed (NaN invalid), `sigma` (k,) noise, `motion` from the same readings. A sample with
    an invalid channel is NaN in every channel it takes part with, and so is one at which ω is
    not known. Channels without redundancy are NaN.
    """
    held = np.ones(len(array), dtype=np.bool_) if used is None else used
    accelerometers, gyros = np.flatnonzero(array.is_accelerometer), np.flatnonzero(~array.is_accelerometer)
    value, variance = np.full(readings.shape, np.nan), np.zeros(readings.shape)
    noise = np.full(readings.shape, np.nan)
    patterns = calibration.all_columns(array, bridge(readings, time), time, motion)
    readings = np.where(held, readings, 0.0)
    positions, axes = array.positions[accelerometers], array.axes[accelerometers]
    projector = _projector(rigid_body.design(positions, axes), held[accelerometers])
    if projector.any():
        y = readings[:, accelerometers] - rigid_body.centripetal(positions, axes, motion.omega)
        value[:, accelerometers] = y @ projector.T
        if motion.known is not None:
            value[np.ix_(~motion.known, accelerometers)] = np.nan
        noise[:, accelerometers] = np.sqrt(projector**2 @ sigma[accelerometers] ** 2)
        variance[:, accelerometers] = _accelerometer_budget(array, time, motion, patterns, projector, sigma, held)
        value[:, accelerometers[~projector.any(axis=1)]] = np.nan
    spare = _projector(array.axes[gyros], held[gyros])
    if spare.any() and has_rates(array):
        value[:, gyros] = readings[:, gyros] @ spare.T
        noise[:, gyros] = np.sqrt(spare**2 @ sigma[gyros] ** 2)
        variance[:, gyros] = np.einsum("ij,jnp->ni", spare**2, patterns[gyros] ** 2)
        value[:, gyros[~spare.any(axis=1)]] = np.nan
    return Residual(value, noise, np.sqrt(variance + noise**2))


@dataclass(frozen=True)
class Worst:
    """The residual that exceeds its budget most: `column`, `row`, its size, its limit, its noise; SI."""

    column: int
    row: int
    value: float
    limit: float
    noise: float


def budget_factor(false_alarm: float, count: int) -> float:
    """How many standard deviations `count` residuals of a healthy array exceed once in 1/`false_alarm` records."""
    from statistics import NormalDist

    return -NormalDist().inv_cdf(false_alarm / (2.0 * max(count, 1)))


def worst(residual: Residual, false_alarm: float) -> Worst:
    """The worst residual and its limit for a false-alarm probability. EstimationError when there is none.

    Twins have the same ratio but for the last bits: of equals the first is named, on every machine.
    """
    ratio = np.abs(residual.value) / residual.budget
    if not np.isfinite(ratio).any():
        raise EstimationError("no sample has enough valid channels to test the array against itself")
    largest = ratio >= (1.0 - 1e-9) * np.nanmax(ratio)
    row, column = np.unravel_index(int(np.argmax(largest)), ratio.shape)
    factor = budget_factor(false_alarm, int(np.isfinite(ratio).sum()))
    return Worst(
        int(column),
        int(row),
        float(abs(residual.value[row, column])),
        float(factor * residual.budget[row, column]),
        float(residual.noise[row, column]),
    )


def _projector(design: FloatArray, used: BoolArray) -> FloatArray:
    """I − H H⁺ (k,k) of the used rows, onto what no motion can explain; 0 for the others and for a row that no other
    contradicts."""
    out = np.zeros((len(design), len(design)))
    if used.any():
        rows = design[used]
        found = np.eye(len(rows)) - rows @ np.linalg.pinv(rows)
        free = np.diag(found) > NOTHING
        out[np.ix_(used, used)] = np.where(np.outer(free, free), found, 0.0)
    return out


def _accelerometer_budget(
    array: SensorArray,
    time: FloatArray,
    motion: Motion,
    patterns: FloatArray,
    projector: FloatArray,
    sigma: FloatArray,
    used: BoolArray,
) -> FloatArray:
    """(n,a) variance of the accelerometers' residuals from calibration errors and from the noise in ω.

    δr = P (δy − ∂q/∂ω δω), with δω = G δy_g from rate sensors, or δω = ∫ L δy where ω is integrated.
    """
    accelerometers = np.flatnonzero(array.is_accelerometer)
    positions, axes = array.positions[accelerometers], array.axes[accelerometers]
    feed = np.einsum("ij,njc->nic", projector, rigid_body.centripetal_jacobian(positions, axes, motion.omega))
    variance = np.zeros((len(time), len(accelerometers)))
    rates = has_rates(array)
    if rates:
        gyros = np.flatnonzero(~array.is_accelerometer & used)
        gain = np.linalg.pinv(array.axes[gyros] / sigma[gyros, None]) / sigma[gyros]
        for j, g in enumerate(gyros):
            through = feed @ gain[:, j]
            variance += through**2 * ((patterns[g] ** 2).sum(axis=1) + sigma[g] ** 2)[:, None]
        for j, a in enumerate(accelerometers):
            variance += projector[:, j] ** 2 * (patterns[a] ** 2).sum(axis=1)[:, None]
        return variance
    combination = rigid_body.product_free_alpha(positions, axes, leak=OFF_IDEAL)
    step = np.gradient(time)
    for j, a in enumerate(accelerometers):
        through = feed @ combination[:, j]
        turned = kinematics.integrate(patterns[a], time, np.zeros(patterns.shape[2]))
        direct = projector[:, j][None, :, None] * patterns[a][:, None, :]
        variance += ((direct - through[:, :, None] * turned[:, None, :]) ** 2).sum(axis=2)
        variance += through**2 * (sigma[a] ** 2 * np.cumsum(step**2))[:, None]
    return variance
