"""Misprints of Becker and Willems 1975: eqs 6, 15 line 2, and 23 (METHODS 1.2).

METHODS names what eq 15 and 23 need, not all that the paper prints: the product in line 2 of eq 15 is here taken to be
that of line 1, and eq 23 to be the solution of eq 15 for a turn about X, both derived from the scheme itself.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.linalg import expm

from nineaudit.physics import rigid_body
from nineaudit.presets import PRESETS
from nineaudit.schemes import growth
from nineaudit.schemes.six_accelerometers import Package, inverse
from nineaudit.selftest.misprints import Misprint, put_right, random_instants
from nineaudit.selftest.published import Published

SOURCE: Final = "Becker75"
_ARM: Final = 0.05
_PART: Final = 0.1
"""Error of ω over ω, eq 15."""


def checks() -> list[Published]:
    """The three equations put right."""
    return put_right(misprints())


def misprints() -> list[Misprint]:
    """Eqs 6, 15 and 23 as printed and as they should be, on random motion."""
    return [_eq6(), _eq15(), _eq23()]


def _package() -> Package:
    sensors = PRESETS["3-2-1"].sensors([_ARM, _ARM])
    return Package(np.array([s.position for s in sensors]), np.array([s.axis for s in sensors]), np.zeros(6))


def _eq6() -> Misprint:
    """[a0; α] = H⁻¹(v − V + Q(ω)) with Q of either sign."""
    six, motion, every = _package(), random_instants(6), np.ones(6, dtype=np.bool_)
    v = rigid_body.predict(six.positions, six.sensitivity, every, motion.a0, motion.alpha, motion.omega)
    swing = np.cross(motion.omega[:, None], np.cross(motion.omega[:, None], six.positions))
    q = np.einsum("ki,nki->nk", six.sensitivity, swing)
    rows = inverse(six)[3:]
    right = "Q = −S·(ω × (ω × P))"
    return Misprint(SOURCE, "6", "α", "Q = S·(ω × (ω × P))", right, (v + q) @ rows.T, (v - q) @ rows.T, motion.alpha)


def _eq15() -> Misprint:
    """ė = α(ω + e) − α(ω) of the same readings: ė2 = ω1e3 + ω3e1 + e1e3, ω fed back with an error e."""
    six, motion = _package(), random_instants(15)
    w = motion.omega
    e = _PART * random_instants(16).omega
    fed = rigid_body.centripetal(six.positions, six.sensitivity, w + e)
    slope = -(fed - rigid_body.centripetal(six.positions, six.sensitivity, w)) @ inverse(six)[3:].T
    linear = w[:, 0] * e[:, 2] + w[:, 2] * e[:, 0]
    wrong, right = linear + e[:, 1] * e[:, 2], linear + e[:, 0] * e[:, 2]
    return Misprint(
        SOURCE, "15 line 2", "the growth of e2", "another product (here: e2e3)", "e1e3", wrong, right, slope[:, 1]
    )


def _eq23() -> Misprint:
    """A turn φ about X solves eq 15, linear in e: e2 = ½[(e2+e3)e^φ + (e2−e3)e^−φ]; truth: expm of the Jacobian."""
    six, start = _package(), random_instants(23).omega
    phi = np.random.default_rng(23).uniform(0.0, growth.QUARTER_TURN, len(start))
    jacobian = growth.feedback_jacobian(six.positions, six.sensitivity, np.eye(3)[:1])[0]
    truth = np.einsum("nij,nj->ni", expm(phi[:, None, None] * jacobian), start)[:, 1]
    _, e2, e3 = start.T
    twice = (e2 + e3) * np.exp(phi) + (e2 - e3) * np.exp(-phi)
    printed, right = "(e2+e3)e^φ + (e2−e3)e^−φ", "½[(e2+e3)e^φ + (e2−e3)e^−φ]"
    return Misprint(SOURCE, "23", "e2 after a turn φ about X", printed, right, twice, 0.5 * twice, truth)
