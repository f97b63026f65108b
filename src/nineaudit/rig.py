"""The rig file: the array, its units and its uncertainty (INTERFACE.md). Units are converted here, once.

Rig, Point and Units load without pydantic; reading a file needs it (rig_file.py, rig_schema.py).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nineaudit.array import FloatArray, Kind, SensorArray, frozen
from nineaudit.errors import ConfigurationError
from nineaudit.identity import Stated, stated
from nineaudit.parts import NAME, Part, files, in_one_file
from nineaudit.presets import PRESETS, preset_text
from nineaudit.units import factor

if TYPE_CHECKING:
    from nineaudit.rig_schema import RigFile

__all__ = ["PRESETS", "Point", "Rig", "Units", "load_rig", "parse_rig", "preset_text", "rig_schema"]


@dataclass(frozen=True, eq=False)
class Point:
    """A named point of the body: `position` (3,) m, body frame."""

    name: str
    position: FloatArray


@dataclass(frozen=True)
class Units:
    """Units of a rig file's numbers, and of recordings that do not state their own."""

    length: str = "mm"
    acceleration: str = "g_0"
    angular_rate: str = "rad/s"

    def of(self, kind: Kind) -> str:
        """Unit of the readings of one kind of sensor."""
        return self.acceleration if kind == "accelerometer" else self.angular_rate


@dataclass(frozen=True, eq=False)
class Rig:
    """An array as its rig file describes it, in SI, and how its recordings are written.

    `pre_trigger` (start, end) in s, the body at rest. `dbc` resolved against the rig file. `time_unit` None:
    by the suffix of the time column. `separator` and `decimal` of CSV, None where they are to be detected.
    `parts`: the files of a recording, where it has several. `test`: what all recordings have in common. `sha256` of the
    file's bytes (of the text where there is no file); `text` as it was read.
    """

    name: str
    array: SensorArray
    points: tuple[Point, ...] = ()
    units: Units = Units()
    time_signal: str | None = None
    time_unit: str | None = None
    dbc: tuple[Path, ...] = ()
    pre_trigger: tuple[float, float] | None = None
    filter_class: str = "none"
    preset: str | None = None
    path: Path | None = None
    sha256: str = ""
    text: str = ""
    separator: str | None = None
    decimal: str | None = None
    parts: tuple[Part, ...] = ()
    test: tuple[Stated, ...] = ()

    def files(self, recording: Path) -> tuple[Path, ...]:
        """All files of the recording that a path names."""
        return files(recording, self.parts)

    def in_one_file(self) -> Rig:
        """The rig of a file that holds all channels, as `repair` writes it."""
        return replace(self, array=in_one_file(self.array), parts=()) if self.parts else self

    @property
    def cfc(self) -> float | None:
        """Channel frequency class as a number (1000.0 for CFC1000), None for unfiltered readings."""
        return float(self.filter_class.removeprefix("CFC")) if self.filter_class != "none" else None


def load_rig(path: str | Path) -> Rig:
    """Read a rig file. Raises ConfigurationError: one sentence with file, place, value found and expected."""
    from nineaudit.rig_file import decode

    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ConfigurationError(
            f"cannot read the rig file: {error.strerror or error}",
            file=path,
            advice="`nineaudit rig presets NAME` prints one to start from",
        ) from error
    rig = parse_rig(decode(data, path), path)
    return replace(rig, sha256=hashlib.sha256(data).hexdigest())


