"""Small fitting problems with a known truth, for the tests of the whole-record estimator."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from nineaudit.array import FloatArray, Sensor, SensorArray
from nineaudit.estimate import calibration
from nineaudit.estimate.model import Data
from nineaudit.rig import Rig, parse_rig, preset_text
from nineaudit.simulate import Truth, simulate

REDUNDANT = ("naap-3222", "naap-gyro", "triax-3", "triax-4", "coplanar-3", "coplanar-3-gyro", "6aw")
"""Presets with more channels than unknowns (METHODS.md 3)."""
RATES = {"general": 2000.0, "sled": 2000.0, "planar": 2000.0, "oblique": 5000.0, "drop": 10_000.0, "alem-quiet": 1000.0}
"""Sampling at which the midpoint rule's truncation h²α″/24 is small against the noise of α."""
KNOWN_REST = 1e-4
"""Standard deviation with which ω = 0 is known at rest, rad/s: certain, against the noise of α times h."""


@dataclass(frozen=True, eq=False)
class Problem:
    """`data` to fit, the `truth` it was made from, and true ω at the nodes (n+1,3)."""

    data: Data
    truth: Truth
    omega: FloatArray


@cache
def rig_of(preset: str) -> Rig:
    """The preset with white noise: no filter class."""
    return parse_rig(preset_text(preset).replace('"CFC1000"', '"none"'))


def problem(
    preset: str = "naap-3222",
    motion: str = "general",
    seed: int = 0,
    *,
    rate: float | None = None,
    duration: float | None = None,
    imperfect: bool = True,
    noise: bool = True,
) -> Problem:
    """A simulated recording with its stated noise and calibration uncertainty; perfect instruments are known so."""
    rig = rig_of(preset)
    done = simulate(
        rig,
        motion,
        seed=seed,
        rate_hz=RATES[motion] if rate is None else rate,
        duration_s=duration,
        imperfect=imperfect,
        noise=noise,
    )
    time, prior = done.truth.time, calibration.prior_sds(rig.array)
    weight = np.broadcast_to(1.0 / rig.array.values("noise"), done.recording.readings.shape).copy()
    resting = np.append(time, np.inf) < 0.0  # the event begins at t = 0: every node before it is at rest
    data = Data(
        array=rig.array,
        time=time,
        readings=done.recording.readings,
        weight=weight,
        prior_sd=prior if imperfect else np.zeros_like(prior),
        still=np.where(resting, KNOWN_REST**-2, 0.0),
    )
    return Problem(data, done.truth, at_nodes(done.truth.omega))


def at_nodes(values: FloatArray) -> FloatArray:
    """(n+1,...) halfway between the samples of (n,...), one half step beyond the ends."""
    first, last = 1.5 * values[0] - 0.5 * values[1], 1.5 * values[-1] - 0.5 * values[-2]
    return np.concatenate([first[None], 0.5 * (values[1:] + values[:-1]), last[None]])


def scattered(count: int = 12, gyros: int = 3, seed: int = 4) -> SensorArray:
    """An array like none of the presets: positions and axes at random."""
    rng = np.random.default_rng(seed)
    stated = {"u_gain": 0.005, "u_zero": 1.0, "u_alignment": 0.009, "u_position": 5e-4, "u_timing": 1e-5}
    sensors = []
    for i in range(count + gyros):
        axis = rng.standard_normal(3)
        kind = "accelerometer" if i < count else "gyroscope"
        own = stated if i < count else stated | {"u_zero": 0.01, "u_position": 0.0}
        place = rng.uniform(-0.1, 0.1, 3)
        sensors.append(Sensor(f"s{i}", kind, place, axis / np.linalg.norm(axis), f"s{i}", **own))
    return SensorArray(tuple(sensors))


def tiny(array: SensorArray, samples: int = 12, seed: int = 1, *, size: float = 20.0) -> Data:
    """Readings of no particular motion, uneven weights, one channel absent at times, ω known at one node."""
    rng = np.random.default_rng(seed)
    sd = np.where(array.is_accelerometer, 3.0, 0.05)
    weight = rng.uniform(0.5, 1.5, (samples, len(array))) / sd
    weight[3:6, 1] = 0.0
    still = np.zeros(samples + 1)
    still[0] = 1e4
    readings = rng.standard_normal((samples, len(array))) * np.where(array.is_accelerometer, 100.0, size)
    time = np.arange(samples) * 1e-3
    return Data(array, time, readings, weight, calibration.prior_sds(array), still)


def without(data: Data, channels: tuple[str, ...]) -> Data:
    """The same problem on the array that never had these channels."""
    kept = [i for i, name in enumerate(data.array.channels) if name not in channels]
    return replace(
        data,
        array=data.array.select(kept),
        readings=data.readings[:, kept],
        weight=data.weight[:, kept],
        prior_sd=data.prior_sd[kept],
    )
