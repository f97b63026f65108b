"""RQ205-206: noise at rest against what the rig states, and the quantisation step against the noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nineaudit.array import FloatArray, Sensor
from nineaudit.case import Case
from nineaudit.estimate.evidence import resolution
from nineaudit.finding import Measure, NotApplicable
from nineaudit.recording import Trace

FEWEST = 8
"""Samples at rest without which a standard deviation says nothing."""


def noise_level(case: Case, *, max_ratio: float) -> Sequence[Measure] | NotApplicable:
    """RQ205: standard deviation at rest against `max_ratio` times the stated noise.

    A straight line is taken off first, since slow drift is another rule's affair. u = s/√(2(n−2)), the standard
    uncertainty of a standard deviation of n samples about a line (GUM E.4.3), for independent samples.
    """
    stated = [s for s in case.array.sensors if s.noise is not None]
    if not stated:
        return NotApplicable("the rig states no noise level")
    rest = case.required_rest
    traces = {trace.channel: trace for trace in case.recording.native}
    out = []
    for sensor in stated:
        window, count = _at_rest(traces[sensor.channel], rest.t_start, rest.t_end)
        level = np.nan if count < FEWEST else float(np.sqrt(np.sum(window**2) / (count - 2)))
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
    for sensor, sigma, trace in zip(case.array.sensors, case.sigma, _in_order(case), strict=True):
        step = resolution(trace.values)
        out.append(
            Measure(
                value=step / float(np.sqrt(12.0)),
                limit=max_ratio * float(sigma),
                unit=_unit(sensor),
                channels=(sensor.channel,),
                detail="noise of rounding",
            )
        )
    return out


def _at_rest(trace: Trace, start: float, end: float) -> tuple[FloatArray, int]:
    """Finite samples of a trace between two times, less their straight line, and how many there are."""
    inside = (trace.time >= start) & (trace.time <= end) & np.isfinite(trace.values)
    time, values = trace.time[inside], trace.values[inside]
    if values.size < FEWEST:
        return values, int(values.size)
    design = np.stack([np.ones_like(time), time - time.mean()], axis=1)
    fitted = design @ np.linalg.lstsq(design, values, rcond=None)[0]
    return values - fitted, int(values.size)


def _in_order(case: Case) -> list[Trace]:
    traces = {trace.channel: trace for trace in case.recording.native}
    return [traces[name] for name in case.recording.channels]


def _unit(sensor: Sensor) -> str:
    return "m/s^2" if sensor.kind == "accelerometer" else "rad/s"


CHECKS = {"RQ205": noise_level, "RQ206": quantisation}
