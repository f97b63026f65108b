"""Objective rating of one curve against a reference [ISO/TS 18571], 0 to 1, weights 0.4, 0.2, 0.2, 0.2.

    corridor    mean of c(|d|/max|T|): 1 below 0.05, 0 above 0.5, ((0.5 − x)/0.45)² between
    phase       (0.2 N − n)/0.2 N, n the shift (samples) of largest cross-correlation, of at most 0.2 N
    magnitude   (0.5 − E)/0.5, E = ‖C − T‖₁/‖T‖₁ of the shifted curves after dynamic time warping within 0.1 N
    slope       (2 − E)/2, E = ‖C′ − T′‖₁/‖T′‖₁ of the shifted curves' slopes, nine-point means

The public library objective-rating-metrics gives the same numbers (tests/test_comparison.py); it is not a dependency,
for it brings a plotting stack. The standard samples at 10 kHz; at other rates the nine points are another time.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.errors import EstimationError

WEIGHTS: Final = (0.4, 0.2, 0.2, 0.2)
"""Of corridor, phase, magnitude and slope (METHODS 6)."""
INNER, OUTER, SHIFT, WARP, MAGNITUDE, SLOPE = 0.05, 0.5, 0.2, 0.1, 0.5, 2.0
GRADES: Final = ((0.94, "excellent"), (0.80, "good"), (0.58, "fair"), (-1.0, "poor"))
_MEAN = 9


class Rating(NamedTuple):
    """Scores 0 to 1, and `overall`, weighted."""

    corridor: float
    phase: float
    magnitude: float
    slope: float
    overall: float

    @property
    def grade(self) -> str:
        """excellent, good, fair or poor."""
        return next(word for least, word in GRADES if self.overall > least)


def rate(curve: FloatArray, reference: FloatArray) -> Rating:
    """Rating of `curve` (n,) against `reference` (n,), same unit, same even time base.

    EstimationError unless both are finite, of one length of 20 samples or more, and not constant.
    """
    short = curve.shape != reference.shape or curve.ndim != 1 or curve.size < 20
    if short or not (np.isfinite(curve).all() and np.isfinite(reference).all()):
        raise EstimationError(
            "curves cannot be rated", found=(curve.shape, reference.shape), expected="20 finite samples or more, alike"
        )
    if not (np.ptp(reference) > 0.0 and np.ptp(curve) > 0.0):
        raise EstimationError("a constant curve cannot be rated")
    shift = _best_shift(curve, reference)
    lost = abs(shift)
    early, late = slice(0, len(curve) - lost), slice(lost, len(curve))
    shifted, against = (curve[late], reference[early]) if shift > 0 else (curve[early], reference[late])
    scores = (
        _corridor(curve, reference),
        max(0.0, 1.0 - lost / (SHIFT * len(curve))),
        _magnitude(shifted, against),
        _falling(_smooth(np.gradient(shifted)), _smooth(np.gradient(against)), SLOPE),
    )
    return Rating(*scores, float(np.dot(WEIGHTS, scores)))


def _corridor(curve: FloatArray, reference: FloatArray) -> float:
    off = np.abs(curve - reference) / np.abs(reference).max()
    return float((np.clip((OUTER - off) / (OUTER - INNER), 0.0, 1.0) ** 2).mean())


def _best_shift(curve: FloatArray, reference: FloatArray) -> int:
    """Samples by which `curve` comes late, within SHIFT of the record; the smallest of equals."""
    best, found = _correlation(curve, reference), 0
    for n in range(1, int(SHIFT * len(curve)) + 1):
        for shift, r in ((n, _correlation(curve[n:], reference[:-n])), (-n, _correlation(curve[:-n], reference[n:]))):
            if r > best:
                best, found = r, shift
    return found


def _correlation(first: FloatArray, second: FloatArray) -> float:
    x, y = first - first.mean(), second - second.mean()
    size = math.sqrt(float(x @ x) * float(y @ y))
    return float(x @ y) / size if size > 0.0 else -1.0


def _magnitude(curve: FloatArray, reference: FloatArray) -> float:
    i, j = warping_path(curve, reference, math.ceil(WARP * len(curve)) - 1)
    return _falling(curve[i], reference[j], MAGNITUDE)


def _falling(curve: FloatArray, reference: FloatArray, zero: float) -> float:
    """1 at no difference, 0 where the mean difference is `zero` times the mean of the reference."""
    size = float(np.abs(reference).sum())
    return max(0.0, 1.0 - float(np.abs(curve - reference).sum()) / size / zero) if size > 0.0 else 0.0


def _smooth(values: FloatArray) -> FloatArray:
    """Means over nine points, over fewer and still centred at the ends."""
    half = np.minimum(np.minimum(np.arange(len(values)), np.arange(len(values))[::-1]), _MEAN // 2)
    total = np.concatenate([[0.0], np.cumsum(values)])
    at = np.arange(len(values))
    return np.asarray((total[at + half + 1] - total[at - half]) / (2 * half + 1))


def warping_path(first: FloatArray, second: FloatArray, width: int) -> tuple[IntArray, IntArray]:
    """Indices of both curves (n,) along the path of least summed squared difference, |i − j| ≤ `width`
    [Sakoe and Chiba 1978]; steps (1,0), (0,1), (1,1) of equal weight, by anti-diagonals."""
    n = len(first)
    before, last = np.full(n + 1, np.inf), np.full(n + 1, np.inf)  # by i + 1, of the two diagonals before
    came: list[tuple[int, IntArray]] = []
    for d in range(2 * n - 1):
        low = max(0, d - n + 1, -((width - d) // 2))
        high = min(d, n - 1, (d + width) // 2)
        rows = np.arange(low, high + 1)
        options = np.stack([last[rows], last[rows + 1], before[rows]])
        best = np.argmin(options, axis=0)
        here = np.full(n + 1, np.inf)
        here[rows + 1] = (first[rows] - second[d - rows]) ** 2 + (options[best, rows - low] if d else 0.0)
        came.append((low, best))
        before, last = last, here
    i, j = n - 1, n - 1
    path = [(i, j)]
    while i or j:
        low, steps = came[i + j]
        step = int(steps[i - low])
        i, j = i - (step != 1), j - (step != 0)
        path.append((i, j))
    along = np.array(path[::-1], dtype=np.intp)
    return along[:, 0], along[:, 1]
