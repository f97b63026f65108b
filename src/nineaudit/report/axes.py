"""Where the ticks of an axis go."""

from __future__ import annotations

import math

from nineaudit.array import FloatArray


def ticks(low: float, high: float, about: int) -> list[float]:
    """Round numbers (1, 2, 5 times a power of ten) between `low` and `high`, `about` so many, at least three."""
    raw = (high - low) / max(about, 1)
    if raw <= 0.0:
        return [low]
    power = 10.0 ** math.floor(math.log10(raw))
    steps = [m * power for m in (0.2, 0.5, 1.0, 2.0, 5.0, 10.0)]
    chosen = [_multiples(low, high, step) for step in steps if step <= 2.5 * raw]
    return next((found for found in reversed(chosen) if len(found) >= 3), chosen[0])


def _multiples(low: float, high: float, step: float) -> list[float]:
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [k * step for k in range(first, last + 1)]


def time_scale(time: FloatArray) -> tuple[float, float, str]:
    """(origin, seconds a unit, label) of a time axis: ms for records below two seconds.

    The origin is the first sample where the clock counts from far away, seconds since 1970 for instance.
    """
    span = float(time[-1] - time[0])
    far = abs(float(time[0])) > 100.0 * max(span, 1.0)
    unit, name = (1e-3, "ms") if span < 2.0 else (1.0, "s")
    return (float(time[0]) if far else 0.0), unit, f"time{' since the first sample' if far else ''}, {name}"
