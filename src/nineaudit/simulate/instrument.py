"""The instrument as it really is: each sensor a little off what the rig says, by its stated uncertainty.

    y_i(t) = (1 + g_i) n_i·a(r_i + δr_i; t − τ_i) + b_i + noise                             (METHODS.md 1)

with n_i tilted by two small angles about its nominal direction; a rate sensor has ω in the place of a. The
true gains g, zeros b, tilts, position errors δr and time skews τ are normal with the rig's standard
uncertainties.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from nineaudit.array import BoolArray, FloatArray, Kind, SensorArray, frozen
from nineaudit.physics import rigid_body
from nineaudit.physics.filters import SAMPLES_PER_CLASS, cfc
from nineaudit.simulate.truth import Truth
from nineaudit.units import G0

DEFAULT_NOISE: Final[Mapping[Kind, float]] = {"accelerometer": 0.3 * G0, "gyroscope": 0.02}
"""Noise where the rig states none: m/s² (the example of INTERFACE.md) and rad/s (about 1 deg/s)."""


@dataclass(frozen=True, eq=False)
class Instrument:
    """True `positions`, unit `axes` (k,3); `gain` (relative), `zero`, `timing` s, `noise` sd, (k,) SI."""

    positions: FloatArray
    axes: FloatArray
    is_accelerometer: BoolArray
    gain: FloatArray
    zero: FloatArray
    timing: FloatArray
    noise: FloatArray


def perfect(array: SensorArray) -> Instrument:
    """The rig at its word, with its noise."""
    nothing = np.zeros(len(array))
    noise = np.array([DEFAULT_NOISE[s.kind] if s.noise is None else s.noise for s in array.sensors])
    return Instrument(array.positions, array.axes, array.is_accelerometer, nothing, nothing, nothing, noise)


def draw(array: SensorArray, streams: Sequence[np.random.SeedSequence]) -> tuple[Instrument, dict[str, FloatArray]]:
    """An instrument of the rig's uncertainties, one seed stream for each channel, and what was drawn.

    Drawn, SI: gain, zero, timing, noise (k,); tilt (k,2) rad towards the rows of `across`; position (k,3) m.
    """
    z = np.array([np.random.default_rng(stream).standard_normal(8) for stream in streams]).reshape(-1, 8)
    u = {name: array.values(f"u_{name}") for name in ("gain", "zero", "timing", "alignment", "position")}
    tilt, offset = z[:, 3:5] * u["alignment"][:, None], z[:, 5:8] * u["position"][:, None]
    axes = array.axes + np.array([t @ across(n) for t, n in zip(tilt, array.axes, strict=True)]).reshape(-1, 3)
    instrument = Instrument(
        positions=array.positions + offset,
        axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        is_accelerometer=array.is_accelerometer,
        gain=z[:, 0] * u["gain"],
        zero=z[:, 1] * u["zero"],
        timing=z[:, 2] * u["timing"],
        noise=perfect(array).noise,
    )
    names = ("gain", "zero", "timing", "noise")
    drawn = {name: frozen(getattr(instrument, name)) for name in names}
    return instrument, drawn | {"tilt": frozen(tilt), "position": frozen(offset)}


def across(axis: FloatArray) -> FloatArray:
    """(2,3) unit vectors that complete `axis` (3,) to a right-handed orthonormal triad."""
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first)])


def sense(instrument: Instrument, truth: Truth) -> FloatArray:
    """(n,k) readings without noise, SI."""
    return respond(instrument, truth.time, physical(instrument, truth)) + instrument.zero


def physical(instrument: Instrument, truth: Truth) -> FloatArray:
    """(n,k) specific force or rate along the true axis at the true position, SI."""
    return rigid_body.predict(
        instrument.positions, instrument.axes, instrument.is_accelerometer, truth.a0, truth.alpha, truth.omega
    )


def respond(instrument: Instrument, time: FloatArray, values: FloatArray) -> FloatArray:
    """(n,k) what the electronics make of the physical `values` (n,k), less the zero: skew and gain."""
    late = [delayed(values[:, i], time, tau) for i, tau in enumerate(instrument.timing)]
    return np.stack(late, axis=1) * (1.0 + instrument.gain)


def delayed(values: FloatArray, time: FloatArray, delay: float) -> FloatArray:
    """(n,) values(t − delay), by cubic spline; before the first and after the last sample, the end value."""
    if delay == 0.0:
        return values
    from scipy.interpolate import CubicSpline

    step = (time[-1] - time[0]) / (len(time) - 1)
    if abs(delay) < step:  # a skew: the spline carries on for less than one interval
        return np.asarray(CubicSpline(time, values)(time - delay))
    return np.asarray(CubicSpline(time, values)(np.clip(time - delay, time[0], time[-1])))


def noise(
    sd: FloatArray, count: int, rate: float, class_: float | None, streams: Sequence[np.random.SeedSequence]
) -> FloatArray:
    """(count,k) noise of standard deviation `sd` (k,), white or as a channel frequency class leaves it.

    One seed stream for each channel. Filtered noise is coloured (METHODS.md 2) and scaled so that `sd` is
    what is left after the filter: variance ratio Σh² of the impulse response h. Sampled below 10 times the
    class, where the filter is not defined (SAE J211-1) and most of the band is under its corner, noise
    stays white.
    """
    if class_ is None or not filters_at(class_, rate):
        return np.stack([np.random.default_rng(s).standard_normal(count) for s in streams], axis=1) * sd
    pad = int(np.ceil(2 * rate / class_))  # by then the impulse response has fallen to e^-18
    white = [np.random.default_rng(s).standard_normal(count + 2 * pad) for s in streams]
    impulse = np.zeros(2 * pad + 1)
    impulse[pad] = 1.0
    passed = np.sqrt(np.sum(cfc(impulse, rate, class_) ** 2))
    return np.asarray(cfc(np.stack(white, axis=1), rate, class_)[pad : pad + count] * (sd / passed))


def filters_at(class_: float, rate: float) -> bool:
    """Whether a channel frequency class is defined at this sampling rate."""
    return rate >= SAMPLES_PER_CLASS * class_
