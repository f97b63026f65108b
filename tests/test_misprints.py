"""docs/where-the-papers-are-wrong.md: the errors stated are those of the printed forms; the right ones are exact."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from nineaudit.array import FloatArray
from nineaudit.physics import kinematics, rigid_body
from nineaudit.simulate.motions import general

PAGE = Path(__file__).parents[1] / "docs" / "where-the-papers-are-wrong.md"
Forms = dict[str, tuple[FloatArray, FloatArray, FloatArray]]
"""Equation: printed form, right form, truth."""


@cache
def alem() -> Forms:
    """Yaw, pitch, roll under 23°, any ω: element [1,1] of eq 19, and rows 2 and 3 of eq 22 (angle rates from ω)."""
    rng = np.random.default_rng(1977)
    psi, theta, phi = rng.uniform(-0.4, 0.4, (3, 500))
    rates = 30.0 * rng.standard_normal((3, 500))
    x, y, z = _body_rates(rates, theta, phi)
    printed = (y * np.cos(phi) - z * np.sin(phi)) / np.cos(theta)
    first = np.cos(psi) * np.cos(theta)
    turned = y * np.sin(phi) + z * np.cos(phi)
    return {
        "Alem 19": (np.cos(psi) * np.sin(theta), first, first),
        "Alem 22 row 2": (printed, y * np.cos(phi) - z * np.sin(phi), rates[1]),
        "Alem 22 row 3": ((x + np.sin(theta) * turned) / np.cos(theta), x + np.tan(theta) * turned, rates[2]),
    }


def _body_rates(rates: FloatArray, theta: FloatArray, phi: FloatArray) -> FloatArray:
    """(3,n) ω in the body of yaw, pitch and roll rates [Alem77 eq 21]."""
    yaw, pitch, roll = rates
    return np.stack(
        [
            roll - yaw * np.sin(theta),
            yaw * np.cos(theta) * np.sin(phi) + pitch * np.cos(phi),
            yaw * np.cos(theta) * np.cos(phi) - pitch * np.sin(phi),
        ]
    )


@cache
def martin() -> Forms:
    """Random ω (30 rad/s), α (3000 rad/s²), a0 (500 m/s²), arms of the paper's size."""
    rng = np.random.default_rng(1998)
    w, al, a0 = (s * rng.standard_normal((500, 3)) for s in (30.0, 3000.0, 500.0))
    x, y, z = w.T

    def at(*place: float) -> FloatArray:
        return rigid_body.acceleration_at(np.array(place), a0, al, w)

    rx, ry, rz = 0.07, -0.05, 0.09
    two = at(rx, ry, rz)[:, 0] + rx * (y**2 + z**2) - ry * (x * y - al[:, 2])
    lx, ly, lz = 0.050, 0.062, 0.071
    p1, p2, p3 = at(0, ly, 0) - a0, at(lx, 0, 0) - a0, at(0, 0, lz) - a0
    up, down = p1[:, 2] / 2, p3[:, 1] / 2 / lz
    qx, qy, qz = -0.08, -0.10, 0.13
    a1, a2, a3 = at(qx, 0, 0), at(0, qy, 0), at(0, 0, qz)
    thirteen = -x * y - qy * (x**2 + z**2) / qx
    by, bz = (a0[:, 0] - at(0, 0, -0.06)[:, 0]) / 0.06, (at(0, -0.05, 0)[:, 0] - a0[:, 0]) / 0.05
    return {
        "Martin 2": (two - rz * (x * z - al[:, 1]), two - rz * (x * z + al[:, 1]), a0[:, 0]),
        "Martin 5": (up / lx - down, up / ly - down, al[:, 0]),
        "Martin 6": (
            p3[:, 0] / 2 / lz - p2[:, 2] / 2 / ly,
            p3[:, 0] / 2 / lz - p2[:, 2] / 2 / lx,
            al[:, 1],
        ),
        "Martin 7": (
            p2[:, 1] / 2 / ly - p1[:, 0] / 2 / lx,
            p2[:, 1] / 2 / lx - p1[:, 0] / 2 / ly,
            al[:, 2],
        ),
        "Martin 12": (
            (a3 - a1)[:, 0] / qx + x * z + qz * (x**2 + y**2) / qx,
            (a3 - a1)[:, 0] / qz - x * z - qx * (y**2 + z**2) / qz,
            al[:, 1],
        ),
        "Martin 13": ((a1 - a3)[:, 1] / qx + thirteen, (a1 - a2)[:, 1] / qx + thirteen, al[:, 2]),
        "Martin 18": (by + x * z, by - x * z, al[:, 1]),
        "Martin 19": (bz - x * z, bz + x * y, al[:, 2]),
    }


