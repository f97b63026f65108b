"""Faults applied to a recording's readings, in the order given."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Literal

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import ConfigurationError
from nineaudit.rig import Rig
from nineaudit.simulate.faults import Scene, peak
from nineaudit.simulate.instrument import Instrument, filters_at
from nineaudit.simulate.truth import Truth
from nineaudit.simulate.words import FAULTS, PEAK, Fault, FaultKind, fault_kind, unknown_name
from nineaudit.units import factor

CLASSES: Final = (60.0, 180.0, 600.0, 1000.0)


def inject(
    readings: FloatArray,
    faults: Sequence[Fault],
    rig: Rig,
    truth: Truth,
    instrument: Instrument,
    streams: Sequence[np.random.SeedSequence],
) -> FloatArray:
    """(n,k) readings with the faults, invalid samples NaN; `readings` (n,k) SI stay as they are.

    One seed stream for each fault. Raises ConfigurationError for an unknown channel or fault and for a value
    that is out of its bounds.
    """
    out = np.array(readings)
    for fault, stream in zip(faults, streams, strict=True):
        i = column(rig, fault.channel, fault)
        rng = np.random.default_rng(stream)
        scene = Scene(rig.array.sensors[i], i, out.copy(), truth, instrument, rng, _moment(fault, truth), fault.mode)
        value = resolve(fault, rig, scene)
        out[:, i] = FAULTS[fault.kind].apply(scene, value)
        if fault.kind == "swap":
            out[:, int(value)] = scene.column
    return out


def column(rig: Rig, channel: str, fault: Fault) -> int:
    """Column of a channel; ConfigurationError names the nearest."""
    if channel not in rig.array.channels:
        raise unknown_name("the rig has no such channel", channel, rig.array.channels, str(fault))
    return rig.array.index(channel)


def resolve(fault: Fault, rig: Rig, scene: Scene) -> float:
    """The value of a fault in SI (a column for a swap), within its bounds."""
    kind, sensor = fault_kind(fault.kind), scene.sensor
    if kind.accelerometers_only and sensor.kind == "gyroscope":
        raise _wrong(fault, "a rate sensor reads the same everywhere", "an accelerometer")
    if kind.quantity == "channel":
        return float(_partner(fault, rig, scene))
    if kind.quantity == "nothing":
        return 0.0
    value = (_default(fault, kind) if fault.value is None else fault.value) * _scale(fault, kind, rig, scene)
    _check_bounds(fault, kind, value)
    if kind.quantity == "class" and not filters_at(value, scene.rate):
        raise _wrong(fault, f"sampled too slowly for CFC{value:g}", f"{10 * value:g} Hz at least")
    return value


def _scale(fault: Fault, kind: FaultKind, rig: Rig, scene: Scene) -> float:
    """SI value of one unit of the fault's value."""
    place = f"--fault {fault}"
    if kind.quantity == "level":
        if fault.value is None or fault.unit == PEAK:
            return peak(scene.column)
        quantity: Literal["acceleration", "angular_rate"] = (
            "angular_rate" if scene.sensor.kind == "gyroscope" else "acceleration"
        )
        return scene.sensor.to_si if fault.unit is None else factor(fault.unit, quantity, place=place)
    if kind.quantity == "length" and fault.value is not None:
        return factor(fault.unit or rig.units.length, "length", place=place)
    return 1.0


def _default(fault: Fault, kind: FaultKind) -> float:
    if kind.default is None:
        raise _wrong(fault, "a value is needed", kind.unit)
    return kind.default


def _partner(fault: Fault, rig: Rig, scene: Scene) -> int:
    if fault.partner is None:
        raise _wrong(fault, "a swap needs the other channel", "CHANNEL:swap=OTHER")
    partner = column(rig, fault.partner, fault)
    if partner == scene.index or rig.array.sensors[partner].kind != scene.sensor.kind:
        raise _wrong(fault, "these cannot be swapped", f"another {scene.sensor.kind}")
    return partner


def _check_bounds(fault: Fault, kind: FaultKind, value: float) -> None:
    """`value` in SI."""
    if math.isnan(value) or (math.isinf(value) and fault.value is not None):
        raise _wrong(fault, "the value is not a finite number", kind.unit)
    if kind.quantity == "class" and value not in CLASSES:
        raise _wrong(fault, "no such channel frequency class", kind.unit)
    # a part of the peak of a channel that reads nothing is nothing, and does no harm
    at_rest = kind.quantity == "level" and value == 0
    whole = value == kind.default == math.inf
    if not (at_rest or whole or kind.low < value < kind.high):
        high = "" if math.isinf(kind.high) else f" and under {kind.high:g}"
        raise _wrong(fault, "the value is out of bounds", f"more than {kind.low:g}{high}")


def _moment(fault: Fault, truth: Truth) -> float | None:
    """When it happens; ConfigurationError for a time or mode that the fault does not know."""
    kind = fault_kind(fault.kind)
    if fault.mode is not None and fault.mode not in kind.modes:
        raise _wrong(fault, "no such mode of the fault", " ".join(kind.modes) or "none")
    if fault.at is not None and not kind.timed:
        raise _wrong(fault, f"{fault.kind} has no beginning", "no @TIME")
    if fault.at is not None and not truth.time[0] <= fault.at < truth.time[-1]:
        raise _wrong(fault, "the time is not in the recording", f"{truth.time[0]:g} s to {truth.time[-1]:g} s")
    return fault.at


def _wrong(fault: Fault, what: str, expected: str) -> ConfigurationError:
    return ConfigurationError(what, place="--fault", found=str(fault), expected=expected)
