"""Units at the edges. Inside, everything is SI: m, s, m/s², rad/s, rad."""

from __future__ import annotations

import math
from typing import Final, Literal

from nineaudit.errors import ConfigurationError

G0: Final = 9.80665
"""Standard gravity, m/s² (exact, CGPM 1901)."""

Quantity = Literal["length", "acceleration", "angular_rate", "time"]

_LENGTH = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "in": 0.0254}
_ACCELERATION = {"m/s^2": 1.0, "g_0": G0, "mm/s^2": 1e-3, "ft/s^2": 0.3048}
_ANGULAR_RATE = {"rad/s": 1.0, "deg/s": math.pi / 180.0}
_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
FACTORS: Final[dict[Quantity, dict[str, float]]] = {
    "length": _LENGTH,
    "acceleration": _ACCELERATION,
    "angular_rate": _ANGULAR_RATE,
    "time": _TIME,
}

# Spellings met in databases and exports, folded to one of the names above.
_SPELLINGS = {
    "m/s2": "m/s^2", "m/s²": "m/s^2", "m/s/s": "m/s^2", "m/sec^2": "m/s^2", "meter/sec2": "m/s^2",
    "g": "g_0", "gn": "g_0", "g0": "g_0", "°/s": "deg/s", "degree/s": "deg/s", "degrees/s": "deg/s",
    "dps": "deg/s", "deg/sec": "deg/s", "rad/sec": "rad/s", "rps": "rad/s", "sec": "s", "second": "s",
    "seconds": "s", "msec": "ms", "µs": "us", "μs": "us", "inch": "in",
}  # fmt: skip


def factor(unit: str, quantity: Quantity, *, place: str | None = None) -> float:
    """SI value of one `unit` of `quantity`.

    Raises ConfigurationError when the unit is unknown or belongs to another quantity.
    """
    name = unit.strip()
    name = _SPELLINGS.get(name.lower(), name)
    known = FACTORS[quantity]
    if name not in known:
        raise ConfigurationError(
            f"unknown unit of {quantity.replace('_', ' ')}",
            place=place,
            found=unit,
            expected="one of " + ", ".join(known),
        )
    return known[name]
