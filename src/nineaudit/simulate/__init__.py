"""Rigid motion -> readings of an imperfect instrument, with faults: what tests, demo and selftest share.

    truth (motions.py) -> ideal readings -> imperfect instrument (instrument.py) -> faults (faults.py) ->
    Recording

Every random thing has a stream of its own, spawned from the seed: the motion, each channel's imperfection,
each channel's noise, each fault. So a seed gives the same recording bit by bit, and the same seed with and
without a fault differs in the faulty channel only.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from nineaudit.array import FloatArray, SensorArray, frozen
from nineaudit.errors import ConfigurationError
from nineaudit.identity import identify
from nineaudit.physics import nap
from nineaudit.physics.filters import cfc
from nineaudit.recording import Clock, Recording, Source, Trace
from nineaudit.rig import Rig
from nineaudit.simulate import instrument as instruments
from nineaudit.simulate.inject import inject
from nineaudit.simulate.instrument import DEFAULT_NOISE
from nineaudit.simulate.motions import DESCRIPTIONS, MOTIONS, motion_function
from nineaudit.simulate.published import counter_example
from nineaudit.simulate.truth import REST_S, Truth, with_gravity
from nineaudit.simulate.words import FAULTS, Fault, FaultKind, parse_fault

__all__ = [
    "DEFAULT_NOISE",
    "DESCRIPTIONS",
    "FAULTS",
    "MOTIONS",
    "Fault",
    "FaultKind",
    "Simulation",
    "Truth",
    "parse_fault",
    "simulate",
]

REST_SAMPLES = 32
"""Samples of rest before the event, at least, so that slow rates too leave a quiet interval to be found."""


@dataclass(frozen=True, eq=False)
class Simulation:
    """A simulated recording and what it was made from; (n,k) SI in the order of the rig.

    `ideal`: the rig at its word, no noise. `healthy`: the drawn instrument with noise, before the faults.
    `drawn`: gain, zero, timing, noise (k,); tilt (k,2); position (k,3), zero where the instrument is
    perfect.
    """

    recording: Recording
    truth: Truth
    ideal: FloatArray
    healthy: FloatArray
    drawn: Mapping[str, FloatArray]
    faults: tuple[Fault, ...]


def simulate(
    rig: Rig,
    motion: str,
    *,
    faults: Sequence[Fault | str] = (),
    seed: int = 0,
    rate_hz: float = 10_000.0,
    duration_s: float | None = None,
    imperfect: bool = True,
    noise: bool = True,
    gravity: bool = False,
    filter_signal: bool = False,
) -> Simulation:
    """Recording of a motion (MOTIONS) by the rig, `duration_s` after t = 0 (None: the motion's own).

    `imperfect`: calibration errors drawn from the rig's uncertainties; else the rig at its word. `noise`:
    of the rig's level (DEFAULT_NOISE where it states none), in the band of its filter class. `gravity`: a0
    is specific force, z down at the start. `filter_signal`: the signal too goes through the filter class.
    Readings end at the sensors' full scale. Raises ConfigurationError: unknown motion, channel or fault,
    bad value, `t4` on an array that is not 3-2-2-2. EstimationError: `filter_signal` sampled too slowly.
    """
    if seed < 0:
        raise ConfigurationError("bad seed", place="--seed", found=seed, expected="0, 1, 2, ...")
    parsed = tuple(parse_fault(f) if isinstance(f, str) else f for f in faults)
    for_motion, for_draw, for_noise, for_faults = np.random.SeedSequence(seed).spawn(4)
    truth = _truth(rig, motion, rate_hz, duration_s, np.random.default_rng(for_motion), gravity)
    instrument, drawn = instruments.draw(_stated(rig.array, imperfect), for_draw.spawn(len(rig.array)))
    signal = instruments.sense(instrument, truth)
    ideal = instruments.sense(instruments.perfect(rig.array), truth)
    if motion == "t4":
        unphysical = _counter_example_readings(rig.array, truth)
        signal = signal + instruments.respond(instrument, truth.time, unphysical - ideal)
        ideal = unphysical
    if filter_signal and rig.cfc is not None:
        signal = cfc(signal, rate_hz, rig.cfc)
    if noise:
        streams = for_noise.spawn(len(rig.array))
        signal = signal + instruments.noise(instrument.noise, len(truth.time), rate_hz, rig.cfc, streams)
    healthy = _within_range(signal, rig.array)
    readings = inject(healthy, parsed, rig, truth, instrument, for_faults.spawn(len(parsed)))
    notes = (f"simulated motion {motion}, seed {seed}", *(f"injected fault {fault}" for fault in parsed))
    recording = _recording(rig, truth.time, readings, rate_hz, Path(f"simulation:{motion}:seed={seed}"), notes)
    return Simulation(recording, truth, frozen(ideal), frozen(healthy), drawn, parsed)


def _truth(
    rig: Rig, name: str, rate_hz: float, duration_s: float | None, rng: np.random.Generator, gravity: bool
) -> Truth:
    """The motion, resting from 5 ms before the rig's pre_trigger, 25 ms or REST_SAMPLES at least."""
    function = motion_function(name)
    if name == "t4":
        function = partial(counter_example, arms=_layout(rig.array)[1])
    before = 0.0 if rig.pre_trigger is None else 0.005 - rig.pre_trigger[0]
    rest = max(REST_S, before, REST_SAMPLES / rate_hz if rate_hz > 0 else 0.0)
    truth = function(rate_hz, duration_s, rng, rest_s=rest)
    return with_gravity(truth) if gravity else truth


def _stated(array: SensorArray, imperfect: bool) -> SensorArray:
    """The array, with no uncertainty where the instrument is to be perfect."""
    if imperfect:
        return array
    return SensorArray(
        tuple(replace(s, u_gain=0.0, u_zero=0.0, u_alignment=0.0, u_position=0.0, u_timing=0.0) for s in array.sensors)
    )


def _layout(array: SensorArray) -> tuple[tuple[int, ...], FloatArray]:
    found = nap.layout(array)
    if found is None:
        raise ConfigurationError(
            "the t4 counter-example speaks of the 3-2-2-2 array",
            place="--motion",
            found="t4",
            expected="a rig with channels " + " ".join(nap.CHANNELS),
        )
    return found


def _counter_example_readings(array: SensorArray, truth: Truth) -> FloatArray:
    """(n,k): t m/s² in each arm channel, 0 in the centre and other accelerometers [Takhounts09 eq 16]."""
    columns, _ = _layout(array)
    readings = np.where(array.is_accelerometer, 0.0, truth.omega @ array.axes.T)
    readings[:, columns[3:]] = np.maximum(truth.time, 0.0)[:, None]
    return readings


def _within_range(readings: FloatArray, array: SensorArray) -> FloatArray:
    limit = array.values("full_scale")
    limit = np.where(np.isfinite(limit), limit, np.inf)
    return np.clip(readings, -limit, limit)


def _recording(
    rig: Rig, time: FloatArray, readings: FloatArray, rate: float, path: Path, notes: tuple[str, ...]
) -> Recording:
    time, readings = frozen(time), frozen(readings)
    valid = np.isfinite(readings)
    valid.setflags(write=False)
    content = time.tobytes() + readings.tobytes()
    return Recording(
        time=time,
        readings=readings,
        valid=valid,
        rig=rig,
        source=Source(path, "simulation", hashlib.sha256(content).hexdigest(), len(content), notes=notes),
        native=tuple(Trace(s.channel, s.signal, time, readings[:, i]) for i, s in enumerate(rig.array.sensors)),
        clocks=tuple(Clock(rate=rate, jitter=0.0) for _ in rig.array.sensors),
        test=identify(rig.test),
    )
