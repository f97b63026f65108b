"""A recording through a channel frequency class, once: the one way that commands filter readings (physics/filters.py).

What is filtered says so: its rig states the class, and noise levels are those behind it, so that nothing downstream
filters it again or takes its noise for white.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.case import Case
from nineaudit.estimate.motion import bridge
from nineaudit.physics import filters
from nineaudit.recording import Recording
from nineaudit.rig import Rig
from nineaudit.schemes.rgla import even_step

_FREQUENCIES = 4096


def filtered(recording: Recording, class_: float) -> Recording:
    """The recording with every channel filtered to `class_` (SAE J211-1); samples that are not valid stay so.

    Gaps are bridged by straight lines for the filter; a channel without a valid sample stays as it is. The traces as
    recorded (`native`) are kept: overload is looked for in raw data. Raises ConfigurationError: the rig states a class
    that leaves no room for this one, a class that is no positive number. EstimationError: sampled at less than 10 times
    the class, or unevenly.
    """
    rig, rate = recording.rig, 1.0 / even_step(recording.time, 2)
    filters.coefficients(class_, rate)
    filters.require_room(rate, class_, rig.cfc)
    out = np.array(recording.readings)
    for k in np.flatnonzero(recording.valid.any(axis=0)):
        column = filters.once(bridge(out[:, [k]], recording.time)[:, 0], rate, class_, rig.cfc)
        out[:, k] = np.where(recording.valid[:, k], column, np.nan)
    note = f"readings filtered to CFC{class_:g} (SAE J211-1)"
    source = replace(recording.source, notes=(*recording.source.notes, note))
    return replace(recording, readings=out, rig=_behind(rig, class_, rate), source=source)


def _behind(rig: Rig, class_: float, rate: float) -> Rig:
    """The rig of what comes out of the filter: its class, and of stated noise the part that the filter leaves."""
    left = np.sqrt(noise_left(class_, rate, rig.cfc))
    sensors = tuple(replace(s, noise=None if s.noise is None else s.noise * left) for s in rig.array.sensors)
    return replace(rig, filter_class=f"CFC{class_:g}", array=SensorArray(sensors))


def noise_left(class_: float, rate: float, already: float | None) -> float:
    """Variance of noise behind the filter over that before it, white or behind a class `already`.

    ∫|H H₀|² df / ∫|H₀|² df, H of the filter and H₀ of the one before.
    """
    frequency = (np.arange(_FREQUENCIES) + 0.5) / _FREQUENCIES * rate / 2.0
    before: FloatArray = np.ones(_FREQUENCIES)
    if already is not None and filters.fast_enough(rate, already):
        before = filters.response(frequency, already, rate) ** 2
    after = before * filters.response(frequency, class_, rate) ** 2
    return float(after.sum() / before.sum())


def note(case: Case) -> str | None:
    """A sentence where the rig states a class or the noise at rest shows one; None where there is neither.

    What is seen in the noise and what is stated are told apart, and both warn of filtering once more; and of a stated
    class that the recording was sampled too slowly for.
    """
    said = [text for text in (_class(case), _slow(case)) if text]
    return "; ".join(said) or None


def _class(case: Case) -> str | None:
    recording, rest = case.recording, case.rest
    stated = recording.rig.cfc
    noise = None if rest is None else recording.readings[rest.samples]
    seen = None if noise is None else filters.class_of_noise(noise, recording.rate)
    if stated is None and seen is None:
        return None
    again = "do not filter to it again: twice is −6 dB at its corner"
    if seen is None:
        return f"the rig states CFC{stated:g}, which the noise at rest neither shows nor denies; {again}"
    if stated is None:
        return f"the rig states no filter, but the noise at rest looks like CFC{seen:g}; {again}"
    if seen < stated:
        return f"the rig states CFC{stated:g}, but the noise at rest looks like CFC{seen:g}; {again}"
    if seen > stated:
        return f"the rig states CFC{stated:g}; the noise at rest shows no more than CFC{seen:g}; {again}"
    return f"the noise at rest shows the filter that the rig states, CFC{stated:g}; {again}"


def _slow(case: Case) -> str | None:
    class_, rate = case.recording.rig.cfc, case.recording.rate
    if class_ is None or filters.fast_enough(rate, class_):
        return None
    least = filters.SAMPLES_PER_CLASS * class_
    return (
        f"sampled at {rate:g} Hz, too slowly for CFC{class_:g}: at least {least:g} Hz (10 times the class, SAE J211-1)"
    )
