"""Clocks of one recording against each other: rate, drift and skew, and how well the time of each channel is known.

Stamps are taken at their word. What they leave open is added to the timing uncertainty of the channel:

    jitter      s/√2 of the deviation s of its own intervals, and of the base's: a frame that waits for the bus is late
                on average by about as much as its lateness varies, and nobody knows by how much
    skew        d/√3 between two messages d apart in a burst of frames, of one rate or of a whole part of it: sampled
                together and sent one after the other, or sampled so? A rectangle from 0 to d about the value d (GUM
                4.3.7, F.2.4.5)
    a part      the stated or estimated uncertainty of its offset, where a recording has several files (parts.py)

Interpolation is no delay but an error of the value; it is stated as such.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, isfinite, nan, sqrt
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
_BLOCKS, _LEAST = 16, 32
_ALIKE: Final = 0.02  # of an interval: silences of a cycle that differ by less do not tell where a burst begins
_FOLLOWED: Final = 0.1  # of an interval: jitter up to which a skew is followed through whole intervals


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
    jitter = hypot(clock.jitter, base_clock.jitter) / np.sqrt(2.0)
    apart = _steady_skew(trace.time, base.time, other.interval, jitter) if p == 1 else nan
    moved = slip(trace.time, base.time, other.interval, jitter) if p == 1 else (nan, nan)
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
        slip=moved[0],
        u_slip=moved[1],
    )


def in_bursts(found: Mapping[int, Alignment], interval: float) -> dict[int, Alignment]:
    """The alignments of messages of one log with the base's rate, their skews counted within bursts of frames.

    Messages that were sampled together are sent one after the other: a burst begins behind the longest silence of the
    cycle. So the third of three messages 0.3 ms apart is 0.6 ms late, not 0.4 ms early, in a cycle of 1 ms.
    """
    steady = {i: a.skew % interval for i, a in found.items() if isfinite(a.skew)}
    at = np.sort([0.0, *steady.values()])
    silence = np.diff(np.r_[at[-1] - interval, at])
    nearest = np.max(silence) - silence < _ALIKE * interval
    if np.count_nonzero(nearest) > 1 or not steady:
        return dict(found)
    first = at[int(np.argmax(silence))]
    base = (0.0 - first) % interval
    skews = {i: (phase - first) % interval - base for i, phase in steady.items()}
    return {i: _sent_later(a, skews[i]) if i in skews else a for i, a in found.items()}


def _sent_later(a: Alignment, apart: float) -> Alignment:
    """The alignment with another skew between two messages of a log."""
    return replace(a, skew=apart, u_timing=sqrt(max(a.u_timing**2 + (apart**2 - a.skew**2) / 3.0, 0.0)))


def slip(time: FloatArray, base: FloatArray, interval: float, jitter: float) -> tuple[float, float]:
    """(largest change, its standard uncertainty) s of the skew of two clocks of one rate beside a steady drift.

    The skew is followed through whole intervals and taken as medians of up to _BLOCKS stretches; the change is the
    range of these about their straight line. A median of m values of deviation s has s √(π/2m), the difference of two
    √2 times that. NaN where stamps scatter too much to be followed, or a stretch would have less than _LEAST samples.
    """
    apart = _followed(time, base, interval, jitter)
    blocks = 0 if apart is None else min(_BLOCKS, apart.size // _LEAST)
    if apart is None or blocks < 3:
        return nan, nan
    parts = np.array_split(apart, blocks)
    at = np.arange(blocks, dtype=np.float64)
    middle = np.array([np.median(part) for part in parts])
    left = middle - np.polyval(np.polyfit(at, middle, 1), at)
    scatter = np.median([np.std(np.diff(part)) for part in parts]) / np.sqrt(2.0)
    u = scatter * np.sqrt(np.pi / min(part.size for part in parts))
    return float(np.ptp(left)), float(u)


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


def _followed(time: FloatArray, base: FloatArray, interval: float, jitter: float) -> FloatArray | None:
    """(m,) s skew() through whole intervals, so that half of one is not folded; None where stamps scatter too much."""
    return np.unwrap(skew(time, base), period=interval) if jitter <= _FOLLOWED * interval else None


def _steady_skew(time: FloatArray, base: FloatArray, interval: float, jitter: float) -> float:
    """Median skew, NaN where its ends differ by SLIDES of the base's interval or more."""
    followed = _followed(time, base, interval, jitter)
    found = skew(time, base) if followed is None else followed
    if found.size < 2:
        return nan
    part = max(found.size // 10, 1)
    moved = abs(float(np.median(found[-part:]) - np.median(found[:part])))
    return float(np.median(found)) if moved < SLIDES * interval else nan


def _steadiest(time: FloatArray, clock: Clock) -> FloatArray:
    """The stamps without those beyond its longest stretch: all where nothing is lost."""
    if not clock.lost:
        return time
    ends = np.r_[0, np.searchsorted(time, [start for start, _ in clock.gaps], side="right"), time.size]
    longest = int(np.argmax(np.diff(ends)))
    return time[ends[longest] : ends[longest + 1]]
