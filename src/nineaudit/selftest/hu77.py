"""Numbers of Hu 1977, rate gyros and linear accelerometers."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from nineaudit.physics.kinematics import orientation
from nineaudit.schemes import rgla
from nineaudit.selftest.misprints import Misprint, put_right, random_instants
from nineaudit.selftest.published import Published

SOURCE = "Hu 1977"
PRINTED_MATRIX = np.array(
    [
        [0.664463024, 0.707106781, -0.241844763],
        [-0.664463024, 0.707106781, 0.241844763],
        [0.342020143, 0.0, 0.939692621],
    ]
)
"""Direction cosines of 20° and 45°, ground to body."""
_RATE, _STEP, _COUNT = 30.0, 1e-3, 150


def checks() -> list[Published]:
    """The recursion as printed, what it does to lengths and angles, the printed matrix, and the derivatives."""
    return [*_recursion(), _matrix(), *put_right(misprints()), *_derivatives()]


def misprints() -> list[Misprint]:
    """The direction-cosine matrix is called self-adjoint, C = Cᵀ; it is orthogonal, C⁻¹ = Cᵀ: a vector to and fro."""
    turned, v = _turned().as_matrix(), random_instants(77).omega
    there = v @ turned.T
    words = ("C is self-adjoint: back by C", "C is orthogonal: back by Cᵀ")
    return [Misprint(SOURCE, "C⁻¹", "a vector turned there and back", *words, there @ turned.T, there @ turned, v)]


def _turned() -> Rotation:
    """Rz(45°)Ry(20°), ground to body."""
    return Rotation.from_euler("z", 45.0, degrees=True).inv() * Rotation.from_euler("y", 20.0, degrees=True).inv()


def _recursion() -> list[Published]:
    time = np.linspace(0.0, _COUNT * _STEP, _COUNT + 1)
    omega = np.tile([0.0, 0.0, _RATE], (_COUNT + 1, 1))
    printed, exact = rgla.direction_cosines(omega, time)[-1], orientation(omega, time)[-1]
    growth, digit = "150 steps of 1 ms at 30 rad/s", "half a unit of the last printed digit"
    angle = np.arctan2(printed[1, 0], printed[0, 0]) % (2.0 * np.pi)
    true = np.arctan2(exact[1, 0], exact[0, 0]) % (2.0 * np.pi)
    departed = rgla.departure(printed)
    return [
        Published(SOURCE, f"row norm of the recursion, {growth}", 1.069798, 1.0 + departed.norm, 1.069798, 5e-7, digit),
        Published(SOURCE, f"angle of the recursion, rad, {growth}", 4.498651, float(angle), 4.498651, 5e-7, digit),
        Published(
            SOURCE,
            "angle of the orthonormal recursion, rad",
            "4.5 (ωt)",
            float(true),
            4.5,
            1e-12,
            "rounding, 150 steps",
        ),
        Published(
            SOURCE,
            "largest |CCᵀ − I| of the orthonormal recursion",
            "0 (a rotation)",
            rgla.departure(exact).product,
            0.0,
            1e-12,
            "rounding, 150 steps",
        ),
    ]


def _matrix() -> Published:
    off = float(np.abs(_turned().as_matrix() - PRINTED_MATRIX).max())
    return Published(
        SOURCE, "matrix of 20° and 45° against Rz(45)Ry(20)", "nine entries", off, 0.0, 5e-10, "nine printed decimals"
    )


def _derivatives() -> list[Published]:
    """A sine of known derivative: the error of each rule against its own truncation term."""
    step, f = 1e-3, 25.0
    time = np.linspace(0.0, 400 * step, 401)
    w = 2.0 * np.pi * f
    values, slope = np.sin(w * time), w * np.cos(w * time)
    five = rgla.five_point_derivative(values, time)[2:-2]
    gain = (np.sin(w * step) + 2.0 * np.sin(2.0 * w * step)) * 2.0 / (10.0 * w * step)
    series = rgla.fourier_derivative(values, time, 40)
    inner = slice(40, -40)
    return [
        Published(
            SOURCE,
            "five-point derivative of a 25 Hz sine at 1 kHz, gain",
            "(2/10wh)(sin wh + 2 sin 2wh)",
            float((five / slope[2:-2])[10]),
            gain,
            1e-9,
            "rounding; the response of the printed weights −2 −1 0 1 2",
        ),
        Published(
            SOURCE,
            "Fourier derivative of the same, 40 terms, largest error over the peak",
            "0 (the sine is one of the terms)",
            float(np.abs(series - slope)[inner].max() / w),
            0.0,
            1e-9,
            "rounding: 20 half-waves in the record",
        ),
    ]
