"""Budgets: the example of METHODS 5, three ways that agree where all is linear, and what a layout can prove."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from nineaudit import cli
from nineaudit.array import FloatArray, SensorArray
from nineaudit.budgets import Budget, typical
from nineaudit.budgets.ambiguity import ambiguity
from nineaudit.budgets.monte_carlo import scatter
from nineaudit.estimate import trajectory
from nineaudit.estimate.at_their_word import Word, at_their_word, motion_at_their_word
from nineaudit.estimate.budget import ROWS, Rows, Way, rows, total
from nineaudit.estimate.calibration import SOURCES
from nineaudit.estimate.functional import smoothed
from nineaudit.estimate.motion import Motion
from nineaudit.estimate.outputs import Gradient, Output, at_instant, outputs
from nineaudit.estimate.posterior import posterior
from nineaudit.physics import rigid_body
from nineaudit.rig import Rig, parse_rig, preset_text
from nineaudit.simulate import simulate
from nineaudit.units import G0
from test_ambiguity import HIDDEN, TABLE

ORIGIN = np.zeros(3)


@cache
def rig_of(preset: str) -> Rig:
    return parse_rig(preset_text(preset))


def known_rows(way: Way, gradient: Gradient) -> Rows:
    """Standard uncertainty by calibration and noise of all channels, without what is beyond these."""
    return {s: float(np.linalg.norm(u)) for s, u in way.by_channel(way.coefficients(gradient), gradient).items()}


def certain(array: SensorArray, **stated: float) -> SensorArray:
    """The array with no uncertainty but what is `stated`."""
    none = dict.fromkeys(("u_gain", "u_zero", "u_alignment", "u_position", "u_timing"), 0.0)
    return SensorArray(tuple(replace(s, **(none | stated)) for s in array.sensors))


def scaled(rig: Rig, by: float) -> Rig:
    """The rig with all its uncertainties, noise too, `by` times as large."""
    names = ("u_gain", "u_zero", "u_alignment", "u_position", "u_timing", "noise")
    sensors = (replace(s, **{name: by * getattr(s, name) for name in names}) for s in rig.array.sensors)
    return replace(rig, array=SensorArray(tuple(sensors)))


@cache
def budget(preset: str, motion: str = "general") -> Budget:
    return typical(rig_of(preset), motion)


# --- the example of METHODS 5 -------------------------------------------------------------------------------------

EXAMPLE = [
    ("gain", {"u_gain": 0.01}, 196.0),
    ("alignment", {"u_alignment": 0.03}, 588.0),  # cross-axis of 3 % is a tilt of 0.03
    ("alignment", {"u_alignment": np.deg2rad(0.5)}, 171.0),
    ("noise", {}, 59.0),
]


def still(y: FloatArray, array: SensorArray, sigma: float) -> Word:
    """The estimator for readings `y` (9,) at one sample of a record at rest, 0.1 ms a sample."""
    readings = np.zeros((21, len(array)))
    readings[10] = y
    return at_their_word(array, np.arange(21) * 1e-4, readings, np.full(len(array), sigma), 0)


@pytest.mark.parametrize(("source", "stated", "printed"), EXAMPLE)
def test_example_of_100_g_on_50_mm(source: str, stated: dict[str, float], printed: float) -> None:
    """αx from four channels that all read 100 g, across which there are 100 g as well: half of the printed digit."""
    array = certain(rig_of("naap-3222").array, **stated)
    word = still(array.axes @ np.array([0.0, 100.0, 100.0]) * G0, array, 0.3 * G0 if source == "noise" else 1e-9)
    found = known_rows(word, at_instant("α", 10, 0, word.motion, ORIGIN))
    assert found[source] == pytest.approx(printed, abs=0.5)
    assert total(found) == pytest.approx(found[source], rel=1e-6)


def test_example_of_an_arm_that_is_half_a_millimetre_off() -> None:
    """83 rad/s² where the two arms differ from the centre by 60 g, the centre's place being known."""
    array = certain(rig_of("naap-3222").array)
    arms = tuple(replace(s, u_position=5e-4 * s.position.any()) for s in array.sensors)
    array = SensorArray(arms)
    y = np.array([{"a2z": 60.0, "a3y": -60.0}.get(c, 0.0) * G0 for c in array.channels])
    word = still(y, array, 1e-9)
    found = known_rows(word, at_instant("α", 10, 0, word.motion, ORIGIN))
    assert found["position"] == pytest.approx(83.0, abs=0.5)


