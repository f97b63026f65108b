"""Parity of any array: zero for a rigid body, blind to the frame, and with a budget that predicts its scatter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nineaudit.array import SensorArray
from nineaudit.errors import EstimationError
from nineaudit.estimate import parity
from nineaudit.estimate.motion import Motion, estimate_motion
from nineaudit.physics import rigid_body
from nineaudit.rig import PRESETS, parse_rig, preset_text
from nineaudit.simulate import simulate

REDUNDANT = ["naap-3222", "triax-4", "naap-gyro", "coplanar-3-gyro"]


def simulated(preset, **options):
    return simulate(parse_rig(preset_text(preset)), "general", **options)


def residual_of(found, readings, sigma=None):
    array = found.recording.rig.array
    sigma = np.ones(len(array)) if sigma is None else sigma
    motion = estimate_motion(array, found.truth.time, readings, sigma)
    return parity.channel_residuals(array, found.truth.time, readings, sigma, motion)


@pytest.mark.parametrize("preset", REDUNDANT)
def test_an_ideal_rigid_body_has_no_residual(preset):
    found = simulated(preset, imperfect=False, noise=False, seed=2)
    residual = residual_of(found, found.ideal)
    size = np.abs(found.ideal).max(axis=0)
    tested = np.isfinite(residual.value).all(axis=0)
    array = found.recording.rig.array
    held = array.is_accelerometer
    basis = np.linalg.svd(rigid_body.design(array.positions[held], array.axes[held]), full_matrices=False)
    leverage = (basis.U[:, basis.S > 1e-9] ** 2).sum(axis=1)
    np.testing.assert_array_equal(tested[held], leverage < 1 - 1e-9)  # one of leverage 1 is what no other contradicts
    assert np.abs(residual.value[:, tested]).max() < 1e-8 * size.max()


@pytest.mark.parametrize("preset", sorted(PRESETS))
def test_redundancy_counts_rows(preset):
    accelerometers, rates = parity.redundancy(parse_rig(preset_text(preset)).array)
    expected = {
        "naap-3222": (3, 0),
        "triax-3": (3, 0),
        "triax-4": (6, 0),
        "coplanar-3": (3, 0),
        "coplanar-3-gyro": (3, 0),
        "naap-gyro": (3, 0),
        "6aw": (0, 0),
        "3-2-1": (0, 0),
        "rgla": (0, 0),
        "compact-cube": (0, 0),
    }
    assert (accelerometers, rates) == expected[preset]


@pytest.mark.parametrize("preset", ["triax-3", "coplanar-3"])
def test_a_redundant_array_without_product_free_alpha_says_so(preset):
    found = simulated(preset, seed=1)
    with pytest.raises(EstimationError, match="free of products"):
        residual_of(found, found.recording.readings)


@pytest.mark.parametrize("preset", ["triax-4", "naap-gyro"])
def test_turning_the_body_frame_changes_nothing(preset):
    found = simulated(preset, seed=4)
    turn = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    array = found.recording.rig.array
    turned = SensorArray(tuple(replace(s, position=turn @ s.position, axis=turn @ s.axis) for s in array.sensors))
    readings, sigma, time = found.recording.readings, np.ones(len(array)), found.truth.time
    before = parity.channel_residuals(array, time, readings, sigma, estimate_motion(array, time, readings, sigma))
    after = parity.channel_residuals(turned, time, readings, sigma, estimate_motion(turned, time, readings, sigma))
    size = np.abs(readings).max()
    assert np.nanmax(np.abs(before.value - after.value)) < 1e-8 * size
    # the two tilts span the same plane, but position errors along turned axes are the same ball only if isotropic
    assert np.nanmax(np.abs(before.budget / after.budget - 1)) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["naap-3222", "naap-gyro", "triax-4"])
def test_budget_predicts_the_observed_scatter(preset):
    """Over instruments drawn from the rig's uncertainty, residual over budget has a standard deviation near 1."""
    ratios = []
    for seed in range(60):
        found = simulate(parse_rig(preset_text(preset)), "oblique", seed=seed, rate_hz=2000.0)
        case_sigma = found.recording.rig.array.values("noise")
        quiet = found.truth.time < -0.001
        readings = found.recording.readings - found.recording.readings[quiet].mean(axis=0)
        residual = residual_of(found, readings, case_sigma)
        event = slice(int(quiet.sum()), None, 7)
        ratios.append((residual.value / residual.budget)[event])
    held = np.isfinite(ratios).all(axis=(0, 1))
    spread = np.sqrt(np.mean(np.square(ratios), axis=(0, 1)))
    # zeroing on the quiet interval takes the zero offset off, which the budget still counts: under 1, not over
    assert (spread[held] > 0.5).all()
    assert (spread[held] < 1.25).all()


def test_an_invalid_channel_is_left_out_of_the_rates():
    found = simulated("naap-gyro", seed=1)
    readings = found.recording.readings.copy()
    readings[100:120, found.recording.rig.array.index("gx")] = np.nan
    residual = residual_of(found, readings)
    assert np.isfinite(residual.value[:90, :9]).all()


def test_worst_needs_a_sample():
    nothing = parity.Residual(np.full((5, 2), np.nan), np.ones((5, 2)), np.ones((5, 2)))
    with pytest.raises(EstimationError, match="enough valid channels"):
        parity.worst(nothing, 1e-3)


def test_budget_factor_is_the_bonferroni_quantile():
    """Of N independent normals the largest exceeds the factor with the stated probability: observed on 4000 draws."""
    rng = np.random.default_rng(5)
    draws = np.abs(rng.standard_normal((4000, 50))).max(axis=1)
    observed = (draws > parity.budget_factor(0.05, 50)).mean()
    assert observed == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / 4000))


def test_motion_of_rates_and_of_the_product_free_alpha_agree():
    found = simulated("naap-gyro", imperfect=False, noise=False, seed=6)
    array, time = found.recording.rig.array, found.truth.time
    with_gyros = estimate_motion(array, time, found.ideal, np.ones(12))
    nine = array.subset(c for c in array.channels if not c.startswith("g"))
    without = estimate_motion(nine, time, found.ideal[:, :9], np.ones(9))
    for a, b in ((with_gyros, without), (with_gyros, Motion(found.truth.omega, found.truth.alpha, found.truth.a0, ""))):
        assert np.abs(a.omega - b.omega).max() < 1e-6 * np.abs(b.omega).max()
        assert np.abs(a.alpha - b.alpha).max() < 1e-6 * np.abs(b.alpha).max()
