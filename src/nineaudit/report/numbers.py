"""How a number leaves nineaudit: its unit at the edge and its digits, decided here and nowhere else."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from nineaudit.units import in_rig_units

if TYPE_CHECKING:
    from nineaudit.array import Sensor
    from nineaudit.finding import Measure
    from nineaudit.rig import Rig

JSON_DIGITS = 6
TEXT_DIGITS = 3
TIME_DECIMALS = 7
DASH = "–"
NO_BREAK = "\u00a0"

_SPELLED = {"g_0": "g", "g_0^2.5 s": "", "1": "", "deg/s": "°/s", "deg": "°", "percent": "%"}
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def edge(unit: str, rig: Rig) -> tuple[str, float]:
    """The rig's unit for a value in an SI `unit`, and what one of it is in SI; other units stay, factor 1."""
    value, name = in_rig_units(1.0, unit, rig.units)
    return name, 1.0 / value


def sensor_edge(sensor: Sensor, rig: Rig) -> tuple[str, float]:
    """The unit of one channel's readings at the edge, and its SI factor."""
    return edge("m/s^2" if sensor.kind == "accelerometer" else "rad/s", rig)


def at_edge(measure: Measure, rig: Rig) -> tuple[float, float, float, str]:
    """(value, limit, u, unit) of a measure in the rig's unit."""
    unit, one = edge(measure.unit, rig)
    return measure.value / one, measure.limit / one, measure.u / one, unit


def spelled(unit: str) -> str:
    """A unit as people write it: ``g_0`` is g, ``rad/s^2`` is rad/s², ``1`` is nothing."""
    if unit in _SPELLED:
        return _SPELLED[unit]
    base, caret, power = unit.partition("^")
    return base + power.translate(_SUPERSCRIPT) if caret else unit


def digits(value: float | None, significant: int = TEXT_DIGITS, *, full: bool = False) -> str:
    """`significant` digits, a plain decimal where that is short, else a power of ten; a dash for no number.

    Zeros at the end of a decimal fraction are left out unless `full`, as columns of numbers want it.
    """
    if value is None or math.isnan(value):
        return DASH
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value == 0:
        return "0"
    exponent = math.floor(math.log10(abs(float(f"{value:.{significant - 1}e}"))))
    if -4 <= exponent < 6:
        text = f"{value:.{max(significant - 1 - exponent, 0)}f}"
        stripped = text.rstrip("0").rstrip(".") if "." in text and not full else text
        return stripped.replace("-", "−")
    mantissa = f"{value / 10.0**exponent:.{significant - 1}f}".rstrip("0").rstrip(".")
    return f"{mantissa} × 10{str(exponent).translate(_SUPERSCRIPT)}".replace("-", "−", 1)


def quantity(value: float | None, unit: str, significant: int = TEXT_DIGITS, *, full: bool = False) -> str:
    """A number and its unit, held together by a no-break space."""
    text, name = digits(value, significant, full=full), spelled(unit)
    return text if not name or text == DASH else f"{text}{NO_BREAK}{name}"


def told_apart(value: float, limit: float) -> tuple[str, str]:
    """`value` and `limit` with as many digits as show that they differ (at most six)."""
    for significant in range(TEXT_DIGITS, JSON_DIGITS + 1):
        pair = digits(value, significant), digits(limit, significant)
        if pair[0] != pair[1]:
            return pair
    return pair


def probability(value: float | None) -> str:
    """A probability with two decimals that never claims certainty."""
    if value is None or math.isnan(value):
        return DASH
    if value > 0.99:
        return "> 0.99"
    return "< 0.01" if value < 0.01 else f"{value:.2f}"


def seconds(value: float) -> str:
    """A time to a tenth of a millisecond."""
    return f"{value:.4f}{NO_BREAK}s".replace("-", "−")


def printable(text: object) -> str:
    """Names and paths come from files: a line break is a space, and what cannot be printed (control characters,
    terminal escapes, bidirectional overrides) is shown as U+FFFD.
    """
    words = str(text)
    return words if words.isprintable() else "".join(map(_shown, words))


def _shown(character: str) -> str:
    if character.isprintable() or character == NO_BREAK:
        return character
    return " " if character.isspace() else "\ufffd"


def plain(value: Any) -> Any:
    """The same tree with numbers of `JSON_DIGITS` significant digits and null for what is not finite."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.{JSON_DIGITS - 1}e}") + 0.0 if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(item) for item in value]
    return value if value is None else str(value)


def instant(value: float) -> float | None:
    """A time stamp to 0.1 µs: significant digits would ruin seconds since 1970."""
    return round(float(value), TIME_DECIMALS) + 0.0 if math.isfinite(value) else None
