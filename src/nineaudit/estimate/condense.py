"""Fewer samples with the same information: block means, and the noise that is left in them.

Noise behind a channel-frequency-class filter is coloured; a white-noise count of degrees of freedom is then wrong
(METHODS.md 2: work at about twice the pass band). Blocks long against the correlation are nearly independent.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from nineaudit.array import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Condensed:
    """Block means: `time` (m,), `readings` (m,k) NaN where a block has no valid sample, `sigma` (k,) noise of a
    mean, `length` samples to a block."""

    time: FloatArray
    readings: FloatArray
    sigma: FloatArray
    length: int


SLOWEST_BLOCKS, WITH_RATES = 1000.0, 1500.0
"""Blocks a second that a head impact needs: products of ω must not change within a block; and where rate sensors show ω
itself, so that the middle of a block must be the mean of its ends."""
CLOCK = 1e-6
"""Part of a rate that the rounding of its clock may take."""
ENOUGH_BLOCKS = 8
"""Fewest blocks of rest from which the noise of a block is measured (pooled over the channels)."""
KNOWN_FILTER, UNKNOWN_FILTER = 0.1, 0.5
"""How well the correlation of the noise is known (standard deviation of its logarithm) from the stated filter class: a
tenth, what the limits of a class allow; and without one."""
MEDIAN_SPREAD = 1.2533
"""√(π/2), standard deviation of a median over that of a mean."""


def block_length(
    samples: int, rate: float, pass_band: float | None, slowest: float = WITH_RATES, most: int = 2000
) -> int:
    """Samples to a block. `rate`, `pass_band` (None: unfiltered) and `slowest` in Hz.

    About 2.5 blocks a period of the pass band keep the noise of neighbouring blocks nearly independent. Longer
    ones, down to `slowest`, bound the work to about `most` blocks.
    """
    coloured = rate / (2.5 * pass_band) if pass_band else 1.0
    bounded = min(-(-samples // most), rate / slowest)
    return max(1, round(coloured), int(bounded * (1.0 + CLOCK)))


def block_means(values: FloatArray, length: int) -> FloatArray:
    """(n // length, ...) means of consecutive blocks of `values` (n, ...); NaN samples are left out.

    A block without a valid sample is NaN; samples after the last whole block are not used.
    """
    whole = len(values) // length
    blocks = values[: whole * length].reshape(whole, length, *values.shape[1:])
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Mean of empty slice", RuntimeWarning)
        return np.asarray(np.nanmean(blocks, axis=1))


def marked_blocks(marked: BoolArray, length: int) -> BoolArray:
    """(m,k) blocks of `length` samples that hold a marked one; the last few samples that fill no block are left out."""
    whole = len(marked) // length * length
    return np.asarray(marked[:whole].reshape(-1, length, marked.shape[1]).any(axis=1))


def block_noise(sigma: FloatArray, rest: FloatArray | None, length: int, filtered: float | None = None) -> FloatArray:
    """(k,) noise of a block mean: σ/√length for white noise, more where it is correlated.

    `rest` (r,k) zeroed samples of the quiet interval or None; `filtered` what a known filter makes of white noise,
    filters.mean_noise(). The inflation, variance of block means over σ²/length, found at rest is the median of the
    live channels (one bad channel does not count), the better known the more blocks it has. What is expected of the
    filter, or of white noise, counts as known to KNOWN_FILTER or UNKNOWN_FILTER (of its logarithm); the two are weighed
    by their precisions. Never below 1.
    """
    white = sigma / np.sqrt(length)
    expected, known = (1.0, UNKNOWN_FILTER) if filtered is None else (filtered, KNOWN_FILTER)
    blocks = 0 if rest is None else len(rest) // length
    if rest is None or blocks < ENOUGH_BLOCKS:
        return np.asarray(white * np.sqrt(expected))
    free, means = blocks - 1, block_means(rest, length)
    alive = np.isfinite(means).sum(axis=0) > blocks // 2
    if not alive.any():
        return np.asarray(white * np.sqrt(expected))
    ratio = np.nanvar(means[:, alive], axis=0, ddof=1) / white[alive] ** 2
    median = float(np.median(ratio)) / (1.0 - 2.0 / (9.0 * free)) ** 3  # the median of χ²/ν, Wilson and Hilferty 1931
    measured = MEDIAN_SPREAD * np.sqrt(2.0 / (free * int(alive.sum())))
    weight = known**2 / (known**2 + measured**2)
    log_inflation = weight * np.log(max(median, 1e-6)) + (1.0 - weight) * np.log(expected)
    return np.asarray(white * np.sqrt(max(float(np.exp(log_inflation)), 1.0)))
