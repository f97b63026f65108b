"""From a file to a Recording: a reader for each kind of file, then assemble.

A reader is a function ``(path, rig) -> Contents``: the rig's signals as recorded, each with its own clock, and what
the container held. It holds no physics; what it drops it counts.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from nineaudit.errors import RecordingError
from nineaudit.identity import Stated, identify
from nineaudit.parts import in_order, part_of
from nineaudit.provenance import Provenance, beside, path_beside
from nineaudit.readers.can.mdf_signals import read_mf4
from nineaudit.readers.can.reader import read_can
from nineaudit.readers.clocks.assemble import assemble
from nineaudit.readers.clocks.joined import join
from nineaudit.readers.contents import Contents
from nineaudit.readers.mcap.rebuilt import read_repaired
from nineaudit.readers.mme import files as mme_files
from nineaudit.readers.mme.reader import read_mme
from nineaudit.readers.tables.csv_table import read_text_table
from nineaudit.readers.tables.parquet_table import read_parquet
from nineaudit.recording import Damage, Recording, Source
from nineaudit.signals import suggestion

if TYPE_CHECKING:
    from nineaudit.rig import Rig

__all__ = ["READERS", "Contents", "Reader", "assemble", "fingerprint", "read"]

Reader = Callable[[Path, "Rig"], Contents]

_CAN_CSV: Final = b"timestamp,arbitration_id,extended,remote,error,dlc,data"
_MAGIC: Final = {
    b"LOGG": (".blf", "a BLF log"),
    b"\x89MCAP0\r\n": (".mcap", "an MCAP log"),
    b"MDF     ": (".mf4", "an MDF file"),
    b"UnFinMF ": (".mf4", "an MDF file"),
    b"PAR1": (".parquet", "a Parquet table"),
    b"PK\x03\x04": (".zip", "a ZIP archive (or a spreadsheet)"),
    b"\x1f\x8b": ("", "a gzip archive"),
    b"%PDF": ("", "a PDF document"),
    b"\x89PNG": ("", "a PNG picture"),
    b"\x89HDF": ("", "an HDF5 file"),
    b"SQLite format 3": (".db", "an SQLite database"),
}
_BINARY: Final = (".db", ".blf", ".mcap", ".mf4", ".parquet", ".zip")


_UNPACK: Final = "unpack it and read what is in it"


def _read_csv(path: Path, rig: Rig) -> Contents:
    """A table, or python-can's own CSV log, which its header gives away."""
    with path.open("rb") as file:
        head = file.read(len(_CAN_CSV) + 3).removeprefix(b"\xef\xbb\xbf")
    return (read_can if head.startswith(_CAN_CSV) else read_text_table)(path, rig)


READERS: Final[Mapping[str, Reader]] = {
    ".csv": _read_csv,
    ".tsv": read_text_table,
    ".txt": read_text_table,
    ".parquet": read_parquet,
    ".blf": read_can,
    ".asc": read_can,
    ".log": read_can,
    ".trc": read_can,
    ".mf4": read_mf4,
    ".db": read_can,
    ".mcap": read_repaired,
    ".mme": read_mme,
    ".zip": read_mme,
}
"""Reader of each suffix (lower case)."""


def read(
    path: str | Path | Sequence[str | Path],
    rig: Rig,
    *,
    dbc: Sequence[str | Path] = (),
    test: Sequence[Stated] = (),
) -> Recording:
    """Read a recording of a rig: (n,) s and (n,k) SI readings on one time base, and the traces as recorded.

    Of a recording of several files (the rig's parts) `path` is any one of them, or all in a list. `dbc` takes the place
    of the rig's CAN databases; `test` of what rig and recording state of the test (identity.py). Raises RecordingError
    (exit code 3) for a file that cannot be read, is truncated, or lacks a channel; ConfigurationError (2) for
    databases, units and parts.
    """
    rig = replace(rig, dbc=tuple(Path(p) for p in dbc)) if dbc else rig
    paths = rig.files(Path(path)) if isinstance(path, (str, Path)) else _each(path, rig)
    if len(paths) == 1 and part_of(paths[0], rig.parts) is None:
        rig = rig.in_one_file()
        contents, source = _read_file(paths[0], rig)
        found = assemble(contents, rig, source)
    else:
        joined = join(paths, rig, _read_file)
        found = assemble(joined.contents, rig, joined.source, joined.u_clock)
    return replace(found, test=identify(rig.test, (s for file in found.source.files for s in file.stated), test))


