"""Motions against calculus and the printed numbers; the instrument against its stated uncertainty."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest

from nineaudit.array import FloatArray
from nineaudit.errors import ConfigurationError
from nineaudit.physics import nap
from nineaudit.physics.filters import response
from nineaudit.physics.kinematics import orientation
from nineaudit.rig import Rig, parse_rig, preset_text
from nineaudit.simulate import DESCRIPTIONS, MOTIONS, Simulation, Truth, simulate
from nineaudit.simulate.published import alem, alem_quiet, counter_example
from nineaudit.simulate.truth import with_gravity
from nineaudit.units import G0

RESTING = sorted(set(MOTIONS) - {"alem"})
HEAD_EVENTS = ["sled", "drop", "planar", "planar-x", "planar-z", "oblique", "general"]


@cache
def rig(preset: str = "naap-3222", filter_class: str = "none", arms: tuple[float, ...] | None = None) -> Rig:
    text = preset_text(preset, arms=None if arms is None else list(arms))
    return parse_rig(text.replace('filter_class = "CFC1000"', f'filter_class = "{filter_class}"'))


def length(vectors: FloatArray) -> FloatArray:
    return np.linalg.norm(vectors, axis=1)


def difference_error(make: partial[Truth], rate: float) -> float:
    """Largest deviation of the second-order central difference of ω from α."""
    truth = make(rate)
    central = (truth.omega[2:] - truth.omega[:-2]) * (rate / 2)
    return float(np.abs(central - truth.alpha[1:-1]).max())


# --- motions ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(set(MOTIONS) - {"rest", "t4"}))
def test_alpha_is_the_derivative_of_omega(name: str) -> None:
    """The central difference converges to α with h², so α has no error of its own."""
    make = partial(MOTIONS[name], duration_s=0.05, rng=None)
    coarse, fine = difference_error(make, 20_000.0), difference_error(make, 40_000.0)
    assert coarse / fine == pytest.approx(4.0, rel=0.1)
    assert fine < 2e-4 * length(make(40_000.0).alpha).max()


@pytest.mark.parametrize("seed", range(5))
def test_random_motion_keeps_alpha_exact(seed: int) -> None:
    errors = [
        difference_error(partial(MOTIONS["general"], duration_s=None, rng=np.random.default_rng(seed)), rate)
        for rate in (20_000.0, 40_000.0)
    ]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize("name", RESTING)
def test_body_rests_before_the_event(name: str) -> None:
    truth = MOTIONS[name](10_000.0, None, np.random.default_rng(3))
    before = truth.time <= 0.0
    assert truth.time[0] <= -0.025 + 1e-12
    assert 0.0 in truth.time
    for values in (truth.omega, truth.alpha, truth.a0):
        assert not values[before].any()


@pytest.mark.parametrize("name", sorted(set(RESTING) - {"t4", "rest"}))
def test_onset_has_no_step(name: str) -> None:
    """Halving the interval halves the largest step of α and a0: both are continuous."""
    steps = {}
    for rate in (20_000.0, 40_000.0):
        truth = MOTIONS[name](rate, 0.05, None)
        steps[rate] = [np.abs(np.diff(v, axis=0)).max() for v in (truth.alpha, truth.a0)]
    assert np.divide(steps[20_000.0], steps[40_000.0]) == pytest.approx([2.0, 2.0], rel=0.02)


def test_alem_reaches_the_published_size() -> None:
    """METHODS 7.1: max|α| 3205 rad/s² over 2 s, |ω| ≤ 31.7/42.7/42.6 rad/s, at Alem's 1600 Hz."""
    truth = alem(1600.0)
    assert truth.time[0] == 0.0
    assert truth.time[-1] == 2.0
    assert length(truth.alpha).max() == pytest.approx(3205.0, abs=0.5)
    assert np.abs(truth.omega).max(axis=0) == pytest.approx([31.7, 42.7, 42.6], abs=0.05)


def alem_displacement(time: FloatArray) -> FloatArray:
    """Alem 1977 Table 1, inertial axes, m."""
    inches, f1, f2 = np.array([25.0, 7.0, 20.0]), np.array([2.0, 1.0, 4.0]), np.array([3.5, 5.0, 2.5])
    phase = 2 * np.pi * time[:, None]
    return 0.0254 * inches * (np.sin(phase * f1) - np.sin(phase * f2))


