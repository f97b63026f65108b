"""Numbers of Takhounts et al. 2009: counter-example, the triangle of Fig 10, cross-axis error. Clipping and misprints
have modules of their own."""

from __future__ import annotations

import numpy as np

from nineaudit.array import Sensor, SensorArray, frozen
from nineaudit.physics import nap
from nineaudit.schemes import takhounts
from nineaudit.selftest.misprints import random_instants, relative
from nineaudit.selftest.published import Published
from nineaudit.selftest.takhounts_misprints import SOURCE


def checks() -> list[Published]:
    """Counter-example (eqs 15–20), rows 1 and 3 of eq 37, and what 3 % cross-axis does to α."""
    return [*_counter_example(), *_triangle(), *_cross_axis()]


def _counter_example() -> list[Published]:
    """Every arm channel t m/s², the centre 0, at t = 1 s, arms 50, 60, 70 mm."""
    arms, time = np.array([0.05, 0.06, 0.07]), np.linspace(0.0, 1.0, 1001)
    readings = np.zeros((len(time), 9))
    readings[:, 3:] = time[:, None]
    alpha = nap.alpha(readings, arms)[-1]
    omega = nap.omega(readings, arms, time)[-1]
    from_omega = omega[[1, 2, 0]] * omega[[2, 0, 1]]
    told = nap.products(readings, arms)[-1]
    expected = (
        ("α, rad/s²", alpha, (1.1905, -2.8571, 1.6667), 5e-5),
        ("products of the integrated ω, rad²/s²", from_omega, (-1.1905, 0.4960, -0.8503), 5e-5),
        ("products of the constraints, rad²/s²", told, (15.476, 17.143, 18.333), 5e-4),
    )
    digit = "half a unit of the last digit"
    return [
        Published(SOURCE, f"eqs 15-20, t = 1 s: {name} {axis}", value, float(ours[i]), value, width, digit)
        for name, ours, values, width in expected
        for i, (axis, value) in enumerate(zip("xyz", values, strict=True))
    ]


def _triangle() -> list[Published]:
    """Rows 1 and 3 of eq 37 against the rigid body; row 2 is misprinted (takhounts_misprints.py)."""
    motion, rx, ry = random_instants(37), 0.06, 0.05
    ours = takhounts.triangle_corner(motion.a0, motion.alpha, motion.omega, rx, ry)
    truth = motion.at(rx / 2.0, ry, 0.0)
    return [
        Published(
            SOURCE,
            f"eq 37 row {i + 1}, rms relative error on random motion",
            "right as printed",
            relative(ours[:, i], truth[:, i]),
            0.0,
            1e-12,
            "rounding of the sums",
        )
        for i in (0, 2)
    ]


def triangle(rx: float, ry: float) -> SensorArray:
    """Triaxes at the corners (0,0,0), (rx,0,0), (rx/2,ry,0), m: Fig 10."""
    corners = ((0.0, 0.0, 0.0), (rx, 0.0, 0.0), (rx / 2.0, ry, 0.0))
    return SensorArray(
        tuple(
            Sensor(f"a{i}{axis}", "accelerometer", frozen(place), frozen(np.eye(3)[j]), f"a{i}{axis}")
            for i, place in enumerate(corners, 1)
            for j, axis in enumerate("xyz")
        )
    )


def _cross_axis() -> list[Published]:
    """3 % of each axis in the others, ω = 0, equilateral triangle: δα = −0.03(αz, αz, (αx+αy)/2)."""
    side, c = 0.06, 0.03
    array = triangle(side, side * np.sqrt(0.75))
    alpha = np.array([1000.0, 2500.0, -700.0])
    error = takhounts.cross_axis_error(array, np.array([300.0, -200.0, 100.0]), alpha, c * (1.0 - np.eye(3)))
    expected = -c * np.array([alpha[2], alpha[2], (alpha[0] + alpha[1]) / 2.0])
    claim = "0 (optimisation is said to undo it)"
    return [
        Published(
            SOURCE,
            f"3 % cross-axis, ω = 0: error of α{a}, rad/s²",
            claim,
            float(e),
            float(x),
            1e-9,
            "rounding of the sums",
        )
        for a, e, x in zip("xyz", error, expected, strict=True)
    ]
