"""The real array of 24 accelerometers and 24 rate sensors, 62.5 Hz, turned by hand up to 50 rad/s: nothing is said of
what is whole, and a fault put in is named. Windows and faults as in benchmarks/real_array.py, which does them all."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import nineaudit as na
from nineaudit.case import Case
from nineaudit.checks.rigid_body import array_parity, whole_record
from nineaudit.diagnose import Status
from nineaudit.finding import Measure, NotApplicable
from nineaudit.recording import Recording

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
WINDOW = 3


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch, shared_data: Path) -> ModuleType:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    assert shared_data.is_dir()
    return import_module("real_array")


@cache
def whole(folder: Path) -> Recording:
    return na.read(folder / "recording.csv", na.load_rig(folder / "rig.toml"))


def part(script: ModuleType, folder: Path, imus: int) -> Recording:
    """A window of 10 s, without the samples at which rate sensors are at their end."""
    found = script.window(whole(folder / "mimu-array"), WINDOW)
    found = script.with_readings(found, np.where(script.railed(found), np.nan, found.readings))
    return found if imus == 8 else script.only(found, script.SUBSET)


@pytest.mark.parametrize("imus", [8, 3])
def test_an_untouched_window_is_whole(script: ModuleType, shared_data: Path, imus: int) -> None:
    recording = part(script, shared_data, imus)
    found = script.diagnosis(recording)
    assert found.status is Status.HEALTHY, found.reason
    case = Case(recording)
    measures = whole_record(case, false_alarm=1e-3)
    assert isinstance(measures, tuple)
    assert all(isinstance(m, Measure) and m.value <= m.limit for m in measures)
    parity = array_parity(case, false_alarm=1e-3)
    assert isinstance(parity, NotApplicable)
    assert "do not resolve" in parity.reason


def test_the_rails_of_the_rate_sensors_are_named_and_nothing_else(script: ModuleType, shared_data: Path) -> None:
    recording = script.only(script.window(whole(shared_data / "mimu-array"), WINDOW), script.SUBSET)
    found = script.diagnosis(recording)
    railed = {c for c, x in zip(recording.channels, script.railed(recording).any(axis=0), strict=True) if x}
    assert railed
    assert set(found.channels) == railed


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["zero shift 5 m/s²", "polarity", "delay of one sample", "swap"])
def test_a_fault_in_eight_imus_is_named(script: ModuleType, shared_data: Path, fault: str) -> None:
    recording, culprits = script.faulty(part(script, shared_data, 8), fault, "imu5_ay")
    found = script.diagnosis(recording)
    assert found.status is Status.ISOLATED, found.reason
    assert set(found.channels) == set(culprits)


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["zero shift 5 m/s²", "polarity"])
def test_a_fault_in_three_imus_is_named(script: ModuleType, shared_data: Path, fault: str) -> None:
    recording, culprits = script.faulty(part(script, shared_data, 3), fault, "imu1_ax")
    found = script.diagnosis(recording)
    assert found.status is Status.ISOLATED, found.reason
    assert set(found.channels) == set(culprits)