# --- derivatives ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("preset", ["naap-3222", "naap-gyro", "triax-4", "triax-3", "3-2-1", "rgla", "coplanar-3-gyro"])
def test_coefficients_are_the_derivative_of_every_output_by_the_readings(preset: str) -> None:
    """By central differences along random directions, ω fed back where it must be; an output that is a maximum is
    smooth near its peak."""
    found, rng = budget(preset), np.random.default_rng(1)
    blocks, rest = found.blocks, found.rest_index
    word = at_their_word(found.array, blocks.time, blocks.readings, blocks.sigma, rest)

    def value(readings: FloatArray, output: Output) -> float:
        return output.value(motion_at_their_word(found.array, blocks.time, readings, blocks.sigma, rest), blocks.time)

    for output in found.outputs:
        by_reading = word.coefficients(output.gradient(word.motion, blocks.time))
        for _ in range(3):
            along = 1e-5 * blocks.sigma * rng.standard_normal(blocks.readings.shape)
            up, down = (value(blocks.readings + s * along, output) for s in (1.0, -1.0))
            expected = float(2.0 * (by_reading * along).sum())
            size = 2.0 * float(np.linalg.norm(by_reading * along))
            assert up - down == pytest.approx(expected, abs=0.02 * size), output.name


@pytest.mark.parametrize("preset", ["naap-3222", "naap-gyro", "triax-3", "3-2-1"])
def test_coefficients_of_the_fit_are_what_its_noise_comes_from(preset: str) -> None:
    """Σ c²σ² is all that the calibration errors leave of the covariance, which is known without c."""
    found = budget(preset)
    fit = smoothed(found.fit)
    for output in found.outputs:
        gradient = output.gradient(fit.motion, found.blocks.time)
        by_noise = np.sqrt((fit.coefficients(gradient) ** 2 @ found.blocks.sigma**2).sum())
        assert by_noise == pytest.approx(known_rows(fit, gradient)["noise"], rel=1e-3), output.name


@pytest.mark.parametrize("preset", ["naap-3222", "naap-gyro", "triax-3"])
def test_rows_of_the_fit_add_up_to_its_covariance(preset: str) -> None:
    """One component at one sample: posterior.py has it in closed form, without sources."""
    case = budget(preset).case
    known, at = posterior(case.healthy), smoothed(case.healthy)
    place, row = np.array([0.01, -0.02, 0.03]), len(case.condensed.time) // 2
    for axis, n in enumerate(np.eye(3)):
        expected = {
            "α": known.alpha_sd()[row, axis],
            "ω": known.omega_sd()[row, axis],
            "a": known.acceleration_sd(place, n)[row] / G0,
        }
        for kind, sd in expected.items():
            assert total(known_rows(at, at_instant(kind, row, axis, at.motion, place))) == pytest.approx(sd, rel=1e-6)


def test_rows_of_the_fit_are_what_refitting_finds() -> None:
    """A gain that is off by a hundredth of its uncertainty moves the fit as its row says, channel by channel."""
    case = budget("naap-3222").case
    at, part = smoothed(case.healthy), 0.01
    motion, time = at.motion, case.condensed.time
    base = trajectory.fit(replace(at.known.fit.data, readings=at.known.fit.ideal), at.known.fit.omega)
    for output in budget("naap-3222").outputs[:3]:
        squares = 0.0
        for k, sensor in enumerate(case.array.sensors):
            readings = base.data.readings.copy()
            readings[:, k] *= 1.0 + part * sensor.u_gain
            moved = trajectory.fit(replace(base.data, readings=readings), base.omega)
            squares += ((output.value(moved.motion, time) - output.value(base.motion, time)) / part) ** 2
        assert np.sqrt(squares) == pytest.approx(known_rows(at, output.gradient(motion, time))["gain"], rel=0.05)


# --- three ways -----------------------------------------------------------------------------------------------------

DRAWS = 400


def three(rig: Rig, reported: list[Output]) -> list[tuple[str, float, float, float, float]]:
    """Name, root sum of squares, standard deviation and bias by Monte Carlo, and uncertainty through the fit."""
    found = typical(rig)
    word, fit, blocks = found.word, found.smoothed, found.blocks
    assert word is not None
    drawn = scatter(word, np.zeros(len(rig.array)), found.rest_index, reported, DRAWS)
    out = []
    for output, spread in zip(reported, drawn, strict=True):
        rss = total(known_rows(word, output.gradient(word.motion, blocks.time)))
        by_fit = total(known_rows(fit, output.gradient(fit.motion, blocks.time)))
        out.append((output.name, rss, spread.sd, spread.bias, by_fit))
    return out