def test_alem_acceleration_is_the_displacement_twice_differentiated() -> None:
    """a0 turned back to inertial axes by the attitude integrated from ω is ẍ; the first attitude is E = 1."""
    rate = 8000.0
    truth = alem(rate, 0.5)
    inertial = np.einsum("nij,nj->ni", orientation(truth.omega, truth.time), truth.a0)
    around = alem_displacement(np.concatenate([[-1 / rate], truth.time, [truth.time[-1] + 1 / rate]]))
    second = np.diff(around, n=2, axis=0) * rate**2
    assert np.abs(inertial - second).max() < 1e-4 * np.abs(second).max()


def test_alem_quiet_is_the_published_motion_after_its_ramp() -> None:
    quiet, published = alem_quiet(1000.0, 1.0), alem(1000.0, 0.8)
    for name in ("omega", "alpha", "a0"):
        late = getattr(quiet, name)[quiet.time >= 0.2 - 1e-9]
        assert late == pytest.approx(getattr(published, name), rel=1e-9, abs=1e-6)


def test_gravity_follows_the_body() -> None:
    """Gravity by the integrated attitude equals gravity by Alem's Euler angles; it is g_0 long."""
    plain, exact = alem(10_000.0, 0.5), alem(10_000.0, 0.5, gravity=(0.0, 0.0, G0))
    assert with_gravity(plain).a0 == pytest.approx(exact.a0, abs=1e-4 * G0)
    assert length(exact.a0 - plain.a0) == pytest.approx(G0, rel=1e-12)


def test_a_body_at_rest_feels_gravity_upwards() -> None:
    """Standing dummy, z down (SAE J1733): the specific force at rest is −g_0 along z."""
    made = simulate(rig(), "rest", imperfect=False, noise=False, gravity=True)
    assert made.recording.column("a0z") == pytest.approx(-G0)
    assert made.recording.column("a0x") == pytest.approx(0.0, abs=1e-12)


def test_counter_example_has_the_printed_numbers() -> None:
    """METHODS 7.3 (Takhounts 2009 eqs 15-20) at t = 1 s: α, products by integration, by constraints."""
    array = rig(arms=(50.0, 60.0, 70.0))
    made = simulate(array, "t4", imperfect=False, noise=False, rate_hz=1000.0)
    arms = np.array([0.05, 0.06, 0.07])
    readings, time = made.recording.readings, made.recording.time
    assert time[-1] == 1.0
    assert made.truth.alpha[-1] == pytest.approx([1.1905, -2.8571, 1.6667], abs=5e-5)
    assert nap.alpha(readings, arms)[-1] == pytest.approx([1.1905, -2.8571, 1.6667], abs=5e-5)
    x, y, z = nap.omega(readings, arms, time)[-1]
    assert (y * z, z * x, x * y) == pytest.approx((-1.1905, 0.4960, -0.8503), abs=5e-5)
    assert nap.products(readings, arms)[-1] == pytest.approx([15.476, 17.143, 18.333], abs=5e-4)
    assert made.truth.omega[-1] == pytest.approx(counter_example(1000.0).omega[-1])


def test_counter_example_needs_the_array_it_speaks_of() -> None:
    with pytest.raises(ConfigurationError, match="3-2-2-2"):
        simulate(rig("rgla"), "t4")


@pytest.mark.parametrize(
    ("name", "omega", "alpha", "a0_g"),
    [("sled", (30, 40), (2000, 5000), (30, 80)), ("drop", (20, 30), (3000, 8000), (150, 250)),
     ("oblique", (25, 45), (4000, 10000), (80, 200)), ("general", (20, 70), (1500, 9000), (30, 200))],
)  # fmt: skip
@pytest.mark.parametrize("seed", range(4))
def test_events_have_the_size_of_their_kind(
    name: str, omega: tuple[int, int], alpha: tuple[int, int], a0_g: tuple[int, int], seed: int
) -> None:
    truth = MOTIONS[name](10_000.0, None, np.random.default_rng(seed))
    for values, (low, high) in ((truth.omega, omega), (truth.alpha, alpha), (truth.a0 / G0, a0_g)):
        assert low <= length(values).max() <= high


@pytest.mark.parametrize(("name", "axis"), [("planar-x", 0), ("planar", 1), ("planar-z", 2)])
def test_planar_motion_turns_about_one_axis_only(name: str, axis: int) -> None:
    truth = MOTIONS[name](10_000.0, None, np.random.default_rng(0))
    others = [i for i in range(3) if i != axis]
    assert not truth.omega[:, others].any()
    assert not truth.alpha[:, others].any()
    assert not truth.a0[:, axis].any()
    assert np.abs(truth.omega[:, axis]).max() > 25.0


