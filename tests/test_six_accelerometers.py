"""Six accelerometers with ω fed back: exact without noise, growth and envelope as derived, warnings where due."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from nineaudit import cli, motion_six
from nineaudit.array import FloatArray, frozen
from nineaudit.case import Case
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.physics import rigid_body
from nineaudit.presets import preset_text
from nineaudit.rig import parse_rig
from nineaudit.schemes import envelope, growth, rate_gyro
from nineaudit.schemes.six_accelerometers import Package, Solution, inverse, package, products, solve
from nineaudit.selftest import becker75
from nineaudit.simulate import simulate
from nineaudit.simulate.motions import motion_function
from nineaudit.simulate.truth import Truth


def calibrated(seed: int = 0, arm: float = 0.05) -> Package:
    """A 3-2-1 package as built: sensitivities off by 5 %, tilted by some degrees, with offsets and misplaced."""
    rng = np.random.default_rng(seed)
    ideal = becker75.six(arm)
    tilted = ideal.sensitivity + 0.05 * rng.standard_normal((6, 3))
    moved = ideal.positions + 0.001 * rng.standard_normal((6, 3))
    return Package(moved, 3.7 * tilted, rng.standard_normal(6))


def outputs(six: Package, truth: Truth) -> FloatArray:
    """v_i = S_i·(a0 + α×P_i + ω×(ω×P_i)) + V_i, from cross products."""
    at = [rigid_body.acceleration_at(p, truth.a0, truth.alpha, truth.omega) for p in six.positions]
    return np.column_stack([a @ s for a, s in zip(at, six.sensitivity, strict=True)]) + six.offset


def turn(axis: int, angle: float, duration: float = 0.2, rate: float = 10_000.0) -> Truth:
    """From rest to rest about one body axis."""
    time = np.arange(round(duration * rate) + 1) / rate
    phase = 2 * math.pi * time / duration
    omega, alpha = np.zeros((len(time), 3)), np.zeros((len(time), 3))
    omega[:, axis] = angle / duration * (1 - np.cos(phase))
    alpha[:, axis] = angle / duration * 2 * math.pi / duration * np.sin(phase)
    return Truth(time, omega, alpha, np.zeros((len(time), 3)))


def solved(truth: Truth, six: Package | None = None) -> Solution:
    six = six or calibrated()
    return solve(six, outputs(six, truth), truth.time, truth.omega[0])


@pytest.mark.parametrize("seed", range(3))
def test_exact_readings_of_a_general_motion_give_it_back(seed: int) -> None:
    truth = motion_function("general")(10_000.0, None, np.random.default_rng(seed))
    got = solved(truth, calibrated(seed))
    # Fourth order: 1e-4 s steps, nothing faster than 100 Hz, (2π·100·1e-4)⁴/120 ≈ 1e-7, times the growth
    np.testing.assert_allclose(got.omega, truth.omega, atol=1e-5 * np.abs(truth.omega).max())
    np.testing.assert_allclose(got.alpha, truth.alpha, atol=1e-5 * np.abs(truth.alpha).max())
    np.testing.assert_allclose(got.a0, truth.a0, atol=1e-5 * np.abs(truth.a0).max())


def test_the_step_is_of_fourth_order() -> None:
    errors = []
    for rate in (400.0, 800.0, 1600.0):
        truth = motion_function("general")(rate, None, None)
        errors.append(np.abs(solved(truth).omega - truth.omega).max())
    assert errors[0] / errors[1] > 10
    assert errors[1] / errors[2] > 10


def test_outputs_in_other_units_and_of_turned_sensors_are_the_same_motion() -> None:
    truth = turn(1, 1.0)
    first, second = solved(truth, calibrated(1)), solved(truth, calibrated(2))
    np.testing.assert_allclose(first.omega, second.omega, atol=1e-6 * np.abs(truth.omega).max())


def test_products_are_those_of_the_centripetal_part() -> None:
    six, omega = calibrated(), np.random.default_rng(0).standard_normal((5, 3))
    by_products = products(omega) @ rigid_body.product_matrix(six.positions, six.sensitivity).T
    crossed = [np.cross(omega, np.cross(omega, p)) @ s for p, s in zip(six.positions, six.sensitivity, strict=True)]
    np.testing.assert_allclose(by_products, np.column_stack(crossed), rtol=1e-12, atol=1e-15)


def test_the_rig_of_the_preset_is_a_package() -> None:
    array = parse_rig(preset_text("3-2-1")).array
    six = package(array)
    np.testing.assert_allclose(inverse(six) @ rigid_body.design(array.positions, array.axes), np.eye(6), atol=1e-12)
    with pytest.raises(EstimationError, match="found '9 accelerometers'; expected 6"):
        package(parse_rig(preset_text("naap-3222")).array)


def test_a_package_in_line_is_refused_with_its_rank() -> None:
    along = np.linspace(0.0, 0.05, 6)[:, None] * np.array([1.0, 0.0, 0.0])
    in_line = Package(along, np.tile(np.eye(3), (2, 1)), np.zeros(6))
    with pytest.raises(EstimationError, match=r"H of rank 5, condition number .*move one off it"):
        inverse(in_line)


def test_readings_that_do_not_fit_are_refused() -> None:
    truth = turn(0, 1.0)
    six = calibrated()
    readings = outputs(six, truth)
    readings[5, 2] = np.nan
    with pytest.raises(EstimationError, match=r"channels 3 of 6: readings have gaps; found '1 value"):
        solve(six, readings, truth.time)
    with pytest.raises(EstimationError, match="do not fit"):
        solve(six, readings[:, :5], truth.time)
    with pytest.raises(EstimationError, match="not increasing"):
        solve(six, np.zeros((4, 6)), np.array([0.0, 1.0, 1.0, 2.0]))


def test_divergence_is_said_with_its_time() -> None:
    six = becker75.six(0.05)
    time = np.arange(4001) / 1000.0
    with pytest.raises(EstimationError, match=r"has diverged; found .*first quarter turn"):
        solve(six, np.full((4001, 6), 1.0) @ np.diag([0.0, 0.0, 0.0, -200.0, 0.0, 0.0]), time)


@pytest.mark.parametrize("about", np.eye(3))
def test_the_growth_rate_is_the_largest_eigenvalue_about_each_axis(about: FloatArray) -> None:
    six = becker75.six(0.07)
    step = 1e-6
    rows = inverse(six)[3:]
    q = [rigid_body.centripetal(six.positions, six.sensitivity, (about + s * e)[None])[0]
         for e in np.eye(3) for s in (step, -step)]  # fmt: skip
    slope = -rows @ np.column_stack([(q[2 * i] - q[2 * i + 1]) / (2 * step) for i in range(3)])
    found = growth.growth_rate(six.positions, six.sensitivity, about)
    assert found == pytest.approx(np.abs(np.linalg.eigvals(slope).real).max(), abs=1e-6)


def test_only_about_x_of_its_three_axes_does_the_layout_let_errors_grow() -> None:
    six = becker75.six(0.05)
    rates = [growth.growth_rate(six.positions, six.sensitivity, axis) for axis in np.eye(3)]
    assert rates == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
    assert growth.growth_rate(six.positions, six.sensitivity) == pytest.approx(1.0, abs=1e-6)


def test_growth_along_a_record_is_that_of_its_angle() -> None:
    for degrees in (30.0, 80.0):
        found = growth.validity(solved(turn(0, math.radians(degrees)), becker75.six(0.05)))
        assert math.degrees(found.rotation) == pytest.approx(degrees, abs=1e-3)
        assert found.growth == pytest.approx(math.exp(math.radians(degrees)), rel=1e-3)
        assert found.warning is None


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_beyond_a_quarter_turn_there_is_a_warning(axis: int) -> None:
    found = growth.validity(solved(turn(axis, math.radians(120.0)), becker75.six(0.05)))
    assert found.warning is not None
    assert "turned 120°" in found.warning
    assert "about a quarter turn (90°, 4.81 times" in found.warning
    assert f"grew up to {found.growth:.1f} times" in found.warning


def test_the_warning_goes_with_the_motion() -> None:
    array = parse_rig(preset_text("3-2-1")).array
    for degrees in (60.0, 120.0):
        truth = turn(0, math.radians(degrees))
        ideal = Package(array.positions, array.axes, np.zeros(6))
        found, how_far = growth.motion(array, truth.time, outputs(ideal, truth), np.zeros(3))
        np.testing.assert_allclose(found.omega, truth.omega, atol=1e-6 * np.abs(truth.omega).max())
        assert ("about a quarter turn" in found.method) == (degrees > 90.0) == (how_far.warning is not None)


def test_a_turn_and_its_return_is_as_good_as_its_largest_angle() -> None:
    out = turn(0, math.radians(80.0))
    both = Truth(
        np.concatenate([out.time, out.time[-1] + out.time[1:]]),
        np.vstack([out.omega, -out.omega[1:]]),
        np.vstack([out.alpha, -out.alpha[1:]]),
        np.zeros((2 * len(out.time) - 1, 3)),
    )
    found = growth.validity(solved(both, becker75.six(0.05)))
    assert math.degrees(found.rotation) == pytest.approx(80.0, abs=0.01)
    assert found.warning is None


def test_forced_growth_is_the_integral_of_the_growth() -> None:
    for angle in (0.5, math.pi / 2, 2.0):
        mean = np.exp(np.linspace(0.0, angle, 20_001)).mean()
        assert growth.forced_growth(angle) == pytest.approx(mean, rel=1e-4)
    assert growth.forced_growth(math.pi / 2) == pytest.approx(2.43, abs=0.005)
    assert growth.forced_growth(0.0) == 1.0


@pytest.mark.parametrize("parameter", ["gain", "offset"])
def test_sensitivities_are_the_finite_differences_of_the_whole_solution(parameter: str) -> None:
    truth = motion_function("oblique")(10_000.0, None, None)
    six, step = calibrated(4), 1e-5
    readings = outputs(six, truth)
    solution = solve(six, readings, truth.time, truth.omega[0])
    found = (
        envelope.gain_sensitivity(solution, readings) if parameter == "gain" else envelope.offset_sensitivity(solution)
    )
    for channel in range(6):
        change = np.zeros_like(readings)
        change[:, channel] = step * (readings - six.offset)[:, channel] if parameter == "gain" else step
        up, down = (solve(six, readings + s * change, truth.time, truth.omega[0]).omega for s in (1, -1))
        # second-order rule at 1e-4 s against a fourth-order one: (2π·100 Hz·1e-4)²/12 ≈ 3e-4 of the largest
        difference = (up - down) / (2 * step)
        np.testing.assert_allclose(found[:, :, channel], difference, atol=1e-3 * np.abs(difference).max())


def test_the_envelope_is_reached_by_the_worst_signs_and_never_passed() -> None:
    truth = turn(0, 1.2, rate=2000.0)
    six, limit = calibrated(5), 1e-4
    truth = Truth(truth.time, truth.omega, truth.alpha, np.full_like(truth.a0, 30.0))
    readings = outputs(six, truth)
    solution = solve(six, readings, truth.time, truth.omega[0])
    bound = envelope.worst_case(envelope.gain_sensitivity(solution, readings), np.full(6, limit))[-1]
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 6)).reshape(6, -1).T
    signal = readings - six.offset
    ends = np.array([
        solve(six, readings + limit * s * signal, truth.time, truth.omega[0]).omega[-1] for s in signs
    ])  # fmt: skip
    reached = np.abs(ends - solution.omega[-1]).max(axis=0)
    np.testing.assert_allclose(reached, bound, rtol=0.01)


def test_limits_of_an_envelope_are_six_numbers() -> None:
    with pytest.raises(EstimationError, match="expected 6 numbers of 0 or more"):
        envelope.worst_case(np.zeros((4, 3, 6)), np.array([-1.0, 0, 0, 0, 0, 0]))


def test_the_gyros_response_is_that_of_a_second_order_system() -> None:
    time = np.arange(20_001) / 10_000.0
    for hertz in (5.0, 37.0, 90.0):
        shown = rate_gyro.second_order(np.sin(2 * math.pi * hertz * time), time)[-10_000:]
        ratio = hertz / 37.0
        response = 1.0 / (1 - ratio**2 + 2j * 0.5 * ratio)
        expected = np.abs(response) * np.sin(2 * math.pi * hertz * time + np.angle(response))[-10_000:]
        # straight lines between samples: (2π·90·1e-4)²/12 = 3e-4
        np.testing.assert_allclose(shown, expected, atol=5e-4)
    constant = rate_gyro.second_order(np.full(100, 3.0), time[:100])
    np.testing.assert_array_equal(constant, np.full(100, 3.0))


def test_a_slow_gyro_agrees_only_through_its_response() -> None:
    truth = turn(1, 1.3, duration=0.08)
    omega = solved(truth).omega
    gyro = rate_gyro.second_order(truth.omega, truth.time)
    through = rate_gyro.compare(omega, gyro, truth.time)
    assert max(through.of_peak) < 1e-5
    # the response is late by 2ζ/ωn = 4.3 ms: a sixteenth of the turn's 80 ms and of its steepest slope, π
    assert np.abs(omega - gyro).max() / np.abs(gyro).max() > 0.1


def test_a_gyros_bad_parameters_and_records_are_refused() -> None:
    time = np.arange(10) / 1000.0
    with pytest.raises(ConfigurationError, match="damping ratio; found -1"):
        rate_gyro.second_order(np.zeros(10), time, damping=-1.0)
    with pytest.raises(EstimationError, match="even time base"):
        rate_gyro.second_order(np.zeros(10), time**2)
    with pytest.raises(EstimationError, match="1 gap"):
        rate_gyro.second_order(np.r_[np.nan, np.zeros(9)], time)
    with pytest.raises(EstimationError, match="nothing to compare"):
        rate_gyro.compare(np.zeros((10, 3)), np.zeros((10, 3)), time)


@pytest.fixture(scope="module")
def recorded() -> Case:
    """A turn within a quarter turn by a perfect 3-2-1 array."""
    return Case(simulate(parse_rig(preset_text("3-2-1")), "drop", seed=3, imperfect=False, noise=False).recording)


def test_the_worst_case_of_a_recording_is_the_sum_over_its_channels(recorded: Case) -> None:
    channels, limit = motion_six.chosen("0.005", recorded)
    assert (channels, limit) == (recorded.array.channels, 0.005)
    every = motion_six.worst_case(recorded, np.zeros(3), channels, limit)
    each = [motion_six.worst_case(recorded, np.zeros(3), (c,), 2 * limit).at_end for c in channels]
    np.testing.assert_allclose(every.at_end, 0.5 * np.sum(each, axis=0), rtol=1e-12)
    assert all(most >= end for most, end in zip(every.at_most, every.at_end, strict=True))
    assert motion_six.chosen("a0z,a1z=0.01", recorded) == (("a0z", "a1z"), 0.01)


@pytest.mark.parametrize(
    ("text", "said"), [("a9z=0.005", "no such accelerometer; found 'a9z'"), ("5%", "a share of 1")]
)
def test_a_worst_case_that_is_none_is_a_sentence(text: str, said: str, recorded: Case) -> None:
    with pytest.raises(ConfigurationError, match=said):
        motion_six.chosen(text, recorded)


def test_slow_rate_sensors_of_a_recording_agree_through_their_response() -> None:
    made = simulate(parse_rig(preset_text("naap-gyro")), "general", seed=3, imperfect=False, noise=False)
    readings = made.recording.readings.copy()
    readings[:, 9:] = rate_gyro.second_order(readings[:, 9:], made.recording.time)
    case = Case(replace(made.recording, readings=frozen(readings)))
    assert max(motion_six.agreement(case, made.truth.omega, 37.0, 0.5).of_peak) < 1e-6
    assert max(motion_six.agreement(case, made.truth.omega, 74.0, 0.5).of_peak) > 0.01
    six = Case(simulate(parse_rig(preset_text("3-2-1")), "drop").recording)
    with pytest.raises(EstimationError, match="no rate sensors on three axes to compare with"):
        motion_six.agreement(six, np.zeros((len(six.time), 3)), 37.0, 0.5)


def test_the_command_says_warning_worst_case_and_agreement(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)

    def run(line: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as ended:
            cli.main(line.split())
        shown = capsys.readouterr()
        return int(ended.value.code or 0), shown.out, shown.err

    text = preset_text("3-2-1") + "".join(
        f'\n[[sensor]]\nchannel = "g{axis}"\nkind = "gyroscope"\naxis = {[float(axis == a) for a in "xyz"]}\n'
        for axis in "xyz"
    )
    Path("rig.toml").write_text(text, encoding="utf-8")
    run("simulate rig.toml --motion general --output T.csv --rate 4000")
    options = "--worst-case a0z,a1z=0.005 --gyro-response 37,0.5"
    code, shown, said = run(f"motion T.csv --rig rig.toml --method six-accelerometers {options}")
    assert (code, said) == (0, "")
    assert "about a quarter turn (90°, 4.81 times, Becker and Willems 1975)" in shown
    assert "gains of a0z, a1z off by up to 0.5 %, worst signs:" in shown
    assert "ω through a response of 37 Hz, ζ = 0.5, less the rate sensors" in shown
    code, _, said = run("motion T.csv --rig rig.toml --method six-accelerometers --gyro-response 37")
    assert (code, "--gyro-response: response of the rate sensors; found '37'" in said) == (2, True)


def test_the_published_numbers_come_out() -> None:
    missed = [c for c in becker75.checks() if not c.passed]
    assert missed == []
