"""Budgets beyond calibration and noise, with ω fed back, and of rates alone: predicted against observed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from nineaudit.array import FloatArray, SensorArray
from nineaudit.budgets import budget_of, monte_carlo, text, typical
from nineaudit.case import Case
from nineaudit.checks.budget import alpha_uncertainty
from nineaudit.estimate import budget, fed_back, mismatch
from nineaudit.estimate.at_their_word import at_their_word, motion_at_their_word, perfect
from nineaudit.estimate.budget import DRAWN, ROWS, total
from nineaudit.estimate.condense import block_means
from nineaudit.estimate.functional import smoothed
from nineaudit.estimate.hypotheses import healthy_fit
from nineaudit.estimate.outputs import outputs
from nineaudit.finding import Measure, NotApplicable
from nineaudit.physics import filters, rigid_body
from nineaudit.recording import Recording
from nineaudit.rig import Rig, parse_rig, preset_text
from nineaudit.simulate import simulate
from nineaudit.units import G0

ORIGIN = np.zeros(3)


@cache
def rig_of(preset: str) -> Rig:
    return parse_rig(preset_text(preset))


def recorded(preset: str, motion: str = "general", seed: int = 0, fault: tuple[str, ...] = ()) -> Recording:
    return simulate(rig_of(preset), motion, seed=seed, faults=fault).recording


def with_readings(recording: Recording, readings: FloatArray) -> Recording:
    native = tuple(
        replace(t, values=readings[:, recording.rig.array.index(t.channel)].copy()) for t in recording.native
    )
    return replace(recording, readings=readings, native=native)


# --- quantisation ---------------------------------------------------------------------------------------------------


def test_resolution_of_the_rig_is_read_in_its_units() -> None:
    added = "zero_rate = 0.01\nresolution = 0.25\nresolution_rate = 0.02\n"
    rig = parse_rig(preset_text("naap-gyro").replace("zero_rate = 0.01", added, 1))
    assert rig.array["a1y"].resolution == pytest.approx(0.25 * G0)
    assert rig.array["gx"].resolution == pytest.approx(0.02)
    assert rig_of("naap-3222").array["a1y"].resolution is None


def test_step_is_that_of_the_rig_or_else_of_the_recording() -> None:
    step = 0.5 * G0
    record = recorded("naap-3222")
    rounded = with_readings(record, step * np.round(record.readings / step))
    assert budget.steps(rounded) == pytest.approx(np.full(9, step), rel=1e-6)
    stated = tuple(replace(s, resolution=0.1 * G0) for s in record.rig.array.sensors)
    own = replace(rounded, rig=replace(record.rig, array=SensorArray(stated)))
    assert budget.steps(own) == pytest.approx(np.full(9, 0.1 * G0), rel=1e-12)


def test_quantisation_row_is_what_rounding_does() -> None:
    """Outputs of rounded readings less those of the same readings unrounded, over 40 phases of the rounding (readings
    of 1.5 noise deviations a step): the standard deviation is known to 1/√80, 4 of those. HIC and peaks are smooth in
    changes so small."""
    found = typical(rig_of("naap-3222"))
    rounding, step = np.random.default_rng(7), 0.2 * G0
    record = found.case.recording
    noisy = found.case.readings
    stated = tuple(replace(s, resolution=step) for s in record.rig.array.sensors)
    case = Case(replace(record, rig=replace(record.rig, array=SensorArray(stated))))
    blocks, rest = case.condensed, found.rest_index
    word = at_their_word(case.array, blocks.time, blocks.readings, blocks.sigma, rest)
    errors = case.beyond(word.motion)
    reported = outputs([("", ORIGIN)])
    base = np.array([o.value(word.motion, blocks.time) for o in reported])
    off = []
    for _ in range(40):
        phase = rounding.uniform(0.0, step, 9)
        rounded = step * np.round((noisy - phase) / step) + phase
        change = block_means(rounded - noisy, blocks.length)
        motion = motion_at_their_word(case.array, blocks.time, blocks.readings + change, blocks.sigma, rest)
        off.append([o.value(motion, blocks.time) for o in reported] - base)
    for output, seen in zip(reported, np.std(off, axis=0, ddof=1), strict=True):
        stated_u = budget.rows(word, output.gradient(word.motion, blocks.time), errors)["quantisation"]
        assert seen == pytest.approx(stated_u, rel=4.0 / np.sqrt(80.0)), output.name


def test_rounding_that_the_measured_noise_holds_is_not_counted_twice() -> None:
    """Noise not stated but measured on rounded readings: noise and quantisation together are what was measured."""
    record = recorded("naap-3222")
    silent = SensorArray(tuple(replace(s, noise=None) for s in record.rig.array.sensors))
    step = 0.5 * G0
    rounded = with_readings(
        replace(record, rig=replace(record.rig, array=silent)), step * np.round(record.readings / step)
    )
    found = budget_of(Case(rounded), "rounded")
    word = found.word
    assert word is not None
    gradient = found.outputs[0].gradient(word.motion, found.blocks.time)
    rows = budget.rows(word, gradient, found.beyond)
    noise = np.linalg.norm(word.by_channel(word.coefficients(gradient), gradient)["noise"])
    assert rows["quantisation"] > 0.1 * noise
    assert np.hypot(rows["noise"], rows["quantisation"]) == pytest.approx(noise, rel=1e-9)


# --- filters --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(6))
def test_channels_behind_one_class_are_not_taken_for_others(seed: int) -> None:
    case = Case(recorded("naap-3222", "sled", seed))
    assert not budget_of(case, "sled").beyond.mismatch.any()


@pytest.mark.parametrize("class_", [600, 180])
def test_mismatch_is_seen_and_its_row_is_what_it_does(class_: int) -> None:
    """a2x behind a lower class, no noise in what is compared: the row against what the lower class does to each output,
    by the difference of the two motions; a twentieth for its being linear and taken from the disturbed motion."""
    array, rate = rig_of("naap-3222").array, 10_000.0
    done = simulate(rig_of("naap-3222"), "general", imperfect=False)
    lower = done.ideal.copy()
    lower[:, array.index("a2x")] = filters.cfc(done.ideal[:, array.index("a2x")], rate, class_)
    noise = done.recording.readings - done.ideal
    noise[:, array.index("a2x")] = filters.cfc(noise[:, array.index("a2x")], rate, class_)
    case = Case(with_readings(done.recording, lower + noise))
    found = budget_of(case, "mismatch")
    assert dict(zip(array.channels, found.beyond.classes, strict=True))["a2x"] == class_
    blocks, rest, word = found.blocks, found.rest_index, found.word
    assert word is not None
    motions = [
        motion_at_their_word(array, blocks.time, block_means(y, blocks.length), blocks.sigma, rest)
        for y in (lower, done.ideal)
    ]
    for output in outputs([("", ORIGIN)])[1:]:
        seen = abs(output.value(motions[0], blocks.time) - output.value(motions[1], blocks.time))
        row = budget.rows(word, output.gradient(word.motion, blocks.time), found.beyond)
        assert row["filters"] == pytest.approx(seen, rel=0.1, abs=0.1 * total(row)), output.name
    assert "a2x" in " ".join(text.notes(found))


def test_no_class_is_claimed_where_the_noise_says_nothing() -> None:
    assert mismatch.classes(np.zeros((200, 3)), 10_000.0, 600.0, np.zeros(3)) == (600.0,) * 3


# --- the finite step ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("preset", ["naap-3222", "triax-3", "rgla"])
def test_step_of_a_scheme_is_its_error_of_exact_readings(preset: str) -> None:
    """ω (α where it is a slope) of exact block means less the truth at their middles, at blocks of 1 ms so that there
    is something to see; the next order of Richardson's estimate is (ωh)² ~ 0.1 of it, and the ends are not smooth."""
    done = simulate(rig_of(preset), "general", imperfect=False, noise=False)
    length, array = 10, rig_of(preset).array
    time, y = block_means(done.truth.time, length), block_means(done.ideal, length)
    sigma, rest = np.full(len(array), 1e-6), 1
    word = at_their_word(array, time, y, sigma, rest)
    slope = word.slope is not None
    found, truth = (word.motion.alpha, done.truth.alpha) if slope else (word.motion.omega, done.truth.omega)
    middle = CubicSpline(done.truth.time, truth)(time)
    inner = slice(5, -5)
    seen, said = (found - middle)[inner], word.step[inner]
    if not slope:
        seen, said = seen - seen[0], said - said[0]
    assert np.sqrt(np.mean((said - seen) ** 2)) < 0.1 * np.sqrt(np.mean(seen**2))