def _each(paths: Sequence[str | Path], rig: Rig) -> tuple[Path, ...]:
    """The files of one recording in the order of the rig's parts."""
    named = [Path(path) for path in paths]
    return tuple(named) if len(named) == 1 and not rig.parts else in_order(named, rig.parts, rig.path)


def _read_file(path: Path, rig: Rig) -> tuple[Contents, Source]:
    """What one file holds of a rig's channels, and which file that is."""
    reader = _reader(path)
    try:
        size, sha256 = fingerprint(path)
        _require_kind(path, size)
        contents = reader(path, rig)
        provenance, altered = _provenance(path, sha256, contents)
        unchanged = fingerprint(path)[1] == sha256
    except OSError as error:
        raise RecordingError(f"cannot be read: {error.strerror or error}", file=path) from error
    source = Source(
        path=path,
        format="mme" if reader is read_mme else path.suffix.lower().removeprefix("."),
        sha256=sha256,
        size=size,
        unchanged_after_read=unchanged,
        counts=contents.counts,
        notes=contents.notes,
        damage=(*contents.damage, *altered),
        provenance=provenance,
        stated=contents.stated,
    )
    return contents, source


def _provenance(path: Path, sha256: str, contents: Contents) -> tuple[Provenance | None, tuple[Damage, ...]]:
    """The record of a repair that stands in a file or beside it, and what is wrong where it is not that file's."""
    outside = beside(path, sha256)
    if contents.provenance is None and outside is None:
        return None, ()
    inside = None if contents.provenance is None else Provenance(contents.provenance, f"in {path.name}")
    found = inside or outside
    assert found is not None
    if outside is None or outside.fits:
        return found, ()
    what = "this record is of a file with another hash: the file was altered after its repair, or is another"
    return replace(found, fits=False), (
        Damage(what, path_beside(path).name, lost="which readings are made is in doubt"),
    )


def _reader(path: Path) -> Reader:
    if os.path.isdir(path):  # False also for what the system will not look at; opening it says why
        if mme_files.is_test(path):
            return read_mme
        raise RecordingError("is a folder, not a recording", file=path, advice="name the files in it")
    suffix = path.suffix.lower()
    if suffix not in READERS:
        raise RecordingError(
            "unknown kind of file",
            file=path,
            found=path.suffix or "no suffix",
            expected="one of " + " ".join(READERS),
            advice=_UNPACK if suffix == ".gz" else suggestion(suffix, READERS) if suffix else None,
        )
    return READERS[suffix]


def fingerprint(path: Path) -> tuple[int, str]:
    """(bytes, SHA-256) of a recording: of its file, or of the files of an ISO-MME test."""
    if mme_files.is_test(path):
        return mme_files.fingerprint(path)
    with path.open("rb") as file:
        return path.stat().st_size, hashlib.file_digest(file, "sha256").hexdigest()


def _require_kind(path: Path, size: int) -> None:
    """The first bytes must be of the kind that the suffix says."""
    if size == 0:
        raise RecordingError("the file is empty", file=path)
    suffix = path.suffix.lower()
    if mme_files.is_test(path):
        return
    with path.open("rb") as file:
        head = file.read(16)
    found = next((kind for magic, kind in _MAGIC.items() if head.startswith(magic)), None)
    if (found is None and suffix not in _BINARY) or (found and found[0] == suffix):
        return
    raise RecordingError(
        f"the content is not what the suffix {suffix} says",
        file=path,
        place="byte 0",
        found=found[1] if found else head[:8],
        expected=next((kind for end, kind in _MAGIC.values() if end == suffix), "text"),
        advice=_advice(found) if found else None,
    )


def _advice(found: tuple[str, str]) -> str | None:
    suffix, kind = found
    if kind == "a gzip archive":
        return _UNPACK
    return f"rename it to {suffix}" if suffix not in ("", ".zip") else None
