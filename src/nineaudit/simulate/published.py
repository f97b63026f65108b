"""Motions printed in the source papers (METHODS.md 7.1 and 7.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.simulate.truth import REST_S, Truth, timeline

# [Alem77] Table 1: S = Sm (sin 2πf1t − sin 2πf2t) of the displacements X, Y, Z and of yaw, pitch, roll.
_INCH, _DEGREE = 0.0254, np.pi / 180
_SHIFT = (np.array([25.0, 7.0, 20.0]) * _INCH, np.array([2.0, 1.0, 4.0]), np.array([3.5, 5.0, 2.5]))
_EULER = (np.array([20.0, 15.0, 25.0]) * _DEGREE, np.array([12.0, 7.0, 8.0]), np.array([4.0, 13.0, 0.5]))

RAMP_S = 0.2
"""Time in which `alem_quiet` grows from rest to the published motion, s."""

Derivatives = tuple[FloatArray, FloatArray, FloatArray]


def alem(
    rate_hz: float = 10_000.0,
    duration_s: float | None = None,
    rng: np.random.Generator | None = None,
    *,
    rest_s: float = 0.0,
    gravity: Sequence[float] = (0.0, 0.0, 0.0),
) -> Truth:
    """Alem 1977 Table 1 as published: general motion, 2 s from t = 0, moving at the start.

    There is no rest (`rest_s` and `rng` have no effect). `gravity` (3,) m/s² in the inertial axes of the
    displacement: a0 is then the specific force.
    """
    del rng, rest_s
    time = timeline(rate_hz, 2.0 if duration_s is None else duration_s, 0.0)
    return _rigid(time, _sines(time, *_EULER), _sines(time, *_SHIFT), gravity)


def alem_path(rate_hz: float = 10_000.0, duration_s: float | None = None) -> tuple[Derivatives, Derivatives]:
    """Yaw, pitch, roll (rad) and displacement (m) of `alem`, each with its first two derivatives, (n,3)."""
    time = timeline(rate_hz, 2.0 if duration_s is None else duration_s, 0.0)
    return _sines(time, *_EULER), _sines(time, *_SHIFT)


def alem_quiet(
    rate_hz: float = 10_000.0,
    duration_s: float | None = None,
    rng: np.random.Generator | None = None,
    *,
    rest_s: float = REST_S,
    gravity: Sequence[float] = (0.0, 0.0, 0.0),
) -> Truth:
    """Alem 1977 Table 1 behind a rest and a 0.2 s ramp; from t = 0.2 s it is the published motion exactly.

    Angles and displacements are multiplied by a step that is three times continuously differentiable, so α
    and a0 have no corner. Arguments as `alem`.
    """
    del rng
    time = timeline(rate_hz, 2.0 if duration_s is None else duration_s, rest_s)
    envelope = _smooth_step(time / RAMP_S)
    euler, shift = (_product(envelope, _sines(time - RAMP_S, *table)) for table in (_EULER, _SHIFT))
    return _rigid(time, euler, shift, gravity)


def _sines(time: FloatArray, size: FloatArray, f1: FloatArray, f2: FloatArray) -> Derivatives:
    """S = Sm (sin 2πf1t − sin 2πf2t) and its first two derivatives, each (n,3)."""
    w1, w2 = 2 * np.pi * f1, 2 * np.pi * f2
    first, second = time[:, None] * w1, time[:, None] * w2
    return (
        size * (np.sin(first) - np.sin(second)),
        size * (w1 * np.cos(first) - w2 * np.cos(second)),
        size * (w2**2 * np.sin(second) - w1**2 * np.sin(first)),
    )


def _smooth_step(fraction: FloatArray) -> Derivatives:
    """35u⁴ − 84u⁵ + 70u⁶ − 20u⁷ on 0..1 and its derivatives with respect to time, each (n,1)."""
    u = np.clip(fraction, 0.0, 1.0)[:, None]
    return (
        u**4 * (35 - 84 * u + 70 * u**2 - 20 * u**3),
        140 * u**3 * (1 - u) ** 3 / RAMP_S,
        420 * u**2 * (1 - u) ** 2 * (1 - 2 * u) / RAMP_S**2,
    )


def _product(w: Derivatives, s: Derivatives) -> Derivatives:
    return w[0] * s[0], w[1] * s[0] + w[0] * s[1], w[2] * s[0] + 2 * w[1] * s[1] + w[0] * s[2]


def _rigid(time: FloatArray, euler: Derivatives, shift: Derivatives, gravity: Sequence[float]) -> Truth:
    """Body-frame motion of yaw ψ, pitch θ, roll φ (in this order about z, y′, x″) and inertial displacement.

    E = Rx(φ) Ry(θ) Rz(ψ) takes inertial to body axes; a0 = E (ẍ − g);
    ωx = φ̇ − ψ̇ sθ;  ωy = θ̇ cφ + ψ̇ cθ sφ;  ωz = ψ̇ cθ cφ − θ̇ sφ                       [Alem77 eq 22, corrected]
    """
    (psi, th, ph), (psi1, th1, ph1), (psi2, th2, ph2) = (e.T for e in euler)
    c1, s1, c2, s2, c3, s3 = np.cos(psi), np.sin(psi), np.cos(th), np.sin(th), np.cos(ph), np.sin(ph)
    omega = [ph1 - psi1 * s2, th1 * c3 + psi1 * c2 * s3, psi1 * c2 * c3 - th1 * s3]
    alpha = [
        ph2 - psi2 * s2 - psi1 * th1 * c2,
        th2 * c3 - th1 * ph1 * s3 + psi2 * c2 * s3 + psi1 * (ph1 * c2 * c3 - th1 * s2 * s3),
        psi2 * c2 * c3 - psi1 * (th1 * s2 * c3 + ph1 * c2 * s3) - th2 * s3 - th1 * ph1 * c3,
    ]
    to_body = np.array(
        [
            [c1 * c2, s1 * c2, -s2],
            [c1 * s2 * s3 - s1 * c3, s1 * s2 * s3 + c1 * c3, c2 * s3],
            [c1 * s2 * c3 + s1 * s3, s1 * s2 * c3 - c1 * s3, c2 * c3],
        ]
    )
    a0 = np.einsum("ijn,nj->ni", to_body, shift[2] - np.asarray(gravity, dtype=float))
    return Truth(time, np.column_stack(omega), np.column_stack(alpha), a0)


def counter_example(
    rate_hz: float = 10_000.0,
    duration_s: float | None = None,
    rng: np.random.Generator | None = None,
    *,
    rest_s: float = REST_S,
    arms: Sequence[float] | FloatArray = (0.05, 0.06, 0.07),
) -> Truth:
    """Takhounts 2009 eqs 15-20: every arm channel reads t m/s², the centre none; no rigid body does that.

    The motion is what product-free integration makes of those readings, with `arms` (3,) m:
    α = t (1/2ry − 1/2rz, 1/2rz − 1/2rx, 1/2rx − 1/2ry), ω = α t/2, and the products of ω grow with t⁴ while
    the constraint channels ask for growth with t. 1 s long; `rng` has no effect.
    """
    del rng
    time = timeline(rate_hz, 1.0 if duration_s is None else duration_s, rest_s)
    since = np.maximum(time, 0.0)[:, None]
    rx, ry, rz = (0.5 / arm for arm in arms)
    slope = np.array([ry - rz, rz - rx, rx - ry])
    return Truth(time, slope * since**2 / 2, slope * since, np.zeros((len(time), 3)))
