"""Rigid-body motions whose α is the exact derivative of ω: the truth that a simulated recording is judged by.

Every motion is given in the body frame at the origin of the array, SI. The event starts at t = 0 and the
body is at rest before it, for `rest_s` at least. The motions here are sums of lobes sin⁴(πu) of ω (turned
and turned back) or of its integral (ω gained in a pulse), so that ω, α and a0 have no step and no corner:

    lobe   f(u) = sin⁴(πu)                              f′ = 4π sin³(πu) cos(πu)
    step   F(u) = u − 2 sin(2πu)/3π + sin(4πu)/12π      F′ = (8/3) sin⁴(πu),  F(0) = 0, F(1) = 1

Two motions of the literature are as published (published.py). `alem` starts moving, at t = 0 with no rest
before it; `alem-quiet` is the same motion behind a rest and a ramp, for tools that take zeros and ω(0) = 0
from a quiet interval. `t4` begins with ω = α = 0, so its rest takes nothing from it.

Sizes and times are nominal without a generator; with one, each varies by up to 10 %, so that seeds give a
family of tests of one kind.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import Final, NamedTuple, Protocol

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import ConfigurationError
from nineaudit.simulate.published import alem, alem_quiet, counter_example
from nineaudit.simulate.truth import REST_S, Truth, timeline
from nineaudit.units import G0

VARIATION = 0.1
"""Relative half-width of the variation of sizes and durations from seed to seed."""


class MotionFunction(Protocol):
    """Samples per second, seconds after t = 0 (None: its own), generator, seconds of rest -> Truth."""

    def __call__(
        self,
        rate_hz: float = ...,
        duration_s: float | None = ...,
        rng: np.random.Generator | None = ...,
        *,
        rest_s: float = ...,
    ) -> Truth: ...


class Part(NamedTuple):
    """One lobe or step of body axis 0..2: begins at `start` s, lasts `width` s, reaches `height`."""

    axis: int
    start: float
    width: float
    height: float
    is_step: bool = False


def lobe(time: FloatArray, start: float, width: float) -> tuple[FloatArray, FloatArray]:
    """sin⁴(πu) and its time derivative (1/s), each (n,), u = (t − start)/width, 0 outside."""
    u = np.clip((time - start) / width, 0.0, 1.0)
    s = np.sin(np.pi * u)
    return s**4, 4 * np.pi / width * s**3 * np.cos(np.pi * u)


def step(time: FloatArray, start: float, width: float) -> tuple[FloatArray, FloatArray]:
    """The integral of a lobe, from 0 to 1, and its time derivative (1/s), each (n,)."""
    u = np.clip((time - start) / width, 0.0, 1.0)
    rise = u - 2 * np.sin(2 * np.pi * u) / (3 * np.pi) + np.sin(4 * np.pi * u) / (12 * np.pi)
    return rise, 8 / (3 * width) * np.sin(np.pi * u) ** 4


def total(time: FloatArray, parts: Iterable[Part]) -> tuple[FloatArray, FloatArray]:
    """Sum of parts, in the unit of their heights, and its time derivative, each (n,3)."""
    value, slope = np.zeros((len(time), 3)), np.zeros((len(time), 3))
    for part in parts:
        shape, derivative = (step if part.is_step else lobe)(time, part.start, part.width)
        value[:, part.axis] += part.height * shape
        slope[:, part.axis] += part.height * derivative
    return value, slope


def varied(parts: Iterable[Part], rng: np.random.Generator | None) -> list[Part]:
    """The parts with width and height varied by up to VARIATION; as they are without a generator."""
    if rng is None:
        return list(parts)
    sizes = ((part, *rng.uniform(1 - VARIATION, 1 + VARIATION, 2)) for part in parts)
    return [part._replace(width=part.width * w, height=part.height * h) for part, w, h in sizes]


def _assemble(time: FloatArray, turn: Iterable[Part], push: Iterable[Part]) -> Truth:
    """`turn` in rad/s, `push` in g_0."""
    omega, alpha = total(time, turn)
    return Truth(time, omega, alpha, total(time, push)[0] * G0)


# A head in a frontal sled test: flexion (−y) stopped by the chin, rebound; off-axis turning a few per cent.
_SLED_TURN = (
    Part(1, 0.045, 0.075, -36.0), Part(1, 0.100, 0.090, 15.0), Part(1, 0.093, 0.025, 5.0),
    Part(0, 0.050, 0.060, 1.5), Part(0, 0.105, 0.070, -1.0),
    Part(2, 0.060, 0.070, -1.2), Part(2, 0.120, 0.060, 0.9),
)  # fmt: skip
_SLED_PUSH = (
    Part(0, 0.020, 0.110, -40.0), Part(0, 0.095, 0.028, 12.0), Part(2, 0.040, 0.090, 38.0),
    Part(2, 0.110, 0.070, -10.0), Part(1, 0.050, 0.070, 3.0),
)  # fmt: skip

# A helmeted headform dropped near the crown: one pulse of 8 ms at a tenth of its peak, a weak second contact.
_DROP_TURN = (
    Part(1, 0.0005, 0.013, 24.0, True), Part(0, 0.001, 0.012, 6.0, True), Part(2, 0.002, 0.012, -4.0, True),
    Part(1, 0.020, 0.016, -6.0, True), Part(0, 0.022, 0.014, -2.0, True),
)  # fmt: skip
_DROP_PUSH = (
    Part(2, 0.0, 0.013, -195.0), Part(0, 0.001, 0.013, 35.0), Part(1, 0.0015, 0.011, -14.0),
    Part(2, 0.020, 0.016, -18.0), Part(0, 0.020, 0.014, -6.0),
)  # fmt: skip

# A helmet on an inclined anvil: normal and tangential pulse, turned about all axes at different times.
_OBLIQUE_TURN = (
    Part(0, 0.000, 0.012, 17.0, True), Part(1, 0.001, 0.015, -32.0, True), Part(2, 0.003, 0.018, 15.0, True),
    Part(0, 0.014, 0.025, -24.0, True), Part(1, 0.018, 0.030, 14.0, True), Part(2, 0.022, 0.030, -7.0, True),
)  # fmt: skip
_OBLIQUE_PUSH = (
    Part(2, 0.0, 0.013, -115.0), Part(0, 0.001, 0.014, 70.0), Part(1, 0.002, 0.012, 38.0),
    Part(2, 0.018, 0.020, -12.0), Part(0, 0.020, 0.022, -9.0), Part(1, 0.016, 0.020, -8.0),
)  # fmt: skip

# Turning about one axis only (height about that axis), pushed in the plane across it.
_PLANAR_TURN = (Part(0, 0.010, 0.080, 32.0), Part(0, 0.070, 0.090, -18.0), Part(0, 0.030, 0.030, 6.0))
_PLANAR_PUSH = (
    Part(1, 0.005, 0.090, 45.0), Part(1, 0.080, 0.070, -15.0),
    Part(2, 0.015, 0.080, -35.0), Part(2, 0.075, 0.080, 12.0),
)  # fmt: skip


def _from_tables(
    turn: tuple[Part, ...],
    push: tuple[Part, ...],
    default_s: float,
    rate_hz: float = 10_000.0,
    duration_s: float | None = None,
    rng: np.random.Generator | None = None,
    *,
    rest_s: float = REST_S,
) -> Truth:
    time = timeline(rate_hz, default_s if duration_s is None else duration_s, rest_s)
    return _assemble(time, varied(turn, rng), varied(push, rng))


def _about(axis: int, parts: Iterable[Part]) -> tuple[Part, ...]:
    """The planar tables, written about x, turned to another axis (cyclic)."""
    return tuple(part._replace(axis=(part.axis + axis) % 3) for part in parts)


def general(
    rate_hz: float = 10_000.0,
    duration_s: float | None = None,
    rng: np.random.Generator | None = None,
    *,
    rest_s: float = REST_S,
) -> Truth:
    """Random smooth motion, 0.2 s: on each axis three lobes of ω (14-35 rad/s) and of a0 (16-80 g_0).

    The event fills the duration, 0.2 s at most; without a generator, that of seed 0.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    duration = 0.2 if duration_s is None else duration_s
    time, event = timeline(rate_hz, duration, rest_s), min(duration, 0.2)
    return _assemble(time, _random_lobes(rng, event, 35.0, 0.4), _random_lobes(rng, event, 80.0, 0.2))


