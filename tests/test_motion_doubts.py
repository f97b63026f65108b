"""What `nineaudit motion` says of doubtful recordings and arrays: gaps, units, poor layouts, uncertainty by method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from nineaudit import cli
from nineaudit.array import SensorArray
from nineaudit.case import Case
from nineaudit.errors import EstimationError
from nineaudit.finding import Verdict
from nineaudit.gaps import SHORT, gaps
from nineaudit.motion import motion_of
from nineaudit.motion_triax import check_triax
from nineaudit.physics import kinematics
from nineaudit.presets import preset_text
from nineaudit.recording import Recording
from nineaudit.rig import parse_rig
from nineaudit.simulate import simulate
from nineaudit.units import G0


def record(preset: str, seed: int = 1, motion: str = "general", **options: bool) -> Recording:
    return simulate(parse_rig(preset_text(preset)), motion, seed=seed, **options).recording


def without(recording: Recording, channel: str, first: int, count: int) -> Recording:
    """The recording with `count` samples of a channel missing."""
    readings = recording.readings.copy()
    readings[first : first + count, recording.channels.index(channel)] = np.nan
    return replace(recording, readings=readings, valid=np.isfinite(readings))


# Gaps


@pytest.mark.parametrize(
    ("preset", "method", "channel"), [("3-2-1", "six-accelerometers", "a1z"), ("naap-3222", "padgaonkar", "a2z")]
)
def test_a_long_gap_is_refused_with_its_count_and_interval(preset: str, method: str, channel: str) -> None:
    """299 samples at 10 kHz from 0.075 s: 30 ms, in which a head turns by a quarter."""
    torn = without(record(preset), channel, 1000, 299)
    with pytest.raises(EstimationError, match=rf"{channel}: 299 of 2251 samples missing, 0\.0749 to 0\.1049 s.*1 ms"):
        motion_of(Case(torn), method, count=0)


def test_a_short_gap_is_bridged_and_said() -> None:
    torn = without(record("naap-3222"), "a2z", 1000, 9)
    notes = motion_of(Case(torn), "padgaonkar", count=0).notes
    assert any("channel a2z: 9 of 2251 samples missing" in n and "bridged by a straight line" in n for n in notes)
    assert not any("missing" in n for n in motion_of(Case(record("naap-3222")), "padgaonkar", count=0).notes)


def test_a_torn_channel_that_the_method_can_do_without_is_left_out() -> None:
    """Twelve accelerometers less one still have rank 6; the motion is that of the eleven, not of a bridged twelfth."""
    whole = simulate(parse_rig(preset_text("triax-4")), "general", seed=2, imperfect=False, noise=False)
    torn = without(whole.recording, "a1y", 900, 400)
    got = motion_of(Case(torn), "ninacc", count=0)
    assert np.abs(got.omega - whole.truth.omega).max() < 2e-3 * np.abs(whole.truth.omega).max()
    assert any("a1y: 400 of 2251" in n and "left out" in n for n in got.notes)


def test_to_the_fit_missing_samples_are_absent() -> None:
    got = motion_of(Case(without(record("naap-gyro"), "a1y", 900, 400)), count=0)
    assert any("a1y: 400 of 2251" in n and "absent to the fit" in n for n in got.notes)


def test_gaps_are_counted_by_stretch_and_rates_do_not_matter_to_accelerometers() -> None:
    torn = without(without(record("naap-gyro"), "gx", 10, 5), "gx", 100, 50)
    (found,) = gaps(torn)
    assert (found.count, found.stretches) == (55, 2)
    assert found.longest == pytest.approx(51e-4)
    assert found.longest > SHORT
    assert not any("gx" in n for n in motion_of(Case(torn), "padgaonkar", count=0).notes)


# Units


@pytest.mark.parametrize(
    ("factor", "kind", "said"),
    [
        (G0, "accelerometer", "all accelerations are in m/s^2, it seems, not in g_0"),
        (180.0 / np.pi, "gyroscope", "all rates are in deg/s, it seems, not in rad/s"),
    ],
)
def test_a_wrong_unit_of_all_channels_is_named_before_the_numbers(factor: float, kind: str, said: str) -> None:
    one = record("naap-gyro")
    wrong = [s.kind == kind for s in one.rig.array.sensors]
    got = motion_of(Case(replace(one, readings=np.where(wrong, factor, 1.0) * one.readings)), count=0)
    assert got.wrong_unit
    assert said in got.warnings[0]
    right = motion_of(Case(one), count=0)
    assert not right.wrong_unit
    assert right.warnings == ()


def test_units_of_both_kinds_are_named_at_once_and_a_second_conversion_by_its_factor() -> None:
    one = record("naap-gyro")
    held = one.rig.array.is_accelerometer
    both = motion_of(Case(replace(one, readings=np.where(held, G0, 180.0 / np.pi) * one.readings)), count=0)
    assert both.wrong_unit
    assert "all accelerations are in m/s^2, it seems, not in g_0; all rates are in deg/s" in both.warnings[0]
    twice = motion_of(Case(replace(one, readings=np.where(held, 1.0 / G0, 1.0) * one.readings)), count=0)
    assert twice.wrong_unit
    assert "all accelerometers fit when multiplied by 9.807" in twice.warnings[0]


# Layouts


def test_nearly_collinear_triaxes_are_named_by_condition_number_with_what_to_change() -> None:
    """Three triaxes on a line of 100 mm but for 0.1 mm: turning about it is seen through that alone."""
    rig = parse_rig(preset_text("triax-3"))
    places = {"1": (0.0, 0.0, 0.0), "2": (0.05, 1e-4, 0.0), "3": (0.1, 0.0, 0.0)}
    sensors = tuple(replace(s, position=np.array(places[s.channel[1]])) for s in rig.array.sensors)
    got = motion_of(Case(simulate(replace(rig, array=SensorArray(sensors)), "general", seed=1).recording), count=0)
    (said,) = [w for w in got.warnings if "condition number" in w]
    assert "nearly on one line" in said
    assert "move one of them off the line" in said


# Uncertainties of every method


@pytest.mark.parametrize(
    ("preset", "method"), [("naap-gyro", "padgaonkar"), ("triax-4", "ninacc"), ("naap-gyro", "rates"), ("rgla", "map")]
)
def test_errors_are_as_large_as_the_uncertainty_of_the_method_says(preset: str, method: str) -> None:
    """Error over u, rms over the event, three axes and two records: near 1, few independent errors of ω there are."""
    ratios: dict[str, list[float]] = {"omega": [], "alpha": [], "origin a": []}
    for seed in (1, 2):
        rig = replace(parse_rig(preset_text(preset)), points=())
        made = simulate(rig, "general", seed=seed)
        got = motion_of(Case(made.recording), method, count=24)
        event = made.truth.time > 0.02
        pairs = ((got.omega, made.truth.omega), (got.alpha, made.truth.alpha), (got.a0, made.truth.a0))
        for name, (one, true) in zip(ratios, pairs, strict=True):
            ratios[name].append(float((((one - true)[event] / got.u[name][event]) ** 2).mean()))
    for name, squares in ratios.items():
        assert 0.4 < np.sqrt(np.mean(squares)) < 2.2, name


def test_a_healthy_redundant_triax_is_not_failed_by_ninacc() -> None:
    """Its deviations, fed back, are several times the paper's; the instrument's uncertainty is larger still."""
    rig = replace(parse_rig(preset_text("triax-4")), points=())
    found = check_triax(Case(simulate(rig, "general", seed=1).recording), "a0", "ninacc")
    assert all(one.U is not None and abs(one.deviation) > one.tolerance for one in found.judged)
    assert [one.verdict for one in found.judged] == [Verdict.INCONCLUSIVE, Verdict.INCONCLUSIVE]


def test_the_noise_of_a_drawn_instrument_has_the_colour_of_its_class() -> None:
    """CFC1000 at 10 kHz leaves next to nothing beyond 3 kHz, and all of it has the deviation that is asked for."""
    from nineaudit.instrument_draws import block_noise, noise

    case = Case(record("naap-gyro"))
    drawn = noise(case, np.random.default_rng(3))
    assert drawn.std() == pytest.approx(1.0, rel=0.02)
    power = np.abs(np.fft.rfft(drawn, axis=0)) ** 2
    beyond = np.fft.rfftfreq(len(drawn), 1e-4) > 3000.0
    assert power[beyond].sum() < 0.01 * power.sum()
    blocks = block_noise(case, np.random.default_rng(4)) / case.condensed.sigma
    assert blocks.std() == pytest.approx(1.0, rel=0.05)


def test_a_part_of_a_recording_is_a_recording() -> None:
    one = record("naap-gyro")
    some = one.only([11, 0, 3])
    assert some.channels == ("gz", "a0x", "a1y")
    np.testing.assert_array_equal(some.column("a1y"), one.column("a1y"))
    assert [t.channel for t in some.native] == list(some.channels)
    assert kinematics.resultant(some.readings).shape == one.time.shape


# The command

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as ended:
            cli.main(arguments)
        shown = capsys.readouterr()
        return int(ended.value.code or 0), shown.out, shown.err

    return call


def test_a_wrong_unit_is_the_first_thing_said_and_exit_code_1(run: Run) -> None:
    Path("rig.toml").write_text(preset_text("naap-3222"), encoding="utf-8")
    wrong = preset_text("naap-3222").replace('acceleration = "g_0" ', 'acceleration = "m/s^2" ')
    Path("wrong.toml").write_text(wrong, encoding="utf-8")
    assert run("simulate", "rig.toml", "--motion", "general", "--output", "T1.csv")[0] == 0
    code, out, _ = run("motion", "T1.csv", "--rig", "wrong.toml", "--output", "m.csv")
    assert code == 1
    assert out.splitlines()[1].startswith("  WARNING: all accelerations are in g_0, it seems, not in m/s^2")
    assert "u_alpha_x_rad_s2" in Path("m.csv").read_text(encoding="utf-8").splitlines()[0]


def test_an_unknown_suffix_is_answered_with_one_list(run: Run) -> None:
    Path("rig.toml").write_text(preset_text("naap-3222"), encoding="utf-8")
    assert run("simulate", "rig.toml", "--motion", "general", "--output", "T1.csv")[0] == 0
    code, _, err = run("motion", "T1.csv", "--rig", "rig.toml", "--output", "x.xyz")
    assert code == 2
    assert err.count(".parquet") == 1
    assert "did you mean '.parquet'?" in run("motion", "T1.csv", "--rig", "rig.toml", "--output", "m.parquett")[2]
