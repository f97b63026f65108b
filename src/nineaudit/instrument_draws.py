"""Readings as other instruments of the rig's uncertainties would have given them (JCGM 101).

Every draw changes each channel by its calibration errors, one standard deviation of each as the rig states it
(calibration.py, matrix D of METHODS 2), and by noise:

    y' = y + D z + σ e,    z ~ N(0, 1),    e as white noise comes out of the stated filter class, of deviation 1

Noise behind a class has its power below the corner: white noise of the same deviation would have too little of it in
the band of the motion, by √(corner / half the sampling rate).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.estimate import calibration
from nineaudit.estimate.condense import block_means
from nineaudit.estimate.motion import Motion, bridge
from nineaudit.physics import filters


def readings_drawn(case: Case, motion: Motion, count: int, rng: np.random.Generator) -> Iterator[FloatArray]:
    """`count` times readings (n,k) SI as recorded, zero not taken off, changed; `motion` of the body at the samples."""
    live = case.valid.any(axis=0)
    array = case.array.select(np.flatnonzero(live).tolist())
    columns = calibration.all_columns(array, bridge(case.readings[:, live], case.time), case.time, motion)
    for _ in range(count):
        changed = np.array(case.recording.readings)
        changed[:, live] += errors(columns, rng) + (noise(case, rng) * case.sigma)[:, live]
        yield changed


def errors(columns: FloatArray, rng: np.random.Generator) -> FloatArray:
    """(n,k) calibration errors drawn, `columns` (k,n,8) of one standard deviation."""
    z = rng.standard_normal((columns.shape[0], columns.shape[2]))
    return np.asarray(np.matmul(columns, z[:, :, None])[:, :, 0].T)


def noise(case: Case, rng: np.random.Generator) -> FloatArray:
    """(n,k) noise of standard deviation 1 at the samples, behind the class that the rig states."""
    count, rate, class_ = len(case.time), case.recording.rate, case.recording.rig.cfc
    if class_ is None or not filters.fast_enough(rate, class_):
        return rng.standard_normal((count, len(case.array)))
    pad = math.ceil(2.0 * rate / class_)  # by then the impulse response has fallen to e^-18
    impulse = np.zeros(2 * pad + 1)
    impulse[pad] = 1.0
    left = math.sqrt(float((filters.cfc(impulse, rate, class_) ** 2).sum()))
    white = rng.standard_normal((count + 2 * pad, len(case.array)))
    return np.asarray(filters.cfc(white, rate, class_)[pad : pad + count] / left)


def block_noise(case: Case, rng: np.random.Generator) -> FloatArray:
    """(m,k) noise SI of the blocks of `case.condensed`: of their deviation, and of the colour of `noise`."""
    length = case.condensed.length
    rate, class_ = case.recording.rate, case.recording.rig.cfc
    known = class_ is not None and filters.fast_enough(rate, class_)
    kept = filters.mean_noise(class_, rate, length) if known and class_ is not None else 1.0
    return np.asarray(block_means(noise(case, rng), length) * math.sqrt(length / kept) * case.condensed.sigma)
