"""Numbers of Martin et al. 1998: the equations, and Table 4 from Table 3 by eq 22.

Table 3 (planar motion, x–z), METHODS 1.2: A_X of the peripheral scheme at t1 is −240 g (printed 240), A_Z at t2 about
−8.5 g (printed 5.5). The errors of t2 and t3 are exchanged in Table 4. Its relative standard uncertainties are 1.5 % of
every acceleration, ω and α, and 5 % of every arm; |A| with the norm of the error vector, g = 9.81 m/s².
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.schemes import martin
from nineaudit.selftest.misprints import ROUNDED, random_instants, relative
from nineaudit.selftest.published import Published

SOURCE = "Martin 1998"
G: Final = 9.81
ARMS: Final = (-0.08, -0.10, 0.13)
RELATIVE, ARM = 0.015, 0.05

NOT_REPRODUCED: Final = (
    "Martin 1998 Table 4, peripheral α: 7.30, 0.93 and 24.7 % are printed; no choice among the sources of eq 12, in "
    "either of its forms, gives the three of them.",
    "Martin 1998 Table 4, compact cube |A| at t2 and t3: 2.87 and 9.59 % follow only from a wrong sensitivity to the "
    "arm (ω² where α stands) and no error of α; the right values are 9.08 and 7.46 %.",
)
"""What cannot be reproduced, and why."""


class Instant(NamedTuple):
    """A column of Table 3: compact A1X, A1Z, peripheral A1X, A3Z (g), ω rad/s, α rad/s²."""

    compact: tuple[float, float]
    peripheral: tuple[float, float]
    omega: float
    alpha: float


TABLE_3: Final = {
    "t1": Instant((-240.0, -100.0), (-240.0, -108.0), -5.0, 900.0),
    "t2": Instant((-45.0, 80.0), (-45.0, -8.5), -23.0, 1e4),
    "t3": Instant((15.0, -10.0), (15.0, -31.9), -40.0, 80.0),
}


def peripheral(values: Mapping[str, float]) -> FloatArray:
    """A0X, A0Z (g) of the peripheral scheme in planar motion: eqs 8 and 10."""
    pull = values["omega"] ** 2 / G
    return np.array([values["ax"] + values["rx"] * pull, values["az"] + values["rz"] * pull])


def compact(values: Mapping[str, float]) -> FloatArray:
    """A0X, A0Z (g) of the compact cube in planar motion: eqs 8 and 16."""
    x = values["ax"] + values["rx"] * values["omega"] ** 2 / G
    return np.array([x, values["az"] + values["rx"] * values["alpha"] / G])


def table_4(name: str, scheme: str) -> tuple[float, float]:
    """|A| (g) and its relative standard uncertainty (%) at t1, t2 or t3 by eq 22."""
    at = TABLE_3[name]
    ax, az = at.peripheral if scheme == "peripheral" else at.compact
    values = {"ax": ax, "az": az, "omega": at.omega, "alpha": at.alpha, "rx": ARMS[0], "rz": ARMS[2]}
    u = {k: abs(v) * (ARM if k.startswith("r") else RELATIVE) for k, v in values.items()}
    function = peripheral if scheme == "peripheral" else compact
    spread, _ = martin.rss(function, values, u)
    size = float(np.linalg.norm(function(values)))
    return size, 100.0 * float(np.linalg.norm(spread)) / size


def checks() -> list[Published]:
    """Table 4 as far as it can be reproduced, and the corrected equations on a random rigid motion."""
    return [*_table(), *_equations()]


def _wrong_arm(name: str) -> float:
    """Relative error (%) of the compact |A| as the paper must have found it: ∂A0Z/∂rX = ω², and no error of α."""
    at, pull = TABLE_3[name], ARMS[0] * TABLE_3[name].omega ** 2 / G
    (ax, az), size = at.compact, table_4(name, "compact")[0]
    x = [RELATIVE * ax, 2.0 * RELATIVE * pull, ARM * pull]
    return 100.0 * float(np.linalg.norm([*x, RELATIVE * az, ARM * pull])) / size


def _table() -> list[Published]:
    half = "half a unit of the last digit"
    cut = "a unit of the last printed digit (10.87 was cut, not rounded)"
    unit = "two units of the last digit: Table 3 is printed to two and three digits"
    rows = [
        ("t1", "peripheral", ("263", 263.0, 0.5, half), ("1.50", 1.50, 0.005, half)),
        ("t2", "peripheral", ("49.3", 49.3, 0.05, half), ("1.70, at t3", 1.70, 0.005, half)),
        ("t3", "peripheral", ("10.8", 10.8, 0.1, cut), ("14.3, at t2", 14.2, 0.05, half)),
        ("t1", "compact", ("263", 263.0, 0.5, half), ("1.50", 1.50, 0.02, unit)),
        ("t2", "compact", ("49.3", 49.3, 0.05, half), ("2.87, at t3", 9.08, 0.005, half)),
        ("t3", "compact", ("10.8", 10.8, 0.1, cut), ("9.59, at t2", 7.46, 0.005, half)),
    ]
    out = []
    for name, scheme, size, error in rows:
        for quantity, ours, told in zip(
            ("|A|, g", "error of |A|, %"), table_4(name, scheme), (size, error), strict=True
        ):
            printed, expected, tolerance, why = told
            label = f"Table 4 {name} {scheme}, {quantity}"
            out.append(Published(SOURCE, label, printed, ours, expected, tolerance, why))
    for name, found in (("t2", 2.87), ("t3", 9.59)):
        label = f"Table 4 {name} compact, error of |A| by the wrong sensitivity ω² to the arm, %"
        out.append(Published(SOURCE, label, found, _wrong_arm(name), found, 0.005, half))
    return out


def _equations() -> list[Published]:
    """Eqs 8 to 11, right as printed; the misprinted ones are in martin98_misprints.py."""
    motion, (rx, ry, rz) = random_instants(1998), ARMS
    a1, a2, a3 = (motion.at(*place) for place in np.diag(ARMS))
    six = np.column_stack([a1[:, :2], a2[:, 1], a3])
    a0, alpha = martin.periphery_equations(six, motion.omega, (rx, ry, rz))
    pairs = (("eqs 8-10", a0, motion.a0), ("eq 11", alpha[:, 0], motion.alpha[:, 0]))
    label = "rms relative error on random motion"
    return [
        Published(SOURCE, f"{name}, {label}", "right as printed", relative(*pair), 0.0, ROUNDED, "rounding of the sums")
        for name, *pair in pairs
    ]
