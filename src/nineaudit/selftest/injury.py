"""HIC and GSI of pulses whose values are known exactly (METHODS 6)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.physics import injury
from nineaudit.selftest.published import Published
from nineaudit.units import G0

_SOURCE: Final = "HIC and GSI, METHODS 6"
_PEAK_G, _LENGTH_S, _SAMPLES = 100.0, 0.010, 2001
_SHAPES: Final[dict[str, tuple[Callable[[FloatArray], FloatArray], float, float]]] = {
    "half-sine": (lambda s: np.sin(np.pi * s), 0.414646, 0.457656),
    "triangle": (lambda s: 1.0 - np.abs(2.0 * s - 1.0), 0.246401, 0.285714),
    "haversine": (lambda s: np.sin(np.pi * s) ** 2, 0.302939, 0.339531),
    "square": (np.ones_like, 1.0, 1.0),
}


def checks() -> list[Published]:
    """Both measures of each pulse, in units of A^2.5·T, and the 100 g, 10 ms half-sine in their own."""
    s = np.linspace(0.0, 1.0, _SAMPLES)
    time, unit, out = s * _LENGTH_S, _PEAK_G**2.5 * _LENGTH_S, []
    why = "half of the last printed digit, and the trapezoidal rule, 2.5 π²/12 n⁻²"
    tolerance = 5e-7 + 2.5 * np.pi**2 / 12.0 / (_SAMPLES - 1) ** 2
    for name, (shape, of_hic, of_gsi) in _SHAPES.items():
        a = np.abs(shape(s)) * _PEAK_G * G0
        hic, gsi = injury.hic(a, time).value / unit, injury.gsi(a, time) / unit
        out.append(Published(_SOURCE, f"HIC of a {name} over A^2.5 T", of_hic, hic, of_hic, tolerance, why))
        out.append(Published(_SOURCE, f"GSI of a {name} over A^2.5 T", of_gsi, gsi, of_gsi, tolerance, why))
    a = np.abs(np.sin(np.pi * s)) * _PEAK_G * G0
    digit = "half of the last printed digit"
    half_sine = "half-sine of 100 g and 10 ms"
    out.append(Published(_SOURCE, f"HIC of a {half_sine}", 414.6, injury.hic(a, time).value, 414.6, 0.05, digit))
    out.append(Published(_SOURCE, f"GSI of a {half_sine}", 457.7, injury.gsi(a, time), 457.7, 0.05, digit))
    return out
