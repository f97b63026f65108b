"""A trace onto the stamps of another clock: band-limited between its samples, never across a gap.

Interpolating B-splines of degree 7 (Schoenberg 1946; Unser 1999, IEEE Signal Processing Magazine 16(6)) through the
samples of a run: valid samples whose steps are even. Runs end where a sample is missing, not valid, late or early; a
run knows nothing of what is outside it, so nothing rings across a gap. Its ends are continued by point reflection.
Between runs, and in runs too short, the line between two samples.

Of a sinusoid of f periods a sample, the spline gives at the part φ of an interval, with β the central B-spline,

    Σ_j β(φ − j) e^{2πi f j} / Σ_j β(j) e^{2πi f j}      instead of      e^{2πi f φ}.

Pass band: the error, rms over φ, is under 10⁻⁴ of the amplitude up to 0.23 of the sampling rate, under 1 % up to 0.35,
5 % at 0.4 (a line between two samples: 1 % at 0.053, 21 % at 0.25). It grows with unevenness, at 0.25 by eight for
steps that differ by a quarter. In the first interval of a run it is less than half that of a line.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from nineaudit.array import BoolArray, FloatArray
from nineaudit.readers.clocks.clock import reach
from nineaudit.recording import Clock, Trace

DEGREE: Final = 7
SHORTEST_RUN: Final = 8
"""Samples without which there is no spline of this degree."""
EVEN: Final = 0.25
"""Of an interval: a step that differs more ends a run."""
FASTER: Final = 1.05
"""Ratio of rates from which a channel is low-passed before it is put onto a slower clock."""
_REFLECTED: Final = 12  # samples beyond an end: the largest pole of the spline, 0.535, to the twelfth is 1/2000
_PASS, _STOP, _ATTENUATION = 0.4, 0.5, 60.0  # of the slower rate; dB
_PHASES: Final = 32
_ON_A_SAMPLE: Final = 1e-6  # of an interval
_SEGMENT: Final = 1024  # samples of a spectrum


def resample(time: FloatArray, trace: Trace, clock: Clock, rate: float) -> tuple[FloatArray, float]:
    """((n,) values at (n,) s, rms error of the interpolation) of a trace onto a clock of `rate` Hz.

    NaN where the samples on both sides are not within `reach(clock)` of each other, where one is not valid, and
    outside. On a sample's own stamp its value, unless the trace is more than FASTER than the clock: then what is
    above 0.4 to 0.5 of `rate` is taken away first. The error is that of the recorded spectrum (see expected_error).
    """
    values, errors = resample_columns(time, trace.time, trace.values[:, None], clock, rate)
    return values[:, 0], float(errors[0])


def resample_columns(
    time: FloatArray, stamps: FloatArray, columns: FloatArray, clock: Clock, rate: float
) -> tuple[FloatArray, FloatArray]:
    """((n,k) values, (k,) errors) as resample(), of channels of one message: `stamps` (m,) s, `columns` (m,k), the same
    samples of each valid."""
    interval, valid = 1.0 / clock.rate, np.isfinite(columns[:, 0])
    even = list(_runs(stamps, valid, interval))
    if clock.rate > FASTER * rate:
        columns = _low_passed(columns, even, rate / clock.rate)
    left, phase, values = _between(time, stamps, columns, reach(clock))
    seen = np.isfinite(values[:, 0])
    inner = seen & (phase > 0) & (phase < 1)
    splined = np.zeros(time.size, dtype=np.bool_)
    for run in even:
        here = inner & _within(left, run)
        values[here] = _spline(stamps[run], columns[run], interval, time[here])
        splined |= here & _within(left, slice(run.start + 1, run.stop - 1))
    errors = [expected_error(column, phase[seen], splined[seen]) for column in columns.T]
    return values, np.array(errors)


def expected_error(samples: FloatArray, phase: FloatArray, splined: BoolArray) -> float:
    """Root mean square error of values that are interpolated between `samples` (m,), from their own spectrum.

    `phase` (n,) 0..1: where between two samples each value was taken, `splined` (n,) within a run; others count as on
    the line between the two samples. √∫ S(f) E²(f) df, S the one-sided spectral density over the share f of the
    sampling rate (Welch), E² the squared_error averaged over the phases. What was above half the sampling rate before
    it was sampled is folded in and cannot be told: it is not in this error. Noise near the Nyquist frequency is.
    """
    share, density = _spectrum(samples)
    total = np.zeros_like(share)
    for degree, chosen in ((DEGREE, splined), (1, ~splined)):
        total += _mean_square(share, phase[chosen], degree) * np.count_nonzero(chosen)
    step = 0.5 / max(share.size - 1, 1)
    return float(np.sqrt(np.sum(density * total) * step / max(phase.size, 1)))


def squared_error(share: FloatArray, phase: FloatArray, degree: int = DEGREE) -> FloatArray:
    """(f,p) squared modulus of the error of e^{2πi f n} interpolated at n + φ: `share` (f,) of the sampling rate,
    `phase` (p,) of an interval, by splines of a `degree` (1: lines)."""
    from scipy.interpolate import BSpline

    half = (degree + 1) // 2
    central = BSpline.basis_element(np.arange(-half, half + 1), extrapolate=False)
    at = np.arange(-half, half + 1)
    turns = np.exp(2j * np.pi * share[:, None] * at)
    weights = np.nan_to_num(central(phase - at[:, None]))
    found = turns @ weights / (turns @ np.nan_to_num(central(at.astype(float))))[:, None]
    return np.asarray(np.abs(np.exp(2j * np.pi * share[:, None] * phase) - found) ** 2)


def _mean_square(share: FloatArray, phase: FloatArray, degree: int) -> FloatArray:
    """(f,) squared_error averaged over the phases that occur; none on a sample."""
    off = (phase > _ON_A_SAMPLE) & (phase < 1 - _ON_A_SAMPLE)
    if not off.any():
        return np.zeros_like(share)
    centres = (np.arange(_PHASES) + 0.5) / _PHASES
    counts = np.histogram(phase[off], bins=_PHASES, range=(0.0, 1.0))[0]
    return np.asarray(squared_error(share, centres, degree) @ counts / phase.size)


def _spectrum(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(share of the sampling rate, one-sided density) of samples; what is not valid bridged by lines."""
    from scipy.signal import welch

    valid = np.flatnonzero(np.isfinite(values))
    if valid.size < 2:
        return np.zeros(1), np.zeros(1)
    filled = np.interp(np.arange(values.size), valid, values[valid])
    share, density = welch(filled, nperseg=min(_SEGMENT, values.size), detrend="constant")
    return np.asarray(share), np.asarray(density)


