"""Is the sensor that drifts found, by its serial number? A campaign of real audits with a planted drift, in Markdown.

    python benchmarks/health.py --tests 200 --drift 0.02 --work build/health
    python benchmarks/health.py --tests 200 --drift 0 --seed 3

Five 3-2-2-2 rigs, 45 sensors. Each sensor has gain and tilt errors, each seat position and tilt errors, drawn from what
the rig files state, and each test adds a scatter of gain (temperature) and of tilt and position (mounting), and a zero
of its own. From the middle test on the gain of one sensor is larger by `--drift`. Recordings are simulated, filtered
(CFC 1000) and audited one by one as `campaign run` would; entries are kept in `--work` and not made again.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import date, timedelta
from functools import cache, partial
from pathlib import Path
from typing import Any

RIGS, CHANNELS = 5, 9
MOTIONS = ("general", "oblique", "drop", "sled", "general")
FIRST_DAY = date(2026, 1, 5)
SCATTER = {"gain": 0.001, "tilt": 1e-3, "position": 5e-5}
"""From test to test, one standard deviation: relative, rad, m."""


def main(arguments: Sequence[str] | None = None) -> None:
    options = parse(arguments)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from nineaudit.campaign.health import assess
    from nineaudit.campaign.health.words import text_table

    made = list(entries(options.tests, options.seed, options.drift, options.swap, options.work, options.jobs))
    print(f"{len(made)} audits, planted: {planted(options.seed)} {options.drift:+.3g} from {day(options.tests // 2)}\n")
    print(text_table(assess(made)))


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tests", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--drift", type=float, default=0.02, help="of the gain of one sensor; 0: none")
    parser.add_argument("--swap", type=int, default=2, help="times that the rigs' sensors change seats")
    parser.add_argument("--work", type=Path, help="folder of entries, kept")
    parser.add_argument("--jobs", type=int, default=2)
    return parser.parse_args(arguments)


def planted(seed: int) -> str:
    """The serial number whose gain drifts."""
    import numpy as np

    return f"S{np.random.default_rng([seed, 99]).integers(RIGS * CHANNELS):03d}"


def day(number: int) -> str:
    """The date of a test: three a week or so."""
    return (FIRST_DAY + timedelta(days=number * 300 // 200)).isoformat()


def entries(
    tests: int, seed: int, drift: float, swaps: int = 2, work: Path | None = None, jobs: int = 0
) -> Iterator[dict[str, Any]]:
    """Entries of the lake, test by test."""
    make = partial(entry, tests=tests, seed=seed, drift=drift, swaps=swaps, work=work)
    if jobs < 2:
        yield from map(make, range(tests))
        return
    from multiprocessing import get_context

    with get_context("spawn").Pool(jobs) as pool:
        yield from pool.imap(make, range(tests))


def entry(number: int, *, tests: int, seed: int, drift: float, swaps: int, work: Path | None) -> dict[str, Any]:
    """One test: simulated, audited, as an entry of the lake."""
    kept = None if work is None else work / f"{seed}-{drift:g}-{swaps}-{tests}-{number:05d}.json"
    if kept is not None and kept.is_file():
        return dict(json.loads(kept.read_text(encoding="utf-8")))
    import nineaudit as na
    from nineaudit.report.machine import result_document

    recording = simulated(number, tests, seed, drift, swaps)
    made = {
        "schema": "nineaudit/lake-entry/1",
        "key": f"{number:032x}",
        "uri": f"T{number:05d}.csv",
        "edition": "benchmark",
        "test": {"number": f"T{number:05d}", "date": day(number)},
        "result": result_document(na.audit(recording)),
    }
    if kept is not None:
        kept.parent.mkdir(parents=True, exist_ok=True)
        kept.write_text(json.dumps(made), encoding="utf-8")
    return made


def seated(rig: int, number: int, tests: int, swaps: int) -> list[int]:
    """The sensors of a rig: at each of `swaps` services in the campaign they move on by a seat."""
    turn = (swaps + 1) * number // tests
    return [CHANNELS * rig + (c + turn) % CHANNELS for c in range(CHANNELS)]


@cache
def rig_of(rig: int, sensors: tuple[int, ...]) -> Any:
    from nineaudit.rig import parse_rig, preset_text

    text, serials = preset_text("naap-3222"), iter(sensors)
    made = parse_rig(re.sub(r"(?m)^channel = .*$", lambda line: f'{line[0]}\nserial = "S{next(serials):03d}"', text))
    return replace(made, name=f"head {rig}")


def simulated(number: int, tests: int, seed: int, drift: float, swaps: int, again: int = 0) -> Any:
    """The recording of a test: a perfect instrument's, and what the errors of this one add to it. `again`: another test
    with the same sensors in the same seats."""
    import numpy as np

    from nineaudit.array import frozen
    from nineaudit.physics.filters import cfc
    from nineaudit.simulate import instrument, simulate

    which = number % RIGS
    sensors = seated(which, number, tests, swaps)
    rig, motion = rig_of(which, tuple(sensors)), MOTIONS[(number // RIGS) % len(MOTIONS)]
    clean = simulate(rig, motion, seed=1_000_000 * seed + number + 500_000 * again, rate_hz=10_000.0, imperfect=False)
    real = true_instrument(rig.array, sensors, which, number + 500_000 * again, seed)
    late = drift * (np.array([f"S{s:03d}" == planted(seed) for s in sensors]) & (number >= tests // 2))
    real = replace(real, gain=real.gain + late)
    ideal = instrument.sense(instrument.perfect(rig.array), clean.truth)
    added = cfc(instrument.sense(real, clean.truth) - ideal, 10_000.0, rig.cfc)
    return replace(clean.recording, readings=frozen(clean.recording.readings + added))


def true_instrument(array: Any, sensors: Sequence[int], rig: int, number: int, seed: int) -> Any:
    """Gain and half of the tilt's variance go with the sensor, position and the other half with the seat."""
    import numpy as np

    from nineaudit.simulate import instrument

    own = np.array([np.random.default_rng([seed, 1, s]).standard_normal(3) for s in sensors])
    seat = np.random.default_rng([seed, 2, rig]).standard_normal((len(array), 5))
    test = np.random.default_rng([seed, 3, number]).standard_normal((len(array), 8))
    u = {name: array.values(f"u_{name}")[:, None] for name in ("gain", "zero", "alignment", "position")}
    tilt = u["alignment"] * np.sqrt(0.5) * (own[:, 1:] + seat[:, 3:]) + SCATTER["tilt"] * test[:, 1:3]
    axes = array.axes + np.array([t @ instrument.across(n) for t, n in zip(tilt, array.axes, strict=True)])
    return replace(
        instrument.perfect(array),
        gain=(u["gain"] * own[:, :1] + SCATTER["gain"] * test[:, :1])[:, 0],
        zero=u["zero"][:, 0] * test[:, 3],
        axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        positions=array.positions + u["position"] * seat[:, :3] + SCATTER["position"] * test[:, 5:],
    )


if __name__ == "__main__":
    sys.exit(main())
