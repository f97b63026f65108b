"""Alem 1977: the motion of Table 1 through the whole of NINACC; an extra triax predicted (METHODS 7.1, 7.2).

Both ends are independent: the motion is differentiated by hand (simulate/published.py), the way back is least squares,
ω by predictor–corrector or by the whole-record smoother, attitude and two integrations.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nineaudit.array import FloatArray, Sensor, SensorArray
from nineaudit.estimate.deferred import deferred
from nineaudit.estimate.model import Data
from nineaudit.estimate.motion import Motion
from nineaudit.estimate.samples import at_samples
from nineaudit.estimate.trajectory import fit
from nineaudit.physics import kinematics, laboratory, rigid_body
from nineaudit.presets import preset_text
from nineaudit.rig import parse_rig
from nineaudit.schemes import extra_triax, growth, ninacc
from nineaudit.selftest.published import Published
from nineaudit.simulate import simulate
from nineaudit.simulate.published import alem, alem_path
from nineaudit.units import G0

SOURCE = "Alem77"
RATE, ARMS_IN, INCH = 1600.0, (3.0, 4.0, 5.0), 0.0254
DEVIATIONS = {"α": 0.07, "ω": 0.10, "Euler angles": 0.08, "a": 0.07, "v": 0.10, "x": 0.10}
"""Printed deviations of Table 1, per cent of the peak."""
ROUNDING = 2.0 * 500.0 * G0 / 2**12 / np.sqrt(12.0)
"""Standard deviation of rounding to 12 bits over ±500 g, m/s² (GUM F.2.2.1)."""
_OWN = "the deviation that the paper prints for its own program on this motion"
_DIGITS = "half of the last printed digit"


def array() -> SensorArray:
    """Triaxes at 3, 4 and 5 inches on x, y and z."""
    places = np.repeat(np.diag(ARMS_IN) * INCH, 3, axis=0)
    axes = np.tile(np.eye(3), (3, 1))
    names = [f"a{point}{axis}" for point in (1, 2, 3) for axis in "xyz"]
    parts = zip(names, places, axes, strict=True)
    return SensorArray(tuple(Sensor(name, "accelerometer", place, axis, name) for name, place, axis in parts))


def deviations(smoothed: bool = False) -> dict[str, float]:
    """Largest deviation of a component, per cent of that component's peak, over the 2 s of Table 1 at 1600 Hz; ω by the
    predictor–corrector, or `smoothed`."""
    truth, (euler, shift) = alem(RATE), alem_path(RATE)
    nine = array()
    every = np.ones(9, dtype=np.bool_)
    readings = rigid_body.predict(nine.positions, nine.axes, every, truth.a0, truth.alpha, truth.omega)
    got = ninacc.forward(nine, truth.time, readings, truth.omega[0])
    if smoothed:
        got = _smoothed(nine, truth.time, readings, got.omega)
    attitude = kinematics.orientation(got.omega, truth.time, laboratory.attitude_of(euler[0][0]))
    a, v, x = laboratory.origin_path(truth.time, got.a0, attitude, shift[1][0], shift[0][0])
    pairs = [(got.alpha, truth.alpha), (got.omega, truth.omega), (laboratory.euler_of(attitude), euler[0])]
    pairs += [(a, shift[2]), (v, shift[1]), (x, shift[0])]
    return {name: _worst(*pair) for name, pair in zip(DEVIATIONS, pairs, strict=True)}


def _smoothed(nine: SensorArray, time: FloatArray, readings: FloatArray, near: FloatArray) -> Motion:
    """By the whole-record fit from ω `near` (n,3), the instrument at its word; ω is known of no sample."""
    weight, certain = np.full(readings.shape, 1.0 / ROUNDING), np.zeros((len(nine), 8))
    data = Data(nine, time, readings, weight, certain, np.zeros(len(time) + 1))
    nodes = np.vstack([near[:1], 0.5 * (near[1:] + near[:-1]), near[-1:]])
    return at_samples(deferred(fit(data, nodes)), time, readings, np.full(len(nine), ROUNDING)).motion


def _worst(got: FloatArray, true: FloatArray) -> float:
    return float(100.0 * (np.abs(got - true).max(axis=0) / np.abs(true).max(axis=0)).max())


def predicted_sled(seed: int = 1977) -> extra_triax.Prediction:
    """The centre triax of a simulated sled test from three others: calibrated, with the noise of a 12-bit recorder."""
    rig = parse_rig(preset_text("triax-4"))
    rig = replace(rig, array=SensorArray(tuple(replace(s, noise=ROUNDING) for s in rig.array.sensors)))
    made = simulate(rig, "sled", seed=seed, imperfect=False).recording
    four = rig.array
    columns = extra_triax.triax_columns(four, "a0")
    others = [c for c in range(len(four)) if c not in columns]
    motion = ninacc.forward(four.select(others), made.time, made.readings[:, others], np.zeros(3))
    return extra_triax.check(four, columns, made.time, made.readings, motion)


def checks() -> list[Published]:
    """Table 1, its peaks, the growth by feedback, and the extra triax."""
    ways = (("", deviations()), (" by the smoother", deviations(smoothed=True)))
    out = [
        Published(SOURCE, f"Table 1, deviation of {name}{way}, % of peak", limit, found[name], 0.0, limit, _OWN)
        for way, found in ways
        for name, limit in DEVIATIONS.items()
    ]
    truth = alem(RATE)
    size = float(np.linalg.norm(truth.alpha, axis=1).max())
    out.append(Published(SOURCE, "Table 1, largest |α|, rad/s²", 3205.0, size, 3205.0, 0.5, _DIGITS))
    for axis, printed, value in zip("xyz", (31.7, 42.7, 42.6), np.abs(truth.omega).max(axis=0), strict=True):
        out.append(
            Published(SOURCE, f"Table 1, largest |ω{axis}|, rad/s", printed, float(value), printed, 0.05, _DIGITS)
        )
    nine = array()
    rate = growth.growth_rate(nine.positions, nine.axes)
    out.append(Published(SOURCE, "growth of an error of ω per rad, 3, 4, 5 in", 0.53, rate, 0.53, 0.005, _DIGITS))
    sled = predicted_sled()
    why = "the paper's deviation on its sled; the sled's record is not printed, ours is simulated"
    for name, printed, ours in (("HIC", -0.29, sled.hic_deviation), ("GSI", -0.80, sled.gsi_deviation)):
        quantity = f"extra triax predicted, {name}, % (simulated sled)"
        out.append(Published(SOURCE, quantity, printed, 100.0 * ours, 0.0, abs(printed), why))
    return out
