"""How an error of ω grows where ω is fed back into a least-squares α, and what that does to gains [Becker75].

An error δω, fed back through α = K(y − q(ω)), K the α rows of H⁺, obeys

    d(δω)/dt = J(ω) δω + f,    J(ω) = −K ∂q/∂ω,    f what an error of the readings does to α directly.

J is linear in ω: turning about a fixed n, δω grows by e^(ρφ), φ the angle turned, ρ the largest real part of an
eigenvalue of J(n), per radian, at whatever speed. ρ = 1 at worst for the 3-2-1 layout, about its X axis:
e^(π/2) = 4.81 in a quarter turn (METHODS 1.3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.errors import EstimationError
from nineaudit.estimate.motion import Motion
from nineaudit.physics import rigid_body
from nineaudit.physics.kinematics import orientation
from nineaudit.schemes.six_accelerometers import Solution, inverse, package, solve

QUARTER_TURN: Final = math.pi / 2
LARGEST_GROWTH: Final = math.exp(QUARTER_TURN)
"""Growth in the quarter turn about X that [Becker75] holds the scheme good for."""
_INSTANTS = 200
"""Instants between which growth is compared: as many pairs as half the square of it."""
_ROUNDING: Final = 1e-6


@dataclass(frozen=True)
class Validity:
    """How far a record turned: `rotation` rad, the largest from its first attitude; `growth`: the most that an
    error of ω was magnified between two instants of it; `warning` None where the scheme supports that."""

    rotation: float
    growth: float
    warning: str | None


def feedback_jacobian(positions: FloatArray, axes: FloatArray, omega: FloatArray) -> FloatArray:
    """J (n,3,3) 1/s = −K ∂q/∂ω at `omega` (n,3) rad/s, of any accelerometers (k,3) whose H has rank 6.

    Raises EstimationError, naming the rank, where it has not.
    """
    length = float(np.abs(positions).max(initial=0.0)) or 1.0
    h = rigid_body.design(positions / length, axes)
    rank = int(np.linalg.matrix_rank(h, rtol=1e-10))
    if rank < 6:
        raise EstimationError("angular acceleration is not determined", found=f"H of rank {rank}", expected="rank 6")
    rows = np.linalg.pinv(h)[3:] / length
    return np.asarray(-rows @ rigid_body.centripetal_jacobian(positions, axes, omega))


def growth_rate(positions: FloatArray, axes: FloatArray, about: FloatArray | None = None) -> float:
    """ρ per rad: the largest real part of an eigenvalue of J(n), for n = `about` (3,), or for the worst n.

    The worst n of a half sphere by a grid of 2° and a search from its ten best. Errors as feedback_jacobian.
    """
    if about is not None:
        return float(_rates(positions, axes, (about / np.linalg.norm(about))[None])[0])
    from scipy.optimize import minimize

    polar, azimuth = np.meshgrid(np.radians(np.arange(0, 181, 2)), np.radians(np.arange(0, 180, 2)))
    angles = np.column_stack([polar.ravel(), azimuth.ravel()])
    rates = _rates(positions, axes, _directions(angles))
    best = angles[np.argsort(rates)[-10:]]

    def falling(at: FloatArray) -> float:
        return -float(_rates(positions, axes, _directions(at[None]))[0])

    ends = [minimize(falling, start, method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-10}) for start in best]
    return max(-float(end.fun) for end in ends)


def _directions(angles: FloatArray) -> FloatArray:
    """(m,3) unit vectors of `angles` (m,2): polar from x, azimuth about x. Growth is the same about n and −n up to
    the sign of ω, and both senses of turning are met, J(−n) = −J(n), on the other half of the sphere."""
    polar, azimuth = angles.T
    return np.column_stack([np.cos(polar), np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth)])


def _rates(positions: FloatArray, axes: FloatArray, directions: FloatArray) -> FloatArray:
    """(m,) largest |Re λ| of J(n): turned one way λ grows, turned the other way −λ does."""
    values = np.linalg.eigvals(feedback_jacobian(positions, axes, directions))
    return np.asarray(np.abs(values.real).max(axis=1))


def forced_growth(angle: float, rate: float = 1.0) -> float:
    """Off-axis penalty (e^φ − 1)/φ, φ = `rate`·`angle`: error of ω at the end from a constant wrong α, over the
    error that the same α makes without feedback [Becker75, number put right: 2.43 at 90°, not 3 to 4]."""
    turned = rate * angle
    return math.expm1(turned) / turned if turned else 1.0


def transition(solution: Solution, drive: FloatArray | None = None) -> FloatArray:
    """(n,3,m): d(δω)/dt = J(ω) δω + F along a solution, F = `drive` (n,3,m) from δω = 0; without it, from δω = I.

    Implicit trapezoidal rule, error of order h².
    """
    jacobian = _jacobian(solution)
    half = 0.5 * np.diff(solution.time)[:, None, None]
    left = np.linalg.inv(np.eye(3) - half * jacobian[1:])
    step = left @ (np.eye(3) + half * jacobian[:-1])
    pushed = None if drive is None else left @ (half * (drive[:-1] + drive[1:]))
    state = np.eye(3) if drive is None else np.zeros(drive.shape[1:])
    out = np.empty((len(solution.time), *state.shape))
    out[0] = state
    for i in range(len(step)):
        state = step[i] @ state if pushed is None else step[i] @ state + pushed[i]
        out[i + 1] = state
    return out


def _jacobian(solution: Solution) -> FloatArray:
    """J (n,3,3) by the scheme's own H⁻¹ with its sensitivity vectors."""
    six = solution.package
    slope = rigid_body.centripetal_jacobian(six.positions, six.sensitivity, solution.omega)
    return np.asarray(-inverse(six)[3:] @ slope)


