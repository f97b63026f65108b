"""The tables of a large campaign: compaction, queries, index page: ``python benchmarks/campaign_tables.py``.

Real results of three audits, multiplied. The compaction is of `--entries` of them from a lake on the disk; the queries
are over `--rows` recordings (the tables of 500, as often as it takes under other names), in processor seconds and in
seconds, best of `--runs`, beside DuckDB counting the rows of the same file on its own. Figure to hold: 1 s.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does

import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from campaign_entries import EDITION, entries, lake_of
from nineaudit.campaign.index.index_page import render
from nineaudit.campaign.index.index_rows import index
from nineaudit.campaign.lake import Lake, open_lake
from nineaudit.campaign.results import schema, tables
from nineaudit.campaign.results.compact import compact, stored
from nineaudit.campaign.results.query import select

PART = 500
QUERIES = {
    "verdicts": "SELECT verdict, count(*) FROM recordings GROUP BY verdict",
    "worst": "SELECT uri, culprits, statistic, impact['HIC15'] FROM recordings ORDER BY statistic DESC LIMIT 20",
    "one channel": "SELECT uri, date FROM recordings WHERE list_contains(culprits, 'a1y') AND date > DATE '2026-06-01'",
    "by rig": "SELECT rig, fault, count(*), avg(statistic) FROM recordings GROUP BY ALL ORDER BY 3 DESC",
    "findings": "SELECT rule, verdict, count(*) FROM findings GROUP BY ALL",
    "sensors": "SELECT rig, channel, avg(gain), avg(gain_u) FROM sensors JOIN recordings USING (uri) GROUP BY ALL",
}


def multiplied(folder: Path, count: int) -> Lake:
    """A lake with the tables of `count` recordings: those of `PART`, again and again under other names."""
    tables.write_tables(entries(PART), folder, EDITION)
    lake = open_lake(folder / "lake", create=True)
    (folder / "lake" / "tables").mkdir()
    for name in schema.TABLES:
        part = pq.read_table(folder / f"{name}.parquet")
        about = pq.read_schema(folder / f"{name}.parquet").metadata | {tables.OF: b"benchmark"}
        uris = part["uri"].to_pylist()
        place = folder / "lake" / "tables" / f"{name}.parquet"
        with pq.ParquetWriter(place, schema.arrow(name).with_metadata(about), compression="zstd") as file:
            for first in range(0, count, tables.GROUP):
                copies = range(first // PART, min(first + tables.GROUP, count) // PART)
                file.write_table(pa.concat_tables(_named(part, uris, k) for k in copies).combine_chunks())
    return lake


def _named(part: pa.Table, uris: list[str], k: int) -> pa.Table:
    return part.set_column(0, "uri", pa.array([f"{k:05d}/{uri}" for uri in uris])).replace_schema_metadata(None)


def best(runs: int, call: Callable[[], Any]) -> tuple[float, float]:
    """Least processor seconds and least seconds of a call."""
    found = []
    for _ in range(runs):
        cpu, wall = time.process_time(), time.perf_counter()
        call()
        found.append((time.process_time() - cpu, time.perf_counter() - wall))
    return min(a for a, _ in found), min(b for _, b in found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=100_000)
    parser.add_argument("--entries", type=int, default=2_000)
    parser.add_argument("--runs", type=int, default=5)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        _compaction(Path(name), chosen.entries)
        lake = multiplied(Path(name), max(PART, chosen.rows // PART * PART))
        _queries(lake, chosen.runs)
        _page(lake)


def _compaction(folder: Path, count: int) -> None:
    lake = lake_of(folder / "small", entries(count))
    cpu = time.process_time()
    compact(lake)
    took = time.process_time() - cpu
    size = sum(path.stat().st_size for path in Path(lake.place("tables")).iterdir())
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(f"compact: {count} entries, {count / took:.0f} a second of processor time, {size / count:.0f} bytes each")
    print(f"largest memory so far {most:.0f} MB (the same for any number beyond {tables.GROUP} entries)")


def _queries(lake: Lake, runs: int) -> None:
    import duckdb

    count = select(stored(lake).tables, "SELECT count(*) AS n FROM recordings")["n"][0].as_py()
    place = lake.place("tables/recordings.parquet")
    alone = best(runs, lambda: duckdb.sql(f"SELECT count(uri) FROM read_parquet('{place}')").fetchall())
    print(
        f"\n{count} recordings; count(uri) of the file by DuckDB alone: {alone[0]:.3f} s of processor, {alone[1]:.3f} s"
    )
    print(f"{'query':<14}{'processor s':>12}{'s':>8}{'/ alone':>9}")
    for name, sql in QUERIES.items():
        cpu, wall = best(runs, lambda sql=sql: select(stored(lake).tables, sql))  # type: ignore[misc]
        print(f"{name:<14}{cpu:>12.3f}{wall:>8.3f}{cpu / alone[0]:>9.1f}" + ("" if wall < 1 else "  over 1 s"))


def _page(lake: Lake) -> None:
    cpu = time.process_time()
    found = index(stored(lake))
    page = render(found, "benchmark", said={}, titles={})
    took, size = time.process_time() - cpu, len(page.encode()) / 1e6
    print(f"\nindex page of {len(found.recordings)}: {took:.1f} s of processor time, {size:.2f} MB")


if __name__ == "__main__":
    main()
