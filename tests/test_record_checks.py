"""Single-channel evidence: silent on healthy signals of every kind, exact about what is wrong, true on real data."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from channels import recording
from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.estimate.evidence import Stretch, dropouts, mask, resolution, spikes, stuck
from nineaudit.estimate.flat_tops import flat_tops
from nineaudit.estimate.single_channel import ChannelEvidence
from nineaudit.readers import read
from nineaudit.recording import Recording
from nineaudit.rig import load_rig, parse_rig, preset_text
from nineaudit.simulate import simulate

SHAPES = {
    "half-sine": lambda u: np.sin(np.pi * u),
    "haversine": lambda u: np.sin(np.pi * u) ** 2,
    "triangle": lambda u: 1 - np.abs(2 * u - 1),
    "fourth order": lambda u: 1 - (2 * u - 1) ** 4,
    "ringing": lambda u: np.sin(np.pi * u) * np.cos(6 * np.pi * u),
}


def pulse(shape: str, samples: int, n: int, phase: float, at: float = 0.4) -> FloatArray:
    """(n,) a pulse of height 1 that lasts `samples`, sampled at some phase."""
    u = (np.arange(n) + phase - at * n) / samples
    return np.where((u > 0) & (u < 1), SHAPES[shape](u), 0.0)


def signals(shape: str, samples: int, seed: int) -> list[tuple[FloatArray, float]]:
    """Healthy signals and their noise: five noise levels × six resolutions."""
    rng = np.random.default_rng(seed)
    out = []
    for noise in (0.0, 1e-4, 1e-3, 1e-2, 5e-2):
        for step in (0.0, 1 / 20, 1 / 50, 1 / 200, 1 / 1000, 1e-5):
            n = max(400, 4 * samples)
            x = pulse(shape, samples, n, rng.uniform()) + noise * rng.standard_normal(n) + 0.01 * rng.uniform()
            out.append((step * np.round(x / step) if step else x, noise))
    return out


@pytest.mark.parametrize("samples", [8, 16, 40, 200, 2000])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_healthy_pulse_is_not_accused(shape: str, samples: int) -> None:
    for seed in range(3):
        for x, noise in signals(shape, samples, seed):
            assert flat_tops(x, noise) == ()
            assert dropouts(x, noise) == ()
            assert spikes(x, noise) == ()


@pytest.mark.parametrize("per_period", [8, 10.5, 33, 400])
@pytest.mark.parametrize("step", [0.0, 0.005, 0.05])
def test_a_vibration_of_constant_amplitude_is_not_clipped(per_period: float, step: float) -> None:
    rng = np.random.default_rng(1)
    x = np.sin(2 * np.pi * np.arange(4000) / per_period + 0.3) + 1e-3 * rng.standard_normal(4000)
    x = step * np.round(x / step) if step else x
    assert flat_tops(x, 1e-3) == ()
    assert spikes(x, 1e-3) == ()


@pytest.mark.parametrize("seed", range(4))
def test_healthy_random_motion_of_an_array_is_not_accused(seed: int) -> None:
    """Pulses between rests, coarse and fine, on channels of one array: rest is flat, but nothing moves then."""
    rng = np.random.default_rng(seed)
    n = 3000
    t = np.arange(n) * 1e-3
    places = rng.uniform(0.1, 0.7, 4)
    columns = {}
    for k in range(4):
        x = sum(rng.uniform(-1, 1) * pulse("half-sine", 60, n, 0.0, at) for at in places)
        x = 100.0 * np.abs(x) if k == 0 else 100.0 * np.asarray(x)
        x += (0.02, 0.3, 0.05, 0.3)[k] * rng.standard_normal(n)
        columns[f"c{k}"] = np.round(x / 0.2) * 0.2 if k % 2 == 0 else x
    noise = {"c0": 0.02, "c1": 0.3, "c2": 0.05, "c3": 0.3}
    for found in evidence(recording(t, columns, noise=noise)).values():
        assert found.stretches == (), found


def evidence(recorded: Recording) -> dict[str, ChannelEvidence]:
    return {found.channel: found for found in Case(recorded).evidence}


@pytest.mark.parametrize("samples", [50, 200, 1000])
@pytest.mark.parametrize("level", [0.3, 0.5, 0.8, 0.9])
@pytest.mark.parametrize("step", [0.0, 1e-4, 1e-2])
def test_a_digital_limit_is_found_to_the_sample(samples: int, level: float, step: float) -> None:
    rng = np.random.default_rng(3)
    x = pulse("half-sine", samples, 5 * samples, 0.3) + 1e-3 * rng.standard_normal(5 * samples)
    x = step * np.round(x / step) if step else x
    clipped = np.minimum(x, level)
    (top,) = flat_tops(clipped, 1e-3)
    assert top.level == level
    found = mask(top.stretches, x.size)
    truly = x > level
    assert found[truly].all()
    assert (x[found] > level - 4.5 * step - 1e-9).all()  # nothing further than four steps below it


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("noise", [1e-4, 1e-3, 3e-3])
def test_a_limit_before_the_noise_is_found(noise: float, seed: int) -> None:
    """An analogue stage saturates, then the noise of the converter is added: no two samples are equal."""
    rng = np.random.default_rng(seed)
    x = np.maximum(pulse("half-sine", 100, 500, 0.3) * -1, -0.6) + noise * rng.standard_normal(500)
    (top,) = flat_tops(x, noise)
    assert top.level == pytest.approx(-0.6, abs=5 * noise)
    truly = np.count_nonzero(pulse("half-sine", 100, 500, 0.3) > 0.6)
    assert top.samples == pytest.approx(truly, abs=4)


def test_a_limit_that_wriggles_by_a_few_steps_is_found() -> None:
    """As the rate sensors of the real recordings do: 250, 250, 249.5, 249.75, 250."""
    rng = np.random.default_rng(0)
    x = np.round(400 * np.sin(np.arange(3000) / 25) / 0.25) * 0.25
    x = np.where(x > 250, 250 - 0.25 * rng.integers(0, 4, 3000), x)
    (top,) = flat_tops(x, 0.05)
    assert top.level == 250
    assert not top.at_rail


def test_short_overloads_at_one_level_add_up() -> None:
    """Two or three samples at a time, again and again at one level."""
    rng = np.random.default_rng(2)
    x = 40 * np.sin(np.arange(4000) * 2 * np.pi / 17.3) + 0.01 * rng.standard_normal(4000)
    (top, bottom) = flat_tops(np.clip(x, -34.9, 34.9), 0.01, full_scale=35.0)
    assert (top.level, bottom.level) == (34.9, -34.9)
    assert top.at_rail
    assert top.samples == np.count_nonzero(x >= 34.9)


@pytest.mark.parametrize("rate", [3200.0, 10_000.0])
@pytest.mark.parametrize("step", [0.0, 0.02])
def test_a_body_that_coasts_at_a_constant_rate_is_no_overload(rate: float, step: float) -> None:
    """After a blow ω stays where it is, until the next: an angular rate with a genuine plateau, eased into."""
    rig = parse_rig(preset_text("compact-cube"))
    for seed in range(6):
        coasting = simulate(rig, "drop", seed=seed, rate_hz=rate)
        for values, noise in ((coasting.recording.readings, 0.05), (coasting.ideal, 0.0)):
            for column in values[:, ~rig.array.is_accelerometer].T:
                assert flat_tops(step * np.round(column / step) if step else column, noise) == ()


def test_the_rail_is_told_from_a_level_below_it() -> None:
    x = np.minimum(60 * pulse("half-sine", 200, 900, 0.3), 42.0)
    assert [top.at_rail for top in flat_tops(x, 0.01, full_scale=40.0)] == [True]
    assert [top.at_rail for top in flat_tops(x, 0.01, full_scale=100.0)] == [False]


def test_invalid_samples_do_no_harm() -> None:
    healthy = pulse("half-sine", 200, 900, 0.3) + 1e-3 * np.random.default_rng(0).standard_normal(900)
    x = np.minimum(healthy, 0.7)
    x[::50] = np.nan
    (top,) = flat_tops(x, 1e-3)
    assert top.level == 0.7
    assert mask(top.stretches, 900)[(healthy > 0.7) & np.isfinite(x)].all()
    for values in (np.full(100, np.nan), np.zeros(0), np.zeros(100), x):
        assert spikes(values, 1.0) == ()
        assert dropouts(values, 1.0) == ()
    assert flat_tops(np.full(100, np.nan), 1.0) == flat_tops(np.zeros(100), 1.0) == ()


@pytest.mark.parametrize("step", [0.1, 0.25, 1 / 1024])
def test_the_resolution_is_the_step_of_quantised_values(step: float) -> None:
    x = np.random.default_rng(0).normal(0, 30 * step, 2000)
    assert resolution(step * np.round(x / step)) == pytest.approx(step, rel=1e-6)
    assert resolution(np.round(step * np.round(x / step), 5)) == pytest.approx(step, abs=2e-5)
    assert resolution(x) == 0.0


def test_a_stuck_channel_is_found_from_where_it_stops() -> None:
    rng = np.random.default_rng(0)
    x = 50 * np.sin(np.arange(2000) / 60) + 0.3 * rng.standard_normal(2000)
    x[700:1100] = x[700]
    found, limit = stuck(x)
    assert [(s.start, s.stop) for s in found] == [(700, 1100)]
    assert limit == 10


@pytest.mark.parametrize("seed", range(4))
def test_a_smooth_pulse_cut_off_close_to_its_peak_is_clipped_not_stuck(seed: int) -> None:
    """The signal eases in there, as if it coasted; but a channel with noise never repeats itself by chance."""
    clipped = simulate(parse_rig(preset_text("naap-3222")), "drop", seed=seed, faults=["a0z:clipping=0.9"])
    found = {f.channel: f.fault for f in Case(clipped.recording).evidence if f.fault}
    assert found == {"a0z": "clipping"}


def test_rest_at_coarse_resolution_is_not_stuck() -> None:
    """A slow signal of one step's size makes runs of hundreds of samples, over and over."""
    x = np.round(1.2 * np.sin(np.arange(20_000) / 300))
    assert stuck(x)[0] == ()


