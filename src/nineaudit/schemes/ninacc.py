"""NINACC: three or more triaxial accelerometers anywhere on the body, in any orientation [Alem77].

α and a0 by least squares at every sample, weighted with the inverse covariance W = V⁻¹ (the paper prints V):

    [a0; α] = K (y − q(ω)),   K = (HᵀWH)⁻¹ HᵀW                                            [Alem77, METHODS 1.2]

and, for triaxes of equal weight, about their centroid (the printed eq 15 holds only with Q0 there), ρ_i = r_i − r̄:

    Σ(|ρ_i|² I − ρ_i ρ_iᵀ) α = Σ ρ_i × (a_i − ω × (ω × ρ_i))                               [Alem77 eq 15]

ω is fed back and integrated forward by the fourth-order Adams–Bashforth–Moulton predictor–corrector (PECE):

    ω* = ω_i + h/24 (55 f_i − 59 f_i−1 + 37 f_i−2 − 9 f_i−3),   ω_i+1 = ω_i + h/24 (9 f* + 19 f_i − 5 f_i−1 + f_i−2)

with f = α(y, ω). The feedback lets an error grow with the angle turned, by e^0.53 per rad for triaxes at 3, 4, 5 in
(METHODS 1.3; growth.py): the whole-record smoother (estimate/trajectory.py) has no such growth.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.errors import EstimationError
from nineaudit.estimate.motion import Motion, bridge
from nineaudit.physics import rigid_body
from nineaudit.units import counted

LARGEST_CONDITION: Final = 1e6
"""Of H, lengths in units of the array's size: beyond, a part in a million of geometry decides over α."""
POOR_CONDITION: Final = 100.0
"""Of the same H: beyond, α rests on a hundredth of the array's size, which alignment to 0.5° does not hold."""
UNEVEN: Final = 1e-3
"""Largest relative difference of sampling steps that counts as uniform."""
_STARTER = np.array([[0, 0, 0, 0], [9, 19, -5, 1], [8, 32, 8, 0], [9, 27, 27, 9]]) / 24.0
"""∫ from the first sample to each of the first four, of the cubic through them, over h."""
_SETTLED, _ROUNDS = 1e-14, 100


class Solver(NamedTuple):
    """`k` (6,k) from readings less centripetal part to [a0; α], `products` (6,6) K·Q, `condition` of the scaled H."""

    k: FloatArray
    products: FloatArray
    condition: float


def solver(positions: FloatArray, axes: FloatArray, covariance: FloatArray | None = None) -> Solver:
    """K = (HᵀV⁻¹H)⁻¹HᵀV⁻¹ of accelerometers at `positions` (k,3) m along `axes` (k,3).

    `covariance` V: (k,) variances or (k,k); None: all alike. Raises EstimationError, naming rank and condition number,
    where the array does not determine α (fewer than six channels, triaxes on one line), or V is not positive definite.
    """
    size = float(np.ptp(positions, axis=0).max()) if len(positions) else 0.0
    scaled = rigid_body.design((positions - positions.mean(axis=0)) / (size or 1.0), axes) if len(positions) else None
    singular = np.zeros(1) if scaled is None else np.linalg.svd(scaled, compute_uv=False)
    rank = int(np.count_nonzero(singular > singular.max() / LARGEST_CONDITION)) if singular.max() > 0 else 0
    if rank < 6:
        least = singular[5] if len(singular) > 5 else 0.0
        condition = "infinite" if least <= 1e-12 * singular[0] else f"{singular[0] / least:.2g}"
        raise EstimationError(
            "angular acceleration is not determined by the accelerometers",
            found=f"{counted(len(axes), 'channel')}, H of rank {rank}, condition number {condition}",
            expected=f"rank 6, condition number below {LARGEST_CONDITION:.0e}",
            advice="triaxes on one line do not see the turning about it: move one of them off the line",
        )
    design = rigid_body.design(positions, axes)
    whitened = _root(covariance, len(axes))
    k = np.linalg.pinv(whitened @ design) @ whitened
    return Solver(k, k @ rigid_body.product_matrix(positions, axes), float(singular[0] / singular[5]))


def _root(covariance: FloatArray | None, channels: int) -> FloatArray:
    """(k,k) R with RᵀR = V⁻¹."""
    if covariance is None:
        return np.eye(channels)
    full = np.diag(covariance) if covariance.ndim == 1 else covariance
    fits = full.shape == (channels, channels) and bool(np.isfinite(full).all())
    values = np.linalg.eigvalsh(full) if fits else np.full(1, np.nan)
    if not values.min() > 0.0:
        raise EstimationError(
            "covariance of the readings cannot be inverted",
            found=f"shape {covariance.shape}, least eigenvalue {values.min():.2g}",
            expected=f"{channels} positive variances, or a positive definite {channels}×{channels} matrix",
        )
    return np.asarray(np.linalg.inv(np.linalg.cholesky(full)))


