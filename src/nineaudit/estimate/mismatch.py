"""Channels behind different filters: which class each shows, and what that does to its readings.

A pair of accelerometers used for α needs matched transfer functions (SAE J211-1): behind different classes, what the
body does comes out as a difference. With F_i the class of channel i, F the one that most channels have and y the
readings of a perfect instrument in the motion, δy_i = F_i y_i − F y_i.

Which class: noise at rest behind a class has its spectrum S = |H|⁴ + floor (forward and backward); by the likelihood of
the periodogram I, its level s unknown, ln L = −Σ ln S − n ln Σ I/S                              [Whittle 1953]
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.physics import filters

SURE = 10.0
"""Nats by which a channel's own class must be the likelier one: e^-10, once in 20,000 healthy channels."""
CORRELATED = 2.0 / 3.0
"""Independent values to a bin of a periodogram behind a Hann window."""
FLOOR, PERIODS = 1e-4, 4.0
"""Of the spectrum, leakage and rounding; and periods of a class's corner that the record must hold."""

Class = float | None


def classes(noise: FloatArray, rate: float, stated: Class, rounding: FloatArray) -> tuple[Class, ...]:
    """The class of each channel (None: no filter) by its `noise` (m,k) at rest, zeroed; where that does not say, what
    most of the others have, or what is `stated`. `rounding` (k,) of a reading, standard deviation."""
    likely = [_likelihoods(column, rate, float(r)) for column, r in zip(noise.T, rounding, strict=True)]
    known = [found for found in likely if found]
    if not known:
        return (stated,) * len(likely)
    pooled: dict[Class, float] = {c: float(np.median([found[c] for found in known])) for c in known[0]}
    most = max(pooled, key=lambda c: pooled[c])
    return tuple(_own(found, most) if found else most for found in likely)


def change(motion: FloatArray, time: FloatArray, rate: float, seen: tuple[Class, ...]) -> FloatArray:
    """(n,k) δy of perfect readings `motion` (n,k) at `time` (n,) s, recorded at `rate` Hz."""
    from scipy.interpolate import CubicSpline

    out, most = np.zeros_like(motion), Counter(seen).most_common(1)[0][0]
    if all(c == most for c in seen):
        return out
    fine = np.arange(time[0], time[-1], 1.0 / rate)
    for k in (i for i, c in enumerate(seen) if c != most):
        y = CubicSpline(time, motion[:, k])(fine)
        off = _through(y, rate, seen[k]) - _through(y, rate, most)
        out[:, k] = np.interp(time, fine, off)
    return out


def _through(values: FloatArray, rate: float, class_: Class) -> FloatArray:
    return values if class_ is None or not filters.fast_enough(rate, class_) else filters.cfc(values, rate, class_)


def _own(likely: dict[Class, float], most: Class) -> Class:
    best = max(likely, key=lambda c: likely[c])
    return best if likely[best] > likely[most] + SURE else most


def _likelihoods(noise: FloatArray, rate: float, rounding: float) -> dict[Class, float]:
    """ln L of each class that the record can show; empty where the noise says nothing."""
    level = float(np.std(noise)) if np.isfinite(noise).all() else 0.0
    if len(noise) < 16 or level <= 0.0:
        return {}
    spectrum = np.abs(np.fft.rfft((noise - noise.mean()) * np.hanning(len(noise)))[2:]) ** 2 / level**2
    frequency = np.asarray(np.fft.rfftfreq(len(noise), 1.0 / rate)[2:], dtype=np.float64)
    out: dict[Class, float] = {}
    for class_ in (None, *filters.CLASSES):
        if class_ is None:
            shape = np.ones_like(frequency)
        elif filters.fast_enough(rate, class_) and len(noise) / rate * filters.corner(class_, rate) >= PERIODS:
            passed = filters.response(frequency, class_, rate) ** 2
            shape = passed + max(FLOOR, (rounding / level) ** 2 * float(passed.mean()))
        else:
            continue
        fitted = np.log(shape).sum() + len(shape) * np.log((spectrum / shape).mean())
        out[class_] = -CORRELATED * float(fitted)
    return out
