"""What a coarse recording does not see between its samples, and what that does to the readings.

The whole-record fit ties neighbouring samples by the midpoint rule, ω̄ = (ω₋ + ω₊)/2 and α = (ω₊ − ω₋)/h, with ω₋ and
ω₊ half a step away. By Taylor's theorem the body's own ω and α at the sample are

    ω(t) = ω̄ − h²/8 dα/dt + O(h⁴),    α(t) = (ω₊ − ω₋)/h − h²/24 d²α/dt² + O(h⁴)

The first is taken off, dα/dt by central differences. Where knocks come faster than the samples no derivative says how
they went. A content of α that the samples do not resolve looks like white noise in them; its size s is read off the
second difference, which for white noise has the variance 6 s² (a resolved motion has h² d²α/dt² there, which over √6
is ten times the truncation error):

    s = |Δ²α| / √6,    α(t) differs from its mean over the step by s,    ω(t) from ω̄ by h s / √12

These errors are the body's: all channels of a sample share them (model.Between). Sensors that are not read at the same
instant differ besides, each by its own time offset τ of standard deviation u_timing:

    δy = τ dy/dt,    (dy/dt)² = π²/6 · mean of the squared forward and backward differences / h²

π²/6 makes the slope of white noise up to half the sampling rate come out right, (π/h)² s²/3.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.estimate import calibration
from nineaudit.estimate.model import Between, Data
from nineaudit.estimate.motion import Motion

WHITE_SECOND, WHITE_SLOPE = float(np.sqrt(6.0)), float(np.pi / np.sqrt(6.0))
LEAST_ALPHA = 1e-9
"""rad/s²: no error is exactly 0."""


def unresolved(values: FloatArray) -> FloatArray:
    """(n,m) size s of what the samples of `values` do not resolve: local rms of the second difference over √6."""
    ends = np.pad(values, ((1, 1), (0, 0)), mode="edge")
    return _around(ends[2:] - 2.0 * values + ends[:-2]) / WHITE_SECOND


def slope(values: FloatArray, step: FloatArray) -> FloatArray:
    """(n,m) size of the derivative of `values` (n,m) at samples of width `step` (n,)."""
    ends = np.pad(values, ((1, 1), (0, 0)), mode="edge")
    both = 0.5 * ((ends[2:] - values) ** 2 + (values - ends[:-2]) ** 2)
    return WHITE_SLOPE * _around(np.sqrt(both)) / step[:, None]


def between(step: FloatArray, motion: Motion) -> Between:
    """Errors of the midpoint rule at samples of width `step` (n,) s in a `motion` sampled there."""
    ends = np.pad(motion.alpha, ((1, 1), (0, 0)), mode="edge")
    lag = -step[:, None] / 16.0 * (ends[2:] - ends[:-2])
    size = unresolved(motion.alpha) + LEAST_ALPHA
    sd = np.hstack([step[:, None] * size / np.sqrt(12.0), size])
    return Between(motion.omega, np.hstack([lag, np.zeros_like(lag)]), sd)


def coarse(data: Data, motion: Motion) -> Data:
    """`data` with what happens between its samples in a `motion` near the true one: errors that the channels share,
    and in each weight the time offset of its channel."""
    features = calibration.features(motion.a0.T, motion.alpha.T, motion.omega.T)
    ideal = data.bent(np.zeros(len(data.channel))).predict(features).T
    moved = data.prior_sd[:, calibration.PARAMETERS.index("timing")] * slope(ideal, data.step)
    weight = data.weight / np.sqrt(1.0 + (data.weight * moved) ** 2)
    return replace(data, weight=weight, between=between(data.step, motion))


def _around(values: FloatArray) -> FloatArray:
    """Root mean square over each sample and its two neighbours."""
    ends = np.pad(values**2, ((1, 1), (0, 0)), mode="edge")
    return np.asarray(np.sqrt((ends[2:] + ends[1:-1] + ends[:-2]) / 3.0))
