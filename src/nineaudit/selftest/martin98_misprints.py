"""Misprints of Martin et al. 1998: eqs 2, 5 to 7, 12, 13, 18, 19 on random motion, and two numbers of Table 3."""

from __future__ import annotations

from typing import Final

import numpy as np

from nineaudit.physics import nap
from nineaudit.schemes import martin
from nineaudit.selftest import martin98
from nineaudit.selftest.martin98 import ARMS, SOURCE
from nineaudit.selftest.misprints import Misprint, put_right, random_instants
from nineaudit.selftest.published import Published

NAP_ARMS: Final = (0.050, 0.062, 0.071)
PLACE: Final = np.array([0.07, -0.05, 0.09])


def checks() -> list[Published]:
    """Each equation put right, and two numbers of Table 3."""
    return [*put_right(misprints()), *_table_3()]


def misprints() -> list[Misprint]:
    """The eight equations as printed and as schemes/martin.py and physics/nap.py have them."""
    return [_eq2(), *_nap(), *_periphery(), *_coplanar()]


def _eq2() -> Misprint:
    motion = random_instants(2)
    right = martin.at_origin(motion.at(*PLACE), PLACE, motion.omega, motion.alpha)[:, 0]
    wrong = right + 2.0 * PLACE[2] * motion.alpha[:, 1]
    words = ("last bracket ωxωz − ω̇y", "ωxωz + ω̇y")
    return Misprint(SOURCE, "2", "Ax", *words, wrong, right, motion.a0[:, 0])


def _nap() -> list[Misprint]:
    """Point 1 of the paper lies on y, point 2 on x: ρX and ρY change places."""
    motion, (rx, ry, rz) = random_instants(5), NAP_ARMS
    on_x, on_y, on_z = (motion.at(*place) for place in np.diag(NAP_ARMS))
    a0, alpha = motion.a0, motion.alpha
    nine = np.column_stack([a0, on_x[:, 1:], on_y[:, [0, 2]], on_z[:, :2]])
    right = nap.alpha(nine, np.array(NAP_ARMS))
    x, y, z = on_x - a0, on_y - a0, on_z - a0
    wrong = (
        y[:, 2] / (2 * rx) - z[:, 1] / (2 * rz),
        z[:, 0] / (2 * rz) - x[:, 2] / (2 * ry),
        x[:, 1] / (2 * ry) - y[:, 0] / (2 * rx),
    )
    words = (
        ("5", "αx", "ρX under the first difference", "ρY"),
        ("6", "αy", "ρY under the second difference", "ρX"),
        ("7", "αz", "ρX and ρY interchanged", "ρX under the first, ρY under the second"),
    )
    return [Misprint(SOURCE, *words[i], wrong[i], right[:, i], alpha[:, i]) for i in range(3)]


def _periphery() -> list[Misprint]:
    motion, (rx, ry, rz) = random_instants(12), ARMS
    a1, a2, a3 = (motion.at(*place) for place in np.diag(ARMS))
    six = np.column_stack([a1[:, :2], a2[:, 1], a3])
    right = martin.periphery_equations(six, motion.omega, ARMS)[1]
    x, y, z = motion.omega.T
    eq12 = (a3 - a1)[:, 0] / rx + x * z + rz * (x**2 + y**2) / rx
    eq13 = (a1 - a3)[:, 1] / rx - x * y - ry * (x**2 + z**2) / rx
    words = ("(A3X−A1X)/rX + ωxωz + rZ(ωx²+ωy²)/rX", "(A3X−A1X)/rZ − ωxωz − rX(ωy²+ωz²)/rZ")
    return [
        Misprint(SOURCE, "12", "αy", *words, eq12, right[:, 1], motion.alpha[:, 1]),
        Misprint(SOURCE, "13", "αz", "A3Y", "A2Y", eq13, right[:, 2], motion.alpha[:, 2]),
    ]


def _coplanar() -> list[Misprint]:
    motion, (_, ry, rz) = random_instants(18), ARMS
    on_y, on_z = motion.at(0.0, ry, 0.0) - motion.a0, motion.at(0.0, 0.0, rz) - motion.a0
    differences = np.stack([on_y[:, 2], on_y[:, 0], on_z[:, 0]], axis=1)
    right = martin.coplanar_equations(differences, motion.omega, (ry, rz))
    x, z = motion.omega[:, 0], motion.omega[:, 2]
    eq18 = on_z[:, 0] / rz + x * z
    eq19 = -on_y[:, 0] / ry - x * z
    return [
        Misprint(SOURCE, "18", "αy", "+ ωxωz", "− ωxωz", eq18, right[:, 1], motion.alpha[:, 1]),
        Misprint(SOURCE, "19", "αz", "− ωxωz", "+ ωxωy", eq19, right[:, 2], motion.alpha[:, 2]),
    ]


def _table_3() -> list[Published]:
    """Both schemes measure one A0: the peripheral one with the printed A_X (t1) and A_Z (t2) put right is held against
    the compact cube. |A| alone would not tell the sign of A_X: 262.9 with 240, 263.2 g with −240."""
    out = []
    for name, axis, channel, misprinted in (("t1", 0, "ax", 240.0), ("t2", 1, "az", 5.5)):
        at = martin98.TABLE_3[name]
        common = {"omega": at.omega, "alpha": at.alpha, "rx": ARMS[0], "rz": ARMS[2]}
        ours = dict(zip(("ax", "az"), at.peripheral, strict=True)) | common
        other = dict(zip(("ax", "az"), at.compact, strict=True)) | common
        printed = float(martin98.peripheral(ours | {channel: misprinted})[axis])
        out.append(
            Published(
                SOURCE,
                f"Table 3 {name}, A0{'XZ'[axis]} of the peripheral scheme against the compact cube, g",
                f"{printed:.1f} by A{'XZ'[axis]} = {misprinted:g}",
                float(martin98.peripheral(ours)[axis]),
                float(martin98.compact(other)[axis]),
                0.5,
                "half of the last digit of Table 3's A1X and A1Z",
            )
        )
    return out
