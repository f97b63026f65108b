"""Amplitude spectral density of a channel, to be looked at: noise floors, mains hum, resonances, the filter's edge."""

from __future__ import annotations

import numpy as np

from nineaudit.array import FloatArray

LONGEST = 1024
"""Samples of a segment (Welch 1967): enough to part lines, few enough to average."""
FEWEST = 16


def density(values: FloatArray, rate: float) -> tuple[FloatArray, FloatArray]:
    """(f, d): frequencies (m,) Hz above 0, and the one-sided density (m,) in the unit of `values` (n,) per √Hz.

    Mean of overlapping segments under a Hann window. Missing samples (NaN) count as the mean. Empty where fewer than
    16 samples are valid.
    """
    finite = np.isfinite(values)
    if finite.sum() < FEWEST:
        return np.empty(0), np.empty(0)
    whole = np.where(finite, values - values[finite].mean(), 0.0)
    length = min(len(whole), LONGEST)
    window = np.hanning(length + 1)[:-1]
    segments = np.lib.stride_tricks.sliding_window_view(whole, length)[:: max(length // 2, 1)]
    power = (np.abs(np.fft.rfft(segments * window, axis=1)) ** 2).mean(axis=0)
    density = np.sqrt(2.0 * power / (rate * (window**2).sum()))
    return np.asarray(np.fft.rfftfreq(length, 1.0 / rate)[1:]), np.asarray(density[1:])
