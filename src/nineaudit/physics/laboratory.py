"""From the body to the laboratory: attitude, Euler angles, gravity, and the path of any point of the body.

C (3,3) takes body to laboratory components, v_lab = C v_body; yaw ψ, pitch θ, roll φ turn about z, then the new y,
then the new x, so that Cᵀ = Rx(φ) Ry(θ) Rz(ψ), element [1,1] = cos ψ cos θ     [Alem77 eq 19, first element put right]

    a = C f + g                              f specific force (body), g gravity (laboratory; +z is down in SAE J1733)
    v = v(0) + ∫a dt,   x = x(0) + ∫v dt     of the array's origin
    a_p = a + C (α × r + ω × (ω × r)),   v_p = v + C (ω × r),   x_p = x + C r                of a point r of the body

A reading whose zero was taken at rest has lost n·Cᵀg of the rest, so there f = reading − C(rest)ᵀ g. SI; angles in rad.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import EstimationError
from nineaudit.physics.kinematics import integrate

GIMBAL = 1e-6
"""cos θ below which yaw and roll are one angle, and their rates have no meaning."""


@dataclass(frozen=True, eq=False)
class Path:
    """Acceleration, velocity and position (n,3) of a point in the laboratory, and the same in body components."""

    a: FloatArray
    v: FloatArray
    x: FloatArray
    a_body: FloatArray
    v_body: FloatArray
    x_body: FloatArray


def attitude_of(euler: FloatArray) -> FloatArray:
    """C (...,3,3) of yaw, pitch, roll (...,3) rad [Alem77 eq 19]."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_euler("ZYX", euler).as_matrix())


def euler_of(attitude: FloatArray) -> FloatArray:
    """Yaw, pitch, roll (n,3) rad of C (n,3,3), yaw and roll without jumps of 2π. Exactly at pitch ±90° only yaw ∓ roll
    is defined: roll is 0 there."""
    from scipy.spatial.transform import Rotation

    with warnings.catch_warnings():  # scipy says that roll was set to 0, and so does the docstring
        warnings.filterwarnings("ignore", message="Gimbal lock", category=UserWarning)
        angles = np.asarray(Rotation.from_matrix(attitude).as_euler("ZYX"))
    angles[:, [0, 2]] = np.unwrap(angles[:, [0, 2]], axis=0)
    return angles


def quaternion_of(attitude: FloatArray) -> FloatArray:
    """Unit quaternions x, y, z, w (n,4) of C (n,3,3), without jumps of sign."""
    from scipy.spatial.transform import Rotation

    found = np.asarray(Rotation.from_matrix(attitude).as_quat())
    flips = np.where(np.einsum("ni,ni->n", found[1:], found[:-1]) < 0.0, -1.0, 1.0)
    return np.asarray(found * np.concatenate([[1.0], np.cumprod(flips)])[:, None])


def euler_rates(euler: FloatArray, omega: FloatArray) -> FloatArray:
    """Rates of yaw, pitch, roll (n,3) rad/s of body-frame `omega` (n,3) at the angles `euler` (n,3):

        ψ̇ = (ωy sφ + ωz cφ)/cθ,   θ̇ = ωy cφ − ωz sφ,   φ̇ = ωx + tθ (ωy sφ + ωz cφ)

    that is 1/C2 times the rows (0, S3, C3), (0, C2 C3, −C2 S3), (C2, S2 S3, S2 C3) [Alem77 eq 22, row 2 and element
    3,1 corrected]. EstimationError at gimbal lock: integrate the attitude (kinematics.orientation) instead.
    """
    (_, pitch, roll), (x, y, z) = euler.T, omega.T
    least = float(np.abs(np.cos(pitch)).min())
    if least < GIMBAL:
        raise EstimationError(
            "Euler rates are singular (gimbal lock)",
            found=f"cos(pitch) = {least:.2g}",
            expected=f"at least {GIMBAL:g}",
            advice="use the attitude or the quaternion, which have no such place",
        )
    turn = (y * np.sin(roll) + z * np.cos(roll)) / np.cos(pitch)
    return np.stack([turn, y * np.cos(roll) - z * np.sin(roll), x + np.sin(pitch) * turn], axis=1)


def without_gravity(a0: FloatArray, attitude: FloatArray, gravity: FloatArray, rest: int | None = None) -> FloatArray:
    """Acceleration (n,3) of the origin in body components from the specific force `a0` (n,3): a0 + Cᵀ g.

    `gravity` (3,) m/s² in the laboratory. `rest`: a sample at which the body is at rest and to whose readings the zero
    was taken: a0 + (C − C(rest))ᵀ g. None: the readings still hold all of gravity.
    """
    pull = np.einsum("nij,i->nj", attitude, gravity)
    return np.asarray(a0 + pull - (0.0 if rest is None else pull[rest]))


def origin_path(
    time: FloatArray, a0: FloatArray, attitude: FloatArray, velocity: FloatArray, position: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """a, v, x (n,3) of the origin in the laboratory from `a0` (n,3), its acceleration in body components, gravity put
    right, and its `velocity` and `position` (3,) at time[0]."""
    a = np.einsum("nij,nj->ni", attitude, a0)
    v = integrate(a, time, velocity)
    return a, v, integrate(v, time, position)


def point_path(
    point: FloatArray,
    origin: tuple[FloatArray, FloatArray, FloatArray],
    alpha: FloatArray,
    omega: FloatArray,
    attitude: FloatArray,
) -> Path:
    """The path of `point` (3,) m of the body, `origin` as from `origin_path`, `alpha` and `omega` (n,3) body frame."""
    swing = np.cross(omega, point)
    turned = (np.cross(alpha, point) + np.cross(omega, swing), swing, np.broadcast_to(point, omega.shape))
    a, v, x = (o + np.einsum("nij,nj->ni", attitude, t) for o, t in zip(origin, turned, strict=True))
    body = [np.einsum("nij,ni->nj", attitude, value) for value in (a, v, x)]
    return Path(a, v, x, *body)
