"""Channel frequency class filters: coefficients, and −3 dB points measured on the filtered impulse (METHODS 6)."""

from __future__ import annotations

from typing import Final, get_args

import numpy as np

from nineaudit.physics import filters
from nineaudit.selftest.published import Published

_COEFFICIENTS: Final = (
    (180.0, 10_000.0, (0.01179627, 1.67011746, -0.71730255)),
    (1000.0, 10_000.0, (0.21923142, 0.31189654, -0.18882221)),
    (1000.0, 20_000.0, (0.07189310, 1.11158618, -0.39915856)),
)
_CORNERS: Final = (
    (10_000.0, (100.0, 300.5, 1018.0, 1751.0)),
    (20_000.0, (100.0, 300.1, 1005.0, 1688.0)),
)
_CLASSES: Final = (60.0, 180.0, 600.0, 1000.0)
_SAMPLES: Final = 1 << 15
_SOURCE: Final = "SAE J211-1 App. C"


def checks() -> list[Published]:
    """Coefficients of three filters, −3 dB points of every class at two rates and of both standards."""
    return [*_coefficients(), *_corners(), *_standards()]


def measured_corner(class_: float, rate: float, standard: filters.Standard = "J211") -> float:
    """Hz at which the spectrum of a filtered impulse falls through √½, between its lines by a straight line."""
    impulse = np.zeros(_SAMPLES)
    impulse[_SAMPLES // 2] = 1.0
    size = np.abs(np.fft.rfft(filters.cfc(impulse, rate, class_, standard)))
    first = int(np.argmax(size < np.sqrt(0.5)))
    part = (size[first - 1] - np.sqrt(0.5)) / (size[first - 1] - size[first])
    return float((first - 1 + part) * rate / _SAMPLES)


def _coefficients() -> list[Published]:
    out = []
    for class_, rate, printed in _COEFFICIENTS:
        b, a = filters.coefficients(class_, rate)
        for name, value, ours in zip(("b0", "a1", "a2"), printed, (b[0], *a), strict=True):
            what = f"CFC{class_:g} at {rate / 1000:g} kHz, {name}"
            out.append(Published(_SOURCE, what, value, ours, value, 5e-9, "half of the last printed digit"))
    return out


def _corners() -> list[Published]:
    out = []
    for rate, printed in _CORNERS:
        for class_, value in zip(_CLASSES, printed, strict=True):
            tolerance = 0.05 if value < 1000.0 else 0.5
            what, why = f"CFC{class_:g} at {rate / 1000:g} kHz, −3 dB in Hz", "half of the last printed digit"
            out.append(Published(_SOURCE, what, value, measured_corner(class_, rate), value, tolerance, why))
    return out


def _standards() -> list[Published]:
    """−3 dB of both passes lies where (f/fd)⁴ = √2 − 1, fd = 2.0775 or 2.08333 CFC, warped by the bilinear map."""
    out = []
    for standard in get_args(filters.Standard):
        for class_ in _CLASSES:
            found, expected = measured_corner(class_, 20_000.0, standard), filters.corner(class_, 20_000.0, standard)
            what = f"CFC{class_:g} at 20 kHz by {standard}, −3 dB in Hz against its closed form"
            line = 20_000.0 / _SAMPLES
            source = _SOURCE if standard == "J211" else "ISO 6487 Annex A"
            why = "a hundredth of a spectral line: the curve is straight between two"
            out.append(Published(source, what, f"{expected:.2f}", found, expected, 0.01 * line, why))
    return out