def alpha_at_centroid(positions: FloatArray, accelerations: FloatArray, omega: FloatArray) -> FloatArray:
    """α (n,3) rad/s² from `accelerations` (n,t,3) m/s², body axes, of t triaxes at `positions` (t,3) m, and ω (n,3).

    Eq 15 with Q0 at the centroid; equal weights. EstimationError where the triaxes lie on one line.
    """
    rho = positions - positions.mean(axis=0)
    inertia = (rho**2).sum() * np.eye(3) - rho.T @ rho
    if np.linalg.matrix_rank(inertia, rtol=1e-9) < 3:
        raise EstimationError(
            "the triaxes lie on one line",
            found=f"rank {np.linalg.matrix_rank(inertia, rtol=1e-9)}",
            expected="rank 3",
            advice="move one of them off the line",
        )
    turning = np.cross(omega[:, None], np.cross(omega[:, None], rho))
    moment = np.cross(rho, accelerations - turning).sum(axis=1)
    return np.asarray(np.linalg.solve(inertia, moment.T).T)


def forward(
    array: SensorArray,
    time: FloatArray,
    readings: FloatArray,
    omega0: FloatArray,
    covariance: FloatArray | None = None,
) -> Motion:
    """ω, α, a0 by the paper: least squares of all accelerometers, ω fed back by predictor–corrector from `omega0` (3,).

    `readings` (n,k) SI, zeroed; rate sensors are not used; gaps are bridged. `covariance` as in `solver`, of the
    accelerometers. Raises EstimationError: geometry (`solver`), fewer than four samples or uneven steps, divergence.
    """
    held = array.is_accelerometer
    positions, axes = array.positions[held], array.axes[held]
    solved = solver(positions, axes, covariance)
    step = _step(time)
    y = bridge(readings[:, held], time)
    omega = predictor_corrector(y @ solved.k[3:].T, solved.products[3:], step, omega0)
    state = (y - rigid_body.centripetal(positions, axes, omega)) @ solved.k.T
    method = "NINACC: least squares, ω by predictor–corrector [Alem77]"
    return Motion(omega, state[:, 3:], state[:, :3], method + _poor(solved.condition))


def poor(positions: FloatArray, axes: FloatArray) -> str:
    """A warning where accelerometers at `positions` (k,3) along `axes` (k,3) hardly determine α, or nothing of it, with
    rank and condition number of H; else the empty string."""
    try:
        return _poor(solver(positions, axes).condition).removeprefix("; ")
    except EstimationError as error:
        return str(error)


def _poor(condition: float) -> str:
    """A warning where the layout hardly determines α, else nothing."""
    if condition <= POOR_CONDITION:
        return ""
    return (
        f"; H of condition number {condition:.2g}, over {POOR_CONDITION:g}: the accelerometers lie nearly on one line"
        " and hardly see the turning about it, α and ω are mostly error: move one of them off the line"
    )


def predictor_corrector(free: FloatArray, products: FloatArray, step: float, omega0: FloatArray) -> FloatArray:
    """ω (n,3) of dω/dt = free − products·[ωx², ωy², ωz², ωyωz, ωzωx, ωxωy], `free` (n,3), `products` (3,6), fourth
    order, the first four samples by Picard iteration on the cubic through them. EstimationError where it diverges."""
    omega = np.empty_like(free)
    with np.errstate(over="ignore", invalid="ignore"):
        omega[:4] = _first_four(free[:4], products, step, omega0)
        f = [free[i] - products @ _products(omega[i]) for i in range(4)]
        for i in range(3, len(free) - 1):
            predicted = omega[i] + step / 24.0 * (55.0 * f[3] - 59.0 * f[2] + 37.0 * f[1] - 9.0 * f[0])
            ahead = free[i + 1] - products @ _products(predicted)
            omega[i + 1] = omega[i] + step / 24.0 * (9.0 * ahead + 19.0 * f[3] - 5.0 * f[2] + f[1])
            f = [*f[1:], free[i + 1] - products @ _products(omega[i + 1])]
    if not np.isfinite(omega).all():
        lost = int(np.argmin(np.isfinite(omega).all(axis=1)))
        raise EstimationError(
            "angular velocity diverges when it is fed back",
            place=f"sample {lost} of {len(omega)}",
            advice="use the whole-record fit (--method map), which feeds nothing back",
        )
    return omega


def _first_four(free: FloatArray, products: FloatArray, step: float, omega0: FloatArray) -> FloatArray:
    omega = np.tile(np.asarray(omega0, dtype=np.float64), (4, 1))
    for _ in range(_ROUNDS):
        f = free - np.stack([products @ _products(w) for w in omega])
        better = omega0 + step * (_STARTER @ f)
        change = float(np.abs(better - omega).max())
        omega = better
        if not change > _SETTLED * max(1.0, float(np.abs(omega).max())):
            break
    return omega


def _products(w: FloatArray) -> FloatArray:
    x, y, z = w
    return np.array([x * x, y * y, z * z, y * z, z * x, x * y])


def _step(time: FloatArray) -> float:
    """The sampling step, s; EstimationError unless there are four samples at even steps."""
    steps = np.diff(time)
    if len(time) < 4 or not (steps > 0).all() or np.ptp(steps) > UNEVEN * steps.mean():
        raise EstimationError(
            "the predictor–corrector needs even steps",
            found=f"{len(time)} samples, steps of {steps.min(initial=np.inf):.3g} to {steps.max(initial=0):.3g} s",
            expected="four samples or more, evenly spaced",
            advice="resample the recording, or use --method map",
        )
    return float((time[-1] - time[0]) / (len(time) - 1))
