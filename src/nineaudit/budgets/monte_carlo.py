"""Propagation of distributions (JCGM 101) as a check of the root sum of squares.

Every draw is an instrument of the rig's uncertainties, with true gains, zeros, tilts, places and time skews
(simulate/instrument.py), which reads the same motion, with noise and rounding; the motion is estimated anew from its
readings by the same estimator, and every output computed from that. Nothing is linear here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.estimate import fed_back
from nineaudit.estimate.at_their_word import Word, motion_at_their_word, perfect, with_a0
from nineaudit.estimate.motion import Motion
from nineaudit.estimate.outputs import Output
from nineaudit.simulate import instrument
from nineaudit.simulate.truth import Truth

DRAWS, SEED = 200, 20080101
"""Draws, which tell a standard deviation to 1/√(2·200) = 5 % of it, and their seed."""


@dataclass(frozen=True)
class Scatter:
    """Of an output over the draws: mean less the value without errors, `bias`, and standard deviation `sd`."""

    bias: float
    sd: float


def scatter(
    word: Word,
    rounding: FloatArray,
    rest_index: int | None,
    outputs: Sequence[Output],
    draws: int = DRAWS,
    seed: int = SEED,
) -> list[Scatter]:
    """Scatter of each of `outputs` about the motion of `word`, estimated as it does, of readings rounded with standard
    deviation `rounding` (k,), SI. A scatter that has run away (fed_back.py) is infinite.

    Errors as at_their_word.motion_at_their_word.
    """
    exact = perfect(word.array, word.motion)
    streams = np.random.SeedSequence(seed).spawn(draws)
    drawn = [exact + _error(word, rounding, stream) for stream in streams]
    base, *found = _motions(word, [exact, *drawn], rest_index)
    values = np.array([[output.value(motion, word.time) for output in outputs] for motion in found])
    bias = values.mean(axis=0) - [output.value(base, word.time) for output in outputs]
    sd = values.std(axis=0, ddof=1)
    away = _runs(word) and any(float(np.abs(motion.omega).max()) > 0.999 * _limit(word, drawn) for motion in found)
    return [Scatter(float(b), np.inf if away else float(s)) for b, s in zip(bias, sd, strict=True)]


def _limit(word: Word, readings: list[FloatArray]) -> float:
    """rad/s at which what runs away is held."""
    return fed_back.fastest_rate(word.array, np.stack(readings)[..., word.array.is_accelerometer])


def _runs(word: Word) -> bool:
    return isinstance(word.in_time, fed_back.Carried)


def _motions(word: Word, readings: list[FloatArray], rest_index: int | None) -> list[Motion]:
    """The motion of each of `readings` (n,k), by the estimator of `word`."""
    array, time = word.array, word.time
    if not _runs(word):
        return [motion_at_their_word(array, time, y, word.sigma, rest_index) for y in readings]
    held = np.stack([y[:, array.is_accelerometer] for y in readings], axis=1)
    omega, alpha = fed_back.integrate(array, time, held, rest_index or 0)
    return [with_a0(array, held[:, i], omega[:, i], alpha[:, i]) for i in range(len(readings))]


def _error(word: Word, rounding: FloatArray, stream: np.random.SeedSequence) -> FloatArray:
    """(n,k) what one drawn instrument adds to the readings in this motion."""
    for_instrument, for_noise, for_rounding = stream.spawn(3)
    array, motion = word.array, word.motion
    truth = Truth(word.time, motion.omega, motion.alpha, np.nan_to_num(motion.a0))
    drawn, _ = instrument.draw(array, for_instrument.spawn(len(array)))
    change = instrument.sense(drawn, truth) - instrument.sense(instrument.perfect(array), truth)
    noise = word.sigma * np.random.default_rng(for_noise).standard_normal(change.shape)
    rounded = np.sqrt(3.0) * rounding * np.random.default_rng(for_rounding).uniform(-1.0, 1.0, change.shape)
    return np.asarray(change + noise + rounded)