def test_step_of_the_fit_is_its_error_of_exact_readings() -> None:
    """Peak ω and HIC of the fit of exact blocks of 1 ms against those of the truth in them."""
    rig = rig_of("naap-gyro")
    done = simulate(rig, "general", imperfect=False, noise=False)
    case = Case(simulate(rig, "general", imperfect=False).recording)
    data = case.fit_data
    exact = healthy_fit(replace(data, readings=block_means(done.ideal, case.condensed.length)))
    way, time = smoothed(exact), data.time
    peak = outputs([("", ORIGIN)])[1]
    row = int(np.linalg.norm(exact.motion.omega, axis=1).argmax())
    truth = CubicSpline(done.truth.time, done.truth.omega)(time)
    direction = exact.motion.omega[row] / np.linalg.norm(exact.motion.omega[row])
    seen = abs(float(direction @ (exact.motion.omega[row] - truth[row])))
    assert way.step_error(peak.gradient(exact.motion, time)) == pytest.approx(seen, rel=0.3, abs=2e-4)


# --- ω fed back -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("preset", ["triax-3", "coplanar-3", "3-2-1"])
def test_monte_carlo_agrees_with_rss_where_omega_is_fed_back(preset: str) -> None:
    """Errors a twentieth of the usual: linear, as growth of e^(0.5 to 1) a radian multiplies both alike. 4 standard
    errors of 200 draws, and peaks may ride on noise."""
    names = ("u_gain", "u_zero", "u_alignment", "u_position", "u_timing", "noise")
    rig = rig_of(preset)
    small = tuple(replace(s, **{n: 0.05 * getattr(s, n) for n in names}) for s in rig.array.sensors)
    found = typical(replace(rig, array=SensorArray(small)))
    for line in found.lines:
        assert line.at_their_word is not None
        assert line.scatter is not None
        rss = total({source: line.at_their_word[source] for source in DRAWN})
        assert line.scatter.sd == pytest.approx(rss, rel=4.0 / np.sqrt(2.0 * monte_carlo.DRAWS)), line.name


