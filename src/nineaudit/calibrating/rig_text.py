"""A rig file with calibration results in it: every other line, its comments and its order stay as they are."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Final

import numpy as np

from nineaudit.array import Sensor
from nineaudit.calibrating.changes import Keys
from nineaudit.errors import ConfigurationError
from nineaudit.rig import Rig, parse_rig
from nineaudit.units import factor

_HEADER: Final = re.compile(r"\s*\[\[?\s*[\w.\"-]+\s*\]\]?\s*(#.*)?$")
_SENSOR: Final = re.compile(r"\s*\[\[\s*sensor\s*\]\]")
_CHANNEL: Final = re.compile(r"""\s*channel\s*=\s*["']([^"']+)["']""")


def calibrated(rig: Rig, changes: Mapping[str, Keys], notes: Sequence[str], output: Path) -> str:
    """The text of `rig` with the keys of `changes` in the [[sensor]] tables of their channels, `notes` on top.

    A channel of a preset without a table of its own gets one at the end. The text is read back before it is given:
    ConfigurationError unless it says what it should, and nothing else has changed.
    """
    lines = rig.text.splitlines()
    stated = {entry["channel"] for entry in tomllib.loads(rig.text).get("sensor", ())}
    for channel in sorted(stated & set(changes)):
        if _table(lines, channel) is None:
            raise _other_form(channel, output)
    for channel, keys in changes.items():
        lines = _with_keys(lines, channel, keys)
    text = "\n".join([*(f"# {note}" for note in notes), *lines, ""])
    _require_meant(rig, parse_rig(text, output), changes, output)
    return text


def _with_keys(lines: list[str], channel: str, keys: Keys) -> list[str]:
    found = _table(lines, channel)
    if found is None:
        return [*lines, "", "[[sensor]]", f'channel = "{channel}"', *(_line(k, v) for k, v in keys.items())]
    start, end = found
    while end > start + 1 and (not lines[end - 1].strip() or lines[end - 1].lstrip().startswith("#")):
        end -= 1  # blank lines and comments before the next table are its own
    table = lines[start:end]
    for key, value in keys.items():
        table = _set(table, key, value)
    return [*lines[:start], *table, *lines[end:]]


def _table(lines: Sequence[str], channel: str) -> tuple[int, int] | None:
    """First line, and the one after the last, of the [[sensor]] table of a channel."""
    heads = [i for i, line in enumerate(lines) if _HEADER.match(line)]
    for start, end in zip(heads, [*heads, len(lines)][1:], strict=True):
        named = [m[1] for line in lines[start:end] if (m := _CHANNEL.match(line))]
        if _SENSOR.match(lines[start]) and named == [channel]:
            return start, end
    return None


def _set(table: list[str], key: str, value: float | list[float]) -> list[str]:
    """The lines of a table with one key set in its place, or at the end. An array may go over several lines."""
    for i, line in enumerate(table):
        if re.match(rf"\s*{key}\s*=", line):
            last, depth = i, _depth(line)
            while depth > 0 and last + 1 < len(table):
                last += 1
                depth += _depth(table[last])
            return [*table[:i], _line(key, value), *table[last + 1 :]]
    return [*table, _line(key, value)]


def _depth(line: str) -> int:
    bare = line.partition("#")[0]
    return bare.count("[") - bare.count("]")


def _line(key: str, value: float | list[float]) -> str:
    return f"{key} = {value!r}"


def _require_meant(before: Rig, after: Rig, changes: Mapping[str, Keys], output: Path) -> None:
    """ConfigurationError unless the sensors of `after` are those of `before` with the changes."""
    wrong = [c for c in before.array.channels if c not in after.array.channels]
    wrong += [s.channel for s in before.array.sensors if s.channel not in wrong and not _meant(s, after, changes)]
    if wrong:
        raise _other_form(wrong[0], output)


def _other_form(channel: str, output: Path) -> ConfigurationError:
    return ConfigurationError(
        "the results cannot be put into a rig file of this form",
        file=output,
        place=f"channel {channel}",
        expected="[[sensor]] tables with one key a line",
        advice="write the rig file in that form, or enter the printed numbers by hand",
    )


def _meant(sensor: Sensor, after: Rig, changes: Mapping[str, Keys]) -> bool:
    now, keys = after.array[sensor.channel], changes.get(sensor.channel, {})
    if not keys:
        return all(np.array_equal(getattr(now, f.name), getattr(sensor, f.name)) for f in fields(Sensor))
    said = {
        "scale": now.scale,
        "offset": now.offset / now.to_si,
        "gain": now.u_gain,
        "zero": now.u_zero / now.to_si,
        "axis": now.axis,
        "alignment_deg": np.degrees(now.u_alignment),
        "position": now.position / factor(after.units.length, "length"),
        "position_u": now.u_position / factor(after.units.length, "length"),
    }
    kept = ("kind", "signal", "unit", "serial", "u_timing", *(() if "position_u" in keys else ("u_position",)))
    same = all(getattr(now, name) == getattr(sensor, name) for name in kept)
    same = same and ("position" in keys or np.array_equal(now.position, sensor.position))
    return same and all(np.allclose(said[key], value, rtol=1e-6, atol=1e-8) for key, value in keys.items())
