"""Is the right channel named? Many simulated recordings, audited; tables by fault and severity, in Markdown.

    python benchmarks/diagnosis.py --count 1000 --output docs/diagnosis-benchmark.md
    python benchmarks/diagnosis.py --count 60 --only gain zero_shift
    python benchmarks/diagnosis.py --case gain/7 delay/12

Beside the audit stand the closed forms of the literature and their naive white-noise test (closed_forms.py). The same
seed and count give the same document but for the seconds.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from trials import Trial


def main(arguments: Sequence[str] | None = None) -> None:
    options = parse(arguments)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy is loaded, here and in the workers
    from draws import names
    from scores import report

    wanted = options.case or names(options.count, options.only)
    trials = list(run(wanted, options))
    if options.case:
        print(json.dumps([asdict(t) for t in trials], indent=1))
        return
    text = report(trials, command(options))
    if options.output:
        options.output.write_text(text, encoding="utf-8")
    else:
        print(text)


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=400, help="recordings")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", metavar="FAULT", help="fault words, healthy, white")
    parser.add_argument("--case", nargs="+", metavar="FAULT/NUMBER", help="these recordings, each in full")
    parser.add_argument("--preset", default="naap-3222", help="layout of the array")
    parser.add_argument("--least-signal", type=float, default=0.25, help="of the largest peak, for a faulty channel")
    parser.add_argument("--jobs", type=int, default=2, help="processes; 0: this one")
    parser.add_argument("--output", type=Path, help="Markdown file; else standard output")
    parser.add_argument(
        "--json", type=Path, help="file of trials, a JSON object a line; a run that was cut off goes on from it"
    )
    options = parser.parse_args(arguments)
    options.start = time.perf_counter()
    return options


def run(wanted: Sequence[str], options: argparse.Namespace) -> Iterator[Trial]:
    """The trials in the order of `wanted`; those that stand in the file of trials are not run again."""
    from trials import from_json

    done = {}
    if options.json and options.json.is_file():
        kept = map(from_json, options.json.read_text(encoding="utf-8").splitlines())
        done = {t.name: t for t in kept}
    missing = [name for name in wanted if name not in done]
    with options.json.open("a", encoding="utf-8") if options.json else nullcontext() as out:
        for count, found in enumerate(fresh(missing, options), 1):
            done[found.name] = found
            if out is not None:
                print(json.dumps(asdict(found)), file=out, flush=True)
            if count % 50 == 0:
                took = time.perf_counter() - options.start
                print(f"{count} of {len(missing)} after {took:.0f} s", file=sys.stderr)
    yield from (done[name] for name in wanted)


def fresh(names: Sequence[str], options: argparse.Namespace) -> Iterator[Trial]:
    """Trials as they are done, in as many processes as asked for."""
    from trials import trial

    work = partial(trial, seed=options.seed, preset=options.preset, least_signal=options.least_signal)
    if options.jobs == 0:
        yield from map(work, names)
        return
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        yield from pool.imap_unordered(work, names)


def command(options: argparse.Namespace) -> str:
    """The command line that makes the same document."""
    line = f"python benchmarks/diagnosis.py --count {options.count} --seed {options.seed}"
    line += f" --preset {options.preset}" if options.preset != "naap-3222" else ""
    line += f" --least-signal {options.least_signal:g}" if options.least_signal != 0.25 else ""
    return line + (f" --only {' '.join(options.only)}" if options.only else "")


if __name__ == "__main__":
    main()
