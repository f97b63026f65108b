"""Misprints of Alem and Holstein 1977: eqs 15, 19, 22, and the weight of the least squares (METHODS 1.2)."""

from __future__ import annotations

from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.physics import laboratory, rigid_body
from nineaudit.schemes import ninacc
from nineaudit.selftest.misprints import Misprint, put_right, random_instants
from nineaudit.selftest.published import Published

SOURCE: Final = "Alem77"
PLACES: Final = np.diag([3.0, 4.0, 5.0]) * 0.0254
"""Of the triaxes of Table 1, m."""
NOISE: Final = np.repeat([1.0, 1.0, 5.0], 3)
"""Standard deviations, m/s², of three triaxes, one of them five times worse than the others."""
_DRAWS: Final = 4000


def checks() -> list[Published]:
    """The four equations put right, and what the printed weight costs."""
    return [*put_right(misprints()), weight()]


def misprints() -> list[Misprint]:
    """Eqs 15, 19 and 22 as printed and as they should be, on random motion."""
    return [_eq15(), *_angles()]


def _eq15() -> Misprint:
    """Σ(|ρ|²I − ρρᵀ)α = Σ ρ×(a − ω×(ω×ρ)), ρ = r − Q0: the acceleration of Q0 adds Σρ × a(Q0), 0 at the centroid."""
    motion = random_instants(15)
    a = np.stack([motion.at(*place) for place in PLACES], axis=1)
    inertia = (PLACES**2).sum() * np.eye(3) - PLACES.T @ PLACES
    turning = np.cross(motion.omega[:, None], np.cross(motion.omega[:, None], PLACES))
    moment = np.cross(PLACES, a - turning).sum(axis=1)
    return Misprint(
        SOURCE,
        "15",
        "α",
        "for any Q0 (here: where the three axes meet)",
        "only with Q0 at the centroid of the triaxes",
        np.linalg.solve(inertia, moment.T).T,
        ninacc.alpha_at_centroid(PLACES, a, motion.omega),
        motion.alpha,
    )


def _angles() -> list[Misprint]:
    """Yaw, pitch, roll under 23°, any ω: element [1,1] of eq 19, rows 2 and 3 of eq 22 (angle rates from ω)."""
    rng = np.random.default_rng(1977)
    euler, rates = rng.uniform(-0.4, 0.4, (500, 3)), 30.0 * rng.standard_normal((500, 3))
    psi, theta, phi = euler.T
    omega = _body_rates(rates, theta, phi)
    x, y, z = omega.T
    right = laboratory.euler_rates(euler, omega)
    first = laboratory.attitude_of(euler)[:, 0, 0]
    turned, pitching = y * np.sin(phi) + z * np.cos(phi), y * np.cos(phi) - z * np.sin(phi)
    wrong_3 = (x + np.sin(theta) * turned) / np.cos(theta)
    c1, c2 = np.cos(psi), np.cos(theta)
    return [
        Misprint(SOURCE, "19 [1,1]", "the element", "C1S2", "C1C2", c1 * np.sin(theta), c1 * c2, first),
        Misprint(
            SOURCE,
            "22 row 2",
            "the pitch rate",
            "(0, C3, −S3)/C2",
            "(0, C2C3, −C2S3)/C2",
            pitching / c2,
            right[:, 1],
            rates[:, 1],
        ),
        Misprint(SOURCE, "22 [3,1]", "the roll rate", "1/C2", "C2/C2 = 1", wrong_3, right[:, 2], rates[:, 2]),
    ]


def _body_rates(rates: FloatArray, theta: FloatArray, phi: FloatArray) -> FloatArray:
    """(n,3) ω in the body of yaw, pitch and roll rates (n,3) [Alem77 eq 21]."""
    yaw, pitch, roll = rates.T
    level = yaw * np.cos(theta)
    y, z = level * np.sin(phi) + pitch * np.cos(phi), level * np.cos(phi) - pitch * np.sin(phi)
    return np.stack([roll - yaw * np.sin(theta), y, z], axis=1)


def weight() -> Published:
    """The paper weights with the covariance V; least squares of least variance (Gauss, Markov) weights with V⁻¹.

    Noise of α by the one over that by the other, on random motion with noise drawn, against K V Kᵀ of both (GUM 5.2).
    """
    positions, axes = np.repeat(PLACES, 3, axis=0), np.tile(np.eye(3), (3, 1))
    motion, rng = random_instants(19, _DRAWS), np.random.default_rng(77)
    every = np.ones(9, dtype=np.bool_)
    readings = rigid_body.predict(positions, axes, every, motion.a0, motion.alpha, motion.omega)
    seen = readings - rigid_body.centripetal(positions, axes, motion.omega)
    seen = seen + NOISE * rng.standard_normal(seen.shape)
    rows = [ninacc.solver(positions, axes, v).k[3:] for v in (1.0 / NOISE**2, NOISE**2)]
    drawn = [float(np.sqrt(((seen @ k.T - motion.alpha) ** 2).mean())) for k in rows]
    stated = [float(np.linalg.norm(k * NOISE)) for k in rows]
    expected = stated[0] / stated[1]
    return Published(
        SOURCE,
        "noise of α with weight V as printed over that with V⁻¹, one triax of three 5 times worse",
        "misprint (weight V)",
        drawn[0] / drawn[1],
        expected,
        4.0 * expected / np.sqrt(_DRAWS),
        "four standard errors of the draws; expected: covariance K V Kᵀ of both",
    )
