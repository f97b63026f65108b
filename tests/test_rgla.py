"""Rate gyros and linear accelerometers [Hu77]: attitude, derivatives, integrals, bandwidth."""

from __future__ import annotations

import numpy as np
import pytest

from nineaudit.errors import EstimationError
from nineaudit.physics.kinematics import orientation
from nineaudit.rig import parse_rig, preset_text
from nineaudit.schemes import rgla
from nineaudit.selftest import hu77
from nineaudit.simulate import simulate


@pytest.mark.parametrize("check", hu77.checks(), ids=lambda check: check.quantity)
def test_published_numbers(check):
    assert check.passed, check


@pytest.mark.parametrize(("rate", "step", "count"), [(30.0, 1e-3, 150), (30.0, 1e-4, 1500), (10.0, 1e-3, 150)])
def test_the_printed_recursion_stretches_rows_and_falls_behind(rate, step, count):
    """A step multiplies by I + h[ω×]: rows perpendicular to ω grow by √(1+h²ω²) and turn by atan(hω)."""
    time = np.arange(count + 1) * step
    omega = np.tile([0.0, 0.0, rate], (count + 1, 1))
    last = rgla.direction_cosines(omega, time)[-1]
    assert np.linalg.norm(last[0]) == pytest.approx((1.0 + (step * rate) ** 2) ** (count / 2), rel=1e-12)
    turned = np.arctan2(last[1, 0], last[0, 0])
    assert np.exp(1j * turned) == pytest.approx(np.exp(1j * count * np.arctan(step * rate)), abs=1e-12)
    assert rgla.departure(last).norm > 0.0
    assert rgla.departure(orientation(omega, time)[-1]).product < 1e-12


def test_the_recursion_approaches_the_rotation_as_the_step_shrinks():
    """First order: half the step, half the error."""
    errors = []
    for count in (1000, 2000):
        time = np.linspace(0.0, 0.1, count + 1)
        omega = np.stack([20 * np.sin(40 * time), 10 * np.cos(30 * time), 15 * np.sin(20 * time)], axis=1)
        errors.append(np.abs(rgla.direction_cosines(omega, time)[-1] - orientation(omega, time)[-1]).max())
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.05)


def test_the_resultant_check_sees_the_stretch():
    """A vector keeps its length in any frame; the printed matrix lengthens it by up to its row norm."""
    time = np.arange(151) * 1e-3
    omega = np.tile([0.0, 0.0, 30.0], (151, 1))
    body = np.tile([1.0, 2.0, 0.0], (151, 1))
    told = [np.einsum("nij,nj->ni", turned(omega, time), body) for turned in (rgla.direction_cosines, orientation)]
    assert rgla.resultant_difference(body, told[0]) == pytest.approx(0.069798, abs=1e-6)
    assert rgla.resultant_difference(body, told[1]) < 1e-12
    with pytest.raises(EstimationError, match="vector that is zero"):
        rgla.resultant_difference(0 * body, told[0])


def test_five_points_have_the_weights_of_the_parabola():
    impulse = np.zeros(21)
    impulse[10] = 1.0
    found = rgla.five_point_derivative(impulse, np.arange(21) * 0.1)[8:13]
    assert found == pytest.approx(np.array([2.0, 1.0, 0.0, -1.0, -2.0]), abs=1e-12)


def test_five_points_are_exact_for_parabolas_to_the_ends_and_err_by_the_third_derivative():
    time = np.linspace(0.0, 1.0, 41)
    assert rgla.five_point_derivative(3 * time**2 - time, time) == pytest.approx(6 * time - 1, abs=1e-10)
    step = time[1]
    error = rgla.five_point_derivative(time**3, time) - 3 * time**2
    assert error[2:-2] == pytest.approx(np.full(37, 17 / 30 * step**2 * 6), rel=1e-6)


def test_five_points_pass_a_fifth_of_the_noise_power_of_the_central_difference():
    noise = np.random.default_rng(0).standard_normal(50_000)
    time = np.arange(50_000) * 1.0
    assert rgla.five_point_derivative(noise, time)[2:-2].std() == pytest.approx(10**-0.5, rel=0.02)


def test_fourier_series_gives_back_what_it_was_made_of():
    time = np.linspace(0.0, 0.4, 401)
    values = 2.0 + 3.0 * time + 5 * np.sin(np.pi * 7 * time / 0.4)
    series = rgla.sine_series(values, time, 10)
    assert series.amplitudes[:, 0] == pytest.approx(5.0 * np.eye(10)[6], abs=1e-12)
    slope = 3.0 + 5 * np.pi * 7 / 0.4 * np.cos(np.pi * 7 * time / 0.4)
    assert rgla.fourier_derivative(values, time, 10) == pytest.approx(slope, abs=1e-9)