def test_error_fed_back_grows_as_published() -> None:
    """3-2-1 turning about X: an error of ω grows by e^(π/2) = 4.81 a quarter turn [Becker75; METHODS 1.3]."""
    array, turns = rig_of("3-2-1").array, np.pi / 2
    time = np.linspace(0.0, 0.1, 2001)
    omega = np.zeros((2001, 3))
    omega[:, 0] = turns / 0.1
    held = array.is_accelerometer
    felt = rigid_body.centripetal_jacobian(array.positions[held], array.axes[held], omega)
    back = np.einsum("ia,nac->nic", fed_back.alpha_rows(array), felt)
    rule = fed_back.Carried(back, time, 0)
    end = np.zeros((2001, 3, 3))
    by_start = []
    for i in range(3):
        end[-1, i, i] = 1.0
        by_start.append(rule(np.ascontiguousarray(end[:, i]))[0] / (0.5 * (time[1] - time[0])))
    growth = np.linalg.norm(np.array(by_start), 2)
    assert growth == pytest.approx(np.exp(turns), rel=0.02)


# --- rates alone ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("motion", ["general", "sled", "drop"])
def test_smoother_of_rates_states_its_error(motion: str) -> None:
    """α of the smoother less the truth over the stated u, noise and smoothing together, over eight records: near 1 (the
    prior is one for a record, rest and event alike, so a third is allowed), and a fifth of what differences have."""
    ratios, better = [], []
    for seed in range(8):
        done = simulate(rig_of("rgla"), motion, seed=seed, imperfect=False)
        case = Case(done.recording)
        blocks = case.condensed
        assert case.rest is not None
        word = at_their_word(case.array, blocks.time, blocks.readings, blocks.sigma, case.rest.start // blocks.length)
        smooth = word.smooth(word.smoother)
        truth = block_means(done.truth.alpha, blocks.length)
        rows = np.arange(40, len(truth) - 40, 40)
        errors = case.beyond(smooth.motion)
        for row in rows:
            gradient = outputs([])[0].gradient(
                replace(smooth.motion, alpha=_only(smooth.motion.alpha, row)), blocks.time
            )
            known = budget.rows(smooth, gradient, errors)
            u = np.hypot(known["noise"], known["integration"])
            ratios.append(float((gradient.alpha * (smooth.motion.alpha - truth)).sum()) / u)
        better.append(np.std(smooth.motion.alpha - truth) / np.std(word.motion.alpha - truth))
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=1 / 3)
    assert np.mean(better) < 0.2


