"""The CSV file of a calibration: a header, one row a run, columns by name. `#` lines are comments."""

from __future__ import annotations

import csv
import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, Sensor, SensorArray
from nineaudit.errors import RecordingError
from nineaudit.presets import nearest
from nineaudit.units import counted

_LETTERS: Final = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_DIRECTION: Final = "+x, -y, ... or three numbers with spaces between them"
NOTES: Final = ("run", "note", "time_s")
"""Columns that are for people only."""


@dataclass(frozen=True)
class Sheet:
    """Cells as text, by column and row; `lines` of the file that the rows stand in, from 1."""

    path: Path
    sha256: str
    names: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]

    def texts(self, name: str) -> list[str]:
        """The cells of a column. RecordingError where there is none of that name."""
        if name not in self.names:
            raise RecordingError(
                "missing column", file=self.path, found=", ".join(self.names), expected=f"a column {name!r}"
            )
        column = self.names.index(name)
        return [row[column] for row in self.rows]


def read_sheet(path: Path) -> Sheet:
    """The cells of a CSV file. RecordingError: not readable, no header, no rows, a row of the wrong length."""
    try:
        data = path.read_bytes()
        text = data.decode("utf-8-sig")
    except OSError as error:
        raise RecordingError(f"cannot be read: {error.strerror or error}", file=path) from error
    except UnicodeDecodeError as error:
        raise RecordingError("not UTF-8 text", file=path, place=f"byte {error.start}", expected="a CSV file") from error
    kept = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")]
    cells = [tuple(cell.strip() for cell in row) for row in csv.reader(line for _, line in kept)]
    if len(cells) < 2:
        raise RecordingError(
            "no runs", file=path, found=counted(len(cells), "line"), expected="a header and one row a run"
        )
    names = cells[0]
    for (line, _), row in zip(kept, cells, strict=True):
        if len(row) != len(names):
            raise RecordingError(
                "a row of the wrong length", file=path, place=f"line {line}", found=len(row), expected=f"{len(names)}"
            )
    twice = [name for name in names if names.count(name) > 1]
    if twice or not all(names):
        raise RecordingError(
            "columns need names of their own", file=path, place=f"line {kept[0][0]}", found=twice[0] if twice else ""
        )
    lines = tuple(line for line, _ in kept[1:])
    return Sheet(path, hashlib.sha256(data).hexdigest(), names, tuple(cells[1:]), lines)


def numbers(sheet: Sheet, name: str, *, gaps: bool = False) -> FloatArray:
    """(n,) the numbers of a column; with `gaps` an empty cell is NaN. RecordingError names the first bad cell."""
    out = np.full(len(sheet.rows), np.nan)
    for i, text in enumerate(sheet.texts(name)):
        if text or not gaps:
            out[i] = _number(text, sheet, name, i)
    return out


def _number(text: str, sheet: Sheet, name: str, row: int) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        place = f"line {sheet.lines[row]}, column {name}"
        raise RecordingError("not a number", file=sheet.path, place=place, found=text, expected="a finite number")
    return value


def directions(sheet: Sheet, name: str) -> FloatArray:
    """(n,3) unit vectors of a column of body directions: ``+x``, ``-z`` or three numbers. RecordingError if not."""
    return np.array([_direction(text, sheet, name, i) for i, text in enumerate(sheet.texts(name))])


def _direction(text: str, sheet: Sheet, name: str, row: int) -> FloatArray:
    sign, letter = text[:1], text.lstrip("+-").lower()
    if letter in _LETTERS and len(text) <= 2:
        return np.array(_LETTERS[letter]) * (-1.0 if sign == "-" else 1.0)
    parts = text.split()
    vector = np.array([_number(part, sheet, name, row) for part in parts] if len(parts) == 3 else [0.0])
    if not vector.any():
        place = f"line {sheet.lines[row]}, column {name}"
        raise RecordingError("not a direction", file=sheet.path, place=place, found=text, expected=_DIRECTION)
    return np.asarray(vector / np.linalg.norm(vector))


def in_unit_of(sheet: Sheet, units: dict[str, float]) -> FloatArray:
    """(n,) SI of the one column that is named in `units`, names to SI factors. RecordingError: none, or several."""
    present = [name for name in units if name in sheet.names]
    if len(present) != 1:
        raise RecordingError(
            "missing column" if not present else "one quantity in several columns",
            file=sheet.path,
            found=", ".join(present or sheet.names),
            expected="one of " + ", ".join(units),
        )
    return numbers(sheet, present[0]) * units[present[0]]


def readings(sheet: Sheet, array: SensorArray, inputs: Sequence[str]) -> tuple[dict[str, FloatArray], list[str]]:
    """By channel, its readings (n,), NaN where a cell is empty; and the channels that have no column.

    A column is named by the channel or its signal; those of `inputs` and NOTES are none. RecordingError: a column of
    neither, or no channel at all.
    """
    owner = {name: sensor for sensor in array.sensors for name in (sensor.signal, sensor.channel)}
    found: dict[str, FloatArray] = {}
    for name in (n for n in sheet.names if n not in inputs and n not in NOTES):
        if name not in owner:
            known = [*inputs, *NOTES, *array.channels]
            close = nearest(name, known)
            raise RecordingError(
                "a column of no channel of the rig",
                file=sheet.path,
                found=name,
                expected="one of " + ", ".join(known),
                advice=f"did you mean {close!r}?" if close else None,
            )
        found[owner[name].channel] = numbers(sheet, name, gaps=True)
    if not found:
        raise RecordingError("no channel has a column", file=sheet.path, expected="one of " + ", ".join(array.channels))
    return found, [channel for channel in array.channels if channel not in found]


def unit_si(sensor: Sensor) -> float:
    """SI value of one unit of a sensor's readings before its calibration: what a new calibration starts from."""
    return sensor.to_si * sensor.scale
