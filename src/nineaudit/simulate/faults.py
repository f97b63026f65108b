"""What can go wrong with a channel: the fault words of INTERFACE.md, each a pure function of a Scene.

Faults act on the channel as recorded, noise included, one after the other in the order given. `position` and
`cross_axis` go through the physics instead: what the displaced or impure sensor would have read of the true
motion replaces what this one read, and its noise stays as it was.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, Sensor
from nineaudit.errors import ConfigurationError
from nineaudit.physics.filters import cfc
from nineaudit.simulate.instrument import Instrument, across, delayed, physical, respond
from nineaudit.simulate.motions import lobe
from nineaudit.simulate.truth import Truth

SPIKE_EVERY_S: Final = 0.02
"""Mean time between spikes, s; there are three at least."""


@dataclass(frozen=True, eq=False)
class Scene:
    """All a fault may look at: the channel (column `index`) in `readings` (n,k) SI, and how they came about.

    `at` is the time the fault was asked for, None for its default; `mode` a word that some faults know.
    """

    sensor: Sensor
    index: int
    readings: FloatArray
    truth: Truth
    instrument: Instrument
    rng: np.random.Generator
    at: float | None = None
    mode: str | None = None

    @property
    def column(self) -> FloatArray:
        """(n,) readings of the channel, SI."""
        return self.readings[:, self.index]

    @property
    def time(self) -> FloatArray:
        """(n,) s."""
        return self.truth.time

    @property
    def rate(self) -> float:
        return self.truth.rate

    @property
    def peak(self) -> float:
        """Largest magnitude of the channel."""
        return peak(self.column)

    @property
    def time_of_peak(self) -> float:
        finite = np.nan_to_num(np.abs(self.column))
        return float(self.time[np.argmax(finite)])


def peak(column: FloatArray) -> float:
    """Largest magnitude of (n,) readings, 0 where none is valid."""
    return float(np.max(np.abs(column), initial=0.0, where=np.isfinite(column)))


def gain(scene: Scene, value: float) -> FloatArray:
    return scene.column * (1.0 + value)


def zero_shift(scene: Scene, value: float) -> FloatArray:
    start = 0.0 if scene.at is None else scene.at
    return scene.column + np.where(scene.time >= start, value, 0.0)


def drift(scene: Scene, value: float) -> FloatArray:
    start = scene.time[0] if scene.at is None else scene.at
    return np.asarray(scene.column + value * np.clip((scene.time - start) / (scene.time[-1] - start), 0.0, 1.0))


def polarity(scene: Scene, _: float) -> FloatArray:
    return np.asarray(-scene.column)


def swap(scene: Scene, value: float) -> FloatArray:
    """`value` is the partner's column; inject() gives the partner this channel's."""
    return scene.readings[:, int(value)]


def unit(scene: Scene, value: float) -> FloatArray:
    return scene.column * value


def delay(scene: Scene, value: float) -> FloatArray:
    return _past_gaps(scene.column, lambda filled: delayed(filled, scene.time, value))


def clipping(scene: Scene, value: float) -> FloatArray:
    level = value * scene.peak
    return np.asarray(np.clip(scene.column, -level, level))


def dropout(scene: Scene, value: float) -> FloatArray:
    """Nothing arrives for `value` s: the channel reads zero, its last value, or nothing that is valid."""
    start = scene.time_of_peak - value / 2 if scene.at is None else scene.at
    lost = (scene.time >= start) & (scene.time < start + value)
    if not lost.any():
        raise ConfigurationError(
            "the dropout falls between two samples",
            place=scene.sensor.channel,
            found=f"{value:g} s",
            expected=f"{1 / scene.rate:g} s at least",
        )
    before = scene.column[max(int(np.argmax(lost)) - 1, 0)]
    reads = {"zero": 0.0, "hold": before, "invalid": np.nan}[scene.mode or "zero"]
    return np.where(lost, reads, scene.column)


def stuck(scene: Scene, value: float) -> FloatArray:
    start = 0.0 if scene.at is None else scene.at
    held = (scene.time >= start) & (scene.time < start + value)
    return np.where(held, scene.column[np.argmax(held)], scene.column)


def spikes(scene: Scene, value: float) -> FloatArray:
    since = np.flatnonzero(scene.time >= (0.0 if scene.at is None else scene.at))
    count = min(max(3, round(len(since) / scene.rate / SPIKE_EVERY_S)), len(since))
    struck = np.zeros(len(scene.time))
    struck[scene.rng.choice(since, count, replace=False)] = scene.rng.choice([-1.0, 1.0], count)
    return scene.column + value * struck


def noise(scene: Scene, value: float) -> FloatArray:
    return scene.column + value * scene.rng.standard_normal(len(scene.time))


def wrong_filter(scene: Scene, value: float) -> FloatArray:
    return _past_gaps(scene.column, lambda filled: np.asarray(cfc(filled, scene.rate, value)))


def ac_coupled(scene: Scene, value: float) -> FloatArray:
    """First-order high-pass s/(s + 2πf), bilinear, settled on the level before the event.

    With k = π f/rate: y[n] = ((1 − k) y[n−1] + x[n] − x[n−1])/(1 + k).
    """
    k = np.pi * value / scene.rate
    rest = scene.time < 0
    level = np.nanmean(scene.column[rest]) if np.isfinite(scene.column[rest]).any() else 0.0
    kept = (1 - k) / (1 + k)

    def high_pass(filled: FloatArray) -> FloatArray:
        steps = np.diff(filled, prepend=level) / (1 + k)
        return np.array(list(accumulate(steps, lambda y, step: kept * y + step)))

    return _past_gaps(scene.column, high_pass)


def cross_axis(scene: Scene, value: float) -> FloatArray:
    """Sensitivity `value` to one direction across the axis, drawn at random."""
    turn = scene.rng.uniform(0.0, 2 * np.pi)
    impure = scene.instrument.axes.copy()
    impure[scene.index] += value * np.array([np.cos(turn), np.sin(turn)]) @ across(impure[scene.index])
    return scene.column + _difference(scene, replace(scene.instrument, axes=impure))


def position(scene: Scene, value: float) -> FloatArray:
    """Sensor `value` m from where it is thought to be, in a direction drawn at random."""
    direction = scene.rng.standard_normal(3)
    moved = scene.instrument.positions.copy()
    moved[scene.index] += value * direction / np.linalg.norm(direction)
    return scene.column + _difference(scene, replace(scene.instrument, positions=moved))


def missing(scene: Scene, _: float) -> FloatArray:
    return np.full(len(scene.time), np.nan)


def unknown(scene: Scene, value: float) -> FloatArray:
    """A free waveform: three lobes at random after the event begins, the largest excursion `value`."""
    last = scene.time[-1]
    wave = np.zeros(len(scene.time))
    for height in scene.rng.uniform(0.3, 1.0, 3) * scene.rng.choice([-1.0, 1.0], 3):
        start, width = scene.rng.uniform(0.0, 0.5) * last, scene.rng.uniform(0.15, 0.5) * last
        wave += height * lobe(scene.time, start, width)[0]
    return scene.column + value * wave / max(peak(wave), np.finfo(float).tiny)


def _difference(scene: Scene, faulty: Instrument) -> FloatArray:
    """(n,) change of the noiseless reading when the instrument is `faulty` instead."""
    change = physical(faulty, scene.truth) - physical(scene.instrument, scene.truth)
    return respond(scene.instrument, scene.time, change)[:, scene.index]


def _past_gaps(column: FloatArray, operation: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """The operation on the column, invalid samples bridged by straight lines and invalid again after."""
    valid = np.isfinite(column)
    if not valid.any():
        return column
    where = np.arange(len(column))
    return np.where(valid, operation(np.interp(where, where[valid], column[valid])), np.nan)
