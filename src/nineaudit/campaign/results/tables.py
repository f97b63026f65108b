"""Rows -> Parquet files, a pure function of the entries: the same entries give the same bytes, whatever the machine did
meanwhile. Entries come one by one, in the order of their uri; memory holds one row group."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from nineaudit.campaign.results import schema
from nineaudit.campaign.results.rows import rows
from nineaudit.errors import RecordingError

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

GROUP: Final = 2_000
"""Recordings in a row group: a query for some of them reads only their groups."""
BATCH: Final = 50
"""Recordings whose rows are put together now and then: many small batches take more memory than their content."""
OF: Final = b"nineaudit.of"
"""Key of a file's metadata: the hash of the entries that it was made of. Files of one compaction have the same."""


class Writer:
    """The Parquet files of all tables, growing by entries. Use with `with`: the end writes what is left."""

    def __init__(self, folder: Path, edition: str) -> None:
        self.edition, self.recordings = edition, 0
        self._digest = hashlib.sha256()
        self._schemas = {name: schema.arrow(name) for name in schema.TABLES}
        self._parts: dict[str, list[pa.Table]] = {name: [] for name in schema.TABLES}
        self._files = {name: _file(folder / f"{name}.parquet", name, edition) for name in schema.TABLES}

    def add(self, entry: Mapping[str, Any]) -> None:
        """Add an entry; nothing of it where it is not one. RecordingError."""
        import pyarrow as pa

        try:
            made = rows(entry)
            tables = {name: pa.Table.from_pylist(made[name], self._schemas[name]) for name in made}
        except (KeyError, TypeError, ValueError, AttributeError, pa.ArrowException) as error:
            raise RecordingError(f"not a result that this version can read: {error!r}") from error
        for name, table in tables.items():
            self._parts[name].append(table)
        self._digest.update(f"{entry['uri']}\0{entry['key']}\0{entry['result'].get('seal')}\n".encode())
        self.recordings += 1
        if self.recordings % BATCH == 0:
            self._parts = {name: [_one(parts)] for name, parts in self._parts.items()}
        if self.recordings % GROUP == 0:
            self._group()

    def __enter__(self) -> Writer:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is None:
            self._group()
        for file in self._files.values():
            file.add_key_value_metadata({OF: self._digest.hexdigest()})
            file.close()

    def _group(self) -> None:
        for name, parts in self._parts.items():
            table = _one(parts) if parts else None
            if table is not None and table.num_rows:
                self._files[name].write_table(table, row_group_size=table.num_rows)
            parts.clear()


def _one(parts: Sequence[pa.Table]) -> pa.Table:
    """Tables as one, its columns whole."""
    import pyarrow as pa

    return pa.concat_tables(parts).combine_chunks()


def write_tables(entries: Iterable[Mapping[str, Any]], folder: Path, edition: str) -> int:
    """Write the tables of `entries`, in order of their uri, into a folder; how many recordings. RecordingError."""
    with Writer(folder, edition) as writer:
        for entry in entries:
            writer.add(entry)
    return writer.recordings


def _file(path: Path, name: str, edition: str) -> pq.ParquetWriter:
    import pyarrow.parquet as pq

    about = {"nineaudit.schema": schema.SCHEMA, "nineaudit.table": name, "nineaudit.edition": edition}
    return pq.ParquetWriter(path, schema.arrow(name).with_metadata(about), compression="zstd", store_schema=True)


def names() -> Sequence[str]:
    """The files of the tables."""
    return tuple(f"{name}.parquet" for name in schema.TABLES)
