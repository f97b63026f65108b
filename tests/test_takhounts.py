"""Optimisation over channels, the triangle of Fig 10, and cross-axis sensitivity [Takhounts09]."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nineaudit.case import Case
from nineaudit.errors import EstimationError
from nineaudit.physics import rigid_body
from nineaudit.rig import parse_rig, preset_text
from nineaudit.schemes import takhounts
from nineaudit.selftest import takhounts09, takhounts_misprints
from nineaudit.selftest.takhounts09 import triangle
from nineaudit.simulate import simulate

C = 0.03
COUPLING = C * (1.0 - np.eye(3))


@pytest.mark.parametrize(
    "check", [*takhounts09.checks(), *takhounts_misprints.checks()], ids=lambda check: check.quantity
)
def test_published_numbers(check):
    assert check.passed, check


def coupled(motion, coupling=COUPLING, seed=2):
    """A NAAP recording whose triaxes read M a, noise only, and the truth."""
    made = simulate(parse_rig(preset_text("naap-3222")), motion, imperfect=False, seed=seed)
    array, truth = made.recording.rig.array, made.truth
    bent = rigid_body.predict(
        array.positions, array.axes @ (np.eye(3) + coupling), array.is_accelerometer, truth.a0, truth.alpha, truth.omega
    )
    return Case(replace(made.recording, readings=made.recording.readings + bent - made.ideal)), truth


def test_an_uneven_triangle_has_the_weighted_third_error():
    """−c(αx Σy² + αy Σx²)/Σ(x²+y²) about the centroid, from the same least squares worked by hand."""
    array = triangle(-0.03, 0.03)
    about = array.positions - array.positions.mean(axis=0)
    (sx, sy), alpha = (about[:, :2] ** 2).sum(axis=0), np.array([100.0, 250.0, -70.0])
    error = takhounts.cross_axis_error(array, np.array([50.0, 60.0, 70.0]), alpha, COUPLING)
    assert error == pytest.approx(-C * np.array([-70.0, -70.0, (100 * sy + 250 * sx) / (sx + sy)]), abs=1e-9)


def test_at_rest_of_rotation_the_optimum_fits_perfectly_and_is_wrong():
    """ω = 0: parity rows of the equilateral triangle see 3 % only by what is not symmetric; α is off regardless."""
    array = triangle(0.06, 0.06 * np.sqrt(0.75))
    alpha, a0 = np.array([0.0, 0.0, 1000.0]), np.array([300.0, -100.0, 50.0])
    felt = a0 + np.cross(alpha, array.positions)
    readings = np.einsum("ki,ki->k", array.axes @ (np.eye(3) + COUPLING), felt)
    left = rigid_body.parity(rigid_body.design(array.positions, array.axes)) @ readings
    error = takhounts.cross_axis_error(array, a0, alpha, COUPLING)
    assert np.abs(error[:2]) == pytest.approx(np.full(2, 30.0), rel=1e-9)
    assert np.abs(left).max() < C * 1000.0 * 0.06  # no constraint sees more than c α r: it names no channel


def test_optimisation_recovers_a_clean_motion_from_all_and_from_eight_channels():
    """σ/r = 59 rad/s² of a sample of 0.3 g noise at 50 mm: the fit is under four of them."""
    case, truth = coupled("general", 0.0 * COUPLING)
    alpha = np.stack([np.interp(case.fit_data.time, truth.time, truth.alpha[:, i]) for i in range(3)], axis=1)
    every = case.array.channels
    for chosen in (None, tuple(c for c in every if c != "a2z")):
        found = takhounts.optimise(case.fit_data, chosen)
        assert found.converged
        assert 0.85 < found.statistic < 1.15
        assert np.abs(found.motion.alpha - alpha).max() < 4 * 0.3 * 9.80665 / 0.05


def test_optimisation_refuses_what_does_not_determine_the_motion():
    case, _ = coupled("general")
    with pytest.raises(EstimationError, match="accelerometers of rank 3, rate sensors of rank 0"):
        takhounts.optimise(case.fit_data, ("a0x", "a0y", "a0z"))
    with pytest.raises(EstimationError, match="no such channel"):
        takhounts.optimise(case.fit_data, ("a9x",))


def test_general_motion_tells_the_coupling_with_its_uncertainty():
    """Six entries of 3 % within 3.5 of their standard uncertainties each, and better known than before (10 %)."""
    case, _ = coupled("general")
    found = takhounts.fit_sensitivity(case.fit_data)
    assert (found.rank, found.unknowns, found.coupling_rank) == (18, 18, 6)
    off = ~np.eye(3, dtype=bool)
    assert np.abs(found.require() - COUPLING)[off].max() < 3.5 * found.coupling_sd[off].max()
    assert (np.abs(found.coupling - COUPLING)[off] < 3.5 * found.coupling_sd[off]).all()
    assert found.coupling_sd[off].max() < 0.3 * takhounts.WIDE
    assert takhounts.optimise(case.fit_data).cost > found.fit.cost


def test_a_motion_that_does_not_turn_enough_is_rank_deficient_and_says_so():
    case, _ = coupled("drop")
    found = takhounts.fit_sensitivity(case.fit_data)
    assert found.rank < found.unknowns
    assert not found.determined
    with pytest.raises(EstimationError, match=r"rank \d of 6, by channel \d+ of 18.*rate table"):
        found.require()


def test_sensors_with_their_own_small_tilts_are_not_taken_for_a_shared_coupling():
    """Healthy instruments of the rig's uncertainties, 0.5° each: every entry over its uncertainty is normal.

    Six related entries of twelve records: the rms of their ratios is 1 within a third.
    """
    rig, off, ratios = parse_rig(preset_text("naap-3222")), ~np.eye(3, dtype=bool), []
    for motion in ("general", "oblique"):
        for seed in range(6):
            made = simulate(rig, motion, seed=seed, duration_s=0.1)
            found = takhounts.fit_sensitivity(Case(made.recording).fit_data)
            ratios.append(found.coupling[off] / found.coupling_sd[off])
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.33)
    assert np.abs(ratios).max() < 4.0