@pytest.mark.parametrize("preset", ["rgla", "3-2-1"])
def test_three_ways_agree_where_nothing_is_redundant_and_errors_are_small(preset: str) -> None:
    """Errors a hundredth of the usual, so that all is linear, noise small against how fast a peak falls off; the zero
    known, which the fit learns from the rest before. Monte Carlo: 4 of its standard errors. RSS against covariance:
    what the fit's midpoint rule and the scheme's steps make of 100 Hz, (ωh)²/24 = 0.1 %, and noise, which the two share
    out differently between samples: 2 %. The α of rates, of which noise makes a hundred times as much, is left to the
    test of its smoother."""
    rig = scaled(rig_of(preset), 0.01)
    rig = replace(rig, array=SensorArray(tuple(replace(s, u_zero=0.0) for s in rig.array.sensors)))
    reported = [o for o in outputs([("", ORIGIN)]) if preset != "rgla" or o.name != "peak α"]
    for name, rss, sd, bias, by_fit in three(rig, reported):
        assert by_fit == pytest.approx(rss, rel=0.02), name
        assert sd == pytest.approx(rss, rel=4.0 / np.sqrt(2.0 * DRAWS)), name
        assert abs(bias) < 4.0 * sd / np.sqrt(DRAWS), name


def test_the_fit_knows_a_redundant_array_better_than_its_channels_at_their_word() -> None:
    for name, rss, sd, _, by_fit in three(scaled(rig_of("naap-3222"), 0.1), outputs([("", ORIGIN)])):
        assert by_fit < rss, name
        assert sd == pytest.approx(rss, rel=4.0 / np.sqrt(2.0 * DRAWS)), name


def test_where_root_sum_of_squares_fails_the_budget_says_so() -> None:
    """At rest BrIC and |ω| are lengths of errors: their derivative is that of one direction, their mean is not 0."""
    found = typical(rig_of("naap-3222"), "rest")
    bent = {line.name for line in found.lines if not line.linear}
    assert {"peak ω", "BrIC"} <= bent
    by_name = {line.name: line for line in found.lines}
    line = by_name["peak ω"]
    assert line.scatter is not None
    assert line.scatter.bias > line.scatter.sd


# --- what would help --------------------------------------------------------------------------------------------------


def with_only(**stated: float) -> Rig:
    rig = rig_of("naap-3222")
    return replace(rig, array=certain(rig.array, **stated))


def test_with_noise_alone_half_of_it_halves_everything_and_arms_halve_alpha() -> None:
    """cov α = σ²(Σhhᵀ)⁻¹ ~ σ²/r² (METHODS 4); a single point's acceleration is told by the centre. The error of the
    step, 1/400 of it, stays."""
    found = typical(with_only())
    changes = {change.name: change for change in found.changes}
    assert changes["half the noise"].ratios == pytest.approx([0.5] * len(found.outputs), rel=1e-3)
    assert changes["arms twice as long"].ratios[0] == pytest.approx(0.5, rel=0.05)
    assert changes["three rate sensors added"].ratios[1] < 0.8
    assert not any("known twice as well" in name for name in changes)


@pytest.mark.parametrize("source", sorted(SOURCES))
def test_better_knowledge_never_hurts(source: str) -> None:
    changes = {c.name: c for c in budget("naap-3222").changes}
    assert max(changes[f"{source} known twice as well"].ratios) <= 1.0 + 1e-9


def test_changes_are_ranked() -> None:
    means = [change.mean for change in budget("naap-3222").changes]
    assert means == sorted(means)
    assert not any("rate sensors" in change.name for change in budget("naap-gyro").changes)
    assert not any("arms" in change.name for change in budget("rgla").changes)


# --- what the layout can prove ------------------------------------------------------------------------------------


@pytest.mark.parametrize("preset", sorted(TABLE))
def test_map_of_ambiguity_is_the_table(preset: str) -> None:
    """METHODS 3, row by row."""
    for motion, groups in ambiguity(rig_of(preset).array).items():
        column = motion.removeprefix("planar ")
        assert set(groups.hidden) == set(HIDDEN.get((preset, column), "").split()), motion
        assert {"-".join(sorted(pair)) for pair in groups.pairs} == set(TABLE[preset][column].split()), motion