def test_lanczos_factors_take_away_the_ripple_of_a_cut_series():
    """The derivative of a ramp that ends in a plateau has a step: Gibbs' overshoot is 9 % of it, Lanczos' 1 %."""
    time = np.linspace(0.0, 1.0, 2001)
    values = np.minimum(time, 0.5) - 0.5 * time
    step = rgla.fourier_derivative(values, time, 40), rgla.fourier_derivative(values, time, 40, sigma=True)
    overshoot = [np.abs(s[500:900]).max() - 0.5 for s in step]
    assert np.abs(step[0]).max() - 0.5 == pytest.approx(0.0895, abs=0.01)
    assert np.abs(step[1]).max() - 0.5 < 0.02
    assert overshoot[1] < 0.2 * overshoot[0]


def test_integration_rules_are_exact_to_their_degree():
    time = np.linspace(0.0, 2.0, 21)
    assert rgla.simpson_integral(time**2, time, 1.0) == pytest.approx(1.0 + time**3 / 3, abs=1e-12)
    assert rgla.simpson_integral(np.stack([time, 0 * time], axis=1), time)[-1] == pytest.approx([2.0, 0.0])
    for order, degree in ((1, 1), (2, 3), (4, 5), (5, 5)):
        found = rgla.newton_cotes_integral(time**degree, time[1], order)
        assert found == pytest.approx(2.0 ** (degree + 1) / (degree + 1), rel=1e-12)
    with pytest.raises(EstimationError, match=r"20 intervals.*multiple of 3"):
        rgla.newton_cotes_integral(time, time[1], 3)


def test_bandwidth_counts_the_harmonics_and_judges_the_rate():
    """25 Hz in 0.4 s is the 20th half-wave: 10 × 25 Hz must have been sampled."""
    for rate, suffices in ((1000.0, True), (200.0, False)):
        time = np.arange(round(0.4 * rate) + 1) / rate
        found = rgla.bandwidth(np.sin(2 * np.pi * 25 * time), time)
        assert found.harmonics == 20
        assert found.frequency == pytest.approx(25.0)
        assert found.required == pytest.approx(250.0)
        assert found.suffices is suffices
    frequencies, amplitudes = rgla.spectrum(np.sin(2 * np.pi * 25 * time), time)
    assert frequencies[np.argmax(amplitudes)] == pytest.approx(25.0)
    with pytest.raises(EstimationError, match="straight line"):
        rgla.bandwidth(time * 0, time)


def test_motion_of_an_rgla_recording():
    """α within the truncation error of the five points, 17/30 h² max|ω‴|."""
    made = simulate(parse_rig(preset_text("rgla")), "general", imperfect=False, noise=False)
    recording, truth = made.recording, made.truth
    found = rgla.motion(recording.rig.array, recording.time, recording.readings, np.ones(6))
    third = np.abs(np.gradient(np.gradient(truth.alpha, truth.time, axis=0), truth.time, axis=0)).max()
    assert np.abs(found.alpha - truth.alpha).max() < 1.5 * 17 / 30 * 1e-8 * third
    assert found.omega == pytest.approx(truth.omega, abs=1e-12)
    assert found.a0 == pytest.approx(truth.a0, abs=1e-9)


def test_errors_name_what_is_missing():
    made = simulate(parse_rig(preset_text("naap-3222")), "general").recording
    with pytest.raises(EstimationError, match=r"0 rate sensors of rank 0.*rate sensors on three axes"):
        rgla.motion(made.rig.array, made.time, made.readings, np.ones(9))
    with pytest.raises(EstimationError, match="even steps"):
        rgla.five_point_derivative(np.arange(6.0), np.array([0.0, 1, 2, 3, 4, 9]))
    with pytest.raises(EstimationError, match="4 samples"):
        rgla.five_point_derivative(np.arange(4.0), np.arange(4.0))
    with pytest.raises(EstimationError, match="found 99"):
        rgla.sine_series(np.arange(10.0) ** 2, np.arange(10.0), 99)
    with pytest.raises(EstimationError, match="gaps"):
        rgla.direction_cosines(np.full((3, 3), np.nan), np.arange(3.0))


def test_what_the_printed_recursion_does_is_said_in_numbers() -> None:
    """METHODS 7.6: 30 rad/s, 150 steps of 1 ms: rows 1.069798 long; a vector across the axis that much too long."""
    time = np.arange(151) * 1e-3
    omega, a0 = np.tile([0.0, 0.0, 30.0], (151, 1)), np.tile([9.0, 0.0, 0.0], (151, 1))
    said = rgla.as_printed(omega, a0, time)
    assert "rows 1.0698 long" in said
    assert "resultants off by 0.07" in said