def _runs(stamps: FloatArray, valid: BoolArray, interval: float) -> Iterator[slice]:
    """Stretches of SHORTEST_RUN and more valid samples whose steps are even."""
    even = np.abs(np.diff(stamps) - interval) <= EVEN * interval
    ends = np.flatnonzero(~(even & valid[1:] & valid[:-1]))
    for first, last in zip(np.r_[-1, ends] + 1, np.r_[ends, valid.size - 1], strict=True):
        if last - first + 1 >= SHORTEST_RUN:
            yield slice(int(first), int(last) + 1)


def _within(left: NDArray[np.intp], run: slice) -> BoolArray:
    return np.asarray((left >= run.start) & (left < run.stop - 1))


def _between(
    time: FloatArray, stamps: FloatArray, columns: FloatArray, furthest: float
) -> tuple[NDArray[np.intp], FloatArray, FloatArray]:
    """((n,) sample before, (n,) part of the interval after it, (n,k) values on the line between the two)."""
    right = np.clip(np.searchsorted(stamps, time), 1, stamps.size - 1)
    left = right - 1
    step = stamps[right] - stamps[left]
    phase = (time - stamps[left]) / step
    low, high = columns[left], columns[right]
    values = low + phase[:, None] * (high - low)
    values[(phase < 0) | (phase > 1) | (step > furthest)] = np.nan
    values[phase == 0], values[phase == 1] = low[phase == 0], high[phase == 1]
    return left, phase, values


def _spline(stamps: FloatArray, columns: FloatArray, interval: float, time: FloatArray) -> FloatArray:
    """(n,k) values of the splines through a run (m,k), at stamps within it."""
    from scipy.interpolate import make_interp_spline

    at = _reflected((stamps - stamps[0]) / interval, _REFLECTED)
    found = make_interp_spline(at, _reflected(columns, _REFLECTED), k=DEGREE)
    return np.asarray(found((time - stamps[0]) / interval), dtype=np.float64)


def _reflected(values: FloatArray, count: int) -> FloatArray:
    """Continued at both ends by point reflection: value and slope go on. Along the first axis."""
    beyond = [(count, count)] + [(0, 0)] * (values.ndim - 1)
    return np.asarray(np.pad(values, beyond, mode="reflect", reflect_type="odd"))


def _low_passed(columns: FloatArray, even: list[slice], ratio: float) -> FloatArray:
    """Without what a clock of `ratio` times their rate cannot hold: a linear-phase filter, run by run."""
    from scipy.signal import firwin, kaiserord, oaconvolve

    count, beta = kaiserord(_ATTENUATION, 2.0 * (_STOP - _PASS) * ratio)
    count += 1 - count % 2
    taps = firwin(count, (_PASS + _STOP) * ratio, window=("kaiser", beta))[:, None]
    values = columns.copy()
    for run in even:
        values[run] = oaconvolve(_reflected(columns[run], count // 2), taps, mode="valid", axes=0)
    return values
