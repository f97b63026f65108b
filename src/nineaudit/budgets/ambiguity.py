"""What a layout can prove before any test: whose fault is never seen, and which pairs are never told apart (METHODS 3).

About the exact readings of a perfect instrument in each of five motions, with calibration known and ω = 0 at the start:
a step in each channel, alone, and beside a free waveform in each other channel (estimate/separation.py). λ over
Σe²/σ² under SEEN is rounding; a pair whose λ is a small part of what detects the fault needs a far larger fault.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from nineaudit.array import BoolArray, FloatArray, SensorArray
from nineaudit.estimate import trajectory
from nineaudit.estimate.model import Data
from nineaudit.estimate.motion import has_rates
from nineaudit.estimate.separation import step_sds
from nineaudit.physics import rigid_body
from nineaudit.simulate.instrument import DEFAULT_NOISE

SAMPLES, STEP = 16, 5e-3
ONSET = 6
RATE = 20.0
"""rad/s, about what a head reaches."""
SEEN = 1e-6
"""Part of Σe²/σ² above which a fault counts as seen: rounding leaves 1e-12, the faintest sight is 1e-5."""
FAINT = 0.01
"""Part of the λ that detects a fault under which its pair is told apart only by a fault ten times as large."""
MOTIONS: Final[Mapping[str, tuple[int, int, int]]] = {
    "rest": (0, 0, 0),
    "planar x": (1, 0, 0),
    "planar y": (0, 1, 0),
    "planar z": (0, 0, 1),
    "general": (1, 1, 1),
}


@dataclass(frozen=True)
class Groups:
    """In one motion: channels whose fault is `hidden`, `pairs` that nothing separates, pairs that are separated only
    `faint`ly, and channels that `cannot` be left out, because the others then do not tell the motion."""

    hidden: tuple[str, ...]
    pairs: tuple[tuple[str, str], ...]
    faint: tuple[tuple[str, str], ...]
    cannot: tuple[str, ...]


def ambiguity(array: SensorArray) -> dict[str, Groups]:
    """Groups of an array in each of MOTIONS. EstimationError where its channels do not determine ω."""
    return {name: _groups(array, _rates(axes)) for name, axes in MOTIONS.items()}


def _groups(array: SensorArray, omega: FloatArray) -> Groups:
    found, names = _perfect(array, omega), array.channels
    onset = float(found.data.time[ONSET])
    scale = (SAMPLES - ONSET) * found.data.weight[0] ** 2
    seen = _information(found, onset, None) / scale
    hidden = seen < SEEN
    cannot = _cannot_be_left_out(array)
    pairs: set[tuple[str, str]] = set()
    faint: set[tuple[str, str]] = set()
    for k in range(len(array)):
        if hidden[k] or cannot[k]:
            continue
        apart = _information(found, onset, k) / scale
        for j in np.flatnonzero(~hidden).tolist():
            pair = (names[min(j, k)], names[max(j, k)])
            if j != k and apart[j] < SEEN:
                pairs.add(pair)
            elif j != k and apart[j] < FAINT * seen[j]:
                faint.add(pair)
    ordered = sorted(pairs), sorted(faint - pairs)
    left = tuple(names[k] for k in np.flatnonzero(cannot & ~hidden))
    return Groups(tuple(names[k] for k in np.flatnonzero(hidden)), tuple(ordered[0]), tuple(ordered[1]), left)


def _information(found: trajectory.Fit, onset: float, free: int | None) -> FloatArray:
    """(k,) λ of a unit step."""
    return np.asarray(step_sds(found, onset, free) ** -2.0)


def _perfect(array: SensorArray, omega: FloatArray) -> trajectory.Fit:
    """The fit of exact readings at the true motion, calibration known."""
    mean, alpha = (omega[1:] + omega[:-1]) / 2, np.diff(omega, axis=0) / STEP
    noise = np.array([DEFAULT_NOISE[s.kind] if s.noise is None else s.noise for s in array.sensors])
    place = array.positions - array.positions.mean(axis=0)  # a0 is free: any origin will do, this one loses no digits
    moved = SensorArray(tuple(replace(s, position=p) for s, p in zip(array.sensors, place, strict=True)))
    y = rigid_body.predict(place, array.axes, array.is_accelerometer, np.zeros_like(mean), alpha, mean)
    still = np.zeros(SAMPLES + 1)
    still[0] = 1e8
    weight = np.broadcast_to(1.0 / noise, y.shape).copy()
    time = np.asarray((np.arange(SAMPLES) + 0.5) * STEP, dtype=np.float64)
    data = Data(moved, time, y, weight, np.zeros((len(array), 8)), still)
    return trajectory.fit(data, omega, iterations=1)


def _rates(axes: tuple[int, int, int]) -> FloatArray:
    """(n+1,3) rad/s at the nodes, from rest, about `axes`, out of step."""
    s = np.arange(SAMPLES + 1) * STEP
    shapes = [
        np.sin(np.pi * s / 0.09) ** 2 * (1 + 0.2 * np.sin(40 * s)),
        0.9 * np.sin(np.pi * s / 0.08),
        np.sin(np.pi * s / 0.075) * (1 - 3.75 * s),
    ]
    return RATE * np.stack(shapes, axis=1) * axes


def _cannot_be_left_out(array: SensorArray) -> BoolArray:
    """(k,) accelerometers without which the others do not span α, and no rate sensors do."""
    held, h = array.is_accelerometer, rigid_body.design(array.positions, array.axes)
    out = np.zeros(len(array), dtype=np.bool_)
    if has_rates(array) or held.sum() < 6 or np.linalg.matrix_rank(h[held], tol=1e-9) < 6:
        return out
    for k in np.flatnonzero(held):
        kept = held & (np.arange(len(array)) != k)
        out[k] = np.linalg.matrix_rank(h[kept], tol=1e-9) < 6
    return out