@cache
def takhounts() -> Forms:
    """Centre channels whose ω products are misprinted, on the simulated motion `general`, arms 55, 48 and 71 mm."""
    truth, (rx, ry, rz) = general(), (0.055, 0.048, 0.071)

    def at(*place: float) -> FloatArray:
        return rigid_body.acceleration_at(np.array(place), truth.a0, truth.alpha, truth.omega)

    a0, a1, a2, a3 = truth.a0, at(rx, 0, 0) - truth.a0, at(0, ry, 0) - truth.a0, at(0, 0, rz) - truth.a0

    def turned(values: FloatArray) -> FloatArray:
        return kinematics.integrate(values, truth.time)

    x, y, z = truth.omega.T
    wrong_y = turned(a3[:, 0] / 2 / rx - a1[:, 2] / 2 / rx)
    wrong_z = turned(a1[:, 1] / 2 / rz - a2[:, 0] / 2 / ry)
    wrong_x = turned(a2[:, 0] / 2 / ry - a3[:, 1] / 2 / rz)
    y_arm, z_arm = (a3 + a0)[:, 1], (a2 + a0)[:, 2]
    return {
        "Takhounts 30a": (
            y_arm - 2 * rz * (wrong_y * wrong_z - a2[:, 2] / 2 / ry),
            y_arm - 2 * rz * (y * z - a2[:, 2] / 2 / ry),
            a0[:, 1],
        ),
        "Takhounts 30b": (
            (a1 + a0)[:, 1] - 2 * rx * (wrong_x * y - a2[:, 2] / 2 / ry),
            (a1 + a0)[:, 1] - 2 * rx * (x * y - a2[:, 0] / 2 / ry),
            a0[:, 1],
        ),
        "Takhounts 32a": (
            z_arm - 2 * ry * (wrong_y * wrong_z - a3[:, 1] / 2 / rz),
            z_arm - 2 * ry * (y * z - a3[:, 1] / 2 / rz),
            a0[:, 2],
        ),
        "Takhounts 32b": (
            (a1 + a0)[:, 2] - 2 * rx * (wrong_z * y - a3[:, 1] / 2 / rz),
            (a1 + a0)[:, 2] - 2 * rx * (z * x - a3[:, 0] / 2 / rz),
            a0[:, 2],
        ),
    }


FORMS = {**alem(), **martin(), **takhounts()}


def relative(values: FloatArray, truth: FloatArray) -> float:
    """rms of the error over rms of the truth."""
    return float(np.sqrt(((values - truth) ** 2).mean() / (truth**2).mean()))


@pytest.mark.parametrize("equation", sorted(FORMS))
def test_right_form_is_exact(equation: str) -> None:
    _, right, truth = FORMS[equation]
    assert relative(right, truth) < 1e-12


@pytest.mark.parametrize("equation", sorted(FORMS))
def test_page_states_the_error_of_the_printed_form(equation: str) -> None:
    """To two digits, in the row of the equation."""
    printed, _, truth = FORMS[equation]
    stated = f"{float(f'{100.0 * relative(printed, truth):.2g}'):g} %"
    rows = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith(f"| {equation} |")]
    assert len(rows) == 1
    assert stated in rows[0], stated
