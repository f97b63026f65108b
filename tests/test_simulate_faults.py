"""Every fault word: what it does to its channel, that it leaves the others alone, and how it is written."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from nineaudit.array import FloatArray
from nineaudit.errors import ConfigurationError
from nineaudit.physics.filters import response
from nineaudit.rig import Rig, parse_rig, preset_text
from nineaudit.simulate import FAULTS, Fault, Simulation, parse_fault, simulate
from nineaudit.units import G0

WORDS = [
    "gain", "zero_shift", "drift", "polarity", "swap", "unit", "delay", "clipping", "dropout", "stuck",
    "spikes", "noise", "wrong_filter", "ac_coupled", "cross_axis", "position", "missing", "unknown",
]  # fmt: skip
K = 3  # a1y in the order of the 3-2-2-2


@cache
def rig(preset: str = "naap-3222") -> Rig:
    return parse_rig(preset_text(preset))


@cache
def faulty(*faults: str, motion: str = "general", preset: str = "naap-3222", **options: bool) -> Simulation:
    return simulate(rig(preset), motion, faults=faults, seed=3, **options)


def before_after(fault: str, **options: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time, healthy and faulty a1y."""
    made = faulty(fault, **options)
    return made.recording.time, made.healthy[:, K], made.recording.column("a1y")


def written(kind: str) -> str:
    return f"a1y:{kind}" + ("=a2x" if kind == "swap" else "")


def test_the_fault_words_are_those_of_the_interface() -> None:
    assert sorted(FAULTS) == sorted(WORDS)
    for kind in FAULTS.values():
        assert kind.help
        assert kind.unit


@pytest.mark.parametrize("kind", WORDS)
def test_a_fault_changes_its_channel_only(kind: str) -> None:
    """Against the same seed without the fault: the other columns are the same bit by bit."""
    made, plain = faulty(written(kind)), faulty()
    hit = {"a1y", "a2x"} if kind == "swap" else {"a1y"}
    for channel in rig().array.channels:
        same = np.array_equal(made.recording.column(channel), plain.recording.column(channel))
        assert same == (channel not in hit), channel
    assert np.array_equal(made.healthy, plain.recording.readings)
    assert any(str(made.faults[0]) in note for note in made.recording.source.notes)


@pytest.mark.parametrize("kind", WORDS)
def test_a_fault_is_reproducible_and_does_not_touch_its_input(kind: str) -> None:
    first, again = (simulate(rig(), "general", faults=[written(kind)], seed=3) for _ in range(2))
    assert first.recording.source.sha256 == again.recording.source.sha256
    assert np.array_equal(first.healthy, faulty().healthy)


@pytest.mark.parametrize("kind", sorted(set(WORDS) - {"position"}))
def test_faults_of_rate_sensors(kind: str) -> None:
    text = "gx:" + kind + ("=gy" if kind == "swap" else "")
    made, plain = faulty(text, preset="naap-gyro"), faulty(preset="naap-gyro")
    assert not np.array_equal(made.recording.column("gx"), plain.recording.column("gx"))
    assert np.array_equal(made.recording.column("a1y"), plain.recording.column("a1y"))


# --- what each does ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "ratio"), [("gain=10%", 1.1), ("gain=-0.05", 0.95), ("unit", 9.80665), ("polarity", -1)]
)
def test_scale_faults(text: str, ratio: float) -> None:
    _, healthy, column = before_after(f"a1y:{text}")
    assert column == pytest.approx(ratio * healthy, rel=1e-12)


@pytest.mark.parametrize(("amount", "part"), [("5%", None), ("2", 2 * G0), ("3 m/s^2", 3.0), ("0.5g_0", 0.5 * G0)])
def test_zero_shift_is_a_step_at_the_event(amount: str, part: float | None) -> None:
    time, healthy, column = before_after(f"a1y:zero_shift={amount}")
    size = 0.05 * np.abs(healthy).max() if part is None else part
    assert column - healthy == pytest.approx(np.where(time < 0, 0.0, size), abs=1e-9)


def test_zero_shift_at_a_given_time() -> None:
    time, healthy, column = before_after("a1y:zero_shift=2@30ms")
    assert time[np.argmax(column != healthy)] == pytest.approx(0.030)


