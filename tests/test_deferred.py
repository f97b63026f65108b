"""The truncation of the midpoint rule taken off the whole-record fit: order of the method, and what noise does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nineaudit.array import FloatArray
from nineaudit.estimate.deferred import deferred, worth
from nineaudit.estimate.hypotheses import log_evidence
from nineaudit.estimate.model import Data
from nineaudit.estimate.samples import at_samples
from nineaudit.estimate.trajectory import Fit, fit
from nineaudit.physics import rigid_body
from nineaudit.selftest import alem77
from nineaudit.simulate.published import alem

NINE = alem77.array()


def smoothed(
    rate: float, duration: float = 0.25, noise: FloatArray | float = 0.0
) -> tuple[Fit, FloatArray, FloatArray]:
    """The fit of Table 1's first part, its truth ω, and its readings."""
    truth = alem(rate, duration)
    every = np.ones(9, dtype=np.bool_)
    readings = rigid_body.predict(NINE.positions, NINE.axes, every, truth.a0, truth.alpha, truth.omega) + noise
    weight, count = np.full(readings.shape, 1.0 / alem77.ROUNDING), len(truth.time)
    data = Data(NINE, truth.time, readings, weight, np.zeros((9, 8)), np.zeros(count + 1))
    near = np.vstack([truth.omega[:1], 0.5 * (truth.omega[1:] + truth.omega[:-1]), truth.omega[-1:]])
    return fit(data, near), truth.omega, readings


def error(found: Fit, omega: FloatArray, readings: FloatArray) -> float:
    """Largest error of ω over its peak, ends left out: splines are of lower order there."""
    got = at_samples(found, found.data.time, readings, np.full(9, alem77.ROUNDING)).motion.omega
    return float((np.abs(got - omega)[20:-20] / np.abs(omega).max()).max())


def test_the_fit_is_of_second_order_and_of_fourth_with_its_truncation_taken_off() -> None:
    """Half the step: a quarter of the error, and a sixteenth."""
    plain, better = [], []
    for rate in (800.0, 1600.0):
        found, *rest = smoothed(rate)
        plain.append(error(found, *rest))
        better.append(error(deferred(found), *rest))
    assert plain[0] / plain[1] == pytest.approx(4.0, rel=0.25)
    assert better[0] / better[1] > 12.0
    assert better[1] < 0.02 * plain[1]


def test_table_1_comes_out_by_the_smoother_as_it_does_by_the_predictor_corrector() -> None:
    for name, value in alem77.deviations(smoothed=True).items():
        assert value <= alem77.DEVIATIONS[name], name


def test_noise_is_hardly_touched() -> None:
    """White noise: ω moves by less than a tenth of its own error, the cost stays what it is expected to be."""
    rng = np.random.default_rng(4)
    noise = alem77.ROUNDING * rng.standard_normal((401, 9))
    found, omega, readings = smoothed(1600.0, noise=noise)
    better = deferred(found)
    assert better.converged
    assert better.statistic == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / better.data.dof))
    assert error(better, omega, readings) < 1.1 * error(found, omega, readings)


@pytest.mark.parametrize("rate", [200.0, 400.0])
def test_a_few_steps_show_what_deferred_correction_gains(rate: float) -> None:
    """Of a settled fit and of one that is far from it: what the truncation explains, not what settling does."""
    found, omega, _ = smoothed(rate, duration=0.25)
    gained = log_evidence(deferred(found)) - log_evidence(found)
    assert gained > 10.0
    assert worth(found) == pytest.approx(gained, rel=0.3)
    rng = np.random.default_rng(7)
    far = fit(found.data, found.omega + 0.05 * np.abs(omega).max() * rng.standard_normal(found.omega.shape), None, 1)
    assert not far.converged
    assert worth(far) == pytest.approx(gained, rel=0.3)


def test_truncation_is_worth_nothing_where_samples_are_fine() -> None:
    rng = np.random.default_rng(4)
    found, *_ = smoothed(1600.0, noise=100.0 * alem77.ROUNDING * rng.standard_normal((401, 9)))
    coarse = replace(found.data, weight=found.data.weight / 100.0)  # as noisy as it is
    assert abs(worth(fit(coarse, found.omega))) < 1.0


def test_three_samples_are_left_as_they_are() -> None:
    found, *_ = smoothed(1600.0)
    data = found.data
    short = Data(NINE, data.time[:3], data.readings[:3], data.weight[:3], data.prior_sd, data.still[:4])
    few = fit(short, found.omega[:4])
    assert deferred(few) is few
