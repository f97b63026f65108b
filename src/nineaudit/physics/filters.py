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
from nineaudit.units import counted

Standard = Literal["J211", "ISO6487"]
_DESIGN_FACTOR: Final[dict[str, float]] = {"J211": 2.0775, "ISO6487": 1.25 * 5.0 / 3.0}
SAMPLES_PER_CLASS: Final = 10.0
"""Sampling rate over CFC, at least (SAE J211-1)."""
CLASSES: Final = (60.0, 180.0, 600.0, 1000.0)
"""Classes of SAE J211-1."""
LOSS_DB: Final = 1.0
"""What an earlier filter may have taken at the corner of the next one, dB, before that counts as filtering twice: from
CFC1000 to CFC600 it is 0.5 dB, to the same class 3 dB."""
_FREQUENCIES = 4096
_ABOVE, _LEFT, _PERIODS = 1.5, 0.1, 4.0
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


def class_of_noise(noise: FloatArray, rate: float) -> float | None:
    """The class whose filter has acted on `noise` (n,k), a record at rest sampled at `rate` Hz; None where none shows.

    The share of its power above 1.5 times a class's −3 dB frequency is 1 − 3 f/rate for white noise, and a hundredth of
    that behind the filter: under a tenth of it, the filter has acted. The lowest class of which that is so and of whose
    corner the record holds four periods. An analogue filter of like bandwidth looks the same.
    """
    values = noise[:, np.isfinite(noise).all(axis=0) & (np.ptp(noise, axis=0) > 0.0)]
    if len(values) < 4 or values.shape[1] == 0:
        return None
    power = np.abs(np.fft.rfft((values - values.mean(axis=0)) * np.hanning(len(values))[:, None], axis=0)) ** 2
    spectrum = (power / power.sum(axis=0)).mean(axis=1)
    frequency = np.fft.rfftfreq(len(values), 1.0 / rate)
    for class_ in CLASSES:
        if not fast_enough(rate, class_) or len(values) / rate * corner(class_, rate) < _PERIODS:
            continue
        limit = _ABOVE * corner(class_, rate)
        if float(spectrum[frequency > limit].sum()) < _LEFT * (1.0 - 2.0 * limit / rate):
            return class_
    return None


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
            found=f"{counted(len(values), 'sample')}, {np.count_nonzero(~np.isfinite(values))} of them not finite",
            expected="at least 2 samples, all finite",
            advice="repair or cut the gap first",
        )
    pad = min(max(100, math.ceil(0.010 * rate)), len(values) - 1)
    head = 2.0 * values[0] - values[pad:0:-1]
    tail = 2.0 * values[-1] - values[-2 : -pad - 2 : -1]
    extended = np.concatenate([head, values, tail])
    both = _one_pass(_one_pass(extended, b, a)[::-1], b, a)[::-1]
    return np.ascontiguousarray(both[pad : pad + len(values)])


def once(
    values: FloatArray, rate: float, class_: float, already: float | None, standard: Standard = "J211"
) -> FloatArray:
    """`cfc`, unless a filter of class `already` (None: none) has acted on `values` that leaves no room for this one.

    ConfigurationError where `already` has taken more than LOSS_DB at the corner of `class_`; else as `cfc`.
    """
    require_room(rate, class_, already, standard)
    return cfc(values, rate, class_, standard)


def require_room(rate: float, class_: float, already: float | None, standard: Standard = "J211") -> None:
    """ConfigurationError where a filter of class `already` (None: none) leaves no room for one of `class_`."""
    if already is None or not fast_enough(rate, already):
        return
    edge = corner(class_, rate, standard)
    warped = math.tan(math.pi * edge / rate) / math.tan(math.pi * already * _DESIGN_FACTOR[standard] / rate)
    lost = 20.0 * math.log10(1.0 + warped**4)
    if lost > LOSS_DB:
        raise ConfigurationError(
            f"filtered twice: CFC{class_:g} after CFC{already:g} leaves −{lost + 3.01:.1f} dB at {edge:.0f} Hz",
            found=f"a recording of CFC{already:g}",
            expected="−3 dB there, of one filter",
            advice="take the recording as it is, or start from unfiltered data",
        )


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
