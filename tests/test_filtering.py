"""Readings are filtered once, by one guard: what a filtered recording says of itself, and who may filter."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from nineaudit.case import Case
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.filtering import filtered, noise_left, note
from nineaudit.motion import motion_of
from nineaudit.physics import filters
from nineaudit.recording import Recording
from nineaudit.rig import parse_rig, preset_text
from nineaudit.simulate import simulate

SOURCES = Path(__file__).parents[1] / "src" / "nineaudit"


def recorded(filter_class: str = "CFC1000", rate: float = 10_000.0, preset: str = "naap-gyro") -> Recording:
    rig = replace(parse_rig(preset_text(preset)), filter_class=filter_class)
    return simulate(rig, "general", seed=4, rate_hz=rate).recording


def test_every_channel_goes_through_the_class_and_its_rig_says_so() -> None:
    recording = recorded()
    behind = filtered(recording, 180.0)
    expected = filters.cfc(recording.readings, recording.rate, 180.0)
    np.testing.assert_allclose(behind.readings, expected, atol=1e-9)
    assert behind.rig.cfc == 180.0
    assert behind.source.notes[-1] == "readings filtered to CFC180 (SAE J211-1)"
    assert recording.rig.cfc == 1000.0
    assert behind.native is recording.native


def test_no_class_is_filtered_to_twice() -> None:
    for class_ in filters.CLASSES:
        recording = recorded(f"CFC{class_:g}", 20_000.0)
        with pytest.raises(ConfigurationError, match=f"filtered twice: CFC{class_:g} after CFC{class_:g}"):
            filtered(recording, class_)
    with pytest.raises(ConfigurationError, match="filtered twice"):
        filtered(filtered(recorded("none"), 600.0), 600.0)


def test_sampling_below_ten_times_the_class_is_refused() -> None:
    with pytest.raises(EstimationError, match="too slowly for CFC1000; found '5000 Hz'; expected at least 10000 Hz"):
        filtered(recorded("none", 5000.0), 1000.0)


def test_uneven_time_is_refused() -> None:
    recording = recorded()
    time = recording.time + np.where(np.arange(len(recording.time)) == 100, 3e-5, 0.0)
    with pytest.raises(EstimationError, match="even steps"):
        filtered(replace(recording, time=time), 180.0)


def test_gaps_stay_gaps_and_a_dead_channel_stays_dead() -> None:
    recording = recorded()
    readings = recording.readings.copy()
    readings[500:520, 3], readings[:, 5] = np.nan, np.nan
    behind = filtered(replace(recording, readings=readings, valid=np.isfinite(readings)), 180.0)
    np.testing.assert_array_equal(np.isfinite(behind.readings), np.isfinite(readings))
    whole = filtered(recording, 180.0).readings
    far = np.r_[0:300, 720:2000]  # 20 ms off the gap: e^-(π/√2·180·2.0775·2·0.02) of it is left, 1e-14
    np.testing.assert_allclose(behind.readings[far, 3], whole[far, 3], atol=1e-6)


@pytest.mark.parametrize(("class_", "already"), [(180.0, None), (180.0, 1000.0), (60.0, 600.0)])
def test_noise_left_is_what_the_filter_leaves_of_noise(class_: float, already: float | None) -> None:
    """A variance over 400,000 samples, some 1 % of them independent behind CFC60: known to 2 %, three times that."""
    white = np.random.default_rng(3).standard_normal(400_000)
    before = white if already is None else filters.cfc(white, 10_000.0, already)
    after = filters.cfc(before, 10_000.0, class_)
    assert noise_left(class_, 10_000.0, already) == pytest.approx(after.var() / before.var(), rel=0.06)


def test_a_healthy_recording_stays_healthy_behind_the_filter() -> None:
    """Cost per degree of freedom of the whole-record fit, 1 expected: its stated noise went through the filter too."""
    case = Case(filtered(recorded("none"), 180.0))
    assert 0.7 < case.statistic < case.statistic_limit
    whole, raw = motion_of(case, count=0), motion_of(Case(recorded("none")), count=0)
    assert np.abs(whole.omega - raw.omega).max() < 0.02 * np.abs(raw.omega).max()


def test_the_note_tells_what_is_stated_from_what_is_seen() -> None:
    def said(recording: Recording, stated: str) -> str | None:
        return note(Case(replace(recording, rig=replace(recording.rig, filter_class=stated))))

    assert said(recorded("none"), "none") is None
    assert str(said(recorded("CFC180"), "none")).startswith(
        "the rig states no filter, but the noise at rest looks like"
    )
    assert "but the noise at rest looks like CFC180" in str(said(recorded("CFC180"), "CFC1000"))
    assert "shows no more than CFC1000" in str(said(recorded("CFC1000"), "CFC180"))
    assert "shows the filter that the rig states, CFC1000" in str(said(recorded(), "CFC1000"))
    slow = str(said(recorded("none", 5000.0), "CFC1000"))
    assert slow.endswith(
        "sampled at 5000 Hz, too slowly for CFC1000: at least 10000 Hz (10 times the class, SAE J211-1)"
    )


def test_nothing_but_the_guard_filters_a_recording() -> None:
    """`filters.cfc` is the bare filter: of the simulator and the published numbers, of what a mismatch does to
    readings that a motion predicts, of noise that is drawn as a class leaves it, and of the guard `filters.once`."""
    allowed, bare = ("physics/filters.py", "estimate/mismatch.py", "instrument_draws.py"), []
    for path in SOURCES.rglob("*.py"):
        name = path.relative_to(SOURCES).as_posix()
        if name.startswith(("simulate/", "selftest/")) or name in allowed:
            continue
        calls = [node.func for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.Call)]
        bare += [name for call in calls if ast.unparse(call) in ("cfc", "filters.cfc")]
    assert bare == []