def test_a_channel_is_stuck_only_while_the_others_move() -> None:
    n = 4000
    rng = np.random.default_rng(0)
    t = np.arange(n) * 1e-3
    lively = 50 * pulse("half-sine", 1000, n, 0.0, 0.5) + 0.2 * rng.standard_normal(n)
    held = lively + 0.2 * rng.standard_normal(n)
    held[100:300] = 0.123  # the body rests
    assert evidence(recording(t, {"a": lively, "b": held}, noise={"a": 0.2, "b": 0.2}))["b"].stuck == ()
    held[2200:2400] = 7.89  # the body moves
    found = evidence(recording(t, {"a": lively, "b": held}, noise={"a": 0.2, "b": 0.2}))["b"]
    assert [(s.start, s.stop) for s in (*found.stuck, *found.dropouts)] == [(2200, 2400)]


def test_a_channel_that_never_changes_is_dead_when_its_kind_moves_and_not_when_nothing_does() -> None:
    n = 2000
    t = np.arange(n) * 1e-3
    rng = np.random.default_rng(0)
    still = np.round(0.2 * rng.standard_normal(n))
    moving = 500 * pulse("half-sine", 1000, n, 0.0, 0.3) + still
    dead = np.full(n, 2.5)
    noise = {"a": 0.3, "b": 0.3}
    assert evidence(recording(t, {"a": moving, "b": dead}, noise=noise))["b"].fault == "stuck"
    assert evidence(recording(t, {"a": still, "b": dead}, noise=noise))["b"].fault is None


