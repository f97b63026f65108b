"""What a laboratory reports of a motion, as numbers with derivatives: peak α, ω, a at a point, HIC, BrIC.

Each has its derivatives by ω, α and a0 at every sample, so that any estimator that knows what an error does to those
can carry it on to the output (GUM 5.1.3):

    a = a0 + α × p + ω × (ω × p)      â·∂a = â·∂a0 + (p × â)·∂α + ∂[â·(ω × (ω × p))]/∂ω · ∂ω      [Becker75 eq 5]
    HIC = T (Δv/T)^2.5                 ∂HIC = 2.5 (Δv/T)^1.5 ∫ â·∂a dt over its window, which stays as it is
    BrIC = √Σ(|ω_i|/c_i)²              each maximum at its own time
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.estimate.motion import Motion
from nineaudit.physics import injury, rigid_body
from nineaudit.units import G0

_TINY = 1e-12


class Gradient(NamedTuple):
    """Derivatives (n,3) of one number by `omega`, `alpha` and `a0` at every sample, SI."""

    omega: FloatArray
    alpha: FloatArray
    a0: FloatArray


@dataclass(frozen=True, eq=False)
class Output:
    """A number that is reported: `value` and `gradient` of a motion and its time (n,) s, in `unit`."""

    name: str
    unit: str
    value: Callable[[Motion, FloatArray], float]
    gradient: Callable[[Motion, FloatArray], Gradient]


def outputs(points: list[tuple[str, FloatArray]]) -> list[Output]:
    """Peak α, peak ω and BrIC; peak a, HIC15 and HIC36 at each of `points`, (name, (3,) m)."""
    return [peak_alpha(), peak_omega(), bric(), *(o for p in points for o in at_point(*p))]


def peak_alpha() -> Output:
    """Largest |α|, rad/s²."""

    def gradient(motion: Motion, _time: FloatArray) -> Gradient:
        none = np.zeros_like(motion.alpha)
        return Gradient(none, _at_peak(motion.alpha), none)

    return Output("peak α", "rad/s^2", lambda motion, time: injury.peak(motion.alpha, time)[0], gradient)


def peak_omega() -> Output:
    """Largest |ω|, rad/s."""

    def gradient(motion: Motion, _time: FloatArray) -> Gradient:
        none = np.zeros_like(motion.omega)
        return Gradient(_at_peak(motion.omega), none, none)

    return Output("peak ω", "rad/s", lambda motion, time: injury.peak(motion.omega, time)[0], gradient)


def bric() -> Output:
    """Brain injury criterion of the whole record."""

    def gradient(motion: Motion, _time: FloatArray) -> Gradient:
        out, none = np.zeros_like(motion.omega), np.zeros_like(motion.omega)
        rows, critical = np.abs(motion.omega).argmax(axis=0), np.asarray(injury.BRIC_CRITICAL)
        for axis, row in enumerate(rows):
            out[row, axis] = motion.omega[row, axis] / critical[axis] ** 2
        return Gradient(out / max(injury.bric(motion.omega), _TINY), none, none)

    return Output("BrIC", "1", lambda motion, _time: injury.bric(motion.omega), gradient)


def at_instant(kind: str, row: int, axis: int, motion: Motion, place: FloatArray) -> Gradient:
    """Gradient of one component (`axis`) of α, ω or a at `place` (3,) m, `kind` "α", "ω" or "a", at sample `row`; a in
    g_0."""
    one, none = np.zeros_like(motion.omega), np.zeros_like(motion.omega)
    one[row, axis] = 1.0
    if kind == "a":
        return _through(place, motion, one / G0)
    return Gradient(none, one, none) if kind == "α" else Gradient(one, none, none)


def at_point(name: str, place: FloatArray) -> list[Output]:
    """Peak a (g_0), HIC15 and HIC36 at `place` (3,) m."""
    of = f" at {name}" if name else ""

    def size(motion: Motion) -> FloatArray:
        return np.asarray(np.linalg.norm(_acceleration(place, motion), axis=1))

    def peak(motion: Motion, _time: FloatArray) -> Gradient:
        return _through(place, motion, _at_peak(_acceleration(place, motion)) / G0)

    found = [Output(f"peak a{of}", "g_0", lambda m, t: injury.peak(size(m), t)[0] / G0, peak)]
    for window in (0.015, 0.036):
        label = f"HIC{window * 1000:.0f}{of}"

        def value(motion: Motion, time: FloatArray, window: float = window) -> float:
            return injury.hic(size(motion), time, window).value

        def gradient(motion: Motion, time: FloatArray, window: float = window) -> Gradient:
            return _through(place, motion, _by_acceleration(_acceleration(place, motion), time, window))

        found.append(Output(label, "g_0^2.5 s", value, gradient))
    return found


def _acceleration(place: FloatArray, motion: Motion) -> FloatArray:
    return rigid_body.acceleration_at(place, motion.a0, motion.alpha, motion.omega)


def _at_peak(values: FloatArray) -> FloatArray:
    """(n,3) derivative of the largest length of `values` (n,3): its direction there, 0 elsewhere."""
    out, size = np.zeros_like(values), np.linalg.norm(values, axis=1)
    row = int(size.argmax())
    out[row] = values[row] / max(float(size[row]), _TINY)
    return out


def _by_acceleration(a: FloatArray, time: FloatArray, window: float) -> FloatArray:
    """(n,3) derivative of HIC by the acceleration (n,3) m/s²."""
    size = np.linalg.norm(a, axis=1)
    best = injury.hic(size, time, window)
    inside = (time >= best.start) & (time <= best.end)
    steps = np.diff(time) * (inside[1:] & inside[:-1])
    weights = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    mean = float(weights @ size) / max(best.end - best.start, _TINY)
    return np.asarray((2.5 * (mean / G0) ** 1.5 / G0 * weights / np.maximum(size, _TINY))[:, None] * a)


def _through(place: FloatArray, motion: Motion, by_a: FloatArray) -> Gradient:
    """A derivative by the acceleration at `place`, carried to ω, α and a0."""
    jacobian = [rigid_body.centripetal_jacobian(place[None], axis[None], motion.omega)[:, 0] for axis in np.eye(3)]
    by_omega = sum(by_a[:, [i]] * jacobian[i] for i in range(3))
    return Gradient(np.asarray(by_omega), np.cross(place, by_a), by_a)