def parse_rig(text: str, path: Path | None = None) -> Rig:
    """A rig from the text of its file; `path` is where it came from (databases are sought next to it).

    Raises ConfigurationError: one sentence with file, place, value found and expected.
    """
    from nineaudit.rig_file import read_tables
    from nineaudit.rig_sensors import build_sensors

    tables = read_tables(text, path)
    units = Units(tables.units.length, tables.units.acceleration, tables.units.angular_rate)
    array = SensorArray(build_sensors(tables, path))
    recording, preset = tables.recording, tables.rig.preset
    if recording.decimal is not None and recording.decimal == recording.separator:
        raise ConfigurationError(
            "the decimal mark is also the separator",
            file=path,
            place="[recording] decimal",
            found=recording.decimal,
            expected="two different characters",
        )
    return Rig(
        name=tables.rig.name or _default_name(preset, path),
        array=array,
        points=_points(tables, factor(units.length, "length"), path),
        units=units,
        time_signal=recording.time,
        time_unit=recording.time_unit,
        dbc=_databases(recording.dbc, path),
        pre_trigger=(recording.pre_trigger[0], recording.pre_trigger[1]) if recording.pre_trigger else None,
        filter_class=recording.filter_class,
        preset=preset,
        path=path,
        sha256=hashlib.sha256(text.encode()).hexdigest(),
        text=text,
        separator=recording.separator,
        decimal=recording.decimal,
        parts=_parts(tables, array, path),
        test=_test(tables, path),
    )


def rig_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of the rig file, with descriptions for editors."""
    from nineaudit.rig_schema import RigFile

    return RigFile.model_json_schema()


def _default_name(preset: str | None, path: Path | None) -> str:
    if preset is not None:
        return PRESETS[preset].title
    return path.stem if path else "rig"


def _databases(names: Iterable[str], path: Path | None) -> tuple[Path, ...]:
    folder = path.parent if path else Path()
    found = tuple(folder / name for name in names)
    for database, name in zip(found, names, strict=True):
        if not database.is_file():
            raise ConfigurationError(
                "no such CAN database",
                file=path,
                place="[recording] dbc",
                found=name,
                expected=f"a file relative to {folder.absolute()}",
            )
    return found


def _test(tables: RigFile, path: Path | None) -> tuple[Stated, ...]:
    """What the table [test] states."""
    values = tables.test.model_dump(exclude_none=True)
    return stated({key: str(value) for key, value in values.items()}, f"rig file {path.name}" if path else "rig file")


def _parts(tables: RigFile, array: SensorArray, path: Path | None) -> tuple[Part, ...]:
    """The parts; ConfigurationError where a channel is not in exactly one, or only some patterns have a {name}."""
    from nineaudit.rig_sensors import check_unique

    parts = tuple(
        Part(
            p.file, tuple(p.channels), p.time, p.time_unit, p.offset_s or 0.0, p.offset_u_s or 0.0, p.align != "stamps"
        )
        for p in tables.part
    )
    check_unique("file", [(f"[[part]] {i}", part.file) for i, part in enumerate(parts, 1)], path)
    placed = [(f"[[part]] {i}", channel) for i, part in enumerate(parts, 1) for channel in part.channels]
    check_unique("channel", placed, path)
    said, known = [channel for _, channel in placed], set(array.channels)
    for where, channel in placed:
        if channel not in known:
            expected = "one of " + ", ".join(array.channels)
            raise ConfigurationError("no such channel", file=path, place=where, found=channel, expected=expected)
    for channel in array.channels if parts else ():
        if channel not in said:
            raise ConfigurationError(f"channel {channel} is in no part", file=path, place="[[part]] channels")
    _require_findable(tables, parts, path)
    return parts


def _require_findable(tables: RigFile, parts: Sequence[Part], path: Path | None) -> None:
    """Parts whose files can be told, and whose offsets are stated or to be found, not both."""
    for i, (part, table) in enumerate(zip(parts, tables.part, strict=True), 1):
        where = f"[[part]] {i}"
        if part.file.count(NAME) > 1 or (NAME in part.file) != (NAME in parts[0].file):
            expected = f"{NAME} once in each of them, or in none"
            raise ConfigurationError("a pattern of its own", file=path, place=where, found=part.file, expected=expected)
        if part.correlate and (i == 1 or table.offset_s is not None or table.offset_u_s is not None):
            expected = "align or offset_s, in a part that is not the first"
            raise ConfigurationError("nothing to find", file=path, place=f"{where} align", expected=expected)


def _points(tables: RigFile, length: float, path: Path | None) -> tuple[Point, ...]:
    from nineaudit.rig_sensors import check_unique

    check_unique("name", [(f"[[point]] {i}", p.name) for i, p in enumerate(tables.point, 1)], path)
    return tuple(Point(p.name, frozen(length * np.array(p.position))) for p in tables.point)
