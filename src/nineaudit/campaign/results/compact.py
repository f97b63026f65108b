"""`campaign compact`: the tables of a lake's edition, made anew from its entries and put in the place of the old."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nineaudit.campaign.entries import Damaged, chosen, current_entries
from nineaudit.campaign.results import schema
from nineaudit.campaign.results.tables import OF, Writer, names
from nineaudit.errors import ConfigurationError, RecordingError
from nineaudit.files import settle

if TYPE_CHECKING:
    from nineaudit.campaign.lake import Lake

FOLDER = "tables"


@dataclass(frozen=True)
class Compaction:
    """What was made: of which edition, from how many recordings, and what could not be used."""

    edition: str
    recordings: int
    damaged: tuple[Damaged, ...]


@dataclass(frozen=True, eq=False)
class Stored:
    """The tables of a lake as pyarrow datasets by name; `of`: the hash of the entries that they were made of."""

    tables: dict[str, Any]
    edition: str
    of: str


def compact(lake: Lake, edition: str | None = None, seen: Callable[[int], None] | None = None) -> Compaction:
    """Make the tables of an edition (default: the newest). What cannot be used is left out and told; `seen` is told
    how many entries are done. ConfigurationError: no such edition, or the place cannot be written to."""
    edition = chosen(lake, edition)
    damaged: list[Damaged] = []
    with _workshop(lake) as folder:
        with Writer(folder, edition) as writer:
            for entry in current_entries(lake, edition, damaged):
                try:
                    writer.add(entry)
                except RecordingError as error:
                    damaged.append(Damaged(entry["uri"], str(error)))
                if seen is not None:
                    seen(writer.recordings)
        _publish(lake, folder)
    return Compaction(edition, writer.recordings, tuple(damaged))


def stored(lake: Lake) -> Stored:
    """The tables of a lake. ConfigurationError: they are not there, of a newer version, or of two compactions."""
    import pyarrow.dataset as ds

    tables, made = {}, set()
    for name in schema.TABLES:
        path = lake.place(f"{FOLDER}/{name}.parquet")
        about = _metadata(lake, path)
        _require_version(about, path)
        tables[name] = ds.dataset(lake.fs._strip_protocol(path), filesystem=lake.fs, format="parquet")
        made.add((about[OF].decode(), about[b"nineaudit.edition"].decode()))
    if len(made) > 1:
        raise ConfigurationError("its tables are of two compactions", file=lake.uri, advice=_AGAIN)
    of, edition = made.pop()
    return Stored(tables, edition, of)


_AGAIN = "`nineaudit campaign compact` makes them"


def _metadata(lake: Lake, path: str) -> dict[bytes, bytes]:
    """What a Parquet file says of itself."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with lake.fs.open(path, "rb") as file:
            return dict(pq.read_metadata(file).metadata or {})
    except FileNotFoundError as error:
        raise ConfigurationError("has no tables yet", file=lake.uri, advice=_AGAIN) from error
    except pa.ArrowInvalid as error:
        raise ConfigurationError(f"is no Parquet file: {error}", file=path, advice=_AGAIN) from error


def _require_version(about: dict[bytes, bytes], path: str) -> None:
    found = about.get(b"nineaudit.schema", b"").decode()
    if found == schema.SCHEMA and OF in about:
        return
    number = found.removeprefix("nineaudit/tables/")
    newer = number.isdecimal() and int(number) > schema.VERSION
    advice = "this nineaudit is older than that which made them: upgrade it, or compact again" if newer else _AGAIN
    raise ConfigurationError(
        "tables of another version", file=path, found=found or None, expected=schema.SCHEMA, advice=advice
    )


@contextmanager
def _workshop(lake: Lake) -> Iterator[Path]:
    """An empty folder to write in; of a local lake beside the tables, so that a file can take its name at once."""
    if not lake.local:
        with tempfile.TemporaryDirectory() as name:
            yield Path(name)
        return
    folder = Path(lake.place(FOLDER)) / f".partial-{os.getpid()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield folder
    except OSError as error:
        raise ConfigurationError(f"cannot be written: {error.strerror or error}", file=folder) from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _publish(lake: Lake, folder: Path) -> None:
    """Put the finished files in place: each whole or not at all."""
    for name in names():
        if lake.local:
            settle(folder / name, Path(lake.place(FOLDER)) / name)
        else:
            lake.fs.put_file(str(folder / name), lake.place(f"{FOLDER}/{name}"))
