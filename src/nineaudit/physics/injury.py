"""Injury measures of the head. Accelerations in m/s² in, standard gravity inside; times in s."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import EstimationError
from nineaudit.units import G0

BRIC_CRITICAL: Final = (66.25, 56.45, 42.87)
"""Critical ωx, ωy, ωz in rad/s [Takhounts et al. 2013, Stapp 57; METHODS.md 6]."""


class Window(NamedTuple):
    """A maximum over windows: its value and the window, s."""

    value: float
    start: float
    end: float


def _checked(acceleration: FloatArray, time: FloatArray) -> FloatArray:
    """The resultant in g; EstimationError unless (n,) finite, not negative, time increasing, n ≥ 2."""
    if acceleration.shape != time.shape or time.ndim != 1 or time.size < 2 or not (np.diff(time) > 0.0).all():
        raise EstimationError(
            "resultant and time base do not fit",
            found=(acceleration.shape, time.shape),
            expected="two (n,) arrays, n ≥ 2, time increasing",
        )
    if not np.isfinite(acceleration).all() or (acceleration < 0.0).any():
        raise EstimationError("not a resultant acceleration", expected="finite values, none negative")
    return acceleration / G0


def _trapezoid(values: FloatArray, time: FloatArray) -> FloatArray:
    """Cumulative trapezoidal integral, 0 at the first sample (the rule that J211 users apply)."""
    return np.concatenate([[0.0], np.cumsum(np.diff(time) * (values[1:] + values[:-1]) / 2.0)])


def hic(acceleration: FloatArray, time: FloatArray, window: float = 0.015) -> Window:
    """Head injury criterion (g^2.5 s) of the resultant `acceleration` (n,) m/s² at the centre of gravity.

    HIC = max over t2 − t1 ≤ `window` of (t2 − t1) {[v(t2) − v(t1)]/(t2 − t1)}^2.5, v = ∫a dt by trapezoids
    [METHODS.md 6], over all pairs of samples; n × (samples in the window) operations, memory O(n).
    `window` in s: 0.015 (HIC15) or 0.036 (HIC36). Raises EstimationError for a signal that is no resultant.
    """
    velocity = _trapezoid(_checked(acceleration, time), time)
    # HIC = [Δv Δt^-0.6]^2.5: the bracket is maximised; powers are taken only where they could beat the best.
    best, start, end = 0.0, 0, 0
    for lag in range(1, time.size):
        duration = time[lag:] - time[:-lag]
        shortest = float(duration.min())
        if shortest > window * (1.0 + 1e-9):
            break
        gained = velocity[lag:] - velocity[:-lag]
        hopeful = np.flatnonzero(gained > best * shortest**0.6)
        hopeful = hopeful[duration[hopeful] <= window * (1.0 + 1e-9)]
        if hopeful.size:
            scores = gained[hopeful] * duration[hopeful] ** -0.6
            top = int(np.argmax(scores))
            if scores[top] > best:
                best, start, end = float(scores[top]), int(hopeful[top]), int(hopeful[top]) + lag
    return Window(best**2.5, float(time[start]), float(time[end]))


def gsi(acceleration: FloatArray, time: FloatArray) -> float:
    """Gadd severity index ∫a^2.5 dt (g^2.5 s) of the resultant `acceleration` (n,) m/s² [Gadd 1966].

    Trapezoidal rule. Raises EstimationError for a signal that is no resultant.
    """
    return float(_trapezoid(_checked(acceleration, time) ** 2.5, time)[-1])


def a3ms(acceleration: FloatArray, time: FloatArray, duration: float = 0.003, *, cumulative: bool = False) -> float:
    """Highest level (m/s²) that the resultant `acceleration` (n,) m/s² holds for `duration` s (METHODS.md 6).

    Without a break; `cumulative`: summed over the record. Exact for the straight lines between samples, by
    bisection on the level (time above falls as the level rises). Raises EstimationError for a signal that is
    no resultant or a record shorter than `duration`.
    """
    _checked(acceleration, time)
    if time[-1] - time[0] < duration:
        raise EstimationError(
            "record is shorter than the window",
            found=f"{time[-1] - time[0]:g} s",
            expected=f"≥ {duration:g} s",
        )
    low, high = float(acceleration.min()), float(acceleration.max())
    for _ in range(60):
        level = (low + high) / 2.0
        held = _time_above(acceleration, time, level)
        longest = held.sum() if cumulative else held.max()
        low, high = (level, high) if longest >= duration else (low, level)
    return low


def _time_above(values: FloatArray, time: FloatArray, level: float) -> FloatArray:
    """Durations (s) of the runs at or above a level, lines between samples; zeros among them."""
    lower, upper = np.minimum(values[1:], values[:-1]), np.maximum(values[1:], values[:-1])
    rise = np.where(upper > lower, upper - lower, 1.0)
    part = np.where(lower >= level, 1.0, np.clip((upper - level) / rise, 0.0, 1.0))
    run = np.cumsum(values < level)[:-1]  # a sample below ends a run
    return np.asarray(np.bincount(run, weights=part * np.diff(time)), dtype=np.float64)


def bric(omega: FloatArray, critical: tuple[float, float, float] = BRIC_CRITICAL) -> float:
    """Brain injury criterion √Σ(max|ω_i|/ω_i,crit)² of `omega` (n,3) rad/s in the head frame (SAE J1733).

    The three maxima are taken separately [Takhounts et al. 2013; METHODS.md 6]. EstimationError for gaps.
    """
    if omega.size == 0 or not np.isfinite(omega).all():
        raise EstimationError("angular velocity is empty or has gaps", advice="repair the channel first")
    return float(np.linalg.norm(np.abs(omega).max(axis=0) / np.asarray(critical)))


def peak(values: FloatArray, time: FloatArray) -> tuple[float, float]:
    """Largest |value| of `values` (n,), or length of (n,3), and its time (s). EstimationError for gaps."""
    size = np.abs(values) if values.ndim == 1 else np.linalg.norm(values, axis=1)
    if size.size == 0 or not np.isfinite(size).all():
        raise EstimationError("signal is empty or has gaps", advice="repair the channel first")
    top = int(np.argmax(size))
    return float(size[top]), float(time[top])
