"""The quiet interval before the event, and the noise in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import ConfigurationError
from nineaudit.units import counted

SHORTEST = 16
"""Fewest samples of a quiet interval: a mean to a quarter of the noise, a standard deviation to 18 %."""


@dataclass(frozen=True)
class Quiet:
    """Samples start..stop-1, from `t_start` to `t_end` (s); `stated` by the rig or found."""

    start: int
    stop: int
    t_start: float
    t_end: float
    stated: bool

    @property
    def samples(self) -> slice:
        return slice(self.start, self.stop)

    def __str__(self) -> str:
        how = "stated by the rig" if self.stated else "found"
        return f"{self.t_start:.4g} s to {self.t_end:.4g} s ({how})"


def find_quiet(
    time: FloatArray,
    readings: FloatArray,
    noise: FloatArray,
    stated: tuple[float, float] | None,
    anywhere: bool = True,
) -> Quiet | None:
    """The stated interval, or the quietest stretch of 2 % of the record (16 samples at least), `anywhere` or only where
    the record begins or ends: accelerometers that stay the same may be those of a body that turns steadily.

    `time` (n,) s, `readings` (n,k), `noise` (k,) stated noise or NaN. A stretch found counts as rest when each
    channel's scatter in it is under three times its stated noise, or, with none stated, under 2 % of its scatter
    over the whole record. Raises ConfigurationError when a stated interval holds fewer than 16 samples.
    """
    if stated is not None:
        start = int(np.searchsorted(time, stated[0], side="left"))
        stop = int(np.searchsorted(time, stated[1], side="right"))
        if stop - start < SHORTEST:
            raise ConfigurationError(
                f"the interval holds {counted(stop - start, 'sample')}",
                place="[recording] pre_trigger",
                found=list(stated),
                expected=f"at least {SHORTEST} samples between {time[0]:.6g} s and {time[-1]:.6g} s",
                advice=_longer(time, stop, stated[1]),
            )
        return Quiet(start, stop, float(time[start]), float(time[stop - 1]), stated=True)
    return _quietest(time, readings, noise, anywhere)


def _longer(time: FloatArray, stop: int, end: float) -> str:
    """What to state in place of an interval that ends at `end` s, behind sample `stop`, and is too short."""
    looked_for = "leave it out to have a quiet interval looked for"
    if stop < SHORTEST:
        return looked_for
    begin = time[stop - SHORTEST] - 0.5 * float(np.median(np.diff(time)))
    return f"if the body is at rest then, state [{begin:.4g}, {end:.4g}]; or {looked_for}"


def _quietest(time: FloatArray, readings: FloatArray, noise: FloatArray, anywhere: bool) -> Quiet | None:
    length = max(SHORTEST, readings.shape[0] // 50)
    if readings.shape[0] < 2 * length:
        return None
    alive = np.isfinite(readings).mean(axis=0) > 0.5
    if not alive.any():
        return None
    overall = np.nanstd(readings[:, alive], axis=0)
    allowed = np.where(np.isfinite(noise[alive]), 3.0 * noise[alive], 0.02 * overall)
    allowed = np.where(allowed > 0, allowed, np.inf)
    last = readings.shape[0] - length
    starts = np.arange(0, last + 1, max(1, length // 4)) if anywhere else np.array([0, last])
    scatter = _windowed_sd(np.nan_to_num(readings[:, alive] - np.nanmean(readings[:, alive], axis=0)), starts, length)
    # the median channel chooses, so that one noisy channel cannot hide the rest of the array's rest
    badness = np.median(scatter / allowed, axis=1)
    best = int(np.argmin(badness))
    if not badness[best] < 1.0 or np.mean(scatter[best] < allowed) < 0.75:
        return None
    start = int(starts[best])
    stop = start + length
    return Quiet(start, stop, float(time[start]), float(time[stop - 1]), stated=False)


def quiet_end(time: FloatArray, readings: FloatArray, sigma: FloatArray) -> Quiet | None:
    """The last 2 % of the record if it is quiet: median channel scatter under three times its noise, else None."""
    start = len(time) - max(SHORTEST, len(time) // 50)
    if start < SHORTEST:
        return None
    tail = slice(start, len(time))
    ratio = noise_level(readings, tail) / sigma
    if np.median(ratio) > 3.0 or np.mean(ratio < 3.0) < 0.75:
        return None
    return Quiet(start, len(time), float(time[start]), float(time[-1]), stated=False)


def _windowed_sd(values: FloatArray, starts: np.ndarray, length: int) -> FloatArray:
    """Standard deviation (m,k) of the stretches of `length` samples from `starts`, by cumulative sums."""
    first = np.vstack([np.zeros(values.shape[1]), np.cumsum(values, axis=0)])
    second = np.vstack([np.zeros(values.shape[1]), np.cumsum(values**2, axis=0)])
    mean = (first[starts + length] - first[starts]) / length
    return np.asarray(np.sqrt(np.maximum((second[starts + length] - second[starts]) / length - mean**2, 0.0)))


def noise_level(readings: FloatArray, samples: slice | None) -> FloatArray:
    """(k,) noise standard deviation of `readings` (n,k): in the quiet `samples`, else from second differences.

    The second difference of white noise has variance 6σ²; its median absolute value over 0.6745√6 is a robust σ
    that a smooth motion hardly raises.
    """
    if samples is not None:
        window = readings[samples]
        count = np.isfinite(window).sum(axis=0)
        centred = window - np.nansum(window, axis=0) / np.maximum(count, 1)
        return np.asarray(np.sqrt(np.nansum(centred**2, axis=0) / np.maximum(count - 1, 1)))
    second = np.abs(np.diff(readings, n=2, axis=0))
    out = np.zeros(readings.shape[1])
    for k in range(readings.shape[1]):
        finite = second[np.isfinite(second[:, k]), k]
        out[k] = np.median(finite) / (0.6745 * np.sqrt(6.0)) if finite.size else 0.0
    return out
