"""Every reader beside the libraries, one format after the other in one run.

    python benchmarks/readers.py --part 0.1      # a tenth of the sizes below
    python benchmarks/readers.py                 # 5 million frames, 600,000 messages, a CSV of 1 GB: an hour

Each format can be run by itself: readers_blf.py, readers_text.py, readers_mdf.py, readers_mcap.py, readers_csv.py.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
SIZES = {
    "readers_blf.py": ("--count", 5_000_000),
    "readers_text.py": ("--count", 5_000_000),
    "readers_mdf.py": ("--count", 5_000_000),
    "readers_mcap.py": ("--count", 600_000),
    "readers_csv.py": ("--megabytes", 1000),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--part", type=float, default=1.0, help="of the sizes")
    part = parser.parse_args().part
    for script, (option, size) in SIZES.items():
        print(f"== {script}", flush=True)
        subprocess.run([sys.executable, HERE / script, option, str(max(int(part * size), 1))], cwd=HERE, check=True)


if __name__ == "__main__":
    main()
