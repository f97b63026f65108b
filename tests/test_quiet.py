"""The quiet interval, the zero and the noise in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nineaudit.case import Case
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.estimate.condense import block_length, block_means, block_noise
from nineaudit.estimate.quiet import find_quiet, noise_level, quiet_end
from nineaudit.rig import parse_rig, preset_text
from nineaudit.simulate import simulate

TIME = np.arange(4000) * 1e-3


def moving(seed=0, noise=0.1):
    """4 s: moves, rests from 1.5 s to 2.5 s, moves."""
    rng = np.random.default_rng(seed)
    envelope = np.where((TIME > 1.5) & (TIME < 2.5), 0.0, 1.0)
    signal = envelope[:, None] * np.sin(TIME[:, None] * rng.uniform(20, 60, 5)) * 10
    return signal + noise * rng.standard_normal((4000, 5)) + rng.uniform(-3, 3, 5)


@pytest.mark.parametrize("stated", [0.1, np.nan])
def test_the_quietest_stretch_is_found(stated):
    for seed in range(10):
        quiet = find_quiet(TIME, moving(seed), np.full(5, stated), None)
        assert quiet is not None
        assert 1.5 < quiet.t_start < quiet.t_end < 2.5
        assert not quiet.stated
        assert "found" in str(quiet)


def test_no_rest_is_invented():
    rng = np.random.default_rng(3)
    always = np.sin(TIME[:, None] * rng.uniform(20, 60, 5)) * 10 + 0.1 * rng.standard_normal((4000, 5))
    assert find_quiet(TIME, always, np.full(5, 0.1), None) is None


def test_one_noisy_channel_does_not_hide_the_rest():
    readings = moving()
    readings[:, 2] += 5 * np.random.default_rng(1).standard_normal(4000)
    assert find_quiet(TIME, readings, np.full(5, 0.1), None) is not None


def test_stated_interval_is_taken_and_checked():
    quiet = find_quiet(TIME, moving(), np.full(5, 0.1), (1.6, 2.0))
    assert (quiet.t_start, quiet.t_end, quiet.stated) == (1.6, 2.0, True)
    with pytest.raises(ConfigurationError, match=r"pre_trigger.*holds 0 samples.*between 0 s and 3.999 s"):
        find_quiet(TIME, moving(), np.full(5, 0.1), (-0.5, -0.1))
    says = r"holds 11 samples.*at least 16.*if the body is at rest then, state \[1\.595, 1\.61\]; or leave it out"
    with pytest.raises(ConfigurationError, match=says):
        find_quiet(TIME, moving(), np.full(5, 0.1), (1.6, 1.61))
    advised = find_quiet(TIME, moving(), np.full(5, 0.1), (1.5945, 1.61))
    assert advised is not None
    assert (advised.stop - advised.start, advised.t_end) == (16, 1.61)


def test_noise_level_measures_noise():
    readings = moving(noise=0.2)
    assert noise_level(readings, slice(1600, 2400)) == pytest.approx([0.2] * 5, rel=5 / np.sqrt(2 * 800))
    # without rest: from second differences, which a motion of 60 rad/s at 1 kHz hardly raises
    assert noise_level(readings, None) == pytest.approx([0.2] * 5, rel=0.1)


def test_quiet_end_needs_a_quiet_end():
    readings = moving()
    assert quiet_end(TIME, readings, np.full(5, 0.1)) is None
    assert quiet_end(TIME[:2400], readings[:2400], np.full(5, 0.1)).t_end == TIME[2399]


def test_zero_is_the_mean_of_the_quiet_interval_and_gravity_goes_with_it():
    rig = parse_rig(preset_text("naap-3222"))
    found = simulate(rig, "general", seed=1, gravity=True)
    case = Case(found.recording)
    assert np.abs(case.readings[case.rest.samples].mean(axis=0)).max() < 1e-9
    assert np.abs(case.zero[rig.array.index("a0z")]) == pytest.approx(9.8, abs=5 * 0.98)


def test_rules_that_need_rest_say_so():
    rig = parse_rig("""[rig]\npreset = "rgla"\n""")
    found = simulate(rig, "general", seed=1).recording
    start = int(np.searchsorted(found.time, 0.02))
    stop = int(np.searchsorted(found.time, 0.08))
    moving_part = replace(
        found,
        time=found.time[start:stop],
        readings=found.readings[start:stop],
        valid=found.valid[start:stop],
        native=tuple(replace(t, time=t.time[start:stop], values=t.values[start:stop]) for t in found.native),
    )
    with pytest.raises(EstimationError, match="no quiet interval"):
        _ = Case(moving_part).required_rest


def test_block_means_and_their_noise():
    rng = np.random.default_rng(2)
    white = rng.standard_normal((40_000, 3))
    means = block_means(white, 10)
    assert means.std(axis=0) == pytest.approx([10**-0.5] * 3, rel=0.05)
    assert block_noise(np.ones(3), white[:2000], 10) == pytest.approx([10**-0.5] * 3, rel=0.15)
    coloured = np.repeat(rng.standard_normal((4_000, 3)), 10, axis=0)
    assert block_noise(np.ones(3), coloured[:4000], 10) == pytest.approx([1.0] * 3, rel=0.15)


def test_blocks_follow_the_pass_band_and_never_blur_a_head_impact():
    assert block_length(2_000, 10_000.0, 1650.0) == 2
    assert block_length(20_000, 20_000.0, 1650.0) == 10
    assert block_length(6_734, 62.5, None) == 1
    assert 10_000.0 / block_length(2_000_000, 10_000.0, None) >= 1500.0
    assert 10_000.0 / block_length(2_000_000, 10_000.0, None, slowest=1000.0) == 1000.0


def test_blocks_without_a_valid_sample_are_invalid():
    values = np.ones((20, 1))
    values[5:10] = np.nan
    values[12] = np.nan
    assert np.isnan(block_means(values, 5)[:, 0]).tolist() == [False, True, False, False]
