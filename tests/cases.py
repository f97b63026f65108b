"""Cases as data: what ``fixtures/cases/CODE.toml`` may say, and how it becomes a recording.

[[case]]
name = "one channel clips at half its peak"
motion = "general"            # of simulate.MOTIONS
verdict = "fail"              # what the rule must answer
channels = ["a1y"]            # absent: any; given: these have the verdict, all others pass
preset = "naap-3222"          # with arms = [...] in mm if need be; or rig = '''...''': a whole rig file
faults = ["a1y:clipping=0.5"]
seed = 0
rate = 10000.0
imperfect = true
noise = true
[case.record]                 # what happened to the record itself, times in s
gaps = [[0.03, 0.035]]        # samples lost in all channels
jitter = 2e-5                 # standard deviation of the stamps
repeat = 3                    # so many stamps are those of the sample before
quantise = {a1y = 5.0}        # step, SI
stamps = {a2x = {drift = 5e-4, late = 3e-4, jump = 1e-4}}  # its clock runs fast, is late, jumps in the middle
[case.counts]                 # what the container held (CAN frames)
frames = 1000
[[case.damage]]               # what of the file could not be read (recording.Damage)
what = "a container cannot be inflated"
place = "byte 4711"
[case.bus]                    # what was on a CAN bus (tests/bus_logs.py)
[case.provenance]             # the record of a repair that comes with the file
[[case.waiver]]               # as in a waiver file
rule = "RQ202"
"""

from __future__ import annotations

import datetime as dt
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bus_logs import bus_from
from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.engine import run
from nineaudit.finding import Finding
from nineaudit.provenance import Provenance
from nineaudit.readers.clocks.assemble import assemble
from nineaudit.readers.contents import Contents
from nineaudit.recording import Damage, Recording
from nineaudit.rig import parse_rig, preset_text
from nineaudit.rulebook import load_rulebook
from nineaudit.simulate import simulate
from nineaudit.waivers import parse_waivers

FOLDER = Path(__file__).parents[1] / "fixtures" / "cases"
TODAY = dt.date(2026, 6, 1)
KEYS = {
    "name", "motion", "verdict", "channels", "preset", "rig", "faults", "seed", "rate", "imperfect", "noise",
    "duration", "gravity", "arms", "record", "counts", "damage", "bus", "waiver", "provenance",
}  # fmt: skip


def all_cases() -> Iterator[tuple[str, Mapping[str, Any]]]:
    """(code of the rule, case) of every file."""
    for path in sorted(FOLDER.glob("*.toml")):
        for case in tomllib.loads(path.read_text(encoding="utf-8"))["case"]:
            assert set(case) <= KEYS, f"{path.name}: unknown keys {set(case) - KEYS}"
            yield path.stem, case


def recording_of(case: Mapping[str, Any]) -> Recording:
    rig = parse_rig(case.get("rig") or preset_text(case.get("preset", "naap-3222"), arms=case.get("arms")))
    simulated = simulate(
        rig,
        case.get("motion", "general"),
        faults=case.get("faults", ()),
        seed=case.get("seed", 0),
        rate_hz=case.get("rate", 10_000.0),
        duration_s=case.get("duration"),
        imperfect=case.get("imperfect", True),
        noise=case.get("noise", True),
        gravity=case.get("gravity", False),
    ).recording
    disturbed = _disturbed(simulated, case["record"], case.get("seed", 0)) if "record" in case else simulated
    bus = bus_from(case["bus"]) if "bus" in case else None
    damage = tuple(Damage(**place) for place in case.get("damage", ()))
    record = Provenance(case["provenance"], "T0001.csv.provenance.json") if "provenance" in case else None
    source = replace(disturbed.source, counts=case.get("counts", {}), damage=damage, provenance=record)
    return replace(disturbed, bus=bus, source=source)


def findings_of(code: str, case: Mapping[str, Any]) -> list[Finding]:
    """The findings of one rule on a case; all rules are run where waivers are concerned."""
    waivers = parse_waivers({"waiver": case["waiver"]}) if "waiver" in case else None
    book = load_rulebook() if waivers is not None else load_rulebook(select=code)
    found = run(Case(recording_of(case)), book, waivers=waivers, today=TODAY)
    return [f for f in found if f.rule == code]


def _disturbed(recording: Recording, how: Mapping[str, Any], seed: int) -> Recording:
    """The recording as a reader would find it after what `how` says, assembled anew."""
    rng = np.random.default_rng(seed)
    time = np.array(recording.time) + how.get("jitter", 0.0) * rng.standard_normal(recording.time.size)
    struck = rng.choice(np.arange(1, time.size), how.get("repeat", 0), replace=False)
    time[struck] = time[struck - 1]
    kept = np.ones(time.size, dtype=np.bool_)
    for start, end in how.get("gaps", ()):
        kept &= (recording.time < start) | (recording.time > end)
    steps = how.get("quantise", {})
    traces = []
    for trace, sensor in zip(recording.native, recording.rig.array.sensors, strict=True):
        step = steps.get(trace.channel)
        values = trace.values if step is None else step * np.round(trace.values / step)
        unit = "m/s^2" if sensor.kind == "accelerometer" else "rad/s"
        own = _stamps(time[kept], how.get("stamps", {}).get(trace.channel, {}))
        traces.append(replace(trace, time=own, values=values[kept], unit=unit))
    return assemble(Contents(tuple(traces)), recording.rig, recording.source)


def _stamps(time: FloatArray, clock: Mapping[str, float]) -> FloatArray:
    """What a clock of its own makes of the stamps: `drift` counts from the first."""
    assert set(clock) <= {"drift", "late", "jump"}
    jump = np.where(time > time.mean(), clock.get("jump", 0.0), 0.0)
    return np.asarray(time[0] + (time - time[0]) / (1.0 + clock.get("drift", 0.0)) + clock.get("late", 0.0) + jump)
