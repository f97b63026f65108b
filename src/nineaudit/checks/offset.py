"""ZO: zero offsets before and after the event, agreement at rest, drift.

Limits hold what a healthy sensor may show plus U, so that a healthy channel passes with its guard band.
At rest α = ω = 0, so all accelerometers feel the same vector a0 and all rate sensors ω = 0 (METHODS.md 3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.case import Case
from nineaudit.estimate.quiet import Quiet, noise_level, quiet_end
from nineaudit.finding import COVERAGE_FACTOR, Measure, NotApplicable
from nineaudit.units import G0


def _unit(kind: str) -> str:
    return "m/s^2" if kind == "accelerometer" else "rad/s"


def _mean(values: FloatArray, quiet: Quiet) -> FloatArray:
    """(k,) mean over a quiet interval, NaN without a valid sample."""
    window = values[quiet.samples]
    count = np.isfinite(window).sum(axis=0)
    return np.where(count > 0, np.nansum(window, axis=0) / np.maximum(count, 1), np.nan)


def _u_mean(case: Case, quiet: Quiet) -> FloatArray:
    """(k,) standard uncertainty of a mean: sd/√N of the samples in it."""
    return np.asarray(noise_level(case.recording.readings, quiet.samples) / np.sqrt(quiet.stop - quiet.start))


def zero_before(case: Case, *, offset_sd: float, full_scale_part: float) -> Sequence[Measure]:
    """ZO101: mean before the event. Accelerometers may show gravity (1 g) besides their zero offset.

    Limit: `offset_sd` of the stated zero uncertainty or `full_scale_part` of the range, whichever is larger.
    """
    rest = case.required_rest
    mean, u = _mean(case.recording.readings, rest), _u_mean(case, rest)
    return [
        Measure(
            value=float(abs(mean[i])),
            limit=max(offset_sd * s.u_zero, full_scale_part * (s.full_scale or 0.0))
            + (G0 if s.kind == "accelerometer" else 0.0)
            + float(COVERAGE_FACTOR * u[i]),
            unit=_unit(s.kind),
            u=float(u[i]),
            channels=(s.channel,),
            interval=(rest.t_start, rest.t_end),
        )
        for i, s in enumerate(case.array.sensors)
        if np.isfinite(mean[i])
    ]


@dataclass(frozen=True, eq=False)
class Departures:
    """What no common a0 explains in means at rest: `value` (k,), NaN where no other channel determines it, and
    `share` (k,k) its response to an offset of each channel."""

    value: FloatArray
    share: FloatArray


def _departures(case: Case, mean: FloatArray, u: FloatArray, budget_sd: float) -> Departures:
    """Accelerometers against the a0 of the *others*, y_i − n_i·â0 (without i); rate sensors as they are.

    One bad channel drags the a0 of all that it takes part in. The worst is therefore set aside, while it exceeds
    `budget_sd` of its budget from the offsets `u` (k,) and those that stay still check one another; what was set
    aside is measured against those that stay.
    """
    trusted = case.array.is_accelerometer & np.isfinite(mean)
    while True:
        found = _against(case, mean, trusted)
        excess = np.abs(found.value) / np.sqrt(found.share**2 @ u**2 + 1e-300)
        excess = np.where(trusted & np.isfinite(excess), excess, 0.0)
        worst = int(np.argmax(excess))
        fewer = trusted & (np.arange(len(mean)) != worst)
        if excess[worst] <= budget_sd or not _redundant(case.array.axes[fewer], case.array.axes[worst]):
            return found
        trusted = fewer


def _redundant(axes: FloatArray, axis: FloatArray) -> bool:
    """Whether sensors of `axes` (m,3) check one another in the direction of `axis` (3,)."""
    leverage = axis @ np.linalg.pinv(axes)
    return bool(np.linalg.norm(axis - leverage @ axes) < 1e-6 and (np.abs(leverage) > 0.1).sum() > 1)


def _against(case: Case, mean: FloatArray, trusted: BoolArray) -> Departures:
    """Departures from the a0 of the `trusted` (k,) accelerometers, each without itself."""
    count, axes = len(mean), case.array.axes
    value, share = mean.copy(), np.eye(count)
    for i in np.flatnonzero(case.array.is_accelerometer):
        others = np.flatnonzero(trusted & (np.arange(count) != i))
        weights = axes[i] @ np.linalg.pinv(axes[others]) if len(others) else np.zeros(0)
        determined = len(others) > 0 and np.linalg.norm(axes[i] - weights @ axes[others]) < 1e-6
        share[i, others] = -weights
        value[i] = mean[i] - weights @ mean[others] if determined else np.nan
    return Departures(value, share)


def same_axis_agreement(case: Case, *, budget_sd: float) -> Sequence[Measure] | NotApplicable:
    """ZO103: at rest every accelerometer must show its component of one common vector, within its zero offset.

    Budget of a departure: its own and the others' zero offsets, and their tilt and gain against gravity.
    """
    rest = case.required_rest
    u = _allowed(case, G0)
    found = _departures(case, _mean(case.recording.readings, rest), u, budget_sd)
    checked = np.flatnonzero(case.array.is_accelerometer & np.isfinite(found.value)).tolist()
    if not checked:
        return NotApplicable("no two accelerometers sense the same direction")
    spread = _u_mean(case, rest)
    return [_measure(case, i, found.value[i], found.share[i], u, spread, rest, budget_sd) for i in checked]


def _allowed(case: Case, gravity: float) -> FloatArray:
    """(k,) offset a healthy channel may show at rest: its zero, and `gravity` seen through its tilt and gain."""
    return np.array(
        [
            np.hypot(s.u_zero, gravity * np.hypot(s.u_alignment, s.u_gain) * (s.kind == "accelerometer"))
            for s in case.array.sensors
        ]
    )


def _measure(
    case: Case,
    i: int,
    departure: float,
    share: FloatArray,
    u: FloatArray,
    spread: FloatArray,
    quiet: Quiet,
    budget_sd: float,
) -> Measure:
    """Departure of channel `i` against the offsets `u` (k,) allowed to all; `spread` (k,) of the means."""
    sensor = case.array.sensors[i]
    noise = float(np.sqrt(share**2 @ spread**2))
    return Measure(
        value=float(abs(departure)),
        limit=float(budget_sd * np.sqrt(share**2 @ u**2)) + COVERAGE_FACTOR * noise,
        unit=_unit(sensor.kind),
        u=noise,
        channels=(sensor.channel,),
        interval=(quiet.t_start, quiet.t_end),
    )


def zero_after(case: Case, *, budget_sd: float) -> Sequence[Measure] | NotApplicable:
    """ZO102: has the zero moved during the event? Departures at the end of the record less those before it.

    Only where the record ends at rest; gravity, which the head may now feel in another direction (by up to 2 g),
    is common to the accelerometers and drops out. A channel that no other checks at rest is left out.
    """
    rest, end = case.required_rest, quiet_end(case.time, case.recording.readings, case.sigma)
    if end is None or end.start < rest.stop:
        return NotApplicable("the record does not end at rest")
    turning = float(np.linalg.norm(case.motion.omega[end.samples], axis=1).max())
    reach = float(np.linalg.norm(case.array.positions - case.array.positions.mean(axis=0), axis=1).max())
    if reach * turning**2 > float(np.median(case.array.values("u_zero")[case.array.is_accelerometer])):
        return NotApplicable(f"the body seems to turn at {turning:.3g} rad/s at the end of the record")
    u = _allowed(case, 2.0 * G0)
    before, after = (_mean(case.recording.readings, q) for q in (rest, end))
    found = _departures(case, after - before, u, budget_sd)
    spread = np.hypot(_u_mean(case, rest), _u_mean(case, end))
    return [
        _measure(case, i, found.value[i], found.share[i], u, spread, end, budget_sd)
        for i in np.flatnonzero(np.isfinite(found.value)).tolist()
    ]


def drift(case: Case, *, budget_sd: float) -> Sequence[Measure] | NotApplicable:
    """ZO104: slope over the quiet interval, carried on to the end of the record, against the zero uncertainty.

    Its standard uncertainty is that of a fitted line, σ √12 / (T √N) per second. An interval too short to show
    a drift of the limit's size in any channel has nothing to say.
    """
    rest = case.required_rest
    t = case.time[rest.samples] - case.time[rest.samples].mean()
    values = np.nan_to_num(case.readings[rest.samples])
    ahead = float(case.time[-1] - rest.t_start)
    slope = (t @ values) / (t @ t)
    left = noise_level(values - t[:, None] * slope, slice(None))
    moved, u = np.abs(slope) * ahead, left / np.sqrt(t @ t) * ahead
    allowed = budget_sd * case.array.values("u_zero")
    telling = (COVERAGE_FACTOR * u < allowed) & np.isfinite(case.readings[rest.samples]).any(axis=0)
    if not telling.any():
        return NotApplicable(
            f"the quiet interval of {rest.t_end - rest.t_start:.3g} s is too short to show a drift that matters "
            f"over {ahead:.3g} s"
        )
    return [
        Measure(
            value=float(moved[i]),
            limit=float(allowed[i] + COVERAGE_FACTOR * u[i]),
            unit=_unit(s.kind),
            u=float(u[i]),
            channels=(s.channel,),
            interval=(rest.t_start, rest.t_end),
            detail="extrapolated to the end of the record",
        )
        for i, s in enumerate(case.array.sensors)
        if telling[i]
    ]


CHECKS = {"ZO101": zero_before, "ZO102": zero_after, "ZO103": same_axis_agreement, "ZO104": drift}
