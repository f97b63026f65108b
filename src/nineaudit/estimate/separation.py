"""How far a fault in one channel stays visible, and apart from a free waveform in any other (METHODS.md 3).

    λ = ‖(I − Π) S e‖² = e·e − what motion and calibration, each with its prior, can imitate of it

from the normal equations about a fit, with the fault e as one more unknown: λ is its Schur complement.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.estimate.hypotheses import masked, theta_for
from nineaudit.estimate.model import Data, Extra
from nineaudit.estimate.normal import eliminate, normal_equations
from nineaudit.estimate.point import point
from nineaudit.estimate.trajectory import Fit

DETECTION_NATS = 12.0
"""Evidence over no fault before anything is said: prior odds of 1000 for a healthy record, and 160 to 1 beyond."""
ENOUGH = 800
"""Samples that tell as much of a slow fault as any more."""
CLAIMED = 4.0
"""Standard deviations that a sample must lie off what the others predict to belong to the fault that is claimed."""


def coarser(at: Fit, most: int) -> Fit:
    """The fit at every so many nodes, with means of the readings between them, at most about `most`: what the record
    tells of slow faults is the same."""
    data, length = at.data, -(-len(at.data.time) // most)
    if length == 1:
        return at
    whole = len(data.time) // length
    squares, readings, time = (
        values[: whole * length].reshape(whole, length, *values.shape[1:])
        for values in (data.weight**2, data.readings, data.time)
    )
    total = squares.sum(axis=1)
    mean = (squares * readings).sum(axis=1) / np.where(total > 0, total, 1.0)
    still = data.still[: whole * length + 1 : length]
    part = replace(data, time=time.mean(axis=1), readings=mean, weight=np.sqrt(total), still=still)
    part = replace(part, extra=None, between=None)
    return replace(at, data=part, omega=at.omega[: whole * length + 1 : length], theta=theta_for(part, at))


def step_sds(at: Fit, onset: float, free: int | None = None) -> FloatArray:
    """(k,) standard deviation (SI) with which a step at the `onset` (s) in each channel would be known, beside
    everything else; `free`: with that channel's waveform free (infinite for itself). ∞ where it could not be told at
    all."""
    data = at.data if free is None else masked(at.data, free)
    count = len(data.array)
    step = (data.time >= onset).astype(float)
    told = _information(data, at, np.repeat(step[None], count, axis=0), np.arange(count))
    return np.asarray(np.where(told > 0, 1.0 / np.sqrt(np.where(told > 0, told, 1.0)), np.inf))


def _information(data: Data, at: Fit, faults: FloatArray, channel: IntArray) -> FloatArray:
    """(e,) λ of each of `faults` (e,n) in its `channel` (e,), about a fit; 0 where it is lost in rounding."""
    whole = replace(data, extra=Extra(faults, channel))
    theta = theta_for(whole, at)
    solved = eliminate(normal_equations(point(whole, at.omega, theta)))
    base, out = len(theta) - len(channel), np.zeros(len(channel))
    for e in range(len(channel)):
        rows = np.r_[np.arange(base), base + e]
        schur = solved.schur[np.ix_(rows, rows)]
        # the prior 1 of a shape in the normal equations is taken off: the fault is wholly unknown
        left = schur[-1, -1] - 1.0 - schur[-1, :-1] @ np.linalg.solve(schur[:-1, :-1], schur[:-1, -1])
        out[e] = left if left > 1e-9 * max(solved.normal.dense[base + e, base + e], 1e-300) else 0.0
    return out


def claimed(data: Data, left: Fit, channel: int, rivals: list[int]) -> dict[int, float]:
    """λ of the waveform that a channel seems to have had added to it (its readings less what the fit `left` without it
    predicts), with each rival's waveform free."""
    off = np.where(data.weight[:, channel] > 0, data.readings[:, channel] - left.ideal[:, channel], 0.0)
    fault = np.where(np.abs(off) * data.weight[:, channel] > CLAIMED, off, 0.0)
    return {k: float(_information(masked(data, k), left, fault[None], np.array([channel]))[0]) for k in rivals}


def apart(at: Fit, onset: int) -> FloatArray:
    """(k,k) [i, j] by how much larger a step at the onset in channel i must be to be told from a free waveform in
    channel j, than to be seen at all: 1 where j cannot imitate it, ∞ where it can wholly, NaN for i = j and for
    channels without a valid sample."""
    begin, at = float(at.data.time[onset]), coarser(at, ENOUGH)
    alone, out = step_sds(at, begin), np.full((len(at.data.array), len(at.data.array)), np.nan)
    used = np.flatnonzero((at.data.weight > 0).any(axis=0))
    for j in used.tolist():
        sds = step_sds(at, begin, free=j)
        out[used, j] = np.where(np.isfinite(alone[used]), np.maximum(sds[used] / alone[used], 1.0), np.inf)
    out[np.arange(len(out)), np.arange(len(out))] = np.nan
    return out


def smallest(at: Fit, onset: int, separation: float) -> tuple[FloatArray, FloatArray]:
    """(k,) size of a step at the onset that would be detected, and that would be told from every other channel's
    free waveform (λ = `separation`), SI; ∞ where no size would do."""
    begin, at = float(at.data.time[onset]), coarser(at, ENOUGH)
    alone = step_sds(at, begin)
    detect = alone * np.sqrt(2.0 * DETECTION_NATS + 2.0 * np.log(30.0))
    used = np.flatnonzero((at.data.weight > 0).any(axis=0)).tolist()
    rivals = np.stack([step_sds(at, begin, free=j) for j in used])
    for row, j in enumerate(used):
        rivals[row, j] = 0.0
    return detect, np.maximum(detect, rivals.max(axis=0) * np.sqrt(separation))
