"""Whole-process times of what a user waits for: seconds, and ratios to an empty Python and to numpy with scipy.

    python benchmarks/startup.py [--runs 5]

Figures to hold: ``--help`` 0.3 s, ``demo`` 5 s, ``check`` of nine channels × 20,000 samples from CSV 1.5 s. The best
of the runs counts: what else the machine does only adds to a time. One run before them is not counted, so that the
files are in memory and the modules compiled.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

NINEAUDIT = (sys.executable, "-m", "nineaudit")
RIG = ("rig", "presets", "naap-3222")
SIMULATE = ("simulate", "rig.toml", "--motion", "alem-quiet", "--rate", "10000", "--duration", "1.975")
"""20,000 samples: 1.975 s after the event and 25 ms of rest before it."""

LIMITS = {"--help": 0.3, "demo": 5.0, "check, healthy": 1.5, "check, a1y clipped": 1.5}


def seconds(command: tuple[str, ...], folder: Path, runs: int) -> float:
    """Best time of a process, s. CalledProcessError when it ends with something else than 0 or 1."""
    best = float("inf")
    for _ in range(runs + 1):
        start = time.perf_counter()
        done = subprocess.run(command, cwd=folder, capture_output=True, check=False)
        elapsed = time.perf_counter() - start
        if done.returncode not in (0, 1):
            raise subprocess.CalledProcessError(done.returncode, command, done.stdout, done.stderr)
        best = min(best, elapsed) if _ else best
    return best


def prepare(folder: Path) -> None:
    """The rig and two recordings of nine channels × 20,000 samples."""
    rig = subprocess.run((*NINEAUDIT, *RIG), capture_output=True, check=True).stdout
    (folder / "rig.toml").write_bytes(rig)
    for name, fault in (("healthy.csv", ()), ("clipped.csv", ("--fault", "a1y:clipping=0.5"))):
        subprocess.run((*NINEAUDIT, *SIMULATE, *fault, "--output", name), cwd=folder, capture_output=True, check=True)
        samples = sum(1 for _ in (folder / name).open()) - 1
        print(f"{name}: {samples} samples of 9 channels, {(folder / name).stat().st_size / 1e6:.1f} MB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=5)
    runs = parser.parse_args().runs
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        prepare(folder)
        empty = seconds((sys.executable, "-c", "pass"), folder, runs)
        numeric = seconds((sys.executable, "-c", "import numpy, scipy.linalg"), folder, runs)
        print(f"python -c pass: {empty:.3f} s; import numpy, scipy.linalg: {numeric:.3f} s")
        print(f"{'':<20}{'s':>7}{'limit':>7}{'/ empty':>9}{'/ numpy+scipy':>15}")
        commands = {
            "--help": ("--help",),
            "demo": ("demo",),
            "check, healthy": ("check", "healthy.csv", "--rig", "rig.toml"),
            "check, a1y clipped": ("check", "clipped.csv", "--rig", "rig.toml"),
        }
        for label, arguments in commands.items():
            took = seconds((*NINEAUDIT, *arguments), folder, runs)
            row = f"{label:<20}{took:>7.2f}{LIMITS[label]:>7.1f}{took / empty:>9.0f}{took / numeric:>15.1f}"
            print(row + ("" if took <= LIMITS[label] else "  over the limit"))


if __name__ == "__main__":
    main()
