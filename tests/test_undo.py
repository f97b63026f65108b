"""Faults undone by their model: the laws of it, and whether the stated uncertainty is true."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from nineaudit.array import FloatArray, SensorArray
from nineaudit.auditing import audit
from nineaudit.case import Case
from nineaudit.diagnosis import Candidate
from nineaudit.estimate.fault_models import advanced
from nineaudit.readers import read
from nineaudit.reconstruct import Reconstruction
from nineaudit.repair import repair
from nineaudit.rig import Rig, parse_rig, preset_text
from nineaudit.simulate import Simulation, simulate
from nineaudit.undo import undo
from nineaudit.writers import write_recording

RIG = parse_rig(preset_text("naap-3222"))
NOW = datetime(2026, 5, 4, 12, 0, tzinfo=UTC)
FAULTS = {
    "gain": "a2x:gain=15%",
    "unit": "a1y:unit=9.80665",
    "polarity": "a0z:polarity",
    "delay": "a1y:delay=0.8ms",
    "zero_shift": "a3y:zero_shift=10%",
    "drift": "a0y:drift=15%",
    "cross_axis": "a2z:cross_axis=12%",
    "position": "a1y:position=8mm",
    "swap": "a0x:swap=a1y",
}


def candidate(case: Case, word: str) -> Candidate:
    head, _, tail = FAULTS[word].partition(":")
    channels = (head, tail.partition("=")[2]) if word == "swap" else (head,)
    at = {"at": float(case.fit_data.time[case.onset])} if word == "zero_shift" else {}
    return Candidate(channels, word, 1.0, 1.0, at)


def undone(word: str, seed: int, motion: str = "general", rig: Rig = RIG) -> tuple[Simulation, Case, Reconstruction]:
    found = simulate(rig, motion, faults=[FAULTS[word]], seed=seed)
    case = Case(found.recording)
    made = undo(case, candidate(case, word))
    assert made is not None
    return found, case, made


def truth(found: Simulation, case: Case, made: Reconstruction) -> FloatArray:
    """(n,m) what a perfect sensor would have read, its own zero taken off."""
    columns = [case.array.index(c) for c in made.channels]
    assert case.rest is not None
    return np.asarray(found.ideal[:, columns] - found.ideal[case.rest.samples][:, columns].mean(axis=0))


def almost_certain() -> Rig:
    """A hundredth of the noise and of the instrument's uncertainty; with less, what the midpoint rule on blocks leaves
    would count as a fault."""
    scale = ("u_gain", "u_zero", "u_alignment", "u_position", "u_timing")
    told = [
        replace(s, noise=1e-2 * (s.noise or 1.0), **{name: 1e-2 * getattr(s, name) for name in scale})
        for s in RIG.array.sensors
    ]
    return replace(RIG, array=SensorArray(tuple(told)), filter_class="none")


# --- laws -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("word", [w for w in FAULTS if w != "zero_shift"])
def test_without_noise_the_original_comes_back(word: str) -> None:
    """U → 0. A filter of 64 samples and the midpoint rule leave parts in ten thousand."""
    found, case, made = undone(word, 1, rig=almost_certain())
    sure = truth(found, case, made)
    assert np.abs(made.rebuilt - sure)[made.replaced].max() <= 2e-3 * np.abs(sure).max()
    assert made.u_rms <= 1e-3 * np.abs(sure).max()


@pytest.mark.parametrize("word", list(FAULTS))
def test_what_was_measured_stays(word: str) -> None:
    """The undone channel is the measured one but for the fault: the two differ by less than the channel's noise where
    the fault is put back, and what is not replaced is as measured to the last bit."""
    found, case, made = undone(word, 2)
    columns = [case.array.index(c) for c in made.channels]
    assert np.array_equal(made.measured, case.readings[:, columns])
    assert np.array_equal(made.repaired[~made.replaced], made.measured[~made.replaced])
    assert made.fault == word
    assert set(made.parameters) >= set(made.parameters_u)
    healthy = found.healthy[:, columns]
    kept = case.time < case.time[-1] - 0.005  # a delay takes the last samples away
    assert case.rest is not None
    apart = (made.repaired - (healthy - healthy[case.rest.samples].mean(axis=0)))[kept]
    slow = np.sqrt(np.maximum(made.u[kept] ** 2 - 0.5 * case.sigma[columns] ** 2, 0.0))
    assert np.abs(apart).max() <= 5.0 * np.maximum(slow, case.sigma[columns]).max()


def test_a_gain_is_divided_out() -> None:
    _, case, made = undone("gain", 0)
    factor = made.parameters["factor"]
    column = case.array.index("a2x")
    assert np.allclose(made.rebuilt[:, 0], case.readings[:, column] / factor, rtol=1e-12)
    assert made.replaced.mean() > 0.999  # and nothing else: a reading of exactly zero does not change
    assert f"divided by {factor:.5g}" in made.method
    assert made.bound_ratio < 1.0  # the channel's own noise is less than that of a channel made of the others


def test_a_shift_is_subtracted_from_its_instant() -> None:
    found = simulate(RIG, "general", faults=["a3y:zero_shift=40%@0.0600"], seed=3)
    case = Case(found.recording)
    made = undo(case, Candidate(("a3y",), "zero_shift", 1.0, 1.0, {"at": 0.068}))
    assert made is not None
    assert made.parameters["at"] == pytest.approx(0.0600, abs=2.5e-4)
    before = case.time < 0.0595
    assert not made.replaced[before].any()
    size = np.median(found.recording.readings[-50:, 8] - found.healthy[-50:, 8])
    assert abs(made.parameters["size"] - size) < 4 * made.parameters_u["size"]


def test_a_swap_is_swapped_back() -> None:
    _, case, made = undone("swap", 4)
    first, second = (case.array.index(c) for c in made.channels)
    assert np.array_equal(made.rebuilt, case.readings[:, [second, first]])
    assert made.donors == made.channels


def test_a_record_that_is_not_whole_afterwards_is_not_said_to_be_undone() -> None:
    case = Case(simulate(RIG, "general", faults=["a1y:unknown=40%"], seed=5).recording)
    for word in ("gain", "drift"):
        assert undo(case, Candidate(("a1y",), word, 1.0, 1.0)) is None
    for word in ("unknown", "clipping", "wrong_filter", "noise", "missing"):
        assert undo(case, Candidate(("a1y",), word, 1.0, 1.0)) is None


@pytest.mark.parametrize("late", [0.0, 3.0, 0.37, 7.81, -2.5])
def test_shifting_back_is_exact_in_the_band(late: float) -> None:
    """Sinusoids up to half the Nyquist frequency, to the ripple of the window; shifting there and back is nothing."""
    where = np.arange(2000.0)
    for frequency in (0.01, 0.1, 0.25):
        wave = np.cos(2 * np.pi * frequency * where + 0.3)
        moved = advanced(wave, late)
        inside = slice(60, -60)
        assert np.abs(moved - np.cos(2 * np.pi * frequency * (where + late) + 0.3))[inside].max() < 1e-4
        assert np.abs(advanced(moved, -late) - wave)[100:-100].max() < 2e-4
    assert np.isnan(advanced(where, 5.2)[-5:]).all()


def test_invalid_samples_are_filled_and_the_fault_undone() -> None:
    found = simulate(RIG, "general", faults=["a2x:gain=15%"], seed=6).recording
    readings, column = found.readings.copy(), RIG.array.index("a2x")
    readings[900:950, column] = np.nan
    case = Case(replace(found, readings=readings, valid=np.isfinite(readings)))
    made = undo(case, Candidate(("a2x",), "gain", 1.0, 1.0))
    assert made is not None
    assert np.isfinite(made.repaired).all()
    assert "50 samples filled" in made.method
    assert made.u[900:950].mean() > 1.2 * made.u[1000:1050].mean()


# --- the audit and the repaired file ------------------------------------------------------------------------------


def test_a_repaired_swap_is_the_recording_with_two_columns_exchanged(tmp_path) -> None:
    path, output = tmp_path / "T0001.csv", tmp_path / "repaired.csv"
    write_recording(simulate(RIG, "drop", faults=["a0x:swap=a1y"], seed=1).recording, path)
    result = audit(read(path, RIG))
    assert result.reconstruction is not None
    assert result.reconstruction.fault == "swap"
    document = json.loads(repair(result, output, by="A. Engineer", now=NOW).read_text(encoding="utf-8"))
    assert document["undone"] == {"fault": "swap", "parameters": {}, "u": {}}
    assert sorted(document["channels"]) == ["a0x", "a1y"]
    before, after = read(path, RIG).readings, read(output, RIG).readings
    i, j = RIG.array.index("a0x"), RIG.array.index("a1y")
    order = np.arange(9)
    order[[i, j]] = j, i
    assert np.allclose(after, before[:, order], rtol=0, atol=1e-9)
    assert (after != before).any(axis=1).sum() == document["samples_replaced"]
    assert audit(read(output, RIG)).diagnosis.status == "healthy"


# --- statistics ---------------------------------------------------------------------------------------------------


def many(word: str, seeds: range) -> tuple[FloatArray, FloatArray]:
    """Rms of error over u, and part in the 95 % interval, of each recording."""
    ratios, covered = [], []
    for seed in seeds:
        motion = ("general", "oblique", "drop", "sled")[seed % 4]
        found = simulate(RIG, motion, faults=[FAULTS[word]], seed=seed)
        case = Case(found.recording)
        made = undo(case, candidate(case, word))
        if made is None:
            continue
        inside = made.replaced & (case.time >= 0.0)[:, None]
        off = ((made.rebuilt - truth(found, case, made)) / made.u)[inside]
        ratios.append(np.sqrt(np.mean(off**2)))
        covered.append(np.mean(np.abs(off) <= 1.959964))
    assert len(ratios) > 0.6 * len(seeds)
    return np.array(ratios), np.array(covered)


@pytest.mark.parametrize("word", ["gain", "zero_shift", "swap"])
def test_stated_uncertainty_of_an_undone_channel(word: str) -> None:
    """Error over stated uncertainty over six instruments and motions drawn anew: near 1."""
    ratios, _ = many(word, range(6))
    assert 0.6 < np.sqrt(np.mean(ratios**2)) < 1.5


@pytest.mark.slow
@pytest.mark.parametrize("word", list(FAULTS))
def test_coverage_of_an_undone_channel(word: str) -> None:
    """Issue 3: rms error at most 1.3 of the stated u, 95 % intervals cover 95 % of the samples.

    Errors are common to many samples, so that the coverage of one recording scatters: the mean of 32 is held to three
    of its own standard deviations. benchmarks/diagnosis.py has all kinds of fault together.
    """
    ratios, covered = many(word, range(100, 132))
    assert np.sqrt(np.mean(ratios**2)) < 1.3
    assert abs(covered.mean() - 0.95) < 3.0 * np.std(covered, ddof=1) / np.sqrt(len(covered))


@pytest.mark.slow
def test_parameters_are_as_far_from_the_truth_as_stated() -> None:
    """Gain with the sensor's own, and zero shift with the zero's: error over u over 64 recordings, 1 to 9 %."""
    off = []
    for seed in range(64):
        found, case, made = undone("gain", seed)
        true = 1.15 * (1.0 + found.drawn["gain"][case.array.index("a2x")])
        off.append((made.parameters["factor"] - true) / made.parameters_u["factor"])
    assert np.sqrt(np.mean(np.square(off))) == pytest.approx(1.0, abs=0.27)
