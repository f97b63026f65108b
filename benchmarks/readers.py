"""Every reader beside the libraries, one format after the other in one run, and one table of all figures at its end.

    python benchmarks/readers.py --part 0.1      # a tenth of the sizes below
    python benchmarks/readers.py                 # 5 million frames, 600,000 messages, a CSV of 1 GB

Each format can be run by itself: readers_blf.py, readers_text.py, readers_mdf.py, readers_mcap.py, readers_csv.py.
Where the library would need many minutes its time a frame is that of the first frames, which its script's output says.
The exit code is 1 where a figure is short of what is asked, or a script did not give all of its own.
"""

from __future__ import annotations

import argparse
import re
import resource
import subprocess
import sys
import time
from pathlib import Path

from figures import Figure, figure, table

HERE = Path(__file__).parent
SIZES = {
    "readers_blf.py": ("--count", 5_000_000, 6),
    "readers_text.py": ("--count", 5_000_000, 4),
    "readers_mdf.py": ("--count", 5_000_000, 2),
    "readers_mcap.py": ("--count", 600_000, 3),
    "readers_csv.py": ("--megabytes", 1000, 1),
}
"""Of each script the option of its size, the size, and how many figures it gives."""
MDF = {
    r"ratio ([\d.]+)": ("MF4: asammdf extract_bus_logging / read and decoded", ">=", 2.5),
    r"peak memory ([\d.]+) bytes a frame": ("MF4: peak memory, bytes a frame", "<=", 160),
}
"""Figures of readers_mdf.py, which are within its sentences."""
MINUTES, GIBIBYTES = 15.0, 20.0


def run(script: str, option: str, size: int) -> list[Figure]:
    """Run a script, show what it says, and gather the figures in it."""
    found: list[Figure] = []
    command = [sys.executable, "-u", str(HERE / script), option, str(size)]
    with subprocess.Popen(command, cwd=HERE, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout or ():
            print(line, end="", flush=True)
            one = figure(line)
            found += [one] if one else []
            if script == "readers_mdf.py":
                found += of_mdf(line)
    return found


def of_mdf(line: str) -> list[Figure]:
    """Figures within a line of readers_mdf.py."""
    hits = ((re.search(pattern, line), rest) for pattern, rest in MDF.items())
    return [Figure(what, float(hit[1]), sense, asked) for hit, (what, sense, asked) in hits if hit]


def main() -> int:
    """Run all, then the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", type=float, default=1.0, help="of the sizes")
    part = parser.parse_args().part
    start, figures, silent = time.perf_counter(), list[Figure](), []
    for script, (option, size, count) in SIZES.items():
        began = time.perf_counter()
        print(f"== {script}", flush=True)
        found = run(script, option, max(int(part * size), 1))
        figures += found
        silent += [] if len(found) == count else [script]
        print(f"   {time.perf_counter() - began:.0f} s", flush=True)
    minutes = (time.perf_counter() - start) / 60
    largest = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 2**20
    figures += [
        Figure("all of it, minutes", minutes, "<=", MINUTES),
        Figure("largest process, libraries included, GiB", largest, "<=", GIBIBYTES),
    ]
    print("== all figures: measured, asked")
    print(table(figures))
    print("".join(f"{script}: SHORT, it did not give all its figures\n" for script in silent), end="")
    return int(bool(silent) or not all(f.holds for f in figures))


if __name__ == "__main__":
    sys.exit(main())
