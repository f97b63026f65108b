"""RQ205-207: noise at rest against what the rig states, either way, and the quantisation step against the noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nineaudit.array import FloatArray, Sensor
from nineaudit.case import Case
from nineaudit.estimate import parity
from nineaudit.estimate.evidence import resolution
from nineaudit.estimate.quiet import Quiet
from nineaudit.estimate.search import FEW_CHANNELS
from nineaudit.finding import Measure, NotApplicable
from nineaudit.recording import Trace

FEWEST = 8
"""Samples at rest without which a standard deviation says nothing."""
LEAST = 1e-6
"""Part of the stated noise that counts as no scatter at all: the record is computed, or nothing is connected."""
KINDS = {"accelerometer": "accelerometers", "gyroscope": "rate sensors"}


def noise_level(case: Case, *, max_ratio: float) -> Sequence[Measure] | NotApplicable:
    """RQ205: standard deviation at rest against `max_ratio` times the stated noise.

    u = s/√(2(n−2)), the standard uncertainty of a standard deviation of n independent samples about a line
    (GUM E.4.3).
    """
    stated = [s for s in case.array.sensors if s.noise is not None]
    if not stated:
        return NotApplicable("the rig states no noise level")
    rest = case.required_rest
    traces = {trace.channel: trace for trace in case.recording.native}
    out = []
    for sensor in stated:
        level, count = _scatter(traces[sensor.channel], rest)
        out.append(
            Measure(
                value=level,
                limit=max_ratio * float(sensor.noise or 0.0),
                unit=_unit(sensor),
                u=level / float(np.sqrt(2.0 * max(count - 2, 1))),
                channels=(sensor.channel,),
                interval=(rest.t_start, rest.t_end),
                detail="noise at rest",
            )
        )
    return out


def quantisation(case: Case, *, max_ratio: float) -> Sequence[Measure]:
    """RQ206: rounding noise, step/√12 (GUM F.2.2.1), against `max_ratio` times the channel's noise."""
    out = []
    for sensor, sigma, trace in zip(case.array.sensors, case.noise, _in_order(case), strict=True):
        step = resolution(trace.values)
        noise = float(sigma) if sigma > 1e-6 * step else 0.0  # less is rounding of the arithmetic
        out.append(
            Measure(
                value=step / float(np.sqrt(12.0)),
                limit=max_ratio * noise,
                unit=_unit(sensor),
                channels=(sensor.channel,),
                detail="noise of rounding",
            )
        )
    return out


def too_quiet(case: Case, *, max_ratio: float) -> Sequence[Measure] | NotApplicable:
    """RQ207: the stated noise over what the sensors of a kind scatter at rest (median of the channels, rounding counted
    in), against `max_ratio`. Without rest: 1/√ of what the record costs per degree of freedom, which is near 1 in the
    stated noise; EstimationError where no motion is told either.

    A unit that makes all readings too small hides every fault in the stated noise.
    """
    if all(s.noise is None for s in case.array.sensors):
        return NotApplicable("the rig states no noise level")
    if case.rest is None and parity.redundant(case.array) and len(case.array) <= FEW_CHANNELS:
        ratio = 1.0 / max(float(np.sqrt(case.statistic)), LEAST)
        return [Measure(ratio, max_ratio, "1", detail="stated noise over what the whole record leaves,")]
    rest, traces = case.required_rest, {trace.channel: trace for trace in case.recording.native}
    found = []
    for kind, name in KINDS.items():
        stated = [s for s in case.array.sensors if s.kind == kind and s.noise]
        over = [x for s in stated if np.isfinite(x := _stated_over(float(s.noise or 0.0), traces[s.channel], rest))]
        if over:
            ratio, count = float(np.median(over)), rest.stop - rest.start
            found.append(
                Measure(
                    value=ratio,
                    limit=max_ratio,
                    unit="1",
                    u=ratio / float(np.sqrt(2.0 * max(count - 2, 1))),
                    interval=(rest.t_start, rest.t_end),
                    detail=f"stated noise over scatter at rest of the {name}",
                )
            )
    return found


def _stated_over(stated: float, trace: Trace, rest: Quiet) -> float:
    """Stated noise over the scatter of a trace about a line, rounding noise (step/√12, GUM F.2.2.1) counted in."""
    level, _ = _about_line(trace, rest)
    return stated / max(float(np.hypot(level, resolution(trace.values) / np.sqrt(12.0))), LEAST * stated)


def _scatter(trace: Trace, rest: Quiet) -> tuple[float, int]:
    """Noise standard deviation of a trace at rest, NaN where too few samples tell it; and how many do.

    About a straight line, since slow drift is another rule's affair. Where the interval was found, not stated,
    the body may still stir: then the root mean square second difference over √6 if that is smaller, which slow
    movement hardly raises.
    """
    scatter, values = _about_line(trace, rest)
    if not rest.stated and values.size >= FEWEST:
        scatter = min(scatter, float(np.sqrt(np.mean(np.diff(values, n=2) ** 2) / 6.0)))
    return scatter, int(values.size)


def _about_line(trace: Trace, rest: Quiet) -> tuple[float, FloatArray]:
    """Standard deviation of a trace at rest about a line, NaN where too few samples tell it; and the samples."""
    inside = (trace.time >= rest.t_start) & (trace.time <= rest.t_end) & np.isfinite(trace.values)
    time, values = trace.time[inside], trace.values[inside]
    if values.size < FEWEST:
        return float("nan"), values
    design = np.stack([np.ones_like(time), time - time.mean()], axis=1)
    residual = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
    return float(np.sqrt(np.sum(residual**2) / (values.size - 2))), values


def _in_order(case: Case) -> list[Trace]:
    traces = {trace.channel: trace for trace in case.recording.native}
    return [traces[name] for name in case.recording.channels]


def _unit(sensor: Sensor) -> str:
    return "m/s^2" if sensor.kind == "accelerometer" else "rad/s"


CHECKS = {"RQ205": noise_level, "RQ206": quantisation, "RQ207": too_quiet}
