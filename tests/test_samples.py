"""The whole-record fit carried back to every sample, and motions drawn from its posterior."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nineaudit.array import SensorArray
from nineaudit.case import Case
from nineaudit.estimate.draws import draws
from nineaudit.estimate.posterior import posterior
from nineaudit.estimate.samples import at_samples, bound, rebuild
from nineaudit.estimate.trajectory import fit
from nineaudit.physics import rigid_body
from nineaudit.reconstruct import event_data, left_out
from nineaudit.rig import Rig, parse_rig, preset_text
from nineaudit.simulate import simulate
from smoother_data import problem

CERTAIN = dict.fromkeys(("u_gain", "u_zero", "u_alignment", "u_position", "u_timing"), 0.0)


def certain(preset: str, noise: float | None = None) -> Rig:
    """A perfect instrument in white noise, `noise` in units of the stated one."""
    rig = parse_rig(preset_text(preset))
    told = [replace(s, **CERTAIN, noise=s.noise if noise is None else noise * s.noise) for s in rig.array.sensors]
    return replace(rig, array=SensorArray(tuple(told)), filter_class="none")


@pytest.mark.parametrize("channel", ["a0y", "a2z"])
def test_without_noise_the_channel_comes_back(channel: str) -> None:
    """U → 0: what is left is the midpoint rule on blocks of two samples, h²/12 of the second derivative."""
    found = simulate(certain("naap-3222", 1e-6), "general", seed=3)
    case = Case(found.recording)
    column = case.array.index(channel)
    left = left_out(case, event_data(case), column)
    readings = case.readings.copy()
    readings[:, column] = np.nan
    made = rebuild(at_samples(left, case.time, readings, case.sigma), posterior(left), case.sigma, column)
    truth = found.ideal[:, column]
    assert np.abs(made.values - truth).max() <= 1e-4 * np.abs(truth).max()
    assert np.abs(made.u).max() <= 1e-5 * np.abs(truth).max()


@pytest.mark.parametrize("preset", ["naap-3222", "triax-4", "naap-gyro"])
def test_noise_of_a_rebuilt_sample_is_the_bound(preset: str) -> None:
    """METHODS.md 4: σ√(h/(1−h)), from the other channels of that sample."""
    case = Case(simulate(certain(preset), "general", seed=1).recording)
    column = case.array.index(case.array.channels[4])
    left = left_out(case, event_data(case), column)
    held = np.flatnonzero(case.array.is_accelerometer).tolist()
    design = rigid_body.design(case.array.positions[held], case.array.axes[held])
    expected = rigid_body.missing_channel_bound(design)[held.index(column)] * case.sigma[column]
    assert bound(left, case.sigma, column) == pytest.approx(expected, rel=1e-9)
    readings = case.readings.copy()
    readings[:, column] = np.nan
    made = rebuild(at_samples(left, case.time, readings, case.sigma), posterior(left), case.sigma, column)
    assert made.noise == pytest.approx(expected, rel=1e-9)
    assert np.sqrt(np.mean(made.white**2)) < 1.05 * expected


def test_where_the_sample_does_not_tell_alpha_the_slope_of_omega_does() -> None:
    """Three more accelerometers of the nine absent for a while: six unknowns, five readings."""
    found = simulate(certain("naap-3222", 1e-6), "general", seed=3)
    case = Case(found.recording)
    column, lost = case.array.index("a0x"), [case.array.index(c) for c in ("a1y", "a2z", "a3y")]
    left = left_out(case, event_data(case), column)
    readings = case.readings.copy()
    readings[:, column] = np.nan
    readings[np.ix_(np.arange(800, 840), lost)] = np.nan
    at = at_samples(left, case.time, readings, case.sigma)
    assert at.own.tolist() == [True, False]
    made = rebuild(at, posterior(left), case.sigma, column)
    truth = found.ideal[:, column]
    assert np.abs(made.values - truth).max() <= 2e-3 * np.abs(truth).max()
    readings[850:860] = np.nan
    made = rebuild(at_samples(left, case.time, readings, case.sigma), posterior(left), case.sigma, column)
    assert np.isnan(made.values[850:860]).all()
    assert np.isfinite(np.delete(made.values, np.arange(850, 860))).all()


@pytest.mark.parametrize("preset", ["naap-3222", "naap-gyro"])
def test_draws_have_the_covariance_of_the_posterior(preset: str) -> None:
    """Scatter of 400 draws over the standard deviations that the covariance gives: 1 to 3.5 % each, bias none."""
    made = problem(preset, "general", seed=2, rate=1000.0)
    found = fit(made.data, made.omega)
    sure = posterior(found)
    drawn = list(draws(found, 400, np.random.default_rng(1)))
    motions = [d.motion for d in drawn]
    for values, mean, sd in (
        (np.array([m.omega for m in motions]), found.motion.omega, sure.omega_sd()),
        (np.array([m.alpha for m in motions]), found.motion.alpha, sure.alpha_sd()),
        (np.array([d.theta for d in drawn]), found.theta, sure.theta_sd),
    ):
        told = sd > 1e-3 * sd.max()
        off = (values - mean)[:, told] / sd[told]
        assert np.sqrt(np.mean(off**2)) == pytest.approx(1.0, abs=0.05)
        assert np.abs(off.mean(axis=0)).max() < 6.0 / np.sqrt(400)
    again = next(draws(found, 1, np.random.default_rng(1)))
    assert np.array_equal(again.omega, drawn[0].omega)