def test_drift_is_a_straight_line() -> None:
    time, healthy, column = before_after("a1y:drift=2")
    assert column - healthy == pytest.approx(2 * G0 * (time - time[0]) / (time[-1] - time[0]), abs=1e-9)


def test_swap_exchanges_two_channels() -> None:
    made = faulty("a1y:swap=a2x")
    assert np.array_equal(made.recording.column("a1y"), made.healthy[:, 5])
    assert np.array_equal(made.recording.column("a2x"), made.healthy[:, K])


@pytest.mark.parametrize("delay", [1e-3, 0.37e-3, -0.5e-3])
def test_delay_is_found_by_cross_correlation(delay: float) -> None:
    """The lag of the largest correlation, refined by a parabola, is the delay to a twentieth of a sample."""
    time, healthy, column = before_after(f"a1y:delay={delay * 1e3}ms", noise=False)
    lags = np.arange(-30, 31)
    inside = slice(40, len(time) - 40)
    fit = [-np.sum((column[inside] - np.roll(healthy, lag)[inside]) ** 2) for lag in lags]
    best = int(np.argmax(fit))
    low, mid, high = fit[best - 1 : best + 2]
    found = lags[best] + 0.5 * (low - high) / (low - 2 * mid + high)
    assert found * 1e-4 == pytest.approx(delay, abs=0.05e-4)


@pytest.mark.parametrize("level", [0.5, 0.8])
def test_clipping_is_flat_at_its_level_and_exact_below(level: float) -> None:
    _, healthy, column = before_after(f"a1y:clipping={level}")
    rail = level * np.abs(healthy).max()
    over = np.abs(healthy) > rail
    assert over.sum() > 10
    assert np.abs(column[over]) == pytest.approx(rail, rel=1e-12)
    assert np.array_equal(column[~over], healthy[~over])
    assert rail < rig().array["a1y"].full_scale  # type: ignore[operator]


@pytest.mark.parametrize("mode", ["zero", "hold", "invalid"])
def test_dropout_lasts_as_long_as_asked(mode: str) -> None:
    made = faulty(f"a1y:dropout=5ms,{mode}@40ms")
    time, healthy, column = made.recording.time, made.healthy[:, K], made.recording.column("a1y")
    lost = (time > 0.03995) & (time < 0.04495)
    assert lost.sum() == 50
    assert np.array_equal(column[~lost], healthy[~lost])
    reads = {"zero": 0.0, "hold": healthy[np.argmax(lost) - 1], "invalid": np.nan}[mode]
    assert np.array_equal(column[lost], np.full(50, reads), equal_nan=True)
    assert np.array_equal(made.recording.valid[:, K], ~lost if mode == "invalid" else np.ones(len(time), bool))


def test_dropout_takes_the_peak_unless_told_otherwise() -> None:
    _, healthy, column = before_after("a1y:dropout")
    assert column[np.argmax(np.abs(healthy))] == 0.0
    assert (column != healthy).sum() == pytest.approx(50, abs=1)


def test_stuck_holds_the_value_of_the_moment() -> None:
    time, healthy, column = before_after("a1y:stuck@50ms")
    held = time >= 0.05
    assert np.ptp(column[held]) == 0.0
    assert column[held][0] == healthy[held][0]
    assert np.array_equal(column[~held], healthy[~held])


def test_spikes_are_single_samples() -> None:
    time, healthy, column = before_after("a1y:spikes=50%")
    struck = np.flatnonzero(column != healthy)
    assert len(struck) == 10  # one in 20 ms of 0.2 s
    assert (time[struck] >= 0).all()
    assert np.abs(column - healthy)[struck] == pytest.approx(0.5 * np.abs(healthy).max())


def test_added_noise_has_the_stated_size() -> None:
    time, healthy, column = before_after("a1y:noise=1")
    added = column - healthy
    assert added.std() / G0 == pytest.approx(1.0, abs=5 / np.sqrt(2 * len(time)))
    assert np.corrcoef(added[1:], added[:-1])[0, 1] == pytest.approx(0.0, abs=5 / np.sqrt(len(time)))


