"""How ω, α and a0 follow from a recording: the whole-record fit, and the schemes of the papers, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.case import Case
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.estimate import parity, trajectory
from nineaudit.estimate.deferred import deferred
from nineaudit.estimate.motion import OFF_IDEAL, Motion, bridge, estimate_motion, has_rates
from nineaudit.estimate.samples import Samples, at_samples
from nineaudit.estimate.smoothed_rates import at_rates, smoothed_rates
from nineaudit.physics import kinematics, nap, rigid_body
from nineaudit.schemes import growth, martin, ninacc, rgla
from nineaudit.schemes.requirements import require_acceleration, require_alpha, require_readings

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Start:
    """What is known at the first sample: `omega` rad/s (body; None: at rest), `euler` yaw, pitch, roll rad, `velocity`
    m/s and `position` m of the origin (laboratory). `gravity`: whether the readings hold it and it is to be put right.
    """

    omega: Vector | None = None
    euler: Vector = (0.0, 0.0, 0.0)
    velocity: Vector = (0.0, 0.0, 0.0)
    position: Vector = (0.0, 0.0, 0.0)
    gravity: bool = False


AT_REST: Final = Start()
Method = Callable[[Case, Start], Motion]


def by_fit(case: Case, start: Start) -> Samples:
    """Whole-record maximum a posteriori fit (METHODS.md 2), a0 and α from each sample.

    A stated ω(0) is where the fit starts from, for records without a quiet interval; the readings decide.
    EstimationError where the accelerometers do not tell α: differences of ω would be all that is left of it.
    """
    require_alpha(case.array)
    found = case.healthy if start.omega is None else trajectory.fit(case.fit_data, _from(case, start.omega))
    return at_samples(deferred(found), case.time, case.readings, case.sigma)


def _from(case: Case, omega: Vector) -> FloatArray:
    """(m+1,3) ω at the nodes of the fit, integrated from `omega`, by least squares if the array gives no other."""
    blocks = case.condensed
    held = case.array.is_accelerometer
    nine, readings = case.array.select(np.flatnonzero(held).tolist()), bridge(blocks.readings[:, held], blocks.time)
    try:
        samples = _integrated(nine.positions, nine.axes, readings, blocks.time, np.asarray(omega), None).omega
    except EstimationError:
        samples = ninacc.forward(nine, blocks.time, readings, np.asarray(omega)).omega
    return np.vstack([samples[:1], 0.5 * (samples[1:] + samples[:-1]), samples[-1:]])


def _map(case: Case, start: Start) -> Motion:
    """The fit; where only rate sensors tell α, the whole-record smoother of their ω (estimate/rate_smoother.py)."""
    if parity.tells_alpha(case.array) or not has_rates(case.array):
        return by_fit(case, start).motion
    blocks = case.condensed
    on_blocks = smoothed_rates(case.array, blocks.time, blocks.readings, blocks.sigma)
    return at_rates(case.array, case.time, case.readings, on_blocks, blocks.time)


def _padgaonkar(case: Case, start: Start) -> Motion:
    """α of the 3-2-2-2 array [Takhounts09 eq 12], integrated; a0 from the triax at its centre."""
    found = nap.layout(case.array)
    if found is None:
        raise EstimationError(
            "no 3-2-2-2 array among the accelerometers",
            found=", ".join(case.array.channels),
            expected="a triax and three pairs on its axes",
            advice="use --method map, or ninacc for triaxes",
        )
    columns, arms = list(found[0]), found[1]
    require_readings(case.array.select(columns), case.readings[:, columns], each=True)
    y, centre = bridge(case.readings[:, columns], case.time), case.array.positions[columns[0]]
    alpha = y @ nap.alpha_rows(arms).T
    omega = _omega(case, alpha, start)
    a0 = rigid_body.acceleration_at(-centre, y[:, :3], alpha, omega)
    return Motion(omega, alpha, a0, "Padgaonkar's α of the 3-2-2-2 array, integrated")


def _product_free(case: Case, start: Start) -> Motion:
    held = _live(case)
    y = bridge(case.readings[:, held], case.time)
    omega0, rest = _beginning(case, start)
    return _integrated(case.array.positions[held], case.array.axes[held], y, case.time, omega0, rest)


def _integrated(
    positions: FloatArray, axes: FloatArray, y: FloatArray, time: FloatArray, omega0: FloatArray, rest: int | None
) -> Motion:
    """α without products of ω, integrated; a0 by least squares."""
    alpha = y @ rigid_body.product_free_alpha(positions, axes, leak=OFF_IDEAL).T
    turned = kinematics.integrate(alpha, time, omega0)
    omega = turned - (0.0 if rest is None else turned[rest])
    free = y - rigid_body.centripetal(positions, axes, omega)
    a0 = free @ np.linalg.pinv(rigid_body.design(positions, axes))[:3].T
    return Motion(omega, alpha, a0, "α without products of ω, integrated")


def _ninacc(case: Case, start: Start) -> Motion:
    held = _live(case)
    omega0, _ = _beginning(case, start)
    return ninacc.forward(case.array.select(held), case.time, case.readings[:, held], omega0, case.sigma[held] ** 2)


def _live(case: Case) -> list[int]:
    """Columns of the accelerometers that have a valid sample."""
    return np.flatnonzero(case.array.is_accelerometer & case.valid.any(axis=0)).tolist()


def _six_accelerometers(case: Case, start: Start) -> Motion:
    """[Becker75]; the method's text carries the warning beyond a quarter turn."""
    omega0, _ = _beginning(case, start)
    return growth.motion(case.array, case.time, bridge(case.readings, case.time), omega0)[0]


