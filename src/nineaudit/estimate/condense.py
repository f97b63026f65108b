"""Fewer samples with the same information: block means, and the noise that is left in them.

Noise behind a channel-frequency-class filter is coloured; a white-noise count of degrees of freedom is then wrong
(METHODS.md 2: work at about twice the pass band). Blocks long against the correlation are nearly independent.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray


@dataclass(frozen=True, eq=False)
class Condensed:
    """Block means: `time` (m,), `readings` (m,k) NaN where a block has no valid sample, `sigma` (k,) noise of a
    mean, `length` samples to a block."""

    time: FloatArray
    readings: FloatArray
    sigma: FloatArray
    length: int


SLOWEST_BLOCKS = 1500.0
"""Blocks a second that a head impact needs: products of ω must not change within a block."""
ENOUGH_BLOCKS = 8
"""Fewest blocks of rest from which the noise of a block is measured (pooled over the channels)."""


def block_length(samples: int, rate: float, pass_band: float | None, most: int = 2000) -> int:
    """Samples to a block. `rate` and `pass_band` (None: unfiltered) in Hz.

    About 2.5 blocks a period of the pass band keep the noise of neighbouring blocks nearly independent. Longer
    ones, down to SLOWEST_BLOCKS, bound the work to about `most` blocks.
    """
    coloured = rate / (2.5 * pass_band) if pass_band else 1.0
    bounded = min(-(-samples // most), rate / SLOWEST_BLOCKS)
    return max(1, round(coloured), int(bounded))


def block_means(values: FloatArray, length: int) -> FloatArray:
    """(n // length, ...) means of consecutive blocks of `values` (n, ...); NaN samples are left out.

    A block without a valid sample is NaN; samples after the last whole block are not used.
    """
    whole = len(values) // length
    blocks = values[: whole * length].reshape(whole, length, *values.shape[1:])
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Mean of empty slice", RuntimeWarning)
        return np.asarray(np.nanmean(blocks, axis=1))


def block_noise(sigma: FloatArray, rest: FloatArray | None, length: int) -> FloatArray:
    """(k,) noise of a block mean: σ/√length for white noise, more where the rest shows correlation.

    `rest` (r,k) zeroed samples of the quiet interval or None. The inflation, variance of block means found
    there over σ²/length, is the median of the channels (one bad channel does not count) and never below 1.
    """
    white = sigma / np.sqrt(length)
    if rest is None or len(rest) // length < ENOUGH_BLOCKS:
        return np.asarray(white)
    ratio = np.nanvar(block_means(rest, length), axis=0, ddof=1) / white**2
    return np.asarray(white * np.sqrt(max(float(np.median(ratio)), 1.0)))
