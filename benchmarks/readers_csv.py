"""Text tables: peak memory above the numbers read, and processor time against pandas' C reader and its import.

python benchmarks/readers_csv.py --megabytes 1000
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from figures import Figure, table

CHANNELS = 9
ASKED_MIB = 300.0
_OURS = """
import resource, sys, time
from pathlib import Path
from nineaudit.readers.tables.csv_table import read_text_table
from nineaudit.rig import parse_rig
rig = parse_rig(Path(sys.argv[2]).read_text())
import pyarrow.csv
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
start = time.process_time()
found = read_text_table(Path(sys.argv[1]), rig)
took = time.process_time() - start
numbers = sum(t.values.nbytes for t in found.traces) + found.traces[0].time.nbytes
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(took, peak / 1024, before / 1024, numbers / 2**20, found.counts["rows"])
"""
_PANDAS = """
import sys, time
start = time.process_time()
import pandas
loaded = time.process_time() - start
start = time.process_time()
pandas.read_csv(sys.argv[1], index_col=False)
print(time.process_time() - start, loaded)
"""


def main() -> None:
    """Print the figures for a file of the size asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--megabytes", type=int, default=100)
    parser.add_argument("--words", action="store_true", help="an overflow word in every thousandth row")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path, rig = Path(folder) / "big.csv", Path(folder) / "rig.toml"
        rig.write_text(_rig(), encoding="utf-8")
        _generate(path, options.megabytes * 10**6, options.words)
        took, peak, before, numbers, rows = _run(_OURS, path, rig)
        size = path.stat().st_size / 1e6
        print(f"{size:.0f} MB, {rows:.0f} rows of {CHANNELS + 1} cells: {took:.2f} s, {size / took:.0f} MB/s")
        above = peak - before - numbers
        print(f"peak {peak:.0f} MiB, of which numbers {numbers:.0f}: {above:.0f} MiB above")
        print(table([Figure(f"CSV of {size:.0f} MB: peak memory above the numbers, MiB", above, "<=", ASKED_MIB)]))
        if not options.words:
            theirs, loaded = _run(_PANDAS, path)
            print(f"pandas.read_csv {theirs:.2f} s and {loaded:.2f} s to import it: ours takes {took / theirs:.2f} of")
            print(f"  the former, {took / (theirs + loaded):.2f} of both")


def _rig() -> str:
    sensor = '[[sensor]]\nchannel="c{}"\nkind="accelerometer"\nposition=[0,0,0]\naxis=[1,0,0]\n'
    return '[rig]\nname="big"\n' + "".join(sensor.format(i) for i in range(CHANNELS))


def _generate(path: Path, size: int, words: bool) -> None:
    """Rows of full precision; the readings repeat after 10,000 of them, the time does not."""
    rng = np.random.default_rng(1)
    cells = [",".join(map(repr, row)) for row in (100 * rng.normal(size=(10_000, CHANNELS))).tolist()]
    if words:
        cells[::1000] = [cell.replace(cell.partition(",")[0], "OVERFLOW", 1) for cell in cells[::1000]]
    with path.open("w", encoding="ascii") as file:
        file.write("time_s," + ",".join(f"c{i}" for i in range(CHANNELS)) + "\n")
        row = 0
        while file.tell() < size:
            file.write("".join(f"{(row + i) * 1e-5:.5f},{cell}\n" for i, cell in enumerate(cells)))
            row += len(cells)


def _run(code: str, *arguments: Path) -> list[float]:
    """Numbers that a program prints, run on its own."""
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return [float(word) for word in subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()]


if __name__ == "__main__":
    main()