def motion(array: SensorArray, time: FloatArray, readings: FloatArray, initial: FloatArray) -> tuple[Motion, Validity]:
    """The motion of a rig with six accelerometers from its `readings` (n,k) SI, ω = `initial` (3,) at the first sample,
    and what the scheme's rotation and growth make of it; its warning is in the motion's `method` too.

    Raises EstimationError as six_accelerometers.package and solve.
    """
    six = package(array)
    solution = solve(six, readings[:, array.is_accelerometer], time, initial)
    found = validity(solution)
    method = "six accelerometers, ω fed back step by step"
    said = f"{method}; {found.warning}" if found.warning else method
    return Motion(solution.omega, solution.alpha, solution.a0, said), found


def validity(solution: Solution) -> Validity:
    """How far a record turned and how much errors grew in it; a warning beyond a quarter turn [Becker75].

    Growth is the largest singular value of Φ(t)Φ(s)⁻¹, s < t, Φ the transition from the first sample.
    """
    attitude = orientation(solution.omega, solution.time)
    cosine = 0.5 * (np.trace(attitude, axis1=1, axis2=2) - 1.0)
    rotation = float(np.arccos(np.clip(cosine, -1.0, 1.0)).max())
    growth = _largest_growth(transition(solution))
    fits = rotation <= QUARTER_TURN * (1 + _ROUNDING) and growth <= LARGEST_GROWTH * (1 + _ROUNDING)
    return Validity(rotation, growth, None if fits else _warning(rotation, growth))


def _largest_growth(flow: FloatArray) -> float:
    chosen = flow[np.unique(np.linspace(0, len(flow) - 1, _INSTANTS).astype(int))]
    back = np.linalg.inv(chosen)
    return max(float(np.linalg.norm(chosen[i:] @ back[i], ord=2, axis=(1, 2)).max()) for i in range(len(chosen)))


def _warning(rotation: float, growth: float) -> str:
    return (
        f"the body turned {math.degrees(rotation):.0f}°, and an error of angular velocity grew up to {growth:.1f} times"
        f" on the way; six accelerometers support about a quarter turn (90°, {LARGEST_GROWTH:.2f} times, Becker and"
        " Willems 1975): cut the record before that, or add rate sensors or three more accelerometers"
    )