@pytest.mark.parametrize("level", [0.0, 3.0])
def test_a_dropout_is_found_to_the_sample(level: float) -> None:
    x = 60 * pulse("half-sine", 800, 2000, 0.0) + 0.3 * np.random.default_rng(0).standard_normal(2000)
    x[1100:1150] = level
    assert [(s.start, s.stop, s.level) for s in dropouts(x, 0.3)] == [(1100, 1150, level)]
    assert flat_tops(x, 0.3) == ()


def test_rest_between_two_blows_is_no_dropout() -> None:
    x = np.round(100 * (pulse("half-sine", 8, 400, 0.3, 0.3) + pulse("half-sine", 8, 400, 0.3, 0.36)))
    assert dropouts(x, 0.1) == ()


@pytest.mark.parametrize("width", [1, 2])
def test_a_spike_is_found_where_it_is(width: int) -> None:
    x = 60 * pulse("half-sine", 800, 2000, 0.0) + 0.3 * np.random.default_rng(0).standard_normal(2000)
    x[1200 : 1200 + width] -= 20.0
    assert [(s.start, s.stop) for s in spikes(x, 0.3)] == [(1200, 1200 + width)]


def test_a_blow_that_every_channel_feels_is_no_spike() -> None:
    n, t = 1000, np.arange(1000) * 1e-3
    rng = np.random.default_rng(0)
    columns = {c: 0.1 * rng.standard_normal(n) for c in "abc"}
    for c, height in zip("abc", (40.0, 9.0, -15.0), strict=True):
        columns[c][500] += height
    noise = dict.fromkeys("abc", 0.1)
    assert not any(found.spikes for found in evidence(recording(t, columns, noise=noise)).values())
    columns["b"][700] += 9.0
    assert evidence(recording(t, columns, noise=noise))["b"].spikes == (Stretch(700, 701, columns["b"][700]),)


