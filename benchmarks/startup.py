"""Whole-process times of what a user waits for: seconds, and ratios to an empty Python and to numpy with scipy.

    python benchmarks/startup.py [--runs 5]

Figures to hold: ``--help`` 0.3 s, ``demo`` 5 s, ``check`` of nine channels × 20,000 samples from CSV 1.5 s. The best
of the runs counts: what else the machine does only adds to a time. One run before them is not counted, so that the
files are in memory and the modules compiled, as they are after `uv pip install --compile-bytecode`.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

NINEAUDIT = (sys.executable, "-m", "nineaudit")
RIG = ("rig", "presets", "naap-3222")
RECORDINGS = {
    "healthy": ("--motion", "alem-quiet", "--duration", "1.975"),
    "a1y clipped": ("--motion", "alem-quiet", "--duration", "1.975", "--fault", "a1y:clipping=0.5"),
    "a1y rebuilt": ("--motion", "general", "--rate", "88890", "--fault", "a1y:clipping=0.5"),
}
"""20,000 samples each, with 25 ms of rest: 2 s at 10 kHz, and a head impact so finely sampled, which is repaired."""

HELP, DEMO, CHECK = 0.3, 5.0, 1.5
"""Figures to hold, s."""


def environment(folder: Path) -> dict[str, str]:
    """This one, with compiled modules kept in `folder` whatever it says of them."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return kept | {"PYTHONPYCACHEPREFIX": str(folder / "compiled")}


def seconds(command: tuple[str, ...], folder: Path, runs: int) -> float:
    """Best time of a process, s. CalledProcessError when it ends with something else than 0 or 1."""
    best = float("inf")
    for i in range(runs + 1):
        start = time.perf_counter()
        done = subprocess.run(command, cwd=folder, capture_output=True, check=False, env=environment(folder))
        elapsed = time.perf_counter() - start
        if done.returncode not in (0, 1):
            raise subprocess.CalledProcessError(done.returncode, command, done.stdout, done.stderr)
        best = min(best, elapsed) if i else best
    return best


def prepare(folder: Path) -> None:
    """The rig and two recordings of nine channels × 20,000 samples."""
    rig = subprocess.run((*NINEAUDIT, *RIG), capture_output=True, check=True).stdout
    (folder / "rig.toml").write_bytes(rig)
    for name, options in RECORDINGS.items():
        file = folder / f"{name}.csv"
        command = (*NINEAUDIT, "simulate", "rig.toml", *options, "--output", file.name)
        subprocess.run(command, cwd=folder, capture_output=True, check=True)
        samples = sum(1 for _ in file.open(encoding="utf-8")) - 1
        print(f"{name}: {samples} samples of 9 channels, {file.stat().st_size / 1e6:.1f} MB")


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
        commands = {"--help": (HELP, ("--help",)), "demo": (DEMO, ("demo",))}
        for name in RECORDINGS:
            commands[f"check, {name}"] = (CHECK, ("check", f"{name}.csv", "--rig", "rig.toml"))
        for label, (limit, arguments) in commands.items():
            took = seconds((*NINEAUDIT, *arguments), folder, runs)
            row = f"{label:<20}{took:>7.2f}{limit:>7.1f}{took / empty:>9.0f}{took / numeric:>15.1f}"
            print(row + ("" if took <= limit else "  over the limit"))


if __name__ == "__main__":
    main()
