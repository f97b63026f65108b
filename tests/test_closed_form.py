"""Leave-one-out: its derivatives, its invariances, and the constants of METHODS.md 3."""

from __future__ import annotations

import numpy as np
import pytest

from nineaudit.case import Case
from nineaudit.estimate import closed_form
from nineaudit.physics import kinematics, nap
from nineaudit.rig import parse_rig, preset_text
from nineaudit.simulate import simulate

RIG = parse_rig(preset_text("naap-3222", arms=[50.0, 60.0, 70.0]))


@pytest.fixture(scope="module")
def problem():
    return Case(simulate(RIG, "general", seed=1).recording).nap_problem


@pytest.mark.parametrize("hypothesis", [None, 0, 2, 4, 7])
def test_response_is_the_derivative_of_the_residual(problem, hypothesis):
    rng = np.random.default_rng(7)
    patterns = rng.standard_normal((9, len(problem.time), 2))
    turned = np.stack([kinematics.integrate(p, problem.time) for p in patterns])
    found = closed_form.response(problem, hypothesis, patterns, turned)
    step = 1e-3
    for column in range(9):
        for p in range(2):
            moved = np.zeros_like(problem.readings)
            moved[:, column] = step * patterns[column, :, p]
            up, down = (closed_form.residual(problem, hypothesis, problem.readings + s * moved) for s in (1, -1))
            expected = (up - down) / (2 * step)
            scale = max(np.abs(expected).max(), 1e-12)
            assert np.abs(found[column, :, :, p] - expected).max() < 1e-8 * scale
        assert found[column].any() == (column != hypothesis)


def test_whitener_makes_the_noise_white(problem):
    """The covariance of the whitened residual of pure noise is the identity."""
    rng = np.random.default_rng(3)
    n = 40_000
    for hypothesis in (None, 0, 5):
        whiten = closed_form.whitener(problem, hypothesis)
        noise = rng.standard_normal((n, 9)) * problem.sigma
        rows = noise_rows(problem, hypothesis)
        covariance = np.cov((noise @ rows.T) @ whiten.T, rowvar=False)
        assert len(whiten) == (3 if hypothesis is None else 2)
        assert np.abs(covariance - np.eye(len(whiten))).max() < 6 / np.sqrt(n)


def noise_rows(problem, hypothesis):
    rows, mixing = nap.product_rows(problem.arms), np.eye(9)
    if hypothesis is not None:
        mixing[hypothesis] = nap.closed_form(nap.CHANNELS[hypothesis], problem.arms).row
    return rows @ mixing


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("motion", ["general", "planar", "oblique", "sled", "drop"])
def test_healthy_records_cost_one_per_degree_of_freedom(motion, seed):
    """0.5 % gain, 0.5°, 0.5 mm, 0.1 g: with calibration in the fit the cost is its expectation (METHODS.md 2)."""
    healthy = Case(simulate(RIG, motion, seed=100 + seed).recording).nap_healthy
    assert abs(healthy.statistic - 1.0) < 5 * np.sqrt(2 / healthy.dof) + 0.03


def test_without_calibration_in_the_fit_healthy_records_look_bad():
    """The naive white-noise statistic, which METHODS.md 2 calls useless, against ours, on the same records."""
    naive, ours = [], []
    for seed in range(6):
        problem = Case(simulate(RIG, "general", seed=seed).recording).nap_problem
        whiten = closed_form.whitener(problem, None)
        residual = closed_form.residual(problem, None, problem.readings) @ whiten.T
        naive.append((residual**2).sum() / residual.size)
        ours.append(closed_form.fit_hypothesis(problem, None).statistic)
    assert min(naive) > 1.2 > max(ours)


def test_detection_constants_of_equal_arms():
    """λ0/Σ(e²/σ²) = 5/18 for an arm and 4/9 for a centre channel (METHODS.md 3), about a body at rest and without
    calibration errors to hide behind."""
    n, sigma = 64, np.full(9, 2.0)
    rng = np.random.default_rng(2)
    problem = closed_form.Problem(
        names=tuple("abcdefghi"),
        time=np.arange(n) * 1e-3,
        readings=np.zeros((n, 9)),
        sigma=sigma,
        patterns=np.zeros((9, n, 8)),
        arms=np.array([0.05, 0.05, 0.05]),
    )
    healthy = closed_form.fit_hypothesis(problem, None)
    pattern = rng.standard_normal(n)
    for column in range(9):
        share = closed_form.separations(problem, healthy, pattern)[column] / ((pattern / 2.0) ** 2).sum()
        assert share == pytest.approx(4 / 9 if column < 3 else 5 / 18, rel=1e-12)


def test_twins_cannot_be_told_apart_at_rest_and_others_can():
    n = 64
    problem = closed_form.Problem(
        tuple("abcdefghi"),
        np.arange(n) * 1e-3,
        np.zeros((n, 9)),
        np.ones(9),
        np.zeros((9, n, 8)),
        np.array([0.05, 0.05, 0.05]),
    )
    twins = {3: 5, 5: 3, 4: 7, 7: 4, 6: 8, 8: 6}
    pattern = np.sin(np.linspace(0, 9, n))
    for hypothesis in range(9):
        fit = closed_form.fit_hypothesis(problem, hypothesis)
        for fault in range(9):
            if fault == hypothesis:
                continue
            share = closed_form.separations(problem, fit, pattern)[fault] / (pattern**2).sum()
            if twins.get(fault) == hypothesis:
                assert share == pytest.approx(0.0, abs=1e-12)
            else:
                assert share > 0.1


def test_fault_in_the_free_channel_is_invisible(problem):
    for hypothesis in (1, 6):
        fit = closed_form.fit_hypothesis(problem, hypothesis)
        spoiled = problem.readings.copy()
        spoiled[:, hypothesis] = np.random.default_rng(0).standard_normal(len(problem.time)) * 1e3
        again = closed_form.fit_hypothesis(
            closed_form.Problem(problem.names, problem.time, spoiled, problem.sigma, problem.patterns, problem.arms),
            hypothesis,
        )
        assert again.cost == pytest.approx(fit.cost, rel=1e-12)
        assert closed_form.separations(problem, fit, np.ones(len(problem.time)))[hypothesis] == 0.0


def test_cost_never_exceeds_the_uncalibrated_one(problem):
    whiten = closed_form.whitener(problem, None)
    observed = (closed_form.residual(problem, None, problem.readings) @ whiten.T).ravel()
    assert closed_form.fit_hypothesis(problem, None).cost <= observed @ observed