def test_map_of_ambiguity_does_not_depend_on_the_origin() -> None:
    array = rig_of("naap-3222").array
    moved = SensorArray(tuple(replace(s, position=s.position + np.array([0.1, -0.2, 0.3])) for s in array.sensors))
    assert ambiguity(moved) == ambiguity(array)


# --- over time ------------------------------------------------------------------------------------------------------


def test_over_time_is_the_budget_of_the_instant() -> None:
    """Three components of α at an instant, each by the same function as the lines."""
    found = budget("naap-3222")
    over, way = found.over_time, found.way
    place, row = len(over.time) // 2, int(np.searchsorted(found.blocks.time, over.time[len(over.time) // 2]))
    known = [rows(way, at_instant("α", row, i, way.motion, ORIGIN), found.beyond) for i in range(3)]
    for source in ROWS:
        assert over.curves["α"][source][place] == pytest.approx(np.linalg.norm([k[source] for k in known]), rel=1e-12)
    assert np.isfinite(list(over.curves["α"].values())).all()
    assert (np.diff(over.time) > 0).all()


# --- the command --------------------------------------------------------------------------------------------------


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        cli.main(arguments)
    shown = capsys.readouterr()
    return int(ended.value.code or 0), shown.out, shown.err


def test_command_on_a_rig_and_on_a_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("rig.toml").write_text(preset_text("naap-3222"), encoding="utf-8")
    code, out, _ = run(capsys, "budget", "rig.toml", "--html", "budget.html")
    assert code == 0
    for wanted in ("Channels taken at their word", "whole-record fit", "would help most", "a1y = a2x", "HIC15"):
        assert wanted in out
    page = Path("budget.html").read_text(encoding="utf-8")
    assert page.count('<svg class="chart"') == 3
    assert not re.search(r"""(?:src|href|url\(|@import)[="'\s]*http""", page)
    assert run(capsys, "simulate", "rig.toml", "--motion", "drop", "--output", "drop.csv")[0] == 0
    code, out, _ = run(capsys, "budget", "rig.toml", "--recording", "drop.csv")
    assert code == 0
    assert "budget of drop.csv" in out
    assert "CFC1000" in out


def test_command_never_writes_over_its_rig(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(preset_text("naap-3222"), encoding="utf-8")
    code, _, error = run(capsys, "budget", str(rig), "--html", str(rig))
    assert code == 2
    assert "never written to" in error
    assert rig.read_text(encoding="utf-8") == preset_text("naap-3222")


def test_command_says_what_an_array_lacks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Three accelerometers tell no rotation."""
    sensors = "".join(
        f'[[sensor]]\nchannel = "a{x}"\nkind = "accelerometer"\nposition = [0.0, 0.0, 0.0]\naxis = {axis}\n'
        for x, axis in zip("xyz", np.eye(3).tolist(), strict=True)
    )
    rig = tmp_path / "rig.toml"
    rig.write_text(f'[rig]\nname = "one triax"\n{sensors}', encoding="utf-8")
    code, _, error = run(capsys, "budget", str(rig))
    assert code == 3
    assert "rank" in error


def test_exact_motion_has_the_values_that_the_simulation_had() -> None:
    """What is budgeted is what was done: outputs of the true motion against those of a recording with noise, in the
    zeros as well, which is 0.04 g there and so 0.6 rad/s after 0.2 s."""
    done = simulate(rig_of("naap-3222"), "general", imperfect=False, noise=False)
    truth = Motion(done.truth.omega, done.truth.alpha, done.truth.a0, "truth")
    at_point = rigid_body.acceleration_at(ORIGIN, truth.a0, truth.alpha, truth.omega)
    by_name = {o.name: o.value(truth, done.truth.time) for o in outputs([("", ORIGIN)])}
    assert by_name["peak a"] == pytest.approx(np.linalg.norm(at_point, axis=1).max() / G0, rel=1e-12)
    found = {line.name: line.value for line in budget("naap-3222").lines}
    assert found["peak ω"] == pytest.approx(by_name["peak ω"], abs=3 * 0.6)
    assert found["peak α"] == pytest.approx(by_name["peak α"], rel=0.05)
