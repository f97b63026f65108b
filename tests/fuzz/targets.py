"""What is fuzzed: readers by format, whole files to begin with, and the law that holds for any bytes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from nineaudit.errors import NineauditError
from nineaudit.readers import read
from recordings import array_rig, database, motion, write_any

FORMATS = {"blf": ".blf", "candump": ".log", "asc": ".asc", "mcap": ".mcap", "csv": ".csv", "mme": ".zip"}
"""Each own parser, and the suffix of its files."""
SEED_S = 0.004


def seeds(name: str, folder: Path) -> Iterator[bytes]:
    """A small whole recording of the format."""
    yield write_any(motion(array_rig(), duration_s=SEED_S), folder, FORMATS[name]).read_bytes()


def attempt(path: Path, dbc: Path) -> None:
    """The law: a recording, or one of our errors, and the file as it was."""
    before = path.read_bytes()
    said = ""
    try:
        said = repr(read(path, array_rig(), dbc=[dbc]).source)
    except NineauditError as error:
        said = str(error)
    assert said
    assert path.read_bytes() == before


def prepared(name: str, folder: Path) -> tuple[Path, Path]:
    """Where the bytes of an input go, and the database of the rig."""
    return folder / f"input{FORMATS[name]}", database(array_rig(), folder)
