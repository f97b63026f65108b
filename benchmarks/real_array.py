"""Faults put into a real recording: the 24 accelerometers and 24 rate sensors of the MIMU4444 board, turned by hand.

    python benchmarks/real_array.py --windows 3 --channels 6
    python benchmarks/real_array.py                              # all of it: about 2000 diagnoses

Windows of 10 s of ../shared/data/mimu-array (made by others, never copied here), with all eight IMUs and with a subset
of three. Into each accelerometer in turn go seven faults; printed are, for each, how often the right channel was named,
alone or in a group, another one, or none; and the alarms on the untouched windows.

The rate sensors really clip at 2000 deg/s in every one of these windows. Naming a rate sensor that does is right, not
an alarm: names of such channels are set aside before an answer is judged. `--mask-rails` makes their clipped samples
invalid beforehand, for a run in which nothing real is wrong.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are small

import numpy as np
from trials import FAILURES, Outcome, judge

import nineaudit as na
from nineaudit.array import FloatArray, SensorArray
from nineaudit.case import Case
from nineaudit.diagnose import Diagnosis, diagnose
from nineaudit.recording import Recording, Trace

DATA = Path(__file__).parents[1] / ".." / "shared" / "data" / "mimu-array"
WINDOW_S, RAIL = 10.0, 34.85
"""Length of a window, s; rad/s at which a rate sensor is at its end (2000 deg/s is 34.907)."""
SUBSET = (1, 4, 6)
"""Three IMUs that are not on one line, two on one face of the board and one on the other."""
UNTOUCHED = "untouched"


@dataclass(frozen=True)
class Result:
    """One diagnosis: the window's number, how many IMUs, the fault and its channels, and the answer."""

    window: int
    imus: int
    fault: str
    culprits: tuple[str, ...]
    outcome: Outcome
    said: str
    word: str | None
    statistic: float | None
    seconds: float


def scaled(values: FloatArray, _: FloatArray) -> FloatArray:
    return values * 1.1