def _random_lobes(rng: np.random.Generator, event: float, height: float, least: float) -> list[Part]:
    """Three lobes on each axis, `least`..1 times `height`, alternating, 0.2..0.6 of the event long."""
    parts = []
    for axis in range(3):
        sign = rng.choice([-1.0, 1.0])
        for k in range(3):
            start, width = rng.uniform(0.0, 0.4) * event, rng.uniform(0.2, 0.6) * event
            parts.append(Part(axis, start, width, sign * (-1) ** k * rng.uniform(least, 1.0) * height))
    return parts


MOTIONS: Final[dict[str, MotionFunction]] = {
    "alem": alem,
    "alem-quiet": alem_quiet,
    "sled": partial(_from_tables, _SLED_TURN, _SLED_PUSH, 0.2),
    "drop": partial(_from_tables, _DROP_TURN, _DROP_PUSH, 0.05),
    "planar": partial(_from_tables, _about(1, _PLANAR_TURN), _about(1, _PLANAR_PUSH), 0.2),
    "planar-x": partial(_from_tables, _PLANAR_TURN, _PLANAR_PUSH, 0.2),
    "planar-z": partial(_from_tables, _about(2, _PLANAR_TURN), _about(2, _PLANAR_PUSH), 0.2),
    "oblique": partial(_from_tables, _OBLIQUE_TURN, _OBLIQUE_PUSH, 0.06),
    "general": general,
    "t4": counter_example,
    "rest": partial(_from_tables, (), (), 0.2),
}

DESCRIPTIONS: Final[dict[str, str]] = {
    "alem": "Alem 1977 Table 1 as published, 2 s, moving at t = 0 (no rest before it)",
    "alem-quiet": "Alem 1977 Table 1 behind a rest and a 0.2 s ramp",
    "sled": "head in a frontal sled test, mostly about y, 0.2 s",
    "drop": "helmet drop: a pulse of about 8 ms and 200 g_0, 0.05 s",
    "planar": "turning about y only, 0.2 s",
    "planar-x": "turning about x only, 0.2 s",
    "planar-z": "turning about z only, 0.2 s",
    "oblique": "oblique helmet impact, about all axes, 0.06 s",
    "general": "random smooth motion about and along all axes, 0.2 s",
    "t4": "Takhounts 2009 eqs 15-20: readings that no rigid body gives, 1 s (3-2-2-2 only)",
    "rest": "no motion, 0.2 s",
}


def motion_function(name: str) -> MotionFunction:
    """The motion of that name; ConfigurationError names the nearest."""
    if name in MOTIONS:
        return MOTIONS[name]
    from difflib import get_close_matches

    near = get_close_matches(name, MOTIONS, n=1)
    raise ConfigurationError(
        "unknown motion",
        place="--motion",
        found=name,
        expected="one of " + ", ".join(MOTIONS),
        advice=f"did you mean {near[0]}?" if near else None,
    )
