"""Propagation of distributions (JCGM 101) as a check of the root sum of squares.

Every draw is an instrument of the rig's uncertainties, with true gains, zeros, tilts, places and time skews
(simulate/instrument.py), which reads the same motion, with noise; the motion is estimated anew from its readings by the
estimator of motion.py, and every output computed from that. Nothing is linear here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.estimate.motion import Motion, bridge, estimate_motion
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
    array: SensorArray,
    time: FloatArray,
    readings: FloatArray,
    sigma: FloatArray,
    rest_index: int | None,
    outputs: Sequence[Output],
    draws: int = DRAWS,
    seed: int = SEED,
) -> list[Scatter]:
    """Scatter of each of `outputs` for channels taken at their word. `readings` (n,k) SI zeroed, `sigma` (k,) noise.

    Errors as motion.estimate_motion.
    """
    whole = bridge(readings, time)
    motion = estimate_motion(array, time, whole, sigma, rest_index)
    exact = np.array([output.value(motion, time) for output in outputs])
    values = np.empty((draws, len(outputs)))
    for row, stream in enumerate(np.random.SeedSequence(seed).spawn(draws)):
        drawn = estimate_motion(array, time, whole + _error(array, time, motion, sigma, stream), sigma, rest_index)
        values[row] = [output.value(drawn, time) for output in outputs]
    bias, sd = values.mean(axis=0) - exact, values.std(axis=0, ddof=1)
    return [Scatter(float(b), float(s)) for b, s in zip(bias, sd, strict=True)]


def _error(
    array: SensorArray, time: FloatArray, motion: Motion, sigma: FloatArray, stream: np.random.SeedSequence
) -> FloatArray:
    """(n,k) what one drawn instrument adds to the readings in this motion."""
    for_instrument, for_noise = stream.spawn(2)
    truth = Truth(time, motion.omega, motion.alpha, np.nan_to_num(motion.a0))
    drawn, _ = instrument.draw(array, for_instrument.spawn(len(array)))
    change = instrument.sense(drawn, truth) - instrument.sense(instrument.perfect(array), truth)
    return np.asarray(change + sigma * np.random.default_rng(for_noise).standard_normal(change.shape))
