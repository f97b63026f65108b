"""ZO: zero offsets before and after the event, agreement at rest, drift.

Limits hold what a healthy sensor may show plus U, so that a healthy channel passes with its guard band.
At rest α = ω = 0, so all accelerometers feel the same vector a0 and all rate sensors ω = 0 (METHODS.md 3).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nineaudit.array import FloatArray
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
    return noise_level(case.recording.readings, quiet.samples) / np.sqrt(quiet.stop - quiet.start)


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


def _departures(case: Case, mean: FloatArray) -> FloatArray:
    """(k,) what no common a0 explains in means at rest: accelerometers less n·a0, rate sensors as they are.

    Each accelerometer is compared with the others only (leave-one-out), so that one bad channel cannot drag a0
    towards itself: y_i − ŷ_(−i) = e_i/(1 − h_ii), NaN where no other determines it.
    """
    out = mean.copy()
    held = np.flatnonzero(case.array.is_accelerometer & np.isfinite(mean))
    axes = case.array.axes[held]
    if not len(held):
        return out
    hat = axes @ np.linalg.pinv(axes)
    free = 1.0 - np.diag(hat)
    residual = mean[held] - hat @ mean[held]
    out[held] = np.where(free > 1e-6, residual / np.maximum(free, 1e-6), np.nan)
    return out


def same_axis_agreement(case: Case, *, budget_sd: float) -> Sequence[Measure] | NotApplicable:
    """ZO103: at rest every accelerometer must show its component of one common vector, within its zero offset.

    Budget of a departure: its own and the others' zero offsets, and their tilt and gain against gravity.
    """
    rest = case.required_rest
    mean = _mean(case.recording.readings, rest)
    departure = _departures(case, mean)
    sensors = case.array.sensors
    u = [np.hypot(s.u_zero, G0 * np.hypot(s.u_alignment, s.u_gain)) for s in sensors]
    checked = [i for i, s in enumerate(sensors) if s.kind == "accelerometer" and np.isfinite(departure[i])]
    if not checked:
        return NotApplicable("no two accelerometers sense the same direction")
    return [
        _departure_measure(case, i, departure[i], np.array(u), _u_mean(case, rest), rest, budget_sd)
        for i in checked
    ]


def _departure_measure(
    case: Case, i: int, departure: float, u: FloatArray, spread: FloatArray, quiet: Quiet, budget_sd: float
) -> Measure:
    """Departure of channel `i` against the offsets `u` (k,) allowed to all; `spread` (k,) of the means."""
    share, sensor = _departure_shares(case)[i], case.array.sensors[i]
    noise = float(np.sqrt(share**2 @ spread**2))
    return Measure(
        value=float(abs(departure)),
        limit=float(budget_sd * np.sqrt(share**2 @ u**2)) + COVERAGE_FACTOR * noise,
        unit=_unit(sensor.kind),
        u=noise,
        channels=(sensor.channel,),
        interval=(quiet.t_start, quiet.t_end),
    )


def _departure_shares(case: Case) -> FloatArray:
    """(k,k) response of each departure to an offset of each channel."""
    return np.nan_to_num(np.stack([_departures(case, e) for e in np.eye(len(case.array))], axis=1))


def zero_after(case: Case, *, budget_sd: float) -> Sequence[Measure] | NotApplicable:
    """ZO102: has the zero moved during the event? Departures at the end of the record less those before it.

    Only where the record ends at rest; gravity, which the head may now feel in another direction, is common to
    the accelerometers and drops out. A channel that no other checks at rest (its direction alone) is left out.
    """
    rest, end = case.required_rest, quiet_end(case.time, case.recording.readings, case.sigma)
    if end is None or end.start < rest.stop:
        return NotApplicable("the record does not end at rest")
    turning = float(np.linalg.norm(case.motion.omega[end.samples], axis=1).max())
    reach = float(np.linalg.norm(case.array.positions - case.array.positions.mean(axis=0), axis=1).max())
    if reach * turning**2 > float(np.median(case.array.values("u_zero")[case.array.is_accelerometer])):
        return NotApplicable(f"the body seems to turn at {turning:.3g} rad/s at the end of the record")
    before, after = (_departures(case, _mean(case.recording.readings, q)) for q in (rest, end))
    spread = np.hypot(_u_mean(case, rest), _u_mean(case, end))
    sensors = case.array.sensors
    # what is left of the stated zero, and gravity turned by up to 2 g seen through tilt and gain
    turned = [2.0 * G0 * np.hypot(s.u_alignment, s.u_gain) * (s.kind == "accelerometer") for s in sensors]
    u = np.hypot([s.u_zero for s in sensors], turned)
    moved = after - before
    return [
        _departure_measure(case, i, moved[i], u, spread, end, budget_sd)
        for i in range(len(sensors))
        if np.isfinite(moved[i])
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
    moved = np.abs(t @ values) / (t @ t) * ahead
    u = noise_level(case.recording.readings, rest.samples) / np.sqrt(t @ t) * ahead
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