def test_wrong_filter_has_the_response_of_its_class() -> None:
    """The spectrum ratio of the added difference: white noise at rest loses |H|² of CFC60 against none."""
    made = simulate(rig(), "rest", faults=["a1y:noise=30", "a1y:wrong_filter=CFC60"], duration_s=3.2)
    wide = simulate(rig(), "rest", faults=["a1y:noise=30"], duration_s=3.2).recording.column("a1y")
    frequency = np.fft.rfftfreq(len(wide), 1e-4)
    band = (frequency > 90) & (frequency < 110)
    power = [np.mean(np.abs(np.fft.rfft(c)[band]) ** 2) for c in (made.recording.column("a1y"), wide)]
    assert power[0] / power[1] == pytest.approx(np.mean(response(frequency[band], 60.0, 1e4) ** 2), rel=0.02)


def test_ac_coupling_forgets_a_step_with_its_time_constant() -> None:
    """A step through s/(s + 2πf) is exp(−2πf t) (bilinear to second order in the sampling interval)."""
    options = {"imperfect": False, "noise": False}
    made = simulate(rig(), "rest", faults=["a1y:zero_shift=10", "a1y:ac_coupled=5"], **options)
    time = made.recording.time
    expected = np.where(time < 0, 0.0, 10 * G0 * np.exp(-2 * np.pi * 5 * np.maximum(time, 0.0)))
    assert made.recording.column("a1y") == pytest.approx(expected, abs=0.002 * 10 * G0)


def test_cross_axis_is_a_reading_of_the_true_motion() -> None:
    """The change lies in the span of the specific forces across the axis, with the stated sensitivity."""
    _, healthy, column = before_after("a1y:cross_axis=0.03", imperfect=False)
    truth, r = faulty(imperfect=False).truth, rig().array["a1y"].position
    force = truth.a0 + np.cross(truth.alpha, r) + np.cross(truth.omega, np.cross(truth.omega, r))
    part, *_ = np.linalg.lstsq(force, column - healthy, rcond=None)
    assert force @ part == pytest.approx(column - healthy, abs=1e-8)
    assert np.linalg.norm(part[[0, 2]]) == pytest.approx(0.03, rel=1e-9)
    assert part[1] == pytest.approx(0.0, abs=1e-12)


def test_position_is_a_reading_of_the_true_motion() -> None:
    """The change is n·(α × e + ω × (ω × e)) with |e| the stated displacement."""
    _, healthy, column = before_after("a1y:position=5", imperfect=False)
    truth, axis = faulty(imperfect=False).truth, rig().array["a1y"].axis
    moved = [np.cross(truth.alpha, e) + np.cross(truth.omega, np.cross(truth.omega, e)) for e in np.eye(3)]
    columns = np.stack([m @ axis for m in moved], axis=1)
    offset, *_ = np.linalg.lstsq(columns, column - healthy, rcond=None)
    assert columns @ offset == pytest.approx(column - healthy, abs=1e-8)
    assert np.linalg.norm(offset) == pytest.approx(5e-3, rel=1e-9)


def test_missing_has_no_valid_sample() -> None:
    made = faulty("a1y:missing")
    assert np.isnan(made.recording.column("a1y")).all()
    assert made.recording.valid.all(axis=0).tolist() == [c != "a1y" for c in rig().array.channels]


def test_unknown_is_a_smooth_waveform_of_the_stated_size() -> None:
    time, healthy, column = before_after("a1y:unknown=20%")
    wave = column - healthy
    assert np.abs(wave).max() == pytest.approx(0.2 * np.abs(healthy).max())
    assert np.abs(wave[time < 0]).max() == 0.0
    assert np.abs(np.diff(wave)).max() < 0.05 * np.abs(wave).max()


def test_faults_add_up_in_the_order_given() -> None:
    made = faulty("a1y:gain=1", "a1y:clipping=0.5", "a0x:polarity")
    column, healthy = made.recording.column("a1y"), made.healthy[:, K]
    rail = np.abs(healthy).max()
    assert column == pytest.approx(np.clip(2 * healthy, -rail, rail))
    assert np.array_equal(made.recording.column("a0x"), -made.healthy[:, 0])


def test_filters_and_delays_bridge_invalid_samples() -> None:
    for later in ("delay", "wrong_filter", "ac_coupled"):
        made = faulty("a1y:dropout=5ms,invalid@40ms", f"a1y:{later}")
        assert np.isnan(made.recording.column("a1y")).sum() == 50


