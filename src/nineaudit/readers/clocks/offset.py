"""The time between two clocks without a common zero, from what two sensors of the same kind on one body have in common.

    y_j(t + τ) = c_j + Σ_i G_ji x_i(t) + e_j(t)

y are the readings on the clock that is sought, x those of the first part, G any mixing (axes and mountings need not be
alike), on a common grid as fine as the slower clock. First the τ of greatest explained variance to a step, by Fourier
transform (Knapp and Carter 1976, without weighting); then Gauss–Newton, δτ = Σ s e / Σ s², s = dy/dt less what x
explains of it. Its standard uncertainty is √Σ_b (Σ_b s e)² / Σ s² with the products summed over blocks b of equal Σ s²,
so that errors e which are alike from sample to sample, as those of a lever arm are, do not count as many.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import RecordingError
from nineaudit.recording import Trace

LEAST_EXPLAINED: Final = 0.5
"""Of the variance: two sensors that share less are no clock."""
RIVAL: Final = 0.8
"""Of the best explained variance: another offset that explains more makes it ambiguous."""
_WIDTHS: Final = (2.0, 3.0, 4.0)  # steps: Gaussian means against noise; what they differ by is uncertainty
_MOST: Final = 2**18  # samples of the common grid
_BROAD: Final = 0.25  # of all offsets: a peak that is wider is none
_RANK: Final = 1e-6
_STEPS: Final = 20
_BLOCKS: Final = 8
_WIDTH: Final = 0.5  # of the best explained variance, at which its peak ends


@dataclass(frozen=True)
class Offset:
    """Seconds to add to a part's stamps, their standard uncertainty, and the part of the variance that the first part
    explains (None where the offset was not found but stated)."""

    value: float
    u: float
    explained: float | None


@dataclass(frozen=True, eq=False)
class _Signals:
    """Traces on even stamps `time` (n,) s: `values` (n,k), each with its mean off and of unit variance."""

    time: FloatArray
    values: FloatArray


def find_offset(first: Sequence[Trace], other: Sequence[Trace], path: Path) -> Offset:
    """What to add to the stamps of `other` so that they are on the clock of `first`.

    Raises RecordingError (`path` is the other's file): no sensors of one kind, nothing in common, two offsets as good.
    """
    if not first or not other:
        advice = "state offset_s in the rig file, or align by stamps"
        raise RecordingError("no sensor of a kind that the first part has: no offset to find", file=path, advice=advice)
    step = max(*(_interval(t) for t in (*first, *other)), max(map(_span, (*first, *other))) / _MOST)
    x, y = _even(first, step), _even(other, step)
    lag, explained = _coarse(x, y, step, path)
    found = [_refined(_white(x, width), _white(y, width), lag) for width in _WIDTHS]
    value, u = min(found, key=lambda one: one[1])
    return Offset(value, float(np.hypot(u, np.std([other for other, _ in found]))), explained)


def _interval(trace: Trace) -> float:
    return float(np.median(np.diff(trace.time)))


def _span(trace: Trace) -> float:
    return float(trace.time.max() - trace.time.min())


def _even(traces: Sequence[Trace], step: float) -> _Signals:
    """Means over `step`, where there are several samples in one; lines between samples elsewhere."""
    start, end = min(float(t.time.min()) for t in traces), max(float(t.time.max()) for t in traces)
    time = np.asarray(start + step * np.arange(int((end - start) / step) + 1), dtype=np.float64)
    columns = [_binned(trace, time, step) for trace in traces]
    values = np.asarray(np.stack(columns, axis=1) - np.mean(columns, axis=1), dtype=np.float64)
    spread = values.std(axis=0)
    return _Signals(time, values[:, spread > 0] / spread[spread > 0])


def _binned(trace: Trace, time: FloatArray, step: float) -> FloatArray:
    good = np.isfinite(trace.values)
    if not good.any():
        return np.zeros(time.size)
    at = np.rint((trace.time[good] - time[0]) / step).astype(np.intp).clip(0, time.size - 1)
    count = np.bincount(at, minlength=time.size)
    # The mean of the stamps as well as of the values: a bin holds its samples unevenly.
    total, centre = (np.bincount(at, w, minlength=time.size) for w in (trace.values[good], trace.time[good]))
    held = count > 0
    return np.asarray(np.interp(time, centre[held] / count[held], total[held] / count[held]))


def _coarse(x: _Signals, y: _Signals, step: float, path: Path) -> tuple[float, float]:
    """(seconds to add to y's stamps to a step, part of y's variance that x explains there)."""
    n, m = len(x.values), len(y.values)
    size = 1 << (n + m - 1).bit_length()
    across = np.fft.rfft(x.values, size, axis=0).conj()[:, :, None] * np.fft.rfft(y.values, size, axis=0)[:, None, :]
    crossed = np.roll(np.fft.irfft(across, size, axis=0), n - 1, axis=0)[: n + m - 1]  # lags -(n-1) … m-1
    inverse = np.linalg.pinv(x.values.T @ x.values, rcond=1e-6)
    explained = np.einsum("lij,ik,lkj->l", crossed, inverse, crossed) / max(m * y.values.shape[1], 1)
    best = int(np.argmax(explained))
    peak = float(explained[best])
    if not peak > LEAST_EXPLAINED:
        raise RecordingError(
            f"its readings explain {peak:.0%} of the first part's motion at best: no offset to find",
            file=path,
            expected=f"{LEAST_EXPLAINED:.0%} or more",
            advice="state offset_s in the rig file, or align by stamps",
        )
    _require_one(explained, best, step, path)
    return float(x.time[0] - y.time[0] - (best - (n - 1)) * step), peak


def _require_one(explained: FloatArray, best: int, step: float, path: Path) -> None:
    """No other offset may explain as much (what a periodic motion does), nor all of them (what a steady turn does)."""
    low = np.flatnonzero(explained < _WIDTH * explained[best])
    first = int(low[low < best].max(initial=0))
    last = int(low[low > best].min(initial=explained.size))
    beyond = explained.copy()
    beyond[first : last + 1] = 0.0
    rival = int(np.argmax(beyond))
    what = ""
    if beyond[rival] > RIVAL * explained[best]:
        what = f"two offsets are as good, {abs(rival - best) * step:.4g} s apart: the motion repeats itself"
    elif last - first > _BROAD * explained.size:
        what = f"all offsets within {(last - first) * step:.4g} s are as good: the motion tells no time"
    if what:
        raise RecordingError(what, file=path, advice="state offset_s in the rig file")


def _white(signals: _Signals, width: float) -> _Signals:
    """Smoothed by `width` steps, and mixed so that all are of unit variance and none correlates with another: noise in
    x, too, then moves the best offset to neither side (canonical correlation, Hotelling 1936)."""
    from scipy.ndimage import gaussian_filter1d

    smooth = gaussian_filter1d(signals.values, width, axis=0)
    mixed, size, _ = np.linalg.svd(smooth - smooth.mean(axis=0), full_matrices=False)
    return _Signals(signals.time, np.asarray(mixed[:, size > _RANK * size[0]] * np.sqrt(len(smooth))))


def _refined(x: _Signals, y: _Signals, lag: float) -> tuple[float, float]:
    """(offset, its standard uncertainty) s by Gauss–Newton from `lag`, on the samples that both have."""
    from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(y.time, y.values, k=3)
    slope = spline.derivative()
    u = float("nan")
    for _ in range(_STEPS):
        inside = (x.time - lag >= y.time[0]) & (x.time - lag <= y.time[-1])
        at, design = x.time[inside] - lag, np.column_stack([x.values[inside], np.ones(inside.sum())])
        off = _beside(design, spline(at))
        steep = _beside(design, slope(at))
        move = float(np.sum(off * steep) / np.sum(steep**2))
        lag, u = lag + move, _u_of_move(off - move * steep, steep)
        if abs(move) < 0.01 * u:
            break
    return lag, u


def _u_of_move(off: FloatArray, steep: FloatArray) -> float:
    power = np.cumsum(np.sum(steep**2, axis=1))
    ends = np.searchsorted(power, power[-1] * np.arange(1, _BLOCKS) / _BLOCKS)
    sums = [float(np.sum(part)) for part in np.split(np.sum(off * steep, axis=1), ends)]
    return float(np.linalg.norm(sums) / power[-1] * np.sqrt(_BLOCKS / (_BLOCKS - 3)))


def _beside(design: FloatArray, values: FloatArray) -> FloatArray:
    """What the columns of `design` do not explain of `values` (n,k)."""
    return np.asarray(values - design @ np.linalg.lstsq(design, values, rcond=None)[0])
