"""Units at the edges. Inside, everything is SI: m, s, m/s², rad/s, rad."""

from __future__ import annotations

import math
from typing import Final, Literal, Protocol

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
    "m/(s^2)": "m/s^2", "m/(s*s)": "m/s^2",
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


class UnitNames(Protocol):
    """The units a rig speaks in (rig.Units)."""

    @property
    def length(self) -> str: ...
    @property
    def acceleration(self) -> str: ...
    @property
    def angular_rate(self) -> str: ...


_SI_OF: dict[str, Quantity] = {"m/s^2": "acceleration", "rad/s": "angular_rate", "m": "length"}
_COUNTED = ("samples", "frames", "spikes", "messages", "places", "steps")
_SPELLED = {"g_0": "g", "1": "", "m/s^2": "m/s²", "rad/s^2": "rad/s²", "rad/s^3": "rad/s³"}


def in_rig_units(value: float, unit: str, names: UnitNames) -> tuple[float, str]:
    """A value in an SI `unit` as (value, unit) of the rig; other units stay. Millivolt rigs speak of g_0."""
    quantity = _SI_OF.get(unit)
    if quantity is None:
        return value, unit
    name = str(getattr(names, quantity))
    if name not in FACTORS[quantity]:
        name = "g_0" if quantity == "acceleration" else unit
    return value / FACTORS[quantity][name], name


def counted(count: int, noun: str) -> str:
    """``1 gap``, ``2 gaps``."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def display(value: float, unit: str, names: UnitNames, significant: int = 3) -> str:
    """``12.4 g``: a value in an SI (or any other) `unit` with its unit, as the rig speaks."""
    number, name = in_rig_units(value, unit, names)
    spelled = _SPELLED.get(name, name)
    if abs(number) == 1.0 and name in _COUNTED:
        spelled = name.removesuffix("s")
    whole = name in _COUNTED or (float(number).is_integer() and abs(number) < 1e6)
    text = f"{number:.0f}" if whole or 1e3 <= abs(number) < 1e6 else f"{number:.{significant}g}"
    return f"{text} {spelled}" if spelled else text
