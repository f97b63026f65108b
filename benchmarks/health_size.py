"""How long does `campaign health` take with thousands of tests? Time and memory by the size of a campaign, in Markdown.

    python benchmarks/health_size.py --tests 1250 2500 5000
    python benchmarks/health_size.py --tests 5000 --moved --lake build/lake      # and call it as a user would

Nine channels a test, 225 sensors in 25 rigs, one of them with a drift of 2 % from the middle on. What a test tells (Λ)
is that of a real audit of one of five motions; its errors are drawn from the model, not audited one by one. The sensors
of a rig move on by a seat twice; `--moved`: to the next rig, so that all sensors are connected.
"""

from __future__ import annotations

import argparse
import base64
import os
import sys
import time
from collections.abc import Iterator, Sequence
from copy import deepcopy
from datetime import date, timedelta
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import health as audited
import numpy as np

from nineaudit.array import FloatArray

RIGS, CHANNELS, CULPRIT = 25, 9, 100
PARAMETERS = ("gain", "tilt_1", "tilt_2", "position_x", "position_y", "position_z")
FIRST_DAY = date(2016, 1, 4)
DRIFT = 0.02


def main(arguments: Sequence[str] | None = None) -> None:
    options = parse(arguments)
    from nineaudit.campaign.health import assess

    real = templates()
    print("| tests | processor time | memory at most | accused |\n|---|---|---|---|")
    for tests in options.tests:
        start = time.process_time()
        made = list(entries(real, tests, options.seed, options.moved))
        if options.lake is not None:
            write(made, options.lake)
        spent = time.process_time() - start
        found = assess(made)
        accused = ", ".join(m.name for m in (*found.sensors, *found.seats) if m.deviations)
        print(
            f"| {tests:,} | {time.process_time() - start - spent:.1f} s | {memory():.0f} MB | {accused} |", flush=True
        )


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tests", type=int, nargs="+", default=[1250, 2500, 5000])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--moved", action="store_true", help="sensors move from rig to rig")
    parser.add_argument("--lake", type=Path, help="a new folder: the entries are written there too")
    return parser.parse_args(arguments)


def memory() -> float:
    """MB at most so far, of this process: the entries, as JSON objects, included."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def templates() -> list[dict[str, Any]]:
    """Entries of real audits, one of each motion."""
    count = audited.RIGS * len(audited.MOTIONS)
    made = (
        audited.entry(number, tests=count, seed=0, drift=0.0, swaps=0, work=None)
        for number in range(0, count, audited.RIGS)
    )
    return [entry for entry in made if entry["result"]["sensors"]["information"]]


def entries(real: Sequence[dict[str, Any]], tests: int, seed: int, moved: bool) -> Iterator[dict[str, Any]]:
    """Entries of the lake, test by test."""
    from nineaudit.report.sensors import unpacked

    told = [unpacked(entry["result"]["sensors"]["information"])[1] for entry in real]
    for number in range(tests):
        which = (number // RIGS) % len(real)
        yield _entry(real[which], told[which], number, tests, seed, moved)


def _entry(real: dict[str, Any], matrix: FloatArray, number: int, tests: int, seed: int, moved: bool) -> dict[str, Any]:
    rng = np.random.default_rng([seed, 3, number])
    rig, turn = number % RIGS, 3 * number // tests
    sensors = [CHANNELS * ((rig + turn * moved) % RIGS) + (c + turn * (not moved)) % CHANNELS for c in range(CHANNELS)]
    block = deepcopy(real["result"]["sensors"])
    for channel, sensor in zip(block["channels"], sensors, strict=True):
        channel["serial"] = f"S{sensor:03d}"
        channel["shock"] *= rng.uniform(0.5, 1.5)
    theta = errors(block, sensors, rig, seed, DRIFT * (2 * number >= tests), rng)
    values, vectors = np.linalg.eigh(matrix)
    noise = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(len(values)))
    block["information"]["eta"] = base64.b64encode((matrix @ theta + noise).astype("<f4").tobytes()).decode("ascii")
    return real | {
        "uri": f"T{number:05d}.csv",
        "key": f"{number:032x}",
        "test": {"number": f"T{number:05d}", "date": (FIRST_DAY + timedelta(3650 * number // tests)).isoformat()},
        "result": real["result"]
        | {
            "recording": real["result"]["recording"] | {"sha256": f"{number:064x}"},
            "rig": real["result"]["rig"] | {"name": f"head {rig}"},
            "sensors": block,
        },
    }


def errors(
    block: dict[str, Any], sensors: Sequence[int], rig: int, seed: int, drift: float, rng: np.random.Generator
) -> FloatArray:
    """The errors of a test in the rig's standard uncertainties: of sensor and seat as audited.true_instrument has them,
    and the scatter from test to test."""
    channels = [c["channel"] for c in block["channels"]]
    own = np.array([np.random.default_rng([seed, 1, s]).standard_normal(3) for s in sensors])
    own[:, 0] += drift * (np.array(sensors) == CULPRIT) / 0.005
    seat = np.random.default_rng([seed, 2, rig]).standard_normal((CHANNELS, 5))
    lasting = np.column_stack([own[:, 0], np.sqrt(0.5) * (own[:, 1:] + seat[:, 3:]), seat[:, :3]])
    places = [(channels.index(c), PARAMETERS.index(p)) for c, p in block["information"]["parameters"]]
    scatter = [audited.SCATTER[name.partition("_")[0]] for _, name in block["information"]["parameters"]]
    return np.array([lasting[i] for i in places]) + scatter / np.array(
        block["information"]["prior"]
    ) * rng.standard_normal(len(places))


def write(made: Sequence[dict[str, Any]], folder: Path) -> None:
    """The entries as a lake."""
    from nineaudit.campaign.lake import open_lake, write_entry
    from nineaudit.campaign.lake import write as put
    from nineaudit.files import sealed

    lake = open_lake(folder, create=True)
    for entry in made:
        write_entry(lake, entry | {"result": sealed(entry["result"])})
    put(lake, "head.json", {"edition": "benchmark"})


if __name__ == "__main__":
    sys.exit(main())
