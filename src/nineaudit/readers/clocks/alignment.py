"""Clocks of one recording against each other: rate, drift and skew, and how well the time of each channel is known.

Stamps are taken at their word. What they leave open is added to the timing uncertainty of the channel:

    jitter      s/√2 of the deviation s of its own intervals, and of the base's: a frame that waits for the bus is late
                on average by about as much as its lateness varies, and nobody knows by how much
    skew        d/√3 between two messages of one rate, d apart: sampled together and sent one after the other, or
                sampled so? A rectangle from 0 to d about the value d (GUM 4.3.7, F.2.4.5)
    a part      the stated or estimated uncertainty of its offset, where a recording has several files (parts.py)

Interpolation is no delay but an error of the value; it is stated as such.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, isfinite, nan
from typing import TYPE_CHECKING, Final

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.recording import Alignment, Clock, Trace

if TYPE_CHECKING:
    from nineaudit.rig import Rig

NOMINAL: Final = 0.01
"""Of a ratio of rates: what clocks of a nominal ratio may differ from it (crystals less, RC oscillators more)."""
SLIDES: Final = 0.25
"""Of an interval: where the time between two clocks' samples changes by more, there is no skew between them."""


@dataclass(frozen=True)
class Pace:
    """Sampling interval, s, of the longest stretch without a gap, and its standard uncertainty."""

    interval: float
    u: float


def pace(time: FloatArray, clock: Clock) -> Pace:
    """The interval by least squares through the stamps (n,) s of the longest stretch without a gap.

    Its uncertainty: that of a slope, 12 s²/n³, for errors of deviation s of the single stamps; 6/5 q²/n for an interval
    that wanders by q from one to the next, where residuals n/8 apart differ by more than neighbours do (three of its
    standard deviations); and resolution/√6 over n − 1 for stamps that are rounded.
    """
    stamps = _steadiest(time, clock)
    n = stamps.size
    count = np.arange(n) - (n - 1) / 2
    interval = float(count @ stamps / np.sum(count**2))
    residual = stamps - stamps.mean() - interval * count
    apart = max(n // 8, 2)
    near, far = _mean_square_step(residual, 1), _mean_square_step(residual, apart)
    wander = (far - near) / (apart - 1) if far - near > 3.0 * near * np.sqrt(3.0 / n) else 0.0
    rounding = (_resolution(stamps, interval) / (n - 1)) ** 2 / 6.0
    return Pace(interval, float(np.sqrt(6.0 * near / n**3 + 1.2 * wander / n + rounding)))


def _mean_square_step(residual: FloatArray, apart: int) -> float:
    steps = residual[apart:] - residual[:-apart]
    return float(np.mean(steps**2)) if steps.size else 0.0


def _resolution(time: FloatArray, interval: float) -> float:
    """The coarsest decimal, s, up to a tenth of the interval, of which all stamps are multiples; 1 ns where none is."""
    for places in range(int(np.ceil(-np.log10(0.1 * interval))), 9):
        counts = time * 10.0**places
        if np.all(np.abs(counts - np.rint(counts)) < 1e-3):
            return float(10.0**-places)
    return 1e-9


def nominal_ratio(ratio: float) -> tuple[int, int]:
    """The simplest p/q within NOMINAL of a ratio of rates."""
    q = 1
    while round(ratio * q) == 0 or abs(round(ratio * q) / (ratio * q) - 1.0) > NOMINAL:
        q += 1
    return round(ratio * q), q


def skew(time: FloatArray, base: FloatArray) -> FloatArray:
    """(m,) s by which each stamp is later than the nearest of the base's, for those within the base's time."""
    inside = time[(time >= base[0]) & (time <= base[-1])]
    right = np.clip(np.searchsorted(base, inside), 1, base.size - 1)
    before, after = inside - base[right - 1], inside - base[right]
    return np.asarray(np.where(before <= -after, before, after))


def align(
    trace: Trace, clock: Clock, base: Trace, base_clock: Clock, u_value: float, u_part: float | None
) -> Alignment:
    """How `trace` lies against the `base`. `u_part` s: of the offset of its part; None where both are messages of one
    log, whose skew may be that of sending."""
    own, other = pace(trace.time, clock), pace(base.time, base_clock)
    p, q = nominal_ratio(other.interval / own.interval)
    drift = other.interval / own.interval * q / p - 1.0
    apart = _steady_skew(trace.time, base.time, clock) if (p, q) == (1, 1) else nan
    jitter = hypot(clock.jitter, base_clock.jitter) / np.sqrt(2.0)
    sent = abs(apart) / np.sqrt(3.0) if u_part is None and isfinite(apart) else 0.0
    return Alignment(
        channel=trace.channel,
        rate=1.0 / own.interval,
        ratio=(p, q),
        drift=drift,
        u_drift=hypot(own.u / own.interval, other.u / other.interval),
        skew=apart,
        u_timing=hypot(jitter, sent, u_part or 0.0),
        u_value=u_value,
    )


def with_timing(rig: Rig, alignments: Sequence[Alignment]) -> Rig:
    """The rig with u_timing of the alignments added to the sensors', root sum of squares."""
    if not alignments:
        return rig
    added: Mapping[str, float] = {a.channel: a.u_timing for a in alignments}
    sensors = (replace(s, u_timing=hypot(s.u_timing, added.get(s.channel, 0.0))) for s in rig.array.sensors)
    return replace(rig, array=SensorArray(tuple(sensors)))


def notes(alignments: Sequence[Alignment], base: str, base_rate: float, units: Mapping[str, str]) -> tuple[str, ...]:
    """What was done, in words: one note for all channels of one clock. `units` SI of each channel."""
    alike: dict[tuple[object, ...], list[Alignment]] = {}
    for a in alignments:
        alike.setdefault((a.rate, a.drift, a.skew, a.u_timing), []).append(a)
    return tuple(_note(found, base, base_rate, units) for found in alike.values())


def _note(found: Sequence[Alignment], base: str, base_rate: float, units: Mapping[str, str]) -> str:
    first = found[0]
    names = ", ".join(a.channel for a in found)
    drift = f"{1e6 * first.drift:+.3g} ± {1e6 * first.u_drift:.2g} ppm off {first.ratio[0]}:{first.ratio[1]}"
    apart = f", stamped {1e3 * first.skew:.4g} ms after" if isfinite(first.skew) else ""
    errors = ", ".join(f"{a.u_value:.2g} {units[a.channel]}" for a in found)
    return (
        f"{names}: {first.rate:.6g} Hz brought to the {base_rate:.6g} Hz of {base} ({drift}{apart}); "
        f"time known to ±{1e6 * first.u_timing:.3g} µs besides timing_s, interpolation error {errors} rms"
    )


def _steady_skew(time: FloatArray, base: FloatArray, clock: Clock) -> float:
    """Median skew, NaN where its ends differ by SLIDES of an interval or more."""
    found = skew(time, base)
    if found.size < 2:
        return nan
    part = max(found.size // 10, 1)
    moved = abs(float(np.median(found[-part:]) - np.median(found[:part])))
    return float(np.median(found)) if moved < SLIDES / clock.rate else nan


def _steadiest(time: FloatArray, clock: Clock) -> FloatArray:
    """The stamps without those beyond its longest stretch: all where nothing is lost."""
    if not clock.lost:
        return time
    ends = np.r_[0, np.searchsorted(time, [start for start, _ in clock.gaps], side="right"), time.size]
    longest = int(np.argmax(np.diff(ends)))
    return time[ends[longest] : ends[longest + 1]]
