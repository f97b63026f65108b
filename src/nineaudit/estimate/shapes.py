"""What each kind of fault adds to a reading, as a few columns with a wide prior (METHODS.md 3).

ŷ is what a perfect sensor would have read in the fitted motion. To first order in its size each fault is linear:

    gain, polarity, unit   δy = g ŷ                        prior sd 0.5
    zero_shift             δy = b from an instant on       0.3 of the peak
    drift                  δy = b (t − t0)/T               0.3 of the peak at the end
    delay                  δy = −s dŷ/dt                   1 ms
    cross_axis             δy = τ_1 u_1·a + τ_2 u_2·a      0.1 each
    position               δy = n·(α × e + ω × (ω × e))    10 mm each
    ac_coupled             δy = c (high-pass ŷ − ŷ)        1, first order, some time constants
    wrong_filter           δy = c (low-pass ŷ − ŷ)         1, some channel frequency classes
    unknown                δy = Σ c_j hat_j(t)             0.5 of the peak each
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.estimate import calibration
from nineaudit.estimate.model import Data
from nineaudit.estimate.trajectory import Fit
from nineaudit.physics import kinematics

GAIN_SD, SHIFT_PART, DELAY_SD, TILT_SD, POSITION_SD, HAT_PART = 0.5, 0.3, 1e-3, 0.1, 10e-3, 0.5
HATS, ONSETS = 24, 12
TIME_CONSTANTS: Final = (0.02, 0.06, 0.2)
"""s, of AC couplings that are looked for."""
LOW_PASSES: Final = (60.0, 180.0)
"""Channel frequency classes of a wrong filter that block means can still show."""


@dataclass(frozen=True, eq=False)
class Shape:
    """One kind of fault: the fault `word`, its `columns` (e,n) of one prior standard deviation, the `scale` (e,) of
    its parameters (amplitude times scale, SI), `choices`, how many alike were tried (Occam), and a `note`: the instant,
    time constant or class tried."""

    word: str
    columns: FloatArray
    scale: FloatArray
    choices: int = 1
    note: float | None = None


def following(fit: Fit, channel: int) -> list[Shape]:
    """Faults that follow the signal, about a fit that *used* the channel: there ŷ and the residual are uncorrelated.

    About a fit without it, the noise of ŷ would stand in the column and in the residual alike, and look like a fault.
    """
    data = fit.data
    truth, sensor, time = fit.ideal[:, channel], data.array.sensors[channel], data.time
    one = np.ones(1)
    found = [
        Shape("gain", GAIN_SD * truth[None], GAIN_SD * one),
        Shape("delay", -DELAY_SD * kinematics.differentiate(truth, time)[None], DELAY_SD * one),
    ]
    if sensor.kind == "accelerometer":
        alone = calibration.columns(data.array.select([channel]), truth[:, None], time, fit.motion)[:, 0]
        found.append(Shape("cross_axis", TILT_SD * alone[:, 2:4].T, np.full(2, TILT_SD)))
        found.append(Shape("position", POSITION_SD * alone[:, 4:7].T, np.full(3, POSITION_SD)))
    for constant in TIME_CONSTANTS:
        lost = _smoothed(truth, time, constant)
        found.append(Shape("ac_coupled", -lost[None], one, len(TIME_CONSTANTS), constant))
    for class_ in LOW_PASSES:
        constant = 1.0 / (2.0 * np.pi * class_ / 0.6)
        twice = _smoothed(_smoothed(truth, time, constant)[::-1], time, constant)[::-1]
        found.append(Shape("wrong_filter", (twice - truth)[None], one, len(LOW_PASSES), class_))
    return found


def additive(
    data: Data, channel: int, peak: float, onset: int, onsets: int = ONSETS, off: FloatArray | None = None
) -> list[Shape]:
    """Faults that do not know the signal: shift, drift, and any curve. `peak` the size of the channel's signal; `off`
    (n,) what it leaves of the others' prediction, which tells the likeliest instant of a shift."""
    time, size = data.time, SHIFT_PART * max(peak, 10.0 / float(data.weight[:, channel].max()))
    span, one = float(time[-1] - time[onset]), np.ones(1)
    found = [Shape("drift", size * _ramp(time, onset, span), size * one)]
    starts = np.linspace(onset, len(time) - 2, onsets).astype(int)
    if off is not None:
        starts = np.append(starts, _change(data.weight[:, channel] ** 2, off))
    for start in np.unique(starts):
        step = (np.arange(len(time)) >= start).astype(float)[None]
        found.append(Shape("zero_shift", size * step, size * one, onsets, float(time[start])))
    return found


def _change(weight: FloatArray, off: FloatArray) -> int:
    """First sample of the step that explains most of `off` (n,): the largest (Σ_{s≥t} w off)²/Σ_{s≥t} w."""
    after, total = np.cumsum((weight * off)[::-1])[::-1], np.cumsum(weight[::-1])[::-1]
    return int(np.argmax(np.where(total > 0, after**2 / np.where(total > 0, total, 1.0), 0.0)[:-2]))


def any_curve(data: Data, channel: int, peak: float, onset: int) -> Shape:
    """Hats over the event, each free."""
    size = HAT_PART * max(peak, 10.0 / float(data.weight[:, channel].max()))
    return Shape("unknown", size * hats(len(data.time), onset), np.full(HATS, size))


def hats(count: int, onset: int) -> FloatArray:
    """(24,n) overlapping triangles from the onset to the end: any curve that changes no faster."""
    centres = np.linspace(onset, count - 1, HATS)
    width = centres[1] - centres[0]
    return np.asarray(np.maximum(1.0 - np.abs(np.arange(count) - centres[:, None]) / width, 0.0))


def _ramp(time: FloatArray, onset: int, span: float) -> FloatArray:
    return np.asarray(np.clip((time - time[onset]) / max(span, 1e-12), 0.0, 1.0)[None])


def _smoothed(values: FloatArray, time: FloatArray, constant: float) -> FloatArray:
    """First-order low-pass of time constant `constant` s, from rest at the first value (exact for steps)."""
    from scipy.linalg.lapack import dtbtrs

    keep = float(np.exp(-np.median(np.diff(time)) / constant))
    drive = (1.0 - keep) * values
    drive[0] = values[0]
    lower = np.vstack([np.ones(len(values)), np.full(len(values), -keep)])
    out, _ = dtbtrs(lower, drive[:, None], uplo="L")
    return np.asarray(out[:, 0])
