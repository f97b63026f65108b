"""What happens between coarse samples: the laws behind its budget, and the fit that holds it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nineaudit.array import FloatArray
from nineaudit.estimate.between_samples import between, coarse, slope, unresolved
from nineaudit.estimate.model import Between, Data
from nineaudit.estimate.motion import Motion
from nineaudit.estimate.point import point
from nineaudit.estimate.student import _scales
from smoother_data import problem

STEP, CYCLE = 0.016, 4.0
"""A hand at 4 Hz, sampled at 62.5 Hz."""


def turning(amplitude: float = 30.0) -> tuple[FloatArray, Motion, FloatArray, FloatArray]:
    """Step (n,), a sinusoidal motion sampled coarsely, and what the midpoint rule makes of its ω and α (n,3)."""
    time, rate = np.arange(600) * STEP, 2.0 * np.pi * CYCLE
    phases = np.array([0.0, 1.0, 2.0])

    def omega(t: FloatArray) -> FloatArray:
        return amplitude * np.sin(rate * t[:, None] + phases)

    alpha = amplitude * rate * np.cos(rate * time[:, None] + phases)
    before, after = omega(time - STEP / 2), omega(time + STEP / 2)
    motion = Motion(omega(time), alpha, np.zeros_like(alpha), "true")
    return np.full(len(time), STEP), motion, 0.5 * (before + after), (after - before) / STEP


def test_truncation_of_the_midpoint_rule_is_predicted() -> None:
    """The lag of ω is known to the next term of its series, (ωh)²/6 of it for central differences and less, and what
    is left of ω and α stays within the stated standard deviations."""
    step, motion, mean, alpha = turning()
    found, inner = between(step, motion), slice(2, -2)
    lag = (motion.omega - mean)[inner]
    assert np.abs(lag - found.mean[inner, :3]).max() <= (2.0 * np.pi * CYCLE * STEP) ** 2 / 6.0 * np.abs(lag).max()
    assert (np.abs(lag - found.mean[inner, :3]) <= found.sd[inner, :3]).all()
    assert (np.abs(motion.alpha - alpha)[inner] <= found.sd[inner, 3:]).all()


def test_budget_vanishes_with_the_step() -> None:
    """α taken twice as often is resolved four times as well."""
    sizes = []
    for step in (STEP, STEP / 2):
        time = np.arange(0.0, 2.0, step)
        sizes.append(np.sqrt(np.mean(unresolved(np.sin(2.0 * np.pi * CYCLE * time)[:, None])[2:-2] ** 2)))
    assert sizes[0] / sizes[1] == pytest.approx(4.0, rel=(2.0 * np.pi * CYCLE * STEP) ** 2 / 6.0)


def test_white_noise_is_found_as_large_as_it_is_and_its_slope_as_the_spectrum_has_it() -> None:
    rng, n = np.random.default_rng(5), 2**15
    noise = rng.normal(0.0, 3.0, (n, 1))
    spread = 5.0 / np.sqrt(n)  # relative, of a mean square of neighbouring products, five times over
    assert np.mean(unresolved(noise) ** 2) == pytest.approx(9.0, rel=2.0 * spread)
    band = np.fft.rfft(noise[:, 0]) * 2j * np.pi * np.fft.rfftfreq(n, STEP)
    true = np.mean(np.fft.irfft(band, n) ** 2)
    assert np.mean(slope(noise, np.full(n, STEP)) ** 2) == pytest.approx(true, rel=2.0 * spread)


def with_gyros() -> Data:
    return problem("naap-gyro", "general").data


def spread_between(data: Data, size: float) -> Data:
    n, rng = len(data.time), np.random.default_rng(1)
    sd = size * np.tile([0.3, 0.2, 0.1, 50.0, 60.0, 70.0], (n, 1))
    return replace(data, between=Between(rng.normal(0.0, 5.0, (n, 3)), np.zeros((n, 6)), sd))


def test_shared_errors_cost_what_their_covariance_says() -> None:
    """‖z‖² − ‖Gz‖² against zᵀ(C⁻¹ − C⁻¹A(AᵀC⁻¹A)⁻¹AᵀC⁻¹)z with C = diag(σ²) + BBᵀ, a0 free."""
    data = spread_between(with_gyros(), 1.0)
    rng = np.random.default_rng(2)
    omega, theta = rng.normal(0.0, 5.0, (len(data.time) + 1, 3)), np.zeros(len(data.channel))
    at = point(data, omega, theta)
    there, spread = data.bent(theta), data.between
    assert spread is not None
    left = (at.z**2).sum(axis=0) - (at.explained**2).sum(axis=0)
    by_omega = there.by_omega(spread.omega.T)
    for t in (0, 7, len(data.time) - 1):
        b = np.hstack([by_omega[:, :, t], there.lever]) * spread.sd[t]
        c = np.linalg.inv(np.diag(data.weight[t] ** -2.0) + b @ b.T)
        a, y = there.axes_a, at.z[:, t] / data.weight[t]
        free = c @ a @ np.linalg.solve(a.T @ c @ a, a.T @ c)
        assert left[t] == pytest.approx(y @ (c - free) @ y, rel=1e-6)


def test_without_errors_between_samples_the_fit_is_the_old_one() -> None:
    data, rng = with_gyros(), np.random.default_rng(3)
    omega, theta = rng.normal(0.0, 5.0, (len(data.time) + 1, 3)), np.zeros(len(data.channel))
    old, new = point(data, omega, theta), point(spread_between(data, 1e-9), omega, theta)
    assert new.cost == pytest.approx(old.cost, rel=1e-9)
    np.testing.assert_allclose(new.ideal, old.ideal, rtol=1e-6, atol=1e-6 * np.abs(old.ideal).max())


def test_a_time_offset_costs_its_slope() -> None:
    data = with_gyros()
    timing = data.prior_sd.copy()
    timing[:, 7] = 0.0
    motion = point(data, np.zeros((len(data.time) + 1, 3)), np.zeros(len(data.channel))).motion
    still = coarse(replace(data, prior_sd=timing), motion)
    np.testing.assert_array_equal(still.weight, data.weight)
    timing[:, 7] = 1e-3
    assert (coarse(replace(data, prior_sd=timing), motion).weight <= data.weight).all()


def test_knocks_scale_a_kind_and_a_sample_alone() -> None:
    """λ² = (ν + χ²)/(ν + m): small where nothing is left, large for all accelerometers of the sample that is hit."""
    data = with_gyros()
    omega, theta = np.zeros((len(data.time) + 1, 3)), np.zeros(len(data.channel))
    at_rest = np.tile(data.bent(theta).axes_a @ [1.0, 2.0, 3.0], (len(data.time), 1))
    still = spread_between(replace(data, readings=at_rest), 1e-6)
    held, readings = still.array.is_accelerometer, still.readings.copy()
    readings[5, held] += 50.0 * np.resize([1.0, -1.0], held.sum()) / still.weight[5, held]
    hit = replace(still, readings=readings)
    knock, by_sample = _scales(hit, point(hit, omega, theta))
    assert (knock[5, held] > 10.0).all()
    assert (np.delete(knock[:, held], 5, axis=0) < 1.0).all()
    assert (knock[:, ~held] < 1.0).all()
    assert np.nanmedian(by_sample) < 1e-6
