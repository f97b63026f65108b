"""From a Recording to a file that reads back as the same recording: the rig's units and signal names.

A file appears whole or not at all, never in the place of another unless that is asked for, and never in the place
of the recording it comes from.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.errors import ConfigurationError
from nineaudit.files import partial_name, settle
from nineaudit.recording import Recording
from nineaudit.signals import suggestion
from nineaudit.writers.can_file import write_asc, write_blf
from nineaudit.writers.dbc import make_dbc
from nineaudit.writers.mcap_file import write_mcap
from nineaudit.writers.mme_file import write_mme, write_mme_zip
from nineaudit.writers.mme_place import folder_of_test, require_test_free, settle_test
from nineaudit.writers.outcome import Outcome
from nineaudit.writers.table_file import write_csv, write_parquet

__all__ = ["WRITERS", "Outcome", "Written", "encode", "make_dbc", "place", "write_recording"]

Writer = Callable[[Recording, FloatArray, Path, Sequence[Path]], Outcome]
"""(recording, (n,k) SI readings, file, databases) -> what became of the numbers."""

WRITERS: Final[Mapping[str, Writer]] = {
    ".csv": write_csv,
    ".tsv": write_csv,
    ".txt": write_csv,
    ".parquet": write_parquet,
    ".mcap": write_mcap,
    ".blf": write_blf,
    ".asc": write_asc,
    ".mme": write_mme,
    ".zip": write_mme_zip,
}
"""Writer of each suffix (lower case)."""


@dataclass(frozen=True)
class Written:
    """What was written. `error`: by channel, the largest difference (SI) that the format made; `notes` in words."""

    path: Path
    error: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def write_recording(
    recording: Recording,
    path: str | Path,
    *,
    dbc: str | Path | Sequence[str | Path] | None = None,
    readings: FloatArray | None = None,
    force: bool = False,
) -> Written:
    """Write a recording in the format of the path's suffix; ``read(path, rig)`` gives it back.

    `readings` (n,k) SI are written in place of the recording's (a repair). `dbc` for CAN formats, else the rig's.
    CSV, Parquet and MCAP keep every digit; CAN keeps what the database resolves, and `Written.error` says how much
    that is. Raises ConfigurationError: unknown suffix, the file exists (unless `force`) or is the recording's own
    source, a folder that is not there, values that a CAN signal cannot hold.
    """
    databases = dbc if dbc is None or not isinstance(dbc, (str, Path)) else [dbc]
    return place(Path(path), recording, lambda partial: encode(recording, partial, databases, readings), force=force)


def encode(
    recording: Recording,
    path: Path,
    dbc: Sequence[str | Path] | None = None,
    readings: FloatArray | None = None,
) -> Outcome:
    """Write a recording to a file that is not there yet, which is not yet the one that a user asked for; else as
    write_recording. OSError."""
    recording = replace(recording, rig=recording.rig.in_one_file())
    values = recording.readings if readings is None else np.asarray(readings, dtype=np.float64)
    if values.shape != recording.readings.shape:
        raise ValueError(f"readings {values.shape} for a recording of {recording.readings.shape}")
    databases = recording.rig.dbc if dbc is None else dbc
    return _writer(path)(recording, values, path, [Path(p) for p in databases])


def place(path: Path, recording: Recording, make: Callable[[Path], Outcome], *, force: bool = False) -> Written:
    """A file made from a recording: `make` writes it under another name in the same folder, and once it is whole and
    on the disk it takes its own. What `make` raises takes it back, and a file that was there stays.

    ConfigurationError: as write_recording.
    """
    several = _writer(path) is write_mme
    sources = [source.path for source in recording.source.files]
    try:
        _require_free(path, sources, force)
        if several:
            require_test_free(path, sources, force)
        with folder_of_test(path) if several else _one_file(path) as partial:
            outcome = make(partial)
            (settle_test if several else settle)(partial, path)
    except OSError as error:
        raise ConfigurationError(f"cannot be written: {error.strerror or error}", file=path) from error
    return Written(path, outcome.error, outcome.notes)


@contextmanager
def _one_file(path: Path) -> Iterator[Path]:
    """Where a file is written before it takes its name."""
    partial = partial_name(path)
    try:
        yield partial
    finally:
        partial.unlink(missing_ok=True)


def _writer(path: Path) -> Writer:
    suffix = path.suffix.lower()
    if suffix not in WRITERS:
        raise ConfigurationError(
            "no format to write",
            file=path,
            found=path.suffix or "no suffix",
            expected="one of " + " ".join(WRITERS),
            advice=suggestion(suffix, WRITERS) if suffix else None,
        )
    return WRITERS[suffix]


def _require_free(path: Path, sources: Sequence[Path], force: bool) -> None:
    if path.is_dir() or not path.parent.is_dir():
        what = "is a folder" if path.is_dir() else "the folder for it does not exist"
        raise ConfigurationError(what, file=path, expected="a file in a folder that exists")
    same = path.exists() and any(source.exists() and path.samefile(source) for source in sources)
    if same or path.absolute() in [source.absolute() for source in sources]:
        raise ConfigurationError(
            "the original recording is never overwritten", file=path, advice="choose another name for the output"
        )
    if path.exists() and not force:
        raise ConfigurationError("the file exists already", file=path, advice="choose another name")