def test_sled_is_mostly_sagittal() -> None:
    peak = np.abs(MOTIONS["sled"](10_000.0, None, None).omega).max(axis=0)
    assert peak[1] > 20 * max(peak[0], peak[2]) > 0.0


def test_every_motion_is_described() -> None:
    assert list(MOTIONS) == list(DESCRIPTIONS)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [({"motion": "slde"}, "mean sled"), ({"rate_hz": 0.0}, "rate_hz"), ({"duration_s": -1.0}, "dur"),
     ({"rate_hz": float("nan")}, "rate_hz"), ({"seed": -1}, "seed")],
)  # fmt: skip
def test_bad_arguments_are_named(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        simulate(rig(), **({"motion": "sled"} | arguments))  # type: ignore[arg-type]


# --- readings and instrument ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", HEAD_EVENTS)
def test_perfect_readings_hold_the_constraints(name: str) -> None:
    """Noiseless readings of a rigid body meet Takhounts 2009 eqs 12 and 14 with the true ω, to rounding."""
    made = simulate(rig(), name, imperfect=False, noise=False)
    arms = np.array([0.05, 0.05, 0.05])
    x, y, z = made.truth.omega.T
    readings = made.recording.readings
    assert nap.alpha(readings, arms) == pytest.approx(made.truth.alpha, abs=1e-9)
    assert nap.products(readings, arms) == pytest.approx(np.stack([y * z, z * x, x * y], 1), abs=1e-9)
    assert np.array_equal(readings, made.ideal)


def test_rate_sensors_read_omega() -> None:
    made = simulate(rig("naap-gyro"), "general", imperfect=False, noise=False)
    for axis, channel in enumerate(("gx", "gy", "gz")):
        assert made.recording.column(channel) == pytest.approx(made.truth.omega[:, axis])


@cache
def many(imperfect: bool = True) -> list[Simulation]:
    return [simulate(rig(), "rest", seed=s, rate_hz=1000.0, imperfect=imperfect) for s in range(200)]


@pytest.mark.parametrize(
    ("name", "sd"),
    [("gain", 0.005), ("zero", 0.1 * G0), ("tilt", np.radians(0.5)), ("position", 0.5e-3), ("timing", 1e-5)],
)
def test_drawn_parameters_scatter_as_the_rig_states(name: str, sd: float) -> None:
    """Over 200 × 9 draws at least: standard deviation to 5 of its own sd 1/√(2N), mean to 5 of sd/√N."""
    drawn = np.array([made.drawn[name] for made in many()]).ravel()
    assert drawn.std() / sd == pytest.approx(1.0, abs=5 / np.sqrt(2 * drawn.size))
    assert drawn.mean() / sd == pytest.approx(0.0, abs=5 / np.sqrt(drawn.size))


def test_a_perfect_instrument_draws_nothing() -> None:
    for name in ("gain", "zero", "tilt", "position", "timing"):
        assert not many(imperfect=False)[0].drawn[name].any()


def test_drawn_parameters_explain_the_readings() -> None:
    """To first order δy = g y + b + (u·a)τ + n·(α×δr + ω×(ω×δr)) − ẏ s; the rest is of second order."""
    made = simulate(rig(), "general", noise=False, seed=5)
    perfect = simulate(rig(), "general", noise=False, seed=5, imperfect=False)
    truth, drawn, y = made.truth, made.drawn, perfect.recording.readings
    from nineaudit.simulate.instrument import across

    expected = y * drawn["gain"] + drawn["zero"]
    expected -= np.gradient(y, truth.time, axis=0) * drawn["timing"]
    for i, sensor in enumerate(rig().array.sensors):
        at = [np.cross(truth.alpha, r) + np.cross(truth.omega, np.cross(truth.omega, r))
              for r in (sensor.position, drawn["position"][i])]  # fmt: skip
        expected[:, i] += (truth.a0 + at[0]) @ (drawn["tilt"][i] @ across(sensor.axis)) + at[1] @ sensor.axis
    change = made.recording.readings - y
    assert np.abs(change - expected).max() < 0.03 * np.abs(change).max()
    assert np.array_equal(perfect.ideal, made.ideal)


def test_readings_end_at_full_scale() -> None:
    text = preset_text("naap-3222").replace("range = 500.0", "range = 20.0")
    made = simulate(parse_rig(text), "drop")
    assert np.abs(made.recording.readings).max() == pytest.approx(20.0 * G0)


def test_noise_has_the_stated_size() -> None:
    made = simulate(rig(), "rest", imperfect=False)
    quiet = made.recording.readings
    assert quiet.std(axis=0) / (0.3 * G0) == pytest.approx(1.0, abs=5 / np.sqrt(2 * len(quiet)))
    assert np.corrcoef(quiet.T)[np.triu_indices(9, 1)] == pytest.approx(0.0, abs=5 / np.sqrt(len(quiet)))


def test_noise_of_an_unstated_level_is_the_documented_default() -> None:
    text = "\n".join(line for line in preset_text("naap-3222").splitlines() if not line.startswith("noise"))
    assert simulate(parse_rig(text), "rest").drawn["noise"] == pytest.approx(0.3 * G0)


@pytest.mark.parametrize("class_", ["CFC180", "CFC1000"])
def test_filtered_noise_is_coloured_and_keeps_its_size(class_: str) -> None:
    """Its spectrum is white times the squared response of the class (SAE J211), and its sd is σ."""
    made = simulate(rig(filter_class=class_), "rest", imperfect=False, duration_s=3.2, seed=2)
    noise, rate = made.recording.readings, 10_000.0
    spectrum = (np.abs(np.fft.rfft(noise, axis=0)) ** 2).mean(axis=1)
    frequency = np.fft.rfftfreq(len(noise), 1 / rate)
    expected = response(frequency, float(class_[3:]), rate) ** 2
    corner = 5 / 3 * float(class_[3:])
    bands = [(0.01, 0.3), (0.3, 0.6), (0.6, 0.9), (0.9, 1.1), (1.1, 1.4)]
    power = [
        (spectrum[band].mean(), expected[band].mean())
        for low, high in bands
        if (band := (frequency > low * corner) & (frequency < high * corner)).any()
    ]
    measured, predicted = np.array(power).T
    assert measured / measured[0] == pytest.approx(predicted / predicted[0], rel=0.15)
    assert noise.std() == pytest.approx(0.3 * G0, rel=0.05)


def test_the_signal_too_goes_through_the_class_on_request() -> None:
    """CFC60 leaves 1/√2 of an amplitude at 100 Hz: it lowers an 8 ms pulse and leaves a slow motion."""
    sharp, slow = (
        {f: simulate(rig(filter_class="CFC60"), name, imperfect=False, noise=False, filter_signal=f)
         for f in (False, True)} for name in ("drop", "sled")
    )  # fmt: skip
    peak = {f: np.abs(made.recording.readings).max() for f, made in sharp.items()}
    assert peak[True] < 0.97 * peak[False]
    assert slow[True].recording.column("a0x") == pytest.approx(slow[False].recording.column("a0x"), abs=0.02 * 40 * G0)


# --- recording --------------------------------------------------------------------------------------------


def test_a_seed_gives_the_same_recording() -> None:
    first, again, other = (simulate(rig(), "general", seed=s) for s in (4, 4, 5))
    assert first.recording.readings.tobytes() == again.recording.readings.tobytes()
    assert first.recording.source == again.recording.source
    assert first.recording.source.sha256 != other.recording.source.sha256


def test_switches_do_not_disturb_other_draws() -> None:
    """Motion and instrument of a seed are the same with and without noise."""
    noisy, clean = (simulate(rig(), "general", seed=1, noise=n) for n in (True, False))
    assert np.array_equal(noisy.truth.omega, clean.truth.omega)
    assert np.array_equal(noisy.drawn["gain"], clean.drawn["gain"])


def test_recording_is_whole() -> None:
    recording = simulate(rig(), "sled", seed=7, rate_hz=5000.0).recording
    assert str(recording.source.path) == "simulation:sled:seed=7"
    assert recording.source.format == "simulation"
    assert recording.source.size == recording.time.nbytes + recording.readings.nbytes
    assert recording.rate == pytest.approx(5000.0)
    assert recording.valid.all()
    assert [trace.channel for trace in recording.native] == list(rig().array.channels)
    with pytest.raises(ValueError, match="read-only"):
        recording.readings[0, 0] = 1.0


def test_rest_covers_the_stated_pre_trigger_and_slow_rates() -> None:
    early = parse_rig(preset_text("naap-3222").replace("[-0.02, -0.001]", "[-0.2, -0.001]"))
    assert simulate(early, "sled").recording.time[0] < -0.2
    assert (simulate(rig(), "sled", rate_hz=62.5).recording.time < 0).sum() >= 32
