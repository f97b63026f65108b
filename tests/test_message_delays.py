"""All channels of one message late, by whole cycles or less: said of the message, never of one of its channels."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from nineaudit.array import frozen
from nineaudit.case import Case
from nineaudit.diagnose import Diagnosis, Status, diagnose
from nineaudit.estimate.message_delays import delayed, delays
from nineaudit.readers import Contents, assemble, read
from nineaudit.recording import Message, Recording, Source, Trace
from nineaudit.rig import Rig, parse_rig, preset_text
from nineaudit.simulate import simulate
from nineaudit.writers import write_recording
from nineaudit.writers.dbc import make_dbc

OF_A_SAMPLE = 0.1
"""Of the sampling interval of 1 ms: how near a lag must be found."""
MESSAGES = {"ARRAY_1": "a0x a0y a0z", "ARRAY_2": "a1y a1z a2x", "ARRAY_3": "a2z a3x a3y", "ARRAY_4": "gx gy gz"}


def the_rig(preset: str = "naap-gyro") -> Rig:
    return parse_rig(re.sub(r"(?m)^filter_class.*$", "", preset_text(preset)))


def sampled_together(
    seed: int, late: dict[str, float], faults: tuple[str, ...] = (), named: bool = True, preset: str = "naap-gyro"
) -> Recording:
    """Messages of three channels at 1 kHz, stamped alike, each `late` (ms, whole tenths) of its samples."""
    rig = the_rig(preset)
    fine = simulate(rig, "general", seed=seed, rate_hz=10_000.0, faults=faults).recording
    at, traces = np.arange(50, fine.time.size - 50, 10), []
    for t in fine.native:
        message = next(m for m, channels in MESSAGES.items() if t.channel in channels.split())
        values = frozen(t.values[at - round(10 * late.get(message, 0.0))])
        unit = "m/s^2" if rig.array[t.channel].kind == "accelerometer" else "rad/s"
        traces.append(Trace(t.channel, t.signal, frozen(fine.time[at]), values, unit, message if named else None))
    return assemble(Contents(tuple(traces)), rig, Source(Path("x.blf"), "blf", "", 0))


def answer(*args: object, **named: object) -> Diagnosis:
    return diagnose(Case(sampled_together(*args, **named)))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("message", "late"), [("ARRAY_2", 1.0), ("ARRAY_4", 1.0), ("ARRAY_3", 0.3), ("ARRAY_3", -2.0), ("ARRAY_1", 3.0)]
)
@pytest.mark.parametrize("seed", [0, 1])
def test_a_message_that_is_late_is_named_and_none_of_its_channels(seed: int, message: str, late: float) -> None:
    """A message sent a whole cycle late was `undiagnosed` without a reason; a part of one named `gy` or `a3y` alone."""
    found = answer(seed, {message: late})
    assert (found.status, found.channels) == (Status.UNDIAGNOSED, ())
    assert f"all channels of {message} {'late' if late > 0 else 'early'} by " in found.reason
    assert "unless" not in found.reason
    best = found.candidates[0]
    assert (best.fault, best.channels) == ("delay", tuple(MESSAGES[message].split()))
    assert best.parameters["size"] == pytest.approx(late * 1e-3, abs=OF_A_SAMPLE * 1e-3)
    assert len({c.channels for c in found.candidates if c.fault == "delay"}) == len(
        [c for c in found.candidates if c.fault == "delay"]
    )


def test_messages_that_are_each_later_than_the_one_before() -> None:
    found = answer(0, {m: float(i) for i, m in enumerate(MESSAGES)})
    assert found.status is Status.UNDIAGNOSED
    said = {m: float(ms) * (1 if how == "late" else -1) for m, how, ms in re.findall(
        r"of (ARRAY_\d) (late|early) by ([\d.]+) ms", found.reason)}  # fmt: skip
    assert said == pytest.approx({"ARRAY_1": -1.0, "ARRAY_3": 1.0, "ARRAY_4": 2.0}, abs=OF_A_SAMPLE)
    assert "against those of ARRAY_2" in found.reason


@pytest.mark.parametrize("seed", [3, 5])
def test_a_part_of_a_sample_gains_nothing_by_chance(seed: int) -> None:
    """The price of noise moved by whole samples was taken off it: of seed 3 the name was a3x."""
    found = answer(seed, {"ARRAY_3": 0.3}, preset="naap-3222")
    assert (found.status, found.channels) == (Status.UNDIAGNOSED, ())
    assert "all channels of ARRAY_3 late by 0." in found.reason


def test_what_is_not_late_is_healthy() -> None:
    for seed in range(3):
        assert answer(seed, {}).status is Status.HEALTHY


@pytest.mark.parametrize(
    ("fault", "word"),
    [
        ("a1y:delay=0.001", "delay"),
        ("gy:delay=0.0005", "delay"),
        ("a3x:delay=0.0003", "delay"),
        ("gz:gain=0.9", "gain"),
    ],
)
def test_a_fault_of_one_channel_keeps_its_name(fault: str, word: str) -> None:
    for seed in (0, 1):
        found = answer(seed, {}, (fault,))
        assert (found.status, found.channels) == (Status.ISOLATED, (fault.partition(":")[0],)), found.reason
        assert found.candidates[0].fault == word


def test_a_unit_wrong_in_all_accelerometers_keeps_its_name() -> None:
    right = sampled_together(0, {})
    factor = np.where(right.rig.array.is_accelerometer, 1 / 9.80665, 1.0)
    found = diagnose(Case(replace(right, readings=right.readings * factor)))
    assert found.status is Status.UNDIAGNOSED
    assert found.candidates[0].fault == "unit"


def test_what_is_not_known_to_be_messages_is_not_said_of_them() -> None:
    assert "ARRAY" not in answer(0, {"ARRAY_2": 1.0}, named=False).reason


TWO = (Message("A", (0, 1)), Message("B", (2,)))


def test_lags_are_looked_for_between_messages_on_an_even_time_base() -> None:
    time = np.arange(50) * 1e-3
    assert [c.channels for c in delays(time, TWO)] == [(0, 1)]
    assert len(list(delays(time, (*TWO, Message("C", (3,)))))) == 2
    assert not list(delays(time, TWO[:1]))
    assert not list(delays(np.r_[time, 1.0], TWO))
    assert not list(delays(time, (Message("A", (0,)), Message("B", (1,)), Message("C", (2,)))))


def test_of_two_messages_the_later_is_said() -> None:
    """Only what lies between two messages is felt: A early is B late."""
    early = delayed(TWO, (0,), np.array([-1e-3]))
    assert (early.channels, early.size) == ((2,), 1e-3)
    assert "of B late by 1 ms against those of A:" in early.said


@pytest.mark.parametrize("suffix", ["blf", "mcap"])
def test_readers_say_what_the_samples_came_in(tmp_path: Path, suffix: str) -> None:
    rig = the_rig()
    if suffix == "mcap":
        rig = parse_rig(re.sub(r'(?m)^channel = "(\w)(\w+)"', r'\g<0>\nsignal = "/\1:\2"', rig.text))
    dbc = [tmp_path / "x.dbc"] if suffix == "blf" else []
    for path in dbc:
        path.write_text(make_dbc(rig))
    write_recording(simulate(rig, "general", seed=0).recording, tmp_path / f"x.{suffix}", dbc=dbc)
    found = read(tmp_path / f"x.{suffix}", rig, dbc=dbc)
    names = {m.name: " ".join(found.channels[c] for c in m.columns) for m in found.messages}
    topics = {"/a": "a0x a0y a0z a1y a1z a2x a2z a3x a3y", "/g": "gx gy gz"}
    assert names == (MESSAGES if suffix == "blf" else topics)


def test_files_of_one_recording_are_what_their_channels_came_in(tmp_path: Path) -> None:
    text = "[rig]\nname='x'\n[units]\nacceleration='m/s^2'\n[recording]\nfilter_class='none'\n[uncertainty]\nnoise=1\n"
    for c in "pq":
        text += f"[[part]]\nfile='{{name}}_{c}.csv'\nchannels=['{c}']\n"
        text += f"[[sensor]]\nchannel='{c}'\nkind='accelerometer'\nposition=[0,0,0]\naxis=[1,0,0]\nrange=100\n"
        (tmp_path / f"T_{c}.csv").write_text(f"time_s,{c}\n" + "".join(f"{i / 100},{i % 7}\n" for i in range(50)))
    found = read(tmp_path / "T_p.csv", parse_rig(text))
    assert found.messages == (Message("T_p.csv", (0,)), Message("T_q.csv", (1,)))
