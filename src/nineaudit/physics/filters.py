"""Channel frequency class (CFC) filters of crash testing: SAE J211-1 Appendix C, ISO 6487 Annex A.

Two-pole Butterworth, run forward and backward (phaseless, four poles). With T = 1/rate,

    ωd = 2π·CFC·2.0775 (SAE)  or  2π·CFC·2.08333 (ISO, 1.25·5/3),   ωa = tan(ωd T/2),
    b0 = ωa²/(1 + √2 ωa + ωa²),  b1 = 2 b0,  b2 = b0,
    a1 = −2(ωa² − 1)/(1 + √2 ωa + ωa²),   a2 = (−1 + √2 ωa − ωa²)/(1 + √2 ωa + ωa²),
    y_t = b0 x_t + b1 x_{t−1} + b2 x_{t−2} + a1 y_{t−1} + a2 y_{t−2}.

The class is not the −3 dB frequency: that is about 5/3·CFC, where each pass is −1.5 dB.
"""

from __future__ import annotations

import math
from typing import Final, Literal, get_args

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import ConfigurationError, EstimationError

Standard = Literal["J211", "ISO6487"]
_DESIGN_FACTOR: Final[dict[str, float]] = {"J211": 2.0775, "ISO6487": 1.25 * 5.0 / 3.0}
SAMPLES_PER_CLASS: Final = 10.0
"""Sampling rate over CFC, at least (SAE J211-1)."""
_FREQUENCIES = 4096
_CLOCK = 1e-6


def fast_enough(rate: float, class_: float) -> bool:
    """Whether `rate` (Hz) is ten times the class (SAE J211-1), a clock's rounding aside."""
    return rate * (1.0 + _CLOCK) >= SAMPLES_PER_CLASS * class_


def coefficients(
    class_: float, rate: float, standard: Standard = "J211"
) -> tuple[tuple[float, float, float], tuple[float, float]]:
    """(b0, b1, b2), (a1, a2) of one pass, in the sign of the module's recursion; `rate` in Hz.

    Raises ConfigurationError for an unknown standard or a class that is no positive number, EstimationError
    when the rate is below 10 times the class.
    """
    if standard not in _DESIGN_FACTOR:
        raise ConfigurationError(
            "unknown filter standard", found=standard, expected="one of " + ", ".join(get_args(Standard))
        )
    if not (math.isfinite(class_) and class_ > 0.0):
        raise ConfigurationError("channel frequency class", found=class_, expected="a positive number such as 1000")
    if not fast_enough(rate, class_):
        raise EstimationError(
            f"sampled too slowly for CFC{class_:g}",
            found=f"{rate:g} Hz",
            expected=f"at least {SAMPLES_PER_CLASS * class_:g} Hz (10 times the class, SAE J211-1)",
            advice="choose a lower class",
        )
    warped = math.tan(2.0 * math.pi * class_ * _DESIGN_FACTOR[standard] / (2.0 * rate))
    scale = 1.0 / (1.0 + math.sqrt(2.0) * warped + warped**2)
    b0 = warped**2 * scale
    a1 = -2.0 * (warped**2 - 1.0) * scale
    a2 = (-1.0 + math.sqrt(2.0) * warped - warped**2) * scale
    return (b0, 2.0 * b0, b0), (a1, a2)


def response(frequency: FloatArray, class_: float, rate: float, standard: Standard = "J211") -> FloatArray:
    """Amplitude ratio of both passes at `frequency` (m,) Hz, real and positive; errors as `coefficients`."""
    b, a = coefficients(class_, rate, standard)
    delay = np.exp(-2j * np.pi * np.asarray(frequency) / rate)
    once = (b[0] + b[1] * delay + b[2] * delay**2) / (1.0 - a[0] * delay - a[1] * delay**2)
    return np.asarray(np.abs(once) ** 2)


def corner(class_: float, rate: float, standard: Standard = "J211") -> float:
    """−3 dB frequency (Hz) of both passes; errors as `coefficients`.

    Both leave 1/(1 + (tan(πf/rate)/ωa)⁴) of the amplitude, hence f = rate/π · atan((√2 − 1)^¼ ωa): 5/3 of the class
    where the sampling is fast [SAE J211-1].
    """
    coefficients(class_, rate, standard)
    warped = math.tan(math.pi * class_ * _DESIGN_FACTOR[standard] / rate)
    return rate / math.pi * math.atan((math.sqrt(2.0) - 1.0) ** 0.25 * warped)


def mean_noise(class_: float, rate: float, length: int) -> float:
    """Variance of the mean of `length` samples of white noise behind the filter, over σ²/length (1 for white noise).

    length ∫|H D|² df / ∫|H|² df, D = sin(length x)/(length sin x) with x = πf/rate the response of the mean.
    """
    frequency = (np.arange(_FREQUENCIES) + 0.5) / _FREQUENCIES * rate / 2.0
    power, x = response(frequency, class_, rate) ** 2, np.pi * frequency / rate
    mean = np.sin(length * x) / (length * np.sin(x))
    return float(length * (power * mean**2).sum() / power.sum())


def cfc(values: FloatArray, rate: float, class_: float, standard: Standard = "J211") -> FloatArray:
    """`values` (n,) or (n,m) filtered to the class, same shape and unit; uniform `rate` in Hz.

    Both ends are continued by odd reflection about the end sample (ISO 6487 Annex A), over 100 samples or
    10 ms, whichever is more, and less where the record is shorter; each pass starts at rest at its first
    sample. The same is done for SAE J211-1. Raises as `coefficients`, and EstimationError for NaN.
    """
    b, a = coefficients(class_, rate, standard)
    if len(values) < 2 or not np.isfinite(values).all():
        raise EstimationError(
            "signal cannot be filtered",
            found=f"{len(values)} samples, {np.count_nonzero(~np.isfinite(values))} values not finite",
            expected="at least 2 samples, all finite",
            advice="repair or cut the gap first",
        )
    pad = min(max(100, math.ceil(0.010 * rate)), len(values) - 1)
    head = 2.0 * values[0] - values[pad:0:-1]
    tail = 2.0 * values[-1] - values[-2 : -pad - 2 : -1]
    extended = np.concatenate([head, values, tail])
    both = _one_pass(_one_pass(extended, b, a)[::-1], b, a)[::-1]
    return np.ascontiguousarray(both[pad : pad + len(values)])


def _one_pass(x: FloatArray, b: tuple[float, float, float], a: tuple[float, float]) -> FloatArray:
    """The recursion from rest at x[0] (unit gain at zero frequency), as a banded triangular system."""
    from scipy.linalg.lapack import dtbtrs

    step = x - x[0]
    driven = b[0] * step
    driven[1:] += b[1] * step[:-1]
    driven[2:] += b[2] * step[:-2]
    bands = np.broadcast_to(np.array([1.0, -a[0], -a[1]])[:, None], (3, len(x)))
    solved, _ = dtbtrs(bands, driven.reshape(len(x), -1), uplo="L")
    return np.asarray(solved.reshape(x.shape) + x[0])
