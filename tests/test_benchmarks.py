"""The benchmark of the diagnosis runs, is the same each time, and judges answers as it says."""

from __future__ import annotations

import json
from dataclasses import asdict
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.fixture(autouse=True)
def scripts_side_by_side(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scripts import each other as they do when one of them is run."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))


def test_answers_are_judged_by_who_is_accused():
    judge, outcome = (trials := import_module("trials")).judge, trials.Outcome
    assert judge(("isolated", ("a1y",)), ("a1y",)) is outcome.ALONE
    assert judge(("isolated", ("a2x", "a1y")), ("a1y", "a2x")) is outcome.ALONE
    assert judge(("isolated", ("a1y",)), ("a1y", "a2x")) is outcome.OTHER
    assert judge(("isolated", ("a1y", "a2x")), ("a1y",)) is outcome.WRONG
    assert judge(("isolated", ("a1y",)), ()) is outcome.WRONG
    assert judge(("ambiguous", ("a1y", "a2x")), ("a2x",)) is outcome.GROUP
    assert judge(("ambiguous", ("a1y", "a2x")), ("a0x",)) is outcome.OTHER
    assert judge(("healthy", ()), ("a0x",)) is outcome.MISSED
    assert judge(("undiagnosed", ()), ("a0x",)) is outcome.UNDIAGNOSED


def test_every_kind_of_fault_is_dealt_and_only_its_channels_differ_from_the_healthy_recording():
    draws = import_module("draws")
    names = draws.names(100)
    assert len(names) == len(set(names)) == 100
    kinds = {name.split("/")[0] for name in names}
    assert kinds == {"healthy", "white", *draws.SEVERITIES}
    for kind in ("healthy", "white", "swap", "stuck", "dropout", "position", "unit"):
        drawn = draws.draw(f"{kind}/1", seed=4)
        found, healthy = drawn.simulation.recording.readings, drawn.simulation.healthy
        changed = np.flatnonzero(np.any(found != healthy, axis=0))
        assert {drawn.simulation.recording.channels[i] for i in changed} == set(drawn.culprits), kind


def test_a_trial_is_the_same_again_and_survives_its_file():
    trials = import_module("trials")
    first, second = (asdict(trials.trial("clipping/1", seed=2)) for _ in range(2))
    line = json.dumps(first)
    first["seconds"] = second["seconds"] = 0.0
    assert repr(first) == repr(second)
    assert first["answers"].keys() == {trials.AUDIT, trials.CLOSED_FORMS, trials.NAIVE}
    assert first["size"] > 0.0
    assert json.dumps(asdict(trials.from_json(line))) == line


WENT_WRONG = {
    "ac_coupled/3": "the fit without the culprit began at the wrong start and was given up: its twin was named",
    "delay/6": "two free waveforms beat one late channel: two good channels were named",
    "wrong_filter/4": "noise moved by whole samples met other noise: a channel without signal was called late",
    "healthy/29": "the same, with nothing wrong at all",
    "spikes/8": "spikes of which the trace shows some, or a low-pass in the twin that lacks them",
    "noise/6": "the best kind of fault left the record unexplained, and the next was not asked",
    "delay/8": "a delay of many samples is no slope of the signal: its twin fitted as well",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", WENT_WRONG)
def test_draws_that_once_accused_a_good_channel(name: str):
    """Found by the benchmark; each is right now, alone or in a group, or healthy where it is."""
    trials = import_module("trials")
    found = trials.trial(name)
    answer = found.answers[trials.AUDIT]
    said = trials.judge(answer, found.culprits)
    fine = {trials.Outcome.ALONE, trials.Outcome.GROUP}
    assert said in fine or (name in ("healthy/29", "wrong_filter/4") and answer[0] == "healthy"), answer


@pytest.mark.slow
def test_the_tables_are_written(tmp_path: Path):
    output = tmp_path / "benchmark.md"
    arguments = ["--count", "4", "--only", "healthy", "white", "zero_shift", "polarity", "--jobs", "0"]
    import_module("diagnosis").main([*arguments, "--output", str(output), "--json", str(tmp_path / "trials.jsonl")])
    text = output.read_text(encoding="utf-8")
    assert "| healthy recordings called faulty, % | ≤ 1 | 1 |" in text
    assert all(f"| {kind} |" in text for kind in ("healthy", "white", "zero shift", "polarity"))
    widths = {line.count("|") for line in text.split("## Side by side")[1].splitlines() if line.startswith("| white")}
    assert widths == {6}


def test_a_minimisation_per_time_step_meets_the_constraints():
    """[Takhounts09 eq 34] of a motion about all axes: at the minimum the products of ω are those of the constraints."""
    speed = import_module("estimator_speed")
    time = np.linspace(0.0, 0.01, 101)
    omega = np.column_stack([20 + 300 * time, 10 - 200 * time, 15 + 100 * time])
    alpha = np.tile([300.0, -200.0, 100.0], (101, 1))
    products = omega[:, [1, 2, 0]] * omega[:, [2, 0, 1]]
    found = speed.minimised(alpha + 1.0, products, omega[0], time[1])
    assert found[0] == pytest.approx(alpha[0] + 1.0)
    turned = omega[0] + np.cumsum(0.5 * time[1] * (found[1:] + found[:-1]), axis=0)
    assert turned[:, [1, 2, 0]] * turned[:, [2, 0, 1]] == pytest.approx(products[1:], rel=1e-3)


@pytest.mark.slow
def test_faults_in_the_real_array(shared_data: Path, capsys: pytest.CaptureFixture[str]):
    assert shared_data.is_dir()
    faults = ["gain 10 %", "swap"]
    import_module("real_array").main(["--windows", "1", "--channels", "1", "--imus", "3", "--only", *faults])
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| 3 |")]
    assert len(rows) == 4
