"""The channel gallery: every channel raw with its flagged samples and its zero, and its spectrum beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.physics.spectrum import density
from nineaudit.report.chart import Chart, Flags, Level, Line
from nineaudit.report.figures import Figure, figure
from nineaudit.report.numbers import digits, quantity, sensor_edge, spelled
from nineaudit.units import counted

if TYPE_CHECKING:
    from nineaudit.auditing import Audit

DECADES_SHOWN = 6.0
"""Of a spectrum, below its peak; what is further down is rounding."""


def gallery(audit: Audit, marked: Sequence[str]) -> list[Figure]:
    """Each channel as recorded and its spectrum, in turn; `marked` channels are the diagnosis'."""
    return [f for k in range(len(audit.recording.channels)) for f in (_raw(audit, k, marked), _spectrum(audit, k))]


def _raw(audit: Audit, k: int, marked: Sequence[str]) -> Figure:
    recording = audit.recording
    sensor = recording.rig.array.sensors[k]
    unit, one = sensor_edge(sensor, recording.rig)
    values = recording.readings[:, k] / one
    mask = _flagged(audit, sensor.channel)
    missing = int(np.sum(~np.isfinite(values)))
    facts = [f"{sensor.kind}, {_reach(values, unit)}"]
    facts += [f"range ±{quantity(sensor.full_scale / one, unit)}"] if sensor.full_scale else []
    facts += [f"zero {quantity(float(audit.zero[k]) / one, unit)}"] if audit.rest else []
    facts += [f"{counted(int(mask.sum()), 'sample')} flagged"] if mask.any() else []
    facts += [f"{counted(missing, 'sample')} invalid or missing"] if missing else []
    levels = [] if sensor.full_scale is None else [Level(sign * sensor.full_scale / one, "range") for sign in (1, -1)]
    levels += [Level(float(audit.zero[k]) / one, "zero")] if audit.rest else []
    chart = Chart(
        key=f"channel-{k}",
        title=f"{sensor.channel} as recorded",
        description="; ".join(facts) + ".",
        time=recording.time,
        unit=spelled(unit),
        lines=(Line(values, "measured", ""),),
        flags=(Flags(values, mask, "flagged sample"),),
        levels=tuple(levels),
        height=130,
        columns=600,
        recorded=True,
    )
    note = "named by the diagnosis" if sensor.channel in marked else ""
    return figure(chart, "; ".join(facts), sensor.channel, note)


def _spectrum(audit: Audit, k: int) -> Figure:
    recording = audit.recording
    sensor = recording.rig.array.sensors[k]
    unit, one = sensor_edge(sensor, recording.rig)
    name = sensor.channel
    frequency, found = density(recording.readings[:, k] / one, recording.rate)
    there = found > 0
    if there.sum() < 2:
        return Figure("", f"{name}: no spectrum, for too few samples are valid or all are alike.")
    f, d = np.log10(frequency[there]), np.log10(found[there])
    d = np.maximum(d, d.max() - DECADES_SHOWN)
    peak = float(frequency[there][int(np.argmax(d))])
    told = f"most at {quantity(peak, 'Hz')}; median {quantity(float(np.median(found[there])), unit)}/√Hz"
    chart = Chart(
        key=f"spectrum-{k}",
        title=f"Spectrum of {name}",
        description=f"Amplitude spectral density, both axes logarithmic; {told}.",
        time=f,
        unit=f"{spelled(unit)}/√Hz",
        lines=(Line(d, "measured", ""),),
        height=130,
        columns=300,
        zooms=False,
        across=_decades(float(f[0]), float(f[-1])),
        across_label="frequency, Hz",
        up=_decades(float(d.min()) - 1.0, float(d.max()) + 1.0),
    )
    return figure(chart, f"{name}: amplitude spectral density, {told}")


def _decades(low: float, high: float) -> tuple[tuple[float, str], ...]:
    """(exponent, word) of each power of ten between two exponents; of half of them where they are many."""
    first, last = math.ceil(low - 1e-9), math.floor(high + 1e-9)
    by = 1 if last - first <= 5 else 2
    return tuple((float(e), digits(10.0**e)) for e in range(first, last + 1, by))


def _flagged(audit: Audit, channel: str) -> BoolArray:
    mask = audit.flagged.get(channel)
    return np.zeros(len(audit.recording.time), dtype=np.bool_) if mask is None else np.asarray(mask, dtype=np.bool_)


def _reach(values: FloatArray, unit: str) -> str:
    finite = values[np.isfinite(values)]
    if not finite.size:
        return "no valid sample"
    return f"{digits(float(finite.min()))} to {quantity(float(finite.max()), unit)}"