def test_samples_are_flagged_on_the_common_clock_though_the_channel_has_its_own() -> None:
    rng = np.random.default_rng(0)
    fast, slow = np.arange(0, 1, 1e-4), np.arange(0, 1, 5e-4) + 1e-4

    def motion(t: FloatArray) -> FloatArray:
        return 50 * np.sin(2 * np.pi * 3 * t) + 0.05 * rng.standard_normal(t.size)

    columns = {"a": motion(fast), "b": np.minimum(motion(slow), 30.0)}
    case = Case(recording({"a": fast, "b": slow}, columns, noise={"a": 0.05, "b": 0.05}))
    clipped = case.flagged[:, 1]
    true = 50 * np.sin(2 * np.pi * 3 * fast)
    assert clipped[true > 31].all()
    assert not clipped[true < 29].any()
    assert not case.flagged[:, 0].any()


# Real recordings, made by others.


def test_the_gyros_of_the_real_array_clip_and_its_accelerometers_are_not_accused(shared_data: Path) -> None:
    """All 24 rate sensors reach 2000 deg/s, 34.9 rad/s, in about 1000 of 6734 samples (DATA.md)."""
    recorded = read(shared_data / "mimu-array" / "recording.csv", load_rig(shared_data / "mimu-array" / "rig.toml"))
    case = Case(recorded)
    for found in case.evidence:
        if "_w" in found.channel:
            assert found.fault == "clipping"
            assert sorted(round(top.level, 1) for top in found.flat_tops) == [-34.9, 34.9]
            assert all(top.at_rail for top in found.flat_tops)
            assert found.stretches == found.clipped
        else:
            assert found.stretches == (), found
    assert 900 < np.count_nonzero(case.flagged.any(axis=1)) < 1150


def test_the_real_40_g_sensor_clips_at_42_g_and_the_100_g_sensor_does_not(shared_data: Path) -> None:
    folder = shared_data / "impactor-clipping"
    slow, fast = (_table(folder / f"6mps_sphere_1_acc{r}g_impact.csv") for r in (40, 100))
    columns = {k.replace("_(40g)", "40"): v for k, v in slow.items() if k != "t_s"}
    times = dict.fromkeys(columns, slow["t_s"])
    for name, values in fast.items():
        if name != "t_s":
            columns[name.replace("_(100g)", "100")] = values
            times[name.replace("_(100g)", "100")] = fast["t_s"]
    scale = {name: 40.0 if name.endswith("40") else 100.0 for name in columns}
    found = evidence(recording(times, columns, units="[uncertainty]\nnoise = 0.05", full_scale=scale))
    (top,) = found["X40"].flat_tops
    assert (top.level, top.samples, top.at_rail) == (pytest.approx(42.0058), 13, True)
    assert [name for name, f in found.items() if f.fault] == ["X40"]