# --- how it is written ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("a1y:clipping=0.5", Fault("a1y", "clipping", 0.5)),
        ("a1y:clipping", Fault("a1y", "clipping")),
        ("a0x:gain=10%", Fault("a0x", "gain", 0.1)),
        ("a1y:swap=a2x", Fault("a1y", "swap", partner="a2x")),
        ("a1y:delay=0.5ms", Fault("a1y", "delay", 5e-4)),
        ("a1y:delay=0.001", Fault("a1y", "delay", 1e-3)),
        ("a1y:zero-shift=5%", Fault("a1y", "zero_shift", 0.05, unit="peak")),
        ("a1y:zero_shift=1.5", Fault("a1y", "zero_shift", 1.5)),
        ("a1y:drift=-2m/s^2", Fault("a1y", "drift", -2.0, unit="m/s^2")),
        ("a1y:dropout=5ms,hold@30 ms", Fault("a1y", "dropout", 5e-3, at=0.03, mode="hold")),
        ("a1y:dropout=invalid", Fault("a1y", "dropout", mode="invalid")),
        ("a1y:stuck@-0.01", Fault("a1y", "stuck", at=-0.01)),
        ("a1y:wrong_filter=CFC180", Fault("a1y", "wrong_filter", 180.0)),
        ("a1y:ac_coupled=2 Hz", Fault("a1y", "ac_coupled", 2.0)),
        ("a1y:position=3mm", Fault("a1y", "position", 3.0, unit="mm")),
    ],
)
def test_faults_are_read_and_written(text: str, fault: Fault) -> None:
    read = parse_fault(text)
    assert read == fault
    assert parse_fault(str(read)) == read


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a1y", "CHANNEL:FAULT"),
        ("a1y:", "CHANNEL:FAULT"),
        ("a1y:cliping=0.5", "did you mean clipping"),
        ("a1y:clipping=half", "a fraction or a percentage"),
        ("a1y:clipping=", "a fraction"),
        ("a1y:clipping=0.5,0.6", "a fraction"),
        ("a1y:delay=5 parsec", "unknown unit of time"),
        ("a1y:delay=5%", "unknown unit of time"),
        ("a1y:polarity=2", "no value"),
        ("a1y:swap", "another channel"),
        ("a1y:dropout=5ms,sideways", "zero, hold, invalid"),
        ("a1y:stuck@later", "time of a fault"),
        ("a1y:gain=5mm", "a fraction"),
    ],
)
def test_bad_texts_say_what_is_expected(text: str, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words) as error:
        parse_fault(text)
    assert error.value.exit_code == 2


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("a1yy:gain", "did you mean a1y"),
        ("a1y:swap=a2y", "did you mean"),
        ("a1y:swap=a1y", "cannot be swapped"),
        ("a1y:clipping=1.5", "more than 0 and under 1"),
        ("a1y:clipping=-0.5", "more than 0"),
        ("a1y:dropout=-5ms", "more than 0"),
        ("a1y:dropout=1us@40.05ms", "between two samples"),
        ("a1y:zero_shift=1@3", "not in the recording"),
        ("a1y:gain=1@3ms", "no beginning"),
        ("a1y:zero_shift=2rad/s", "unknown unit of acceleration"),
        ("a1y:position=2kg", "unknown unit of length"),
        ("a1y:wrong_filter=CFC100", "no such channel frequency class"),
        (Fault("a1y", "gain", float("nan")), "finite"),
        (Fault("a1y", "swap"), "other channel"),
        (Fault("a1y", "melted"), "unknown fault"),
        (Fault("a1y", "dropout", mode="sideways"), "no such mode"),
    ],
)
def test_faults_that_do_not_fit_the_rig_are_named(fault: Fault | str, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        simulate(rig(), "general", faults=[fault])


def test_faults_that_do_not_fit_the_sensor_are_named() -> None:
    for fault, words in (("gx:position", "rate sensor"), ("gx:swap=a1y", "cannot be swapped")):
        with pytest.raises(ConfigurationError, match=words):
            simulate(rig("naap-gyro"), "general", faults=[fault])


def test_a_class_that_the_rate_cannot_carry_is_named() -> None:
    with pytest.raises(ConfigurationError, match="too slowly for CFC1000"):
        simulate(rig(), "general", faults=["a1y:wrong_filter=CFC1000"], rate_hz=2000.0)
