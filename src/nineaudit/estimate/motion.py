"""ω, α and a0 of the body from all channels, taken at their word (METHODS.md 1.3).

With rate sensors on three axes ω is their least-squares mean and α follows from the accelerometers,
α = K(y − q(ω)), or by differentiation where those do not span α. Without rate sensors α must not feed on ω
(the least-squares feedback grows by e^0.5 to e^1 per rad of rotation): the product-free combination L with
L[H Q] = [0 I 0] is used, Padgaonkar's for a 3-2-2-2 array, and ω = ω(0) + ∫α.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from nineaudit.array import BoolArray, FloatArray, SensorArray
from nineaudit.errors import EstimationError
from nineaudit.physics import kinematics, rigid_body

OFF_IDEAL = 0.05
"""Largest part of the products of ω that may leak into α: seismic masses sit some mm off the ideal points."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Body-frame `omega` rad/s, `alpha` rad/s², `a0` m/s² at the array's origin, each (n,3); `method` in words.

    `known` (n,): False where ω was bridged because too few rate sensors were valid; None: all of it is known.
    """

    omega: FloatArray
    alpha: FloatArray
    a0: FloatArray
    method: str
    known: BoolArray | None = None


def bridge(readings: FloatArray, time: FloatArray) -> FloatArray:
    """(n,k) `readings` with invalid samples bridged by straight lines, ends held; EstimationError if all are.

    Only for quantities that need every sample (integrals); what is bridged is never judged.
    """
    out = readings.copy()
    for k in range(out.shape[1]):
        good = np.isfinite(out[:, k])
        if not good.any():
            raise EstimationError(f"channel {k + 1} of the array has no valid sample")
        if not good.all():
            out[:, k] = np.interp(time, time[good], out[good, k])
    return out


def has_rates(array: SensorArray) -> bool:
    """Whether rate sensors span three axes."""
    gyros = ~array.is_accelerometer
    return bool(gyros.any()) and int(np.linalg.matrix_rank(array.axes[gyros], tol=1e-3)) == 3


def product_free(array: SensorArray) -> bool:
    """Whether the accelerometers give α without products of ω."""
    held = array.is_accelerometer
    try:
        rigid_body.product_free_alpha(array.positions[held], array.axes[held], leak=OFF_IDEAL)
    except EstimationError:
        return False
    return True


def resampled(values: FloatArray, at: FloatArray, time: FloatArray) -> FloatArray:
    """(n,3) `values` (m,3) at times `at`, carried to `time` (n,) by straight lines, ends held."""
    return np.stack([np.interp(time, at, values[:, i]) for i in range(values.shape[1])], axis=1)


def rates_omega(axes: FloatArray, readings: FloatArray, sigma: FloatArray, valid: BoolArray) -> FloatArray:
    """ω (n,3) by weighted least squares of rate sensors; samples with fewer than three axes are NaN.

    `axes` (g,3), `readings` and `valid` (n,g), `sigma` (g,). Solved once per pattern of valid channels.
    """
    omega = np.full((readings.shape[0], 3), np.nan)
    patterns, which = np.unique(valid, axis=0, return_inverse=True)
    for p, good in enumerate(patterns):
        weighted = axes[good] / sigma[good, None]
        if good.sum() < 3 or np.linalg.matrix_rank(axes[good], tol=1e-3) < 3:
            continue
        rows = np.flatnonzero(which.ravel() == p)
        omega[rows] = (readings[np.ix_(rows, good)] / sigma[good]) @ np.linalg.pinv(weighted).T
    return omega


def estimate_motion(
    array: SensorArray,
    time: FloatArray,
    readings: FloatArray,
    sigma: FloatArray,
    rest_index: int | None = 0,
) -> Motion:
    """Motion of the body. `readings` (n,k) SI zeroed, NaN where invalid; `sigma` (k,) noise.

    `rest_index`: a sample at which ω = 0, None where none is known. EstimationError where the array cannot
    tell ω: neither three rate axes nor a product-free α, or no known rest to integrate from.
    """
    accelerometers, gyros = array.is_accelerometer, ~array.is_accelerometer
    positions, axes = array.positions[accelerometers], array.axes[accelerometers]
    if has_rates(array):
        valid = np.isfinite(readings[:, gyros])
        measured = rates_omega(array.axes[gyros], readings[:, gyros], sigma[gyros], valid)
        found = with_accelerations(bridge(measured, time), positions, axes, readings[:, accelerometers], time)
        return replace(found, known=np.asarray(np.isfinite(measured).all(axis=1)))
    combination = rigid_body.product_free_alpha(positions, axes, leak=OFF_IDEAL)
    if rest_index is None:
        raise EstimationError(
            "ω at the start is not known", advice="state [recording] pre_trigger with the body at rest"
        )
    alpha = bridge(readings[:, accelerometers], time) @ combination.T
    turned = kinematics.integrate(alpha, time, np.zeros(3))
    omega = turned - turned[rest_index]
    y = bridge(readings[:, accelerometers], time) - rigid_body.centripetal(positions, axes, omega)
    a0 = y @ np.linalg.pinv(rigid_body.design(positions, axes))[:3].T
    return Motion(omega, alpha, a0, "product-free α integrated from rest")


def with_accelerations(
    omega: FloatArray, positions: FloatArray, axes: FloatArray, readings: FloatArray, time: FloatArray
) -> Motion:
    """ω (n,3) with α and a0 of the accelerometers at `positions` (a,3) along `axes` (a,3), `readings` (n,a); where they
    do not tell α it is dω/dt, and a0 is NaN where their axes do not span."""
    design = rigid_body.design(positions, axes)
    rank = int(np.linalg.matrix_rank(design, tol=1e-6)) if len(design) else 0
    if rank == 6:
        y = bridge(readings, time) - rigid_body.centripetal(positions, axes, omega)
        solved = y @ np.linalg.pinv(design).T
        return Motion(omega, solved[:, 3:], solved[:, :3], "rate sensors; α by least squares of the accelerometers")
    alpha = kinematics.differentiate(omega, time)
    a0 = np.full_like(omega, np.nan)
    if len(axes) and np.linalg.matrix_rank(axes, tol=1e-3) == 3:
        moved = np.einsum("ki,nki->nk", axes, np.cross(alpha[:, None, :], positions)) + rigid_body.centripetal(
            positions, axes, omega
        )
        a0 = (bridge(readings, time) - moved) @ np.linalg.pinv(axes).T
    return Motion(omega, alpha, a0, "rate sensors; α by differentiation")