def _only(alpha: FloatArray, row: int) -> FloatArray:
    out = np.zeros_like(alpha)
    out[row] = alpha[row]
    return out


# --- one definition -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("preset", ["naap-3222", "naap-gyro", "triax-3", "3-2-1", "rgla"])
def test_rule_ub401_judges_what_the_budget_says(preset: str) -> None:
    case = Case(recorded(preset, "sled"))
    measure = alpha_uncertainty(case, part_of_peak=0.5)
    assert isinstance(measure, Measure)
    found = budget_of(case, preset)
    line = found.lines[0]
    rows = line.fit if found.fed_back else line.at_their_word
    assert rows is not None
    assert set(rows) == set(ROWS)
    assert measure.value == pytest.approx(2.0 * total(rows) / line.value, rel=1e-9)


def test_rule_ub401_counts_the_error_along_the_peak() -> None:
    """The measurand is the length of α at its peak: errors across it do not count (GUM 5.1.3), those along it do."""
    case = Case(recorded("naap-3222", "planar"))
    known = case.alpha_budget
    fit_of = case.alpha_budget.rows["noise"]
    reach = np.linalg.norm(at_their_word_rows(case), axis=1)[1] * case.condensed.sigma[0]
    assert fit_of == pytest.approx(reach, rel=0.05)  # motion about y: αy alone, two sums of channels over the arms
    assert known.total == pytest.approx(np.sqrt(sum(v**2 for v in known.rows.values())), rel=1e-12)


def at_their_word_rows(case: Case) -> FloatArray:
    blocks = case.condensed
    return at_their_word(case.array, blocks.time, blocks.readings, blocks.sigma, 0).alpha_rows


def test_rule_ub401_does_not_apply_where_nothing_gives_alpha() -> None:
    rig = rig_of("rgla")
    rig = replace(rig, array=rig.array.select(range(3)))
    assert isinstance(alpha_uncertainty(Case(simulate(rig, "sled").recording), part_of_peak=0.5), NotApplicable)


# --- words ----------------------------------------------------------------------------------------------------------


def test_pairs_are_shown_as_groups_of_which_every_two_are_a_pair() -> None:
    pairs = [("a", "b"), ("a", "c"), ("b", "c"), ("c", "d")]
    assert text.merged(pairs) == [("a", "b", "c"), ("c", "d")]


@pytest.mark.parametrize("preset", ["triax-3", "coplanar-3", "3-2-1", "compact-cube"])
def test_every_preset_has_both_tables(preset: str) -> None:
    shown = "\n".join(text.lines(typical(rig_of(preset))))
    assert "Channels taken at their word" in shown
    assert "Through the" in shown
    assert "nan" not in shown


def test_rates_alone_have_a_budget_of_rotation_only() -> None:
    rig = rig_of("rgla")
    rig = replace(rig, array=rig.array.select(range(3, 6)))
    found = typical(rig)
    assert [line.name for line in found.lines] == ["peak α", "peak ω", "BrIC"]
    assert set(found.over_time.curves) == {"α", "ω"}
    assert "accelerometers on three axes" in "\n".join(text.notes(found))


def test_exact_readings_of_the_motion_are_those_of_the_simulation() -> None:
    done = simulate(rig_of("naap-3222"), "general", imperfect=False, noise=False)
    found = typical(rig_of("naap-3222"))
    y = perfect(found.array, found.way.motion)
    seen = block_means(done.ideal, found.blocks.length)
    assert np.sqrt(np.mean((y - seen) ** 2)) < 0.02 * np.sqrt(np.mean(seen**2))
