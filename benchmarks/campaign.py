"""A campaign on Dask beside as many plain processes, in one run: throughput as a ratio, memory of the client.

    python benchmarks/campaign.py --count 200       # a quick look; starting Dask weighs more
    python benchmarks/campaign.py                   # 5,000 recordings in mixed formats, two workers

The recordings are simulated once, each with noise of its own, every tenth with a clipped channel, in CSV, Parquet,
MCAP, BLF, ASC and ISO-MME in turn (--folder keeps them for the next run). Each plain process is a loop of audit_one
over its share of the list, into another lake: what the machine can do without any scheduler; the mean of their times
counts, for their shares are not quite equal. No reports are kept.
Processor times are told, too: they hold where the machine is shared and the load changes from one to the other.
Tasks that do nothing (--empty) tell what a task costs besides its audit. The exit code is 1 where the ratio is below
0.90 or the client's memory grows.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

ONE = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
FORMATS = ("csv", "parquet", "mcap", "blf", "asc", "mme")
CAN = (".blf", ".asc")
FAULTY = 10
"""One in so many has a fault and costs more: plain processes take runs of so many in turn, to have as much each."""
RATIO, GROWTH = 0.90, 16 * 2**20
"""Asked: throughput of Dask by that of plain processes; bytes that the client may grow from its first tenth on."""


def name(i: int) -> str:
    """The file of a recording, from the folder of all; a test of ISO-MME has a folder of its own."""
    kind = FORMATS[i % len(FORMATS)]
    return f"T{i:05d}/T{i:05d}.mme" if kind == "mme" else f"T{i:05d}.{kind}"


def write(folder: Path, count: int, duration: float) -> None:
    """The recordings that are not there yet, and their rig."""
    from nineaudit.presets import preset_text
    from nineaudit.rig import load_rig
    from nineaudit.simulate import simulate
    from nineaudit.writers import make_dbc, write_recording

    folder.mkdir(parents=True, exist_ok=True)
    rig_file, dbc = folder / "rig.toml", folder / "rig.dbc"
    text = preset_text("naap-3222")
    if not dbc.exists():
        rig_file.write_text(text, encoding="utf-8")
        dbc.write_text(make_dbc(load_rig(rig_file)), encoding="utf-8")
    rig = load_rig(rig_file)
    for i in range(count):
        path = folder / "tests" / name(i)
        if path.exists():
            continue
        path.parent.mkdir(parents=True, exist_ok=True)
        faults = ["a1y:clipping=0.5"] if i % FAULTY == 0 else []
        made = simulate(rig, "general", faults=faults, seed=i, duration_s=duration).recording
        write_recording(made, path, dbc=[dbc] if path.suffix in CAN else None)


def table(folder: Path, count: int) -> Path:
    """The recordings with their databases, as a campaign is told of them."""
    rows = [f"{one},../rig.toml,{'../rig.dbc' if one.endswith(CAN) else ''}" for one in map(name, range(count))]
    file = folder / "tests" / f"first-{count}.csv"
    file.write_text("\n".join(["recording,rig,dbc", *rows, ""]), encoding="utf-8")
    return file


def plain(folder: Path, lake: str, names: list[str]) -> None:
    """One plain process: its share of the list, one after the other."""
    from nineaudit.campaign.task import audit_one

    for one in names:
        dbc = [folder / "rig.dbc"] if one.endswith(CAN) else []
        audit_one(str(folder / "tests" / one), folder / "rig.toml", lake=lake, dbc=dbc, reports="none")


def busy(process: psutil.Process) -> float:
    """Processor time of a process and all below it that are there, s."""
    times = [one.cpu_times() for one in (process, *process.children(recursive=True))]
    return sum(one.user + one.system for one in times)


def by_processes(folder: Path, lake: Path, count: int, workers: int) -> tuple[list[float], float]:
    """Seconds that each plain process takes, and their processor time."""
    before = os.times()
    command = [sys.executable, __file__, "--folder", str(folder), "--count", str(count), "--workers", str(workers)]
    began = time.perf_counter()
    running = [
        subprocess.Popen([*command, "--share", str(i), "--lake", str(lake)], env={**os.environ, **ONE})
        for i in range(workers)
    ]
    seconds = []
    while running:
        for process in [one for one in running if one.poll() is not None]:
            assert process.returncode == 0
            running.remove(process)
            seconds.append(time.perf_counter() - began)
        time.sleep(0.05)
    after = os.times()
    return seconds, after.children_user + after.children_system - before.children_user - before.children_system


def by_dask(folder: Path, lake: Path, count: int, workers: int) -> tuple[float, float, float, list[int]]:
    """(seconds that a campaign takes, of these until the first is done, processor time of all, memory of the client now
    and then)."""
    from nineaudit.campaign import campaigning

    me, held, first, worked = psutil.Process(), [], [], []
    began, before = time.perf_counter(), busy(me)

    def watched(lake: object, done: object) -> object:
        for i, summary in enumerate(noted(lake, done)):
            first or first.append(time.perf_counter() - began)
            if i % max(count // 20, 1) == 0:
                held.append(me.memory_info().rss)
            if i == count - 1:  # workers and their audits are still there
                worked.append(busy(me) - before)
            yield summary

    noted, campaigning._noted = campaigning._noted, watched
    plan = campaigning.Plan((str(table(folder, count)),), str(lake), workers=workers, reports="none", fail_on="never")
    plan.run(print, print)
    seconds = time.perf_counter() - began
    return seconds, first[0], worked[0], [*held, me.memory_info().rss]


def nothing(request: dict[str, object]) -> dict[str, object]:
    """A task that does nothing."""
    return {"uri": request["uri"], "verdict": "pass", "gate": None, "kept": False}


def overhead(count: int, workers: int) -> None:
    """What a task costs besides its audit, with the process of the worker that answers at once."""
    from nineaudit.campaign.running import run

    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).parent), *([before] if before else [])])
    began, first = time.perf_counter(), 0.0
    for _ in run(({"uri": str(i)} for i in range(count)), workers=workers, function="campaign:nothing"):
        first = first or time.perf_counter()
    print(f"start of Dask {first - began:.1f} s; {1000 * (time.perf_counter() - first) / count:.2f} ms an empty task")


def compare(folder: Path, count: int, workers: int, duration: float) -> bool:
    """Run both and print the figures; whether they are as asked."""
    began = time.perf_counter()
    write(folder, count, duration)
    print(f"{count} recordings are there after {time.perf_counter() - began:.0f} s", flush=True)
    with tempfile.TemporaryDirectory() as place:
        each, alone_busy = by_processes(folder, Path(place) / "plain", count, workers)
        alone = sum(each) / workers  # as if their shares took equally long
        told = ", ".join(f"{one:.0f}" for one in each)
        print(f"plain processes: {count / alone:.2f} recordings a second, {told} s", flush=True)
        seconds, start, dask_busy, held = by_dask(folder, Path(place) / "dask", count, workers)
        same = [results(Path(place) / kind) for kind in ("plain", "dask")]
    assert same[0] == same[1], "the lakes differ"
    ratio, growth = alone / seconds, held[-1] - held[len(held) // 10]
    print(f"Dask: {count / seconds:.2f} recordings a second, {seconds:.0f} s, of these {start:.1f} s until the first")
    print(f"both lakes hold the same {len(same[0])} results, {sum(same[0].values()) / count / 1000:.1f} kB each")
    print(f"memory of the client: {held[0] / 2**20:.0f} MiB at first, {held[-1] / 2**20:.0f} MiB at the end")
    print(
        f"processor time of a recording: plain {alone_busy / count:.3f} s, Dask {dask_busy / count:.3f} s with its own"
    )
    print(f"ratio {ratio:.3f} (asked: {RATIO:.2f})")
    return ratio >= RATIO and growth <= GROWTH


def results(lake: Path) -> dict[str, int]:
    """Name -> bytes of each result."""
    return {path.name: path.stat().st_size for path in (lake / "results").rglob("*.json")}


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--count", type=int, default=5000, help="recordings")
    options.add_argument("--workers", type=int, default=2, help="workers, and plain processes")
    options.add_argument("--duration", type=float, default=0.1, help="of a recording, s at 10 kHz")
    options.add_argument("--folder", type=Path, help="where the recordings are kept; default: a fresh one that goes")
    options.add_argument("--share", type=int, help=argparse.SUPPRESS)
    options.add_argument("--lake", help=argparse.SUPPRESS)
    options.add_argument("--empty", type=int, default=2000, help="tasks that do nothing")
    given = options.parse_args()
    if given.share is not None:
        mine = [i for i in range(given.count) if i // FAULTY % given.workers == given.share]
        plain(given.folder, given.lake, [name(i) for i in mine])
        return 0
    overhead(given.empty, given.workers)
    with tempfile.TemporaryDirectory() as fresh:
        return 0 if compare(given.folder or Path(fresh), given.count, given.workers, given.duration) else 1


if __name__ == "__main__":
    sys.exit(main())
