"""From the tables of a rig file to sensors in SI: preset and overrides merged, defaults filled in."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeVar

import numpy as np

from nineaudit.array import FloatArray, Kind, Sensor, frozen
from nineaudit.errors import ConfigurationError
from nineaudit.presets import DEFAULT_ARM, PresetSensor, check_arms, find_preset
from nineaudit.rig_file import describe, table_place
from nineaudit.rig_schema import RigFile, SensorTable
from nineaudit.units import G0, factor

# Defaults of [uncertainty], SI: those of the INTERFACE.md example, as the descriptions in rig_schema.py say.
U_GAIN: Final = 0.005
U_ZERO: Final[Mapping[Kind, float]] = {"accelerometer": 0.1 * G0, "gyroscope": 0.1}
U_ALIGNMENT_DEG: Final = 0.5
U_POSITION: Final = 0.5e-3
U_TIMING: Final = 1e-5

# SI value of one unit of what a sensitivity in mV is stated for: g_0 or deg/s.
_PER_MILLIVOLT: Final[Mapping[Kind, float]] = {"accelerometer": G0, "gyroscope": math.pi / 180.0}

T = TypeVar("T")


@dataclass(frozen=True)
class _Entry:
    """One channel as merged, and where it is described."""

    table: SensorTable
    place: str
    path: Path | None

    def need(self, value: T | None, key: str, advice: str | None = None) -> T:
        if value is None:
            raise ConfigurationError(
                f"missing key {key!r}",
                file=self.path,
                place=self.place,
                expected=describe("sensor", key),
                advice=advice,
            )
        return value


def build_sensors(tables: RigFile, path: Path | None) -> tuple[Sensor, ...]:
    """The preset's sensors as overridden, then the others, in the order of the file.

    Raises ConfigurationError: no sensors, a channel or signal twice, missing key, unknown preset, wrong arms.
    """
    numbered = [(f"[[sensor]] {i}", s.channel) for i, s in enumerate(tables.sensor, 1)]
    check_unique("channel", numbered, path)
    entries = _entries(tables, path)
    if not entries:
        raise ConfigurationError(
            "the rig has no sensors",
            file=path,
            expected="[[sensor]] tables, or a preset in [rig]",
            advice="`nineaudit rig presets` lists the layouts",
        )
    file_of = {channel: i for i, part in enumerate(tables.part) for channel in part.channels}
    for file in {file_of.get(e.table.channel) for e in entries}:
        here = [e.table for e in entries if file_of.get(e.table.channel) == file]
        check_unique("signal", [(f"channel {t.channel}", t.signal or t.channel) for t in here], path)
    return tuple(_sensor(entry, tables) for entry in entries)


def check_unique(key: str, named: Iterable[tuple[str, str]], path: Path | None) -> None:
    """ConfigurationError where two of `named`, pairs (where, name), have the same name under `key`."""
    seen: dict[str, str] = {}
    for where, name in named:
        if name in seen:
            raise ConfigurationError(
                f"has the same {key} as {seen[name]}",
                file=path,
                place=where,
                found=name,
                expected=f"a {key} of its own for each",
            )
        seen[name] = where


def _entries(tables: RigFile, path: Path | None) -> list[_Entry]:
    """Each channel once: the preset's with what its [[sensor]] table states, then the others."""
    merged = {s.channel: _Entry(_table(s), f"[rig] preset ({s.channel})", path) for s in _preset_sensors(tables, path)}
    for index, table in enumerate(tables.sensor):
        place = table_place("sensor", index, table.channel)
        if table.channel in merged:
            changes = {key: getattr(table, key) for key in table.model_fields_set}
            table = merged[table.channel].table.model_copy(update=changes)
        merged[table.channel] = _Entry(table, place, path)
    return list(merged.values())


def _preset_sensors(tables: RigFile, path: Path | None) -> tuple[PresetSensor, ...]:
    """Sensors of the preset, positions in the file's length unit; none where there is no preset."""
    name, arms = tables.rig.preset, tables.rig.arms
    if name is None:
        if arms is not None:
            raise ConfigurationError(
                "arms without a preset",
                file=path,
                place="[rig] arms",
                found=arms,
                expected="a preset that has arms",
            )
        return ()
    preset = find_preset(name, file=path, place="[rig] preset")
    default = [DEFAULT_ARM / factor(tables.units.length, "length")] * len(preset.arms)
    return check_arms(name, default if arms is None else arms, file=path, place="[rig] arms")


def _table(sensor: PresetSensor) -> SensorTable:
    return SensorTable(channel=sensor.channel, kind=sensor.kind, position=list(sensor.position), axis=list(sensor.axis))


def _sensor(entry: _Entry, tables: RigFile) -> Sensor:
    """One channel in SI."""
    table, default = entry.table, tables.uncertainty
    kind: Kind = entry.need(table.kind, "kind")
    is_rate = kind == "gyroscope"
    position = table.position or ([0.0, 0.0, 0.0] if is_rate else entry.need(None, "position"))
    length = factor(tables.units.length, "length")
    unit = tables.units.angular_rate if is_rate else tables.units.acceleration
    scale = _or(1.0, table.scale)
    to_si = _to_si(entry, kind, unit) / scale
    zero = _first(table.zero, default.zero_rate if is_rate else None, default.zero)
    noise = _first(table.noise, default.noise_rate if is_rate else None, default.noise)
    resolution = _first(table.resolution, default.resolution_rate if is_rate else default.resolution)
    position_u = _first(table.position_u, default.position)
    return Sensor(
        channel=table.channel,
        kind=kind,
        position=frozen(length * np.array(position)),
        axis=_unit_vector(entry.need(table.axis, "axis")),
        signal=table.signal or table.channel,
        unit=unit,
        to_si=to_si,
        scale=scale,
        offset=_or(0.0, table.offset) * to_si,
        full_scale=None if table.range is None else table.range * to_si,
        serial=table.serial,
        u_gain=_or(U_GAIN, table.gain, default.gain),
        u_zero=U_ZERO[kind] if zero is None else zero * to_si,
        u_alignment=math.radians(_or(U_ALIGNMENT_DEG, table.alignment_deg, default.alignment_deg)),
        u_position=U_POSITION if position_u is None else position_u * length,
        u_timing=_or(U_TIMING, table.timing_s, default.timing_s),
        noise=None if noise is None else noise * to_si,
        resolution=None if resolution is None else resolution * to_si,
    )


def _to_si(entry: _Entry, kind: Kind, unit: str) -> float:
    """SI value of one `unit` of a sensor's readings as they are nominally; mV through its sensitivity."""
    if unit != "mV":
        return factor(unit, "angular_rate" if kind == "gyroscope" else "acceleration")
    advice = "readings in mV need it; or state another unit in [units]"
    return _PER_MILLIVOLT[kind] / entry.need(entry.table.sensitivity, "sensitivity", advice)


def _unit_vector(direction: list[float]) -> FloatArray:
    """(3,) of length one; scaled by its largest component first, so that no square overflows or vanishes."""
    scaled = np.array(direction) / np.max(np.abs(direction))
    return frozen(scaled / np.linalg.norm(scaled))


def _first(*values: float | None) -> float | None:
    """The first value that is stated."""
    return next((value for value in values if value is not None), None)


def _or(fallback: float, *values: float | None) -> float:
    stated = _first(*values)
    return fallback if stated is None else stated