def _rates(case: Case, start: Start) -> Motion:
    del start
    if not has_rates(case.array):
        raise EstimationError(
            "no rate sensors on three axes",
            found=f"{int((~case.array.is_accelerometer).sum())} rate sensors",
            expected="three or more, axes of rank 3",
            advice="add some, or use --method map where the accelerometers tell α",
        )
    require_acceleration(case.array)
    rest = None if case.rest is None else case.rest.start
    found = estimate_motion(case.array, case.time, case.readings, case.sigma, rest)
    omega, alpha, a0 = (bridge(v, case.time) for v in (found.omega, found.alpha, found.a0))
    return Motion(omega, alpha, a0, found.method)


def _with_rates(scheme: Callable[[SensorArray, FloatArray, FloatArray, FloatArray], Motion]) -> Method:
    """A scheme that measures ω: nothing needs to be known of the start."""

    def solve(case: Case, start: Start) -> Motion:
        del start
        return scheme(case.array, case.time, case.readings, case.sigma)

    return solve


def _rgla(derivative: rgla.Derivative) -> Method:
    """Hu's scheme; attitude comes from the orthonormal recursion, and what the printed one would do is said."""
    scheme = _with_rates(partial(rgla.motion, derivative=derivative))

    def solve(case: Case, start: Start) -> Motion:
        found = scheme(case, start)
        said = f"direction cosines orthonormal; as printed: {rgla.as_printed(found.omega, found.a0, case.time)}"
        return Motion(found.omega, found.alpha, found.a0, f"{found.method}; {said}")

    return solve


def _beginning(case: Case, start: Start) -> tuple[FloatArray, int | None]:
    """ω(0), and the sample at which ω is to be 0 where that is what is known.

    EstimationError where neither the user nor a quiet interval tells.
    """
    if start.omega is not None:
        return np.asarray(start.omega, dtype=np.float64), None
    if case.rest is None or case.rest.start > 0.5 * len(case.time):
        raise EstimationError(
            "ω at the first sample is not known",
            found="no quiet interval before the event",
            advice="state it with --omega, or state [recording] pre_trigger in the rig file, with the body at rest",
        )
    return np.zeros(3), case.rest.start


def _omega(case: Case, alpha: FloatArray, start: Start) -> FloatArray:
    omega0, rest = _beginning(case, start)
    turned = kinematics.integrate(alpha, case.time, omega0)
    return np.asarray(turned - (0.0 if rest is None else turned[rest]))


METHODS: Final[Mapping[str, tuple[Method, str]]] = {
    "map": (_map, "whole-record maximum a posteriori fit of all channels, with uncertainties"),
    "padgaonkar": (_padgaonkar, "3-2-2-2: α without feedback, integrated"),
    "ninacc": (_ninacc, "triaxes anywhere: least squares, ω fed back by predictor-corrector [Alem77]"),
    "six-accelerometers": (_six_accelerometers, "3-2-1: six unknowns of six, ω fed back step by step [Becker75]"),
    "product-free": (_product_free, "any array that gives α without products of ω, integrated"),
    "rates": (_rates, "rate sensors on three axes, α from the accelerometers or by differences"),
    "periphery": (_with_rates(martin.periphery), "triaxes on three axes and rate sensors [Martin98 eqs 8-13]"),
    "co-planar": (_with_rates(martin.coplanar), "triaxes at the origin and on two axes, rate sensors [Martin98]"),
    "compact-cube": (_with_rates(martin.compact_cube), "one triax and rate sensors, α by differences [Martin98]"),
    "rgla": (_rgla("five-point"), "accelerometers at the origin and rate sensors, five-point derivative [Hu77]"),
    "rgla-fourier": (_rgla("fourier"), "the same, derivative of a truncated Fourier series"),
    "rgla-lanczos": (_rgla("lanczos"), "the same, derivative of a Fourier series with Lanczos factors"),
}
"""Name -> function and what it does."""


ACCELEROMETERS_ONLY: Final = ("padgaonkar", "ninacc", "six-accelerometers", "product-free")
"""Methods that do not use rate sensors."""


def method_named(name: str) -> Method:
    """The method of that name; ConfigurationError names the nearest."""
    if name in METHODS:
        return METHODS[name][0]
    near = get_close_matches(name, METHODS, n=1)
    raise ConfigurationError(
        "unknown method",
        place="--method",
        found=name,
        expected="one of " + ", ".join(METHODS),
        advice=f"did you mean {near[0]}?" if near else None,
    )
