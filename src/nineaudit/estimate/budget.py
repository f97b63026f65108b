"""Error-propagation budget of an output, by source (METHODS 5; root sum of squares, GUM 5.1.2; Martin98 eq 22).

An estimator about a motion gives each output a coefficient c for every reading. Sources, each a row:

    gain, zero, alignment, position, timing    calibration errors of one standard deviation        calibration.py
    noise           √Σ c²σ²
    quantisation    √Σ c²(step/√12)²/m for means of m samples, each rounded by itself              [GUM F.2.2.1]
    filters         |Σ c δy|, δy what a class other than that of most channels does                mismatch.py
    integration     what the finite step does, from steps twice as long or the curve in a block

The last two are known in sign but not put right, and count as their size (GUM F.2.4.5). The measurand of a peak is the
length of the vector where it is longest, so that its derivative is the direction there (GUM 5.1.3): errors across it do
not count. One function, `rows`, is behind `nineaudit budget` and rule UB401.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.errors import EstimationError
from nineaudit.estimate import calibration, mismatch
from nineaudit.estimate.at_their_word import perfect
from nineaudit.estimate.evidence import resolution
from nineaudit.estimate.mismatch import Class
from nineaudit.estimate.motion import Motion
from nineaudit.estimate.outputs import Gradient, peak_alpha
from nineaudit.recording import Recording

BEYOND = ("quantisation", "filters", "integration")
ROWS = (*calibration.SOURCES, "noise", *BEYOND)
"""Every row of a budget."""
DRAWN = (*calibration.SOURCES, "noise", "quantisation")
"""The rows that differ from draw to draw of an instrument."""

Rows = dict[str, float]
ByChannel = dict[str, FloatArray]
"""Source -> (k,) standard uncertainty that each channel brings by it."""


class Way(Protocol):
    """An estimator about a motion: at_their_word.Word or functional.Smoothed."""

    @property
    def motion(self) -> Motion:
        """ω, α and a0 at the samples."""

    def coefficients(self, gradient: Gradient) -> FloatArray:
        """(n,k) what one unit of each reading adds to an output with this gradient."""

    def by_channel(self, by_reading: FloatArray, gradient: Gradient) -> ByChannel:
        """Standard uncertainty by calibration and noise of each channel, from the coefficients of its readings."""

    def step_error(self, gradient: Gradient) -> float:
        """What the finite step does to it, absolute."""


@dataclass(frozen=True, eq=False)
class Beyond:
    """Errors of readings besides calibration and noise, SI: `rounding` (k,) of a block mean, standard deviation,
    `counted` (k,) where the noise holds it already, and `mismatch` (n,k) what other filters do. `step` (k,) by which
    readings are quantised, 0: not; `classes` (k,) filter class of each channel."""

    rounding: FloatArray
    counted: BoolArray
    mismatch: FloatArray
    step: FloatArray
    classes: tuple[Class, ...]


def beyond(
    recording: Recording,
    motion: Motion,
    time: FloatArray,
    length: int,
    rest: FloatArray | None,
    simulated: bool = False,
) -> Beyond:
    """What is beyond calibration and noise in a recording: `motion` of its blocks at `time` (n,) s of `length` samples,
    `rest` the readings (m,k) of the quiet interval, zeroed, None where there is none. Of a recording `simulated` for a
    budget only the step that the rig states counts."""
    array = recording.rig.array
    step = np.nan_to_num(array.values("resolution")) if simulated else steps(recording)
    one = step / np.sqrt(12.0)
    seen: tuple[Class, ...] = (recording.rig.cfc,) * len(array)
    if rest is not None:
        seen = mismatch.classes(rest, recording.rate, recording.rig.cfc, one)
    y = perfect(array, motion)
    changed = mismatch.change(y, time, recording.rate, seen)
    measured = np.array([s.noise is None for s in array.sensors])
    return Beyond(one / np.sqrt(length), measured, changed, step, seen)


def steps(recording: Recording) -> FloatArray:
    """(k,) quantisation step of every channel, SI: the rig's, else the recording's; 0 where it is not quantised."""
    traces = {trace.channel: trace for trace in recording.native}
    stated = recording.rig.array.values("resolution")
    found = [resolution(traces[name].values) for name in recording.channels]
    return np.where(np.isfinite(stated), stated, found)


def by_channel(way: Way, gradient: Gradient, errors: Beyond) -> ByChannel:
    """What each channel brings to the standard uncertainty of an output with this gradient, by source; the squares of a
    source add up to that of its row. What filters and the finite step do is of the array as a whole."""
    return _parts(way, gradient, errors, way.coefficients(gradient))


def _parts(way: Way, gradient: Gradient, errors: Beyond, by_reading: FloatArray) -> ByChannel:
    known = way.by_channel(by_reading, gradient)
    rounded = np.linalg.norm(by_reading, axis=0) * errors.rounding
    left = known["noise"] ** 2 - np.where(errors.counted, rounded**2, 0.0)
    return known | {"noise": _rest(left), "quantisation": rounded}


def _rest(squares: FloatArray) -> FloatArray:
    """Roots of what is left of each, none below 0, that together are as large as what is left of all of them."""
    kept, whole = np.maximum(squares, 0.0), max(float(squares.sum()), 0.0)
    return np.asarray(np.sqrt(kept * (whole / kept.sum() if kept.any() else 0.0)))


def rows(way: Way, gradient: Gradient, errors: Beyond) -> Rows:
    """Standard uncertainty of an output with this gradient, by ROWS."""
    return _both(way, gradient, errors)[0]


def _both(way: Way, gradient: Gradient, errors: Beyond) -> tuple[Rows, ByChannel]:
    """The rows, and what each channel brings to them."""
    by_reading = way.coefficients(gradient)
    parts = _parts(way, gradient, errors, by_reading)
    found = {source: float(np.linalg.norm(u)) for source, u in parts.items()}
    filters = abs(float((by_reading * errors.mismatch).sum()))
    return found | {"filters": filters, "integration": way.step_error(gradient)}, parts


def total(found: Rows) -> float:
    """Root of the summed squares of a budget's rows."""
    return float(np.sqrt(sum(value**2 for value in found.values())))


@dataclass(frozen=True, eq=False)
class AlphaBudget:
    """Standard uncertainty of the peak of α, rad/s²: the `peak` |α|, its sample `row`, `rows` by source along the
    direction of the peak, `total` of them all, and `parts`: what each channel brings to each source."""

    peak: float
    row: int
    rows: Rows
    total: float
    parts: ByChannel = field(default_factory=dict)


def alpha_budget(way: Way, time: FloatArray, errors: Beyond) -> AlphaBudget:
    """Budget of the largest |α| of the motion that `way` is about, at `time` (n,) s. EstimationError where it is not
    finite."""
    size = np.linalg.norm(way.motion.alpha, axis=1)
    found, parts = _both(way, peak_alpha().gradient(way.motion, time), errors)
    if not np.isfinite(total(found)):
        raise EstimationError("the budget of α is not finite; a position, axis or reading is missing")
    row = int(np.argmax(size))
    return AlphaBudget(float(size[row]), row, found, total(found), parts)