def test_the_real_mouthguard_impact_is_not_accused(shared_data: Path) -> None:
    table = _table(shared_data / "mouthguard" / "RawData.csv")
    t = table.pop("t_s")
    columns = {name: v * (9.80665 if name.endswith("_g") else 1.0) for name, v in table.items()}
    gyros = tuple(name for name in columns if name.startswith("G"))
    noise = {name: (0.05 if name in gyros else 2.0) for name in columns}
    for found in evidence(recording(t, columns, gyros=gyros, noise=noise)).values():
        assert found.stretches == (), found


def test_the_real_phone_imu_in_a_car_is_not_accused(shared_data: Path) -> None:
    table = _table(shared_data / "rav4-can" / "device-imu.csv")
    t = table.pop("time_s")
    gyros = tuple(name for name in table if name.startswith("w"))
    for found in evidence(recording(t, table, gyros=gyros)).values():
        assert found.stretches == (), found


CANMOD = """
[units]
acceleration = "m/s^2"
angular_rate = "deg/s"
[recording]
dbc = ["canmod-gps.dbc"]
""" + "".join(
    f'[[sensor]]\nchannel = "a{k}"\nkind = "accelerometer"\nposition = [0, 0, 0]\naxis = {axis}\nrange = 64\n'
    f'signal = "gnss_imu.Acceleration{k}"\n[[sensor]]\nchannel = "w{k}"\nkind = "gyroscope"\naxis = {axis}\n'
    f'range = {{rail}}\nsignal = "gnss_imu.AngularRate{k}"\n'
    for k, axis in zip("XYZ", ([1, 0, 0], [0, 1, 0], [0, 0, 1]), strict=True)
)


@pytest.mark.parametrize(("rail", "clipped"), [(250, {"wX", "wZ"}), (2000, {"wX"})])
def test_the_real_hand_held_can_imu_clips_at_250_deg_s(shared_data: Path, rail: int, clipped: set[str]) -> None:
    """About x and z by the look of it; with the rail not stated, five samples about z do not convince."""
    pytest.importorskip("asammdf")
    folder = shared_data / "canmod-imu"
    rig = parse_rig(CANMOD.replace("{rail}", str(rail)), folder / "rig.toml")
    found = evidence(read(folder / "by-hand-115s.mf4", rig))
    assert {name for name, f in found.items() if f.fault} == clipped
    levels = {round(np.rad2deg(top.level)) for name in clipped for top in found[name].flat_tops}
    assert levels <= {250, -250}
    assert not any(f.stretches for f in evidence(read(folder / "drive-45s.mf4", rig)).values())


def _table(path: Path) -> dict[str, FloatArray]:
    import pandas as pd

    return {name: column.to_numpy(dtype=float) for name, column in pd.read_csv(path).items()}


def test_a_dithered_channel_that_eases_into_its_limit_is_clipped() -> None:
    """The true curve only just exceeds the limit and touches it gently, as in the demo: 445 identical samples of a
    channel whose noise is thousands of its steps are no rest."""
    time = np.linspace(0.0, 1.0, 2000)
    noise = 3.0 * np.random.default_rng(4).standard_normal(time.size)
    healthy = 400.0 * np.sin(np.pi * time) ** 2 + 40.0 * np.sin(9.0 * time) * np.sin(np.pi * time) ** 4 + noise
    clipped = np.minimum(healthy, 350.0)
    (top,) = flat_tops(clipped, 3.0)
    assert top.level == 350.0
    assert top.samples == int((clipped == 350.0).sum())
    assert not flat_tops(healthy, 3.0)
