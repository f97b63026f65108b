"""Injury measures of the head. Accelerations in m/s² in, standard gravity inside; times in s."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.errors import EstimationError
from nineaudit.units import G0

BRIC_CRITICAL: Final = (66.25, 56.45, 42.87)
"""Critical ωx, ωy, ωz in rad/s [Takhounts et al. 2013, Stapp 57; METHODS.md 6]."""


class Window(NamedTuple):
    """A maximum over windows: its value and the window, s."""

    value: float
    start: float
    end: float


def _checked(acceleration: FloatArray, time: FloatArray, dimensions: int = 1) -> FloatArray:
    """The resultant, or several (s,n), in g; EstimationError unless finite, not negative, time increasing, n ≥ 2."""
    shape = acceleration.shape[-1:] if acceleration.ndim == dimensions else None
    if shape != time.shape or time.size < 2 or not (np.diff(time) > 0.0).all():
        raise EstimationError(
            "resultant and time base do not fit",
            found=(acceleration.shape, time.shape),
            expected="two (n,) arrays, n ≥ 2, time increasing",
        )
    if not np.isfinite(acceleration).all() or (acceleration < 0.0).any():
        raise EstimationError("not a resultant acceleration", expected="finite values, none negative")
    return acceleration / G0


def _trapezoid(values: FloatArray, time: FloatArray) -> FloatArray:
    """Cumulative trapezoidal integral (...,n), 0 at the first sample (the rule that J211 users apply)."""
    parts = np.diff(time) * (values[..., 1:] + values[..., :-1]) / 2.0
    return np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(parts, axis=-1)], axis=-1)


def hic(acceleration: FloatArray, time: FloatArray, window: float = 0.015) -> Window:
    """Head injury criterion (g^2.5 s) of the resultant `acceleration` (n,) m/s² at the centre of gravity.

    HIC = max over t2 − t1 ≤ `window` of (t2 − t1) {[v(t2) − v(t1)]/(t2 − t1)}^2.5, v = ∫a dt by trapezoids
    [METHODS.md 6], over all pairs of samples; n × (samples in the window) operations, memory O(n).
    `window` in s: 0.015 (HIC15) or 0.036 (HIC36). Raises EstimationError for a signal that is no resultant.
    """
    best, start, end = _windows(_checked(acceleration, time)[None], time, window)
    return Window(float(best[0]) ** 2.5, float(time[start[0]]), float(time[end[0]]))


def hic_of_each(accelerations: FloatArray, time: FloatArray, window: float = 0.015) -> FloatArray:
    """The values (s,) of hic() for resultants (s,n) with one time base."""
    return np.asarray(_windows(_checked(accelerations, time, 2), time, window)[0] ** 2.5)


def _windows(resultants: FloatArray, time: FloatArray, window: float) -> tuple[FloatArray, IntArray, IntArray]:
    """Of resultants (s,n) in g, HIC = [Δv Δt^-0.6]^2.5: the largest bracket, first and last sample of its window."""
    velocity = _trapezoid(resultants, time)
    each = np.arange(len(velocity))
    best, start, end = np.zeros(len(each)), np.zeros(len(each), dtype=np.intp), np.zeros(len(each), dtype=np.intp)
    for lag in range(1, time.size):
        duration = time[lag:] - time[:-lag]
        shortest = float(duration.min())
        if shortest > window * (1.0 + 1e-9):
            break
        gained = velocity[:, lag:] - velocity[:, :-lag]
        hopeful = np.flatnonzero((gained > best[:, None] * shortest**0.6).any(axis=0))  # powers only for these
        hopeful = hopeful[duration[hopeful] <= window * (1.0 + 1e-9)]
        if not hopeful.size:
            continue
        scores = gained[:, hopeful] * duration[hopeful] ** -0.6
        top = np.argmax(scores, axis=1)
        better = scores[each, top] > best
        best[better] = scores[each, top][better]
        start[better], end[better] = hopeful[top[better]], hopeful[top[better]] + lag
    return best, start, end


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
    return float(a3ms_of_each(acceleration[None], time, duration, cumulative=cumulative)[0])


def a3ms_of_each(
    accelerations: FloatArray, time: FloatArray, duration: float = 0.003, *, cumulative: bool = False
) -> FloatArray:
    """The values (s,) of a3ms() for resultants (s,n) with one time base."""
    _checked(accelerations, time, 2)
    if time[-1] - time[0] < duration:
        raise EstimationError(
            "record is shorter than the window",
            found=f"{time[-1] - time[0]:g} s",
            expected=f"≥ {duration:g} s",
        )
    low, high = accelerations.min(axis=1), accelerations.max(axis=1)
    for _ in range(60):
        level = (low + high) / 2.0
        held = _time_above(accelerations, time, level)
        longest = held.sum(axis=1) if cumulative else held.max(axis=1)
        low, high = np.where(longest >= duration, (level, high), (low, level))
    return np.asarray(low)


def _time_above(values: FloatArray, time: FloatArray, level: FloatArray) -> FloatArray:
    """(s,n) durations (s) of the runs of values (s,n) at or above a level (s,), lines between samples; zeros among
    them."""
    level = level[:, None]
    lower, upper = np.minimum(values[:, 1:], values[:, :-1]), np.maximum(values[:, 1:], values[:, :-1])
    rise = np.where(upper > lower, upper - lower, 1.0)
    part = np.where(lower >= level, 1.0, np.clip((upper - level) / rise, 0.0, 1.0))
    run = np.cumsum(values < level, axis=1)[:, :-1]  # a sample below ends a run
    of_row = run + len(time) * np.arange(len(values))[:, None]
    lasting = np.bincount(of_row.ravel(), (part * np.diff(time)).ravel(), values.size)
    return np.asarray(lasting.reshape(values.shape), dtype=np.float64)


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