def shifted(values: FloatArray, _: FloatArray) -> FloatArray:
    """5 m/s² from a third of the window on."""
    return values + np.where(np.arange(len(values)) >= len(values) // 3, 5.0, 0.0)


def dropped(values: FloatArray, time: FloatArray) -> FloatArray:
    """Zero for 20 ms (one sample or two) about the peak."""
    peak = time[np.nanargmax(np.abs(values))]
    return np.where(np.abs(time - peak) <= 0.010, 0.0, values)


def reversed_sign(values: FloatArray, _: FloatArray) -> FloatArray:
    return -values


def late(values: FloatArray, _: FloatArray) -> FloatArray:
    """One sample, 16 ms."""
    return np.concatenate([values[:1], values[:-1]])


def clipped(values: FloatArray, _: FloatArray) -> FloatArray:
    """At 60 % of the peak."""
    level = 0.6 * float(np.nanmax(np.abs(values)))
    return np.clip(values, -level, level)


FAULTS: dict[str, Callable[[FloatArray, FloatArray], FloatArray]] = {
    "gain 10 %": scaled,
    "zero shift 5 m/s²": shifted,
    "dropout 20 ms": dropped,
    "polarity": reversed_sign,
    "delay of one sample": late,
    "clipping at 60 %": clipped,
}
SWAP = "swap"


def window(recording: Recording, number: int) -> Recording:
    """The samples of one window, with their native traces."""
    start = recording.time[0] + number * WINDOW_S
    inside = (recording.time >= start) & (recording.time < start + WINDOW_S)
    return with_readings(replace(recording, time=recording.time[inside]), recording.readings[inside])


def with_readings(recording: Recording, readings: FloatArray) -> Recording:
    """The same recording with other readings (n,k) SI, native traces too."""
    array = recording.rig.array
    native = tuple(Trace(s.channel, s.signal, recording.time, readings[:, i]) for i, s in enumerate(array.sensors))
    return replace(recording, readings=readings, valid=np.isfinite(readings), native=native)


def only(recording: Recording, imus: Sequence[int]) -> Recording:
    """The sensors of some IMUs."""
    names = recording.rig.array.channels
    columns = [i for i, name in enumerate(names) if name.startswith(tuple(f"imu{k}_" for k in imus))]
    rig = replace(recording.rig, array=SensorArray(tuple(recording.rig.array.sensors[c] for c in columns)))
    clocks = tuple(recording.clocks[c] for c in columns)
    return with_readings(replace(recording, rig=rig, clocks=clocks), recording.readings[:, columns])


def railed(recording: Recording) -> FloatArray:
    """(n,k) samples at which a rate sensor really is at its end."""
    return (np.abs(recording.readings) >= RAIL) & ~recording.rig.array.is_accelerometer


def faulty(recording: Recording, fault: str, channel: str) -> tuple[Recording, tuple[str, ...]]:
    """The recording with a fault in one channel, or two swapped: the partner is the next axis of the same IMU."""
    array, readings = recording.rig.array, recording.readings.copy()
    column = array.index(channel)
    if fault == SWAP:
        partner = channel[:-1] + {"x": "y", "y": "z", "z": "x"}[channel[-1]]
        readings[:, [column, array.index(partner)]] = readings[:, [array.index(partner), column]]
        return with_readings(recording, readings), (channel, partner)
    readings[:, column] = FAULTS[fault](readings[:, column], recording.time)
    return with_readings(recording, readings), (channel,)


def diagnosis(recording: Recording) -> Diagnosis:
    """As the audit makes it, without its other rules."""
    case = Case(recording)
    return diagnose(case, {found.channel: found.fault for found in case.evidence if found.fault is not None})


def examine(recording: Recording, number: int, imus: int, fault: str, culprits: tuple[str, ...]) -> Result:
    """One diagnosis, judged without the names of channels that really are at their end."""
    start, word, statistic = time.perf_counter(), None, None
    try:
        found = diagnosis(recording)
    except FAILURES as error:
        outcome, said = Outcome.UNDIAGNOSED, f"{type(error).__name__}: {error}"
    else:
        real = {c for c, any_ in zip(recording.channels, railed(recording).any(axis=0), strict=True) if any_}
        left = tuple(c for c in found.channels if c not in real)
        status = "healthy" if found.channels and not left else str(found.status)
        outcome, said = judge((status, left), culprits), f"{found.status} {', '.join(found.channels)}".strip()
        word = found.candidates[0].fault if found.candidates else None
        statistic = found.healthy_statistic
    seconds = time.perf_counter() - start
    return Result(number, imus, fault, culprits, outcome, said, word, statistic, seconds)


def examine_window(
    recording: Recording, number: int, imus: int, channels: int | None, seed: int, faults: Sequence[str]
) -> list[Result]:
    """The untouched window, and each of the faults in each accelerometer or in `channels` of them, drawn."""
    array = recording.rig.array
    names = [name for name, held in zip(array.channels, array.is_accelerometer, strict=True) if held]
    if channels is not None and channels < len(names):
        rng = np.random.default_rng([seed, number, imus])
        names = sorted(rng.choice(names, channels, replace=False).tolist())
    out = [examine(recording, number, imus, UNTOUCHED, ())]
    for fault in faults:
        out += [examine(found, number, imus, fault, bad) for found, bad in (faulty(recording, fault, c) for c in names)]
    return out


def table(results: Sequence[Result]) -> str:
    """Markdown: per cent by fault and number of IMUs."""
    columns = (Outcome.ALONE, Outcome.GROUP, Outcome.WRONG, Outcome.OTHER, Outcome.UNDIAGNOSED, Outcome.MISSED)
    lines = ["| IMUs | fault | n | " + " | ".join(map(str, columns)) + " | s |", "|--:|---|" + "--:|" * 8]
    for imus in sorted({r.imus for r in results}, reverse=True):
        mine = [r for r in results if r.imus == imus]
        rows = [(fault, [r for r in mine if r.fault == fault]) for fault in (UNTOUCHED, *FAULTS, SWAP)]
        rows = [(fault, group) for fault, group in rows if group]
        rows.append(("all faults", [r for r in mine if r.fault != UNTOUCHED]))
        for fault, group in rows:
            count = Counter(r.outcome for r in group)
            cells = [f"{100 * count[c] / len(group):.0f}" for c in columns]
            seconds = f"{np.median([r.seconds for r in group]):.2f}"
            lines.append("| " + " | ".join([str(imus), fault, str(len(group)), *cells, seconds]) + " |")
    return "\n".join(lines)


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--windows", type=int, default=10, help="of 10 s, spread over the recording")
    parser.add_argument("--channels", type=int, help="accelerometers drawn in each window; all without")
    parser.add_argument("--imus", nargs="+", default=["8", "3"], choices=["8", "3"], help="all eight, the subset")
    parser.add_argument("--mask-rails", action="store_true", help="clipped samples of the rate sensors are invalid")
    parser.add_argument("--only", nargs="+", metavar="FAULT", default=[*FAULTS, SWAP], help="faults to be put in")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, help="every diagnosis, one JSON object a line")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> None:
    options = parse(arguments)
    if not DATA.is_dir():
        sys.exit("the real recordings (../shared/data) are not on this machine")
    whole = na.read(DATA / "recording.csv", na.load_rig(DATA / "rig.toml"))
    count = int((whole.time[-1] - whole.time[0]) // WINDOW_S)
    results: list[Result] = []
    for number in np.unique(np.linspace(0, count - 1, min(options.windows, count)).round().astype(int)).tolist():
        part = window(whole, number)
        if options.mask_rails:
            part = with_readings(part, np.where(railed(part), np.nan, part.readings))
        for imus in map(int, options.imus):
            chosen = part if imus == 8 else only(part, SUBSET)
            results += examine_window(chosen, number, imus, options.channels, options.seed, options.only)
            print(f"window {number}, {imus} IMUs: {len(results)} diagnoses", file=sys.stderr)
            if options.json:
                options.json.write_text("".join(json.dumps(r.__dict__) + "\n" for r in results), encoding="utf-8")
    print(table(results))
    for r in results:
        if r.fault == UNTOUCHED or r.outcome in (Outcome.WRONG, Outcome.OTHER):
            cost = "" if r.statistic is None else f", {r.statistic:.3g} per degree of freedom"
            print(f"- window {r.window}, {r.imus} IMUs, {r.fault} {' '.join(r.culprits)}: {r.said}{cost}")


if __name__ == "__main__":
    main()
