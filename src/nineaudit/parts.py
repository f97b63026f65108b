"""A recording of several files, one a data logger: which file is which part, and which files belong together.

A part names its file by a pattern, ``{name}_acc.csv``: ``{name}`` is what the files of one recording have in common. So
any one of them stands for the recording, on the command line and in Python.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from nineaudit.array import SensorArray
from nineaudit.errors import ConfigurationError

NAME: Final = "{name}"


@dataclass(frozen=True)
class Part:
    """One file of a recording: the pattern of its name (with folders, from where the recording is), its `channels`,
    and its clock: `offset` s is added to its stamps, `u_offset` its standard uncertainty; `correlate` where the offset
    is to be found from the readings. `time_signal` and `time_unit` None: as the rig has them."""

    file: str
    channels: tuple[str, ...]
    time_signal: str | None = None
    time_unit: str | None = None
    offset: float = 0.0
    u_offset: float = 0.0
    correlate: bool = False

    @property
    def depth(self) -> int:
        """How many names of a path the pattern speaks of."""
        return self.file.count("/") + 1

    def name_in(self, path: Path) -> str | None:
        """What stands for ``{name}`` in a path ("" where the pattern has none); None where it is no such file."""
        pattern = re.escape(self.file).replace(re.escape(NAME), "(?P<name>[^/]+)")
        found = re.fullmatch(pattern, "/".join(path.parts[-self.depth :]))
        return None if found is None else found.groupdict().get("name", "")


def part_of(path: Path, parts: Iterable[Part]) -> Part | None:
    """The part that a file is; where several patterns fit, the one with most letters of its own."""
    fitting = [part for part in parts if part.name_in(path) is not None]
    return max(fitting, key=lambda part: len(part.file), default=None)


def files(path: Path, parts: Sequence[Part]) -> tuple[Path, ...]:
    """The files of the recording to which `path` belongs, in the order of `parts`; the path alone where it is no part
    (a file that holds all channels: a repaired recording)."""
    own = part_of(path, parts)
    if own is None:
        return (path,)
    folder, name = Path(*path.parts[: -own.depth]), own.name_in(path) or ""
    return tuple(path if part is own else folder / part.file.replace(NAME, name) for part in parts)


def recordings(paths: Iterable[Path], parts: Sequence[Part]) -> tuple[Path, ...]:
    """One path for each recording, its first part, in the order in which they are first named."""
    return tuple(dict.fromkeys(files(path, parts)[0] for path in paths))


def in_one_file(array: SensorArray) -> SensorArray:
    """The array as one file holds it: signals that two parts call by one name are called by their channels."""
    count = Counter(sensor.signal for sensor in array.sensors)
    own = (replace(s, signal=s.channel) if count[s.signal] > 1 else s for s in array.sensors)
    return SensorArray(tuple(own))


def in_order(paths: Sequence[Path], parts: Sequence[Part], rig: Path | None) -> tuple[Path, ...]:
    """The files of one recording, as they are named, in the order of `parts`. ConfigurationError: not one of each."""
    found = {part_of(path, parts): path for path in paths}
    if set(found) == set(parts) and len(paths) == len(parts):
        return tuple(found[part] for part in parts)
    raise ConfigurationError(
        "the files are not one of each part",
        file=rig,
        place="[[part]]",
        found=", ".join(path.name for path in paths),
        expected=", ".join(part.file for part in parts) or "a rig file with a [[part]] for each file",
    )
