"""The covariance of the whole-record fit against simulation: every θ of every channel, every channel, ω, α, a0.

Truth is drawn from the model itself: θ from its prior, noise of the stated size, ω on the nodes as the midpoint rule
has it. Then (estimate − truth) over its stated standard deviation is standard normal, up to second order in θ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from nineaudit.array import FloatArray, SensorArray
from nineaudit.estimate import calibration, trajectory
from nineaudit.estimate.model import Data
from nineaudit.estimate.posterior import posterior
from nineaudit.physics import kinematics, rigid_body
from smoother_data import rig_of, scattered

SAMPLES, STEP = 40, 2e-3
POINT = np.array([0.1, -0.05, 0.02])
TIMES = (4, 19, 37)
ARRAYS = {"naap-3222": rig_of("naap-3222").array, "naap-gyro": rig_of("naap-gyro").array, "scattered": scattered(10, 3)}


def motion() -> tuple[FloatArray, FloatArray]:
    """ω (n+1,3) at the nodes, from rest, and a0 (n,3)."""
    s = np.linspace(0.0, 1.0, SAMPLES + 1)
    omega = 25.0 * np.stack(
        [np.sin(np.pi * s) ** 2, -0.8 * np.sin(2 * np.pi * s) * s, 0.7 * np.sin(4 * s) ** 2], axis=1
    )
    t = s[1:, None]
    return omega, 400.0 * np.hstack([np.sin(5 * t), np.cos(4 * t) * t, -np.sin(7 * t)])


def read(array: SensorArray, a0: FloatArray, alpha: FloatArray, omega: FloatArray) -> FloatArray:
    return rigid_body.predict(array.positions, array.axes, array.is_accelerometer, a0, alpha, omega)


def bent(array: SensorArray, error: FloatArray) -> SensorArray:
    """The instrument with `error` (k,8), SI: (1 + g)(n + τ_1 u_1 + τ_2 u_2), r + e."""
    return SensorArray(
        tuple(
            replace(s, axis=(1 + g) * (s.axis + tau @ calibration.perpendicular(s.axis)), position=s.position + e)
            for s, g, tau, e in zip(array.sensors, error[:, 0], error[:, 2:4], error[:, 4:7], strict=True)
        )
    )


@dataclass(frozen=True)
class Scores:
    """Errors over stated standard deviations: `theta` (q,) and, whitened by the whole covariance, `joint` (q,);
    `channels` (times,k); `omega`, `alpha`, `a0` (times,3); `point` (times,3)."""

    theta: FloatArray
    parameter: FloatArray
    joint: FloatArray
    channels: FloatArray
    omega: FloatArray
    alpha: FloatArray
    a0: FloatArray
    point: FloatArray


@cache
def score(name: str, seed: int) -> Scores:
    array, rng = ARRAYS[name], np.random.default_rng(seed)
    omega, a0 = motion()
    mean, alpha = (omega[1:] + omega[:-1]) / 2, np.diff(omega, axis=0) / STEP
    prior = calibration.prior_sds(array)
    error = prior * rng.standard_normal(prior.shape)
    time = np.arange(SAMPLES) * STEP
    y = read(bent(array, error), a0, alpha, mean)
    sigma = np.where(array.is_accelerometer, 3.0, 0.05)
    y = y + error[:, 1] - error[:, 7] * kinematics.differentiate(y, time) + sigma * rng.standard_normal(y.shape)
    still = np.zeros(SAMPLES + 1)
    still[0] = 1e6
    data = Data(array, time, y, np.broadcast_to(1 / sigma, y.shape).copy(), prior, still)
    found = trajectory.fit(data, omega)
    assert found.converged
    stated = posterior(found)
    channel, parameter = data.active
    off = found.theta - error[channel, parameter] / prior[channel, parameter]
    at, truth = list(TIMES), read(array, a0, alpha, mean)
    sds = np.stack([stated.channel_sd(k) for k in range(len(array))], axis=1)
    there = rigid_body.acceleration_at(POINT, found.motion.a0, found.motion.alpha, found.motion.omega)
    wrong = there - rigid_body.acceleration_at(POINT, a0, alpha, mean)
    of = np.eye(3)
    return Scores(
        theta=off / stated.theta_sd,
        parameter=parameter,
        joint=np.linalg.solve(np.linalg.cholesky(stated.theta), off),
        channels=((found.ideal - truth) / sds)[at],
        omega=((found.motion.omega - mean) / stated.omega_sd())[at],
        alpha=((found.motion.alpha - alpha) / stated.alpha_sd())[at],
        a0=((found.motion.a0 - a0) / np.stack([stated.acceleration_sd(0 * POINT, u) for u in of], axis=1))[at],
        point=(wrong / np.stack([stated.acceleration_sd(POINT, u) for u in of], axis=1))[at],
    )


def check_mean_squares(values: FloatArray, what: str) -> None:
    """(seeds, ...) scores: the mean square of each over the seeds is 1, to five standard deviations of χ²/seeds (by
    the cube root of Wilson and Hilferty, which is normal also in the tail)."""
    seeds = len(values)
    spread = 2 / (9 * seeds)
    cubic = ((values**2).mean(axis=0) ** (1 / 3) - (1 - spread)) / np.sqrt(spread)
    assert np.abs(cubic).max() < 5.0, f"{what}: {np.abs(cubic).max():.1f} standard deviations"


def check(name: str, seeds: Sequence[int]) -> None:
    scores = [score(name, seed) for seed in seeds]
    joint = np.array([s.joint for s in scores])
    assert (joint**2).mean() == pytest.approx(1.0, abs=5 * np.sqrt(2 / joint.size))
    assert joint.mean() == pytest.approx(0.0, abs=5 / np.sqrt(joint.size))
    theta = np.array([s.theta for s in scores])
    for part, kind in enumerate(calibration.PARAMETERS):
        check_mean_squares(theta[:, scores[0].parameter == part], kind)
    for what in ("channels", "omega", "alpha", "a0", "point"):
        check_mean_squares(np.array([getattr(s, what) for s in scores]), what)


@pytest.mark.parametrize("name", ["naap-gyro", "scattered"])
def test_stated_uncertainty_of_everything_is_its_scatter(name: str) -> None:
    check(name, range(40))


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(ARRAYS))
def test_stated_uncertainty_of_everything_is_its_scatter_in_many(name: str) -> None:
    check(name, range(200))


def test_every_parameter_and_every_channel_is_in_the_test() -> None:
    """So that nothing is covered by name only: all eight parameters of all accelerometers, all but places of rates."""
    done, array = score("naap-gyro", 0), ARRAYS["naap-gyro"]
    held = int(array.is_accelerometer.sum())
    assert done.channels.shape == (len(TIMES), len(array))
    assert np.bincount(done.parameter).tolist() == [len(array)] * 4 + [held] * 3 + [len(array)]


@pytest.mark.parametrize("name", ["naap-gyro", "scattered"])
def test_what_is_known_of_theta_is_never_less_than_its_prior(name: str) -> None:
    """Posterior over prior standard deviation of each θ, between 0 and 1."""
    array = ARRAYS[name]
    omega, a0 = motion()
    mean, alpha = (omega[1:] + omega[:-1]) / 2, np.diff(omega, axis=0) / STEP
    still = np.zeros(SAMPLES + 1)
    still[0] = 1e6
    sigma = np.where(array.is_accelerometer, 3.0, 0.05)
    y = read(array, a0, alpha, mean)
    weight = np.broadcast_to(1 / sigma, y.shape).copy()
    data = Data(array, np.arange(SAMPLES) * STEP, y, weight, calibration.prior_sds(array), still)
    sd = posterior(trajectory.fit(data, omega)).theta_sd
    assert (sd > 0).all()
    assert (sd <= 1.0 + 1e-9).all()
