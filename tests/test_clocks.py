"""Laws of several clocks in one recording: interpolation and its stated error, drift, skew, and what is handed on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nineaudit.array import FloatArray, frozen
from nineaudit.case import Case
from nineaudit.readers import Contents, assemble
from nineaudit.readers.clocks.alignment import nominal_ratio, pace, skew
from nineaudit.readers.clocks.clock import clock_of, in_order
from nineaudit.readers.clocks.resample import resample, squared_error
from nineaudit.recording import Alignment, Recording, Source, Trace
from nineaudit.rig import parse_rig

RIG = parse_rig(
    '[rig]\nname="a"\n[units]\nacceleration="m/s^2"\n'
    + "".join(f'[[sensor]]\nchannel="{c}"\nkind="accelerometer"\nposition=[0,0,0]\naxis=[1,0,0]\n' for c in "pq")
)
RATE = 100.0  # of the channel that is put onto other clocks


def trace(time: FloatArray, values: FloatArray, channel: str = "q") -> Trace:
    return Trace(channel, channel, frozen(time), frozen(values))


def onto(time: FloatArray, source: Trace, rate: float) -> tuple[FloatArray, float]:
    return resample(time, source, clock_of(source.time, in_order(source.time)), rate)


def assembled(p: Trace, q: Trace, format: str = "blf", u_parts: dict[str, float] | None = None) -> Recording:
    traces = (replace(p, channel="p"), replace(q, channel="q"))
    return assemble(Contents(traces), RIG, Source(Path(f"x.{format}"), format, "", 0), u_parts)


def band_limited(low: float, high: float, seed: int) -> Callable[[FloatArray], FloatArray]:
    """A random signal between two shares of RATE, of variance 20."""
    rng = np.random.default_rng(seed)
    frequency, phase = rng.uniform(low, high, 40) * RATE, rng.uniform(0, 2 * np.pi, 40)
    return lambda t: np.asarray(np.sin(2 * np.pi * np.multiply.outer(t, frequency) + phase).sum(-1))


# --- interpolation ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("high", [0.3, 0.36, 0.42, 0.46])
@pytest.mark.parametrize("phase", [None, 0.2, 0.5])
def test_the_predicted_error_is_the_observed_one(high: float, phase: float | None) -> None:
    """Onto a clock of another rate, and onto one of the same rate a part of an interval later."""
    signal = band_limited(0.25, high, seed=round(1000 * high))
    t = np.arange(4000) / RATE
    at = np.arange(1.0, 39.0, 1 / 731.3) if phase is None else t[100:-100] + phase / RATE
    values, predicted = onto(at, trace(t, signal(t)), RATE)
    observed = np.sqrt(np.mean((values - signal(at)) ** 2))
    assert predicted == pytest.approx(observed, rel=0.1)


@pytest.mark.parametrize(("share", "most"), [(0.1, 5e-8), (0.23, 1e-4), (0.35, 1e-2), (0.4, 5.5e-2)])
def test_the_stated_pass_band(share: float, most: float) -> None:
    phases = (np.arange(64) + 0.5) / 64
    stated = np.sqrt(squared_error(np.array([share]), phases).mean())
    assert 0.5 * most < stated < most
    t = np.arange(1000) / RATE
    wave = np.exp(2j * np.pi * share * RATE * t)
    at = np.arange(2.0, 8.0, 1 / 6400)
    parts = [onto(at, trace(t, part), 6400)[0] for part in (wave.real, wave.imag)]
    error = parts[0] + 1j * parts[1] - np.exp(2j * np.pi * share * RATE * at)
    assert np.sqrt(np.mean(np.abs(error) ** 2)) == pytest.approx(stated, rel=0.02)


def test_on_its_own_stamps_a_trace_is_itself() -> None:
    rng = np.random.default_rng(4)
    t = (np.arange(300) + rng.uniform(-0.1, 0.1, 300)) / RATE
    own = trace(t, rng.normal(size=300))
    base = np.sort(np.r_[t, rng.uniform(t[0], t[-1], 500)])
    values, _ = onto(base, own, RATE)
    np.testing.assert_array_equal(values[np.searchsorted(base, t)], own.values)


@given(st.floats(-100, 100), st.floats(-50, 50), st.floats(-5, 5))
@settings(max_examples=20, derandomize=True)
def test_a_line_stays_a_line_and_values_may_be_scaled(a: float, b: float, c: float) -> None:
    t, rng = np.arange(80) / RATE, np.random.default_rng(1)
    at = np.sort(rng.uniform(t[0], t[-1], 200))
    size = 1e-11 * (abs(a) + abs(b) + abs(c) + 1)
    np.testing.assert_allclose(onto(at, trace(t, a + b * t), RATE)[0], a + b * at, rtol=0, atol=size)
    y = rng.normal(size=80)
    once, error = onto(at, trace(t, y), RATE)
    scaled, scaled_error = onto(at, trace(t, a + c * y), RATE)
    np.testing.assert_allclose(scaled, a + c * once, rtol=0, atol=size)
    assert scaled_error == pytest.approx(abs(c) * error, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("broken", ["invalid", "lost"])
def test_nothing_rings_across_a_gap(broken: str) -> None:
    """Whatever is before a sample that is not valid, or lost, does not move what is after it."""
    t, rng = np.arange(100) / RATE, np.random.default_rng(2)
    y = rng.normal(size=100)
    wild = y.copy()
    wild[:50] += 1e3 * rng.normal(size=50)
    if broken == "invalid":
        y[50] = wild[50] = np.nan
    else:
        t, y, wild = (np.delete(v, [50]) for v in (t, y, wild))
    at = np.arange(0.0, 0.99, 1e-3)
    calm, shaken = (onto(at, trace(t, v), 1000)[0] for v in (y, wild))
    after = at >= 0.51
    np.testing.assert_array_equal(calm[after], shaken[after])
    assert np.isfinite(calm[after]).all()
    assert np.isnan(calm[(at > 0.4901) & (at < 0.5099)]).all()


def test_an_uneven_stretch_is_a_line() -> None:
    """Stamps that come in batches carry no spline: between them the line, as ever."""
    rng = np.random.default_rng(5)
    t = np.cumsum(rng.uniform(0.2, 1.8, 200)) / RATE
    y, at = rng.normal(size=200), np.arange(0.1, 1.5, 1e-3)
    values, error = onto(at, trace(t, y), 1000)
    seen = np.isfinite(values)
    np.testing.assert_allclose(values[seen], np.interp(at, t, y)[seen], rtol=1e-12, atol=1e-12)
    assert error > 0.3  # of white noise


def test_a_faster_channel_is_low_passed_first() -> None:
    """Onto 100 Hz: 30 Hz stays, 70 Hz, which would come down to 30 Hz, goes."""
    t, at = np.arange(8000) / 1000, np.arange(1.0, 7.0, 1 / RATE)
    kept = onto(at, trace(t, np.sin(2 * np.pi * 30 * t)), RATE)[0]
    np.testing.assert_allclose(kept, np.sin(2 * np.pi * 30 * at), atol=2e-3)
    gone = onto(at, trace(t, np.sin(2 * np.pi * 70 * t)), RATE)[0]
    assert np.abs(gone).max() < 2e-3


@given(st.integers(-8, 20))
@settings(max_examples=12, derandomize=True)
def test_all_stamps_may_be_shifted(power: int) -> None:
    shift = 2.0**power
    t, base, signal = np.arange(200) / 128, np.arange(2000) / 1024, band_limited(0, 0.4, 3)
    here = assembled(trace(base, base), trace(t + 0.001, signal(t)))
    there = assembled(trace(base + shift, base), trace(t + 0.001 + shift, signal(t)))
    np.testing.assert_allclose(there.readings, here.readings, rtol=0, atol=1e-4)
    np.testing.assert_array_equal(there.valid, here.valid)
    assert there.alignments[0].u_value == pytest.approx(here.alignments[0].u_value, rel=1e-3)


def test_the_rate_is_that_of_the_time_base() -> None:
    """A faster channel that was only on for a short time does not give it."""
    base, t = np.arange(4000) / RATE, np.arange(500) / (10 * RATE) + 3.0
    found = assembled(trace(base, np.sin(base)), trace(t, np.sin(t)))
    assert found.resampled == ("q",)
    assert found.rate == pytest.approx(RATE)


# --- clocks -------------------------------------------------------------------------------------------------------


def paces(kind: str, count: int, seed: int) -> tuple[float, float]:
    """(error over stated uncertainty, uncertainty in ppm) of the interval of a clock with errors of a kind."""
    rng = np.random.default_rng(seed)
    interval = (1 + 1e-4 * rng.normal()) / RATE
    error = {
        "white": rng.normal(size=count) * 3e-4,
        "bus": rng.exponential(3e-4, count),
        "wandering": np.cumsum(rng.normal(size=count)) * 1e-4,
    }[kind]
    t = np.arange(count) * interval + error + rng.uniform()
    found = pace(t, clock_of(t, in_order(t)))
    return (found.interval - interval) / found.u, 1e6 * found.u / interval


@pytest.mark.parametrize("kind", ["white", "bus", "wandering"])
@pytest.mark.parametrize("count", [100, 1000])
def test_drift_is_found_within_its_uncertainty(kind: str, count: int) -> None:
    error = np.array([paces(kind, count, seed)[0] for seed in range(100)])
    assert 0.75 < np.sqrt(np.mean(error**2)) < 1.4


def test_a_longer_record_tells_the_drift_better() -> None:
    """As n^1.5 for errors of the stamps, as √n for a clock that wanders."""
    assert paces("white", 1000, 1)[1] / paces("white", 4000, 1)[1] == pytest.approx(8, rel=0.15)
    assert paces("wandering", 1000, 1)[1] / paces("wandering", 4000, 1)[1] == pytest.approx(2, rel=0.4)


def test_rounded_stamps_do_not_claim_more_than_their_resolution() -> None:
    t = np.round(np.arange(500) * (1 + 3e-5) / RATE, 4)
    found = pace(t, clock_of(t, in_order(t)))
    assert abs(found.interval * RATE - 1 - 3e-5) < 2 * found.u * RATE
    assert found.u * RATE < 3e-5


@pytest.mark.parametrize(("ratio", "found"), [(0.16001, (4, 25)), (10.002, (10, 1)), (1.0003, (1, 1)), (1.25, (5, 4))])
def test_the_nominal_ratio_is_the_simplest(ratio: float, found: tuple[int, int]) -> None:
    assert nominal_ratio(ratio) == found


def test_drift_against_the_base_clock() -> None:
    rng = np.random.default_rng(8)
    base = np.arange(20_000) / 1000 + rng.normal(0, 1e-5, 20_000)
    t = np.arange(4000) / (200 * (1 + 40e-6)) + rng.normal(0, 1e-5, 4000)
    found = assembled(trace(base, base), trace(t, t)).alignments[0]
    assert found.ratio == (1, 5)
    assert abs(found.drift - 40e-6) < 3 * found.u_drift
    assert found.u_drift < 1e-6
    assert np.isnan(found.skew)


# --- skew, and what is handed on ----------------------------------------------------------------------------------


def two_messages(apart: float, jitter: float = 0.0, **more: dict[str, float]) -> Recording:
    rng = np.random.default_rng(6)
    t = np.arange(2000) / RATE + rng.normal(0, 1, 2000) * jitter
    late = np.arange(2000) / RATE + apart + rng.normal(0, 1, 2000) * jitter
    return assembled(trace(t, np.sin(t)), trace(late, np.sin(late)), **more)


def test_skew_between_two_messages_is_its_timing_uncertainty() -> None:
    """Sampled together and sent 0.6 ms apart, or sampled so? d/√3 about the value d."""
    found = two_messages(6e-4)
    assert found.alignments[0].skew == pytest.approx(6e-4)
    assert found.alignments[0].u_timing == pytest.approx(6e-4 / np.sqrt(3), rel=1e-6)
    stated = RIG.array["q"].u_timing
    assert found.rig.array["q"].u_timing == pytest.approx(np.hypot(stated, 6e-4 / np.sqrt(3)), rel=1e-6)
    assert found.rig.array["p"].u_timing == RIG.array["p"].u_timing
    assert RIG.array["q"].u_timing == stated
    assert "stamped 0.6 ms after" in found.source.notes[-1]


def test_jitter_of_both_clocks_is_timing_uncertainty() -> None:
    found = two_messages(0.0, jitter=1e-4)
    assert found.alignments[0].u_timing == pytest.approx(1e-4 * np.sqrt(2), rel=0.1)


def test_parts_are_not_messages() -> None:
    """A file of its own has a clock, not a place on a bus: its skew is one of sampling."""
    found = two_messages(6e-4, u_parts={"p": 0.0, "q": 2e-5})
    assert found.alignments[0].u_timing == pytest.approx(2e-5, rel=1e-6)


def test_the_nearest_stamp_may_be_before_or_after() -> None:
    base = np.arange(10) / 10
    np.testing.assert_allclose(skew(base[1:-1] + 0.04, base), 0.04)
    np.testing.assert_allclose(skew(base[1:-1] - 0.04, base), -0.04)


def test_one_clock_needs_no_alignment() -> None:
    t = np.arange(100) / RATE
    found = assembled(trace(t, t), trace(t, t**2))
    assert (found.alignments, found.resampled, found.source.notes) == ((), (), ())
    assert found.rig is RIG
    np.testing.assert_array_equal(found.column("q"), t**2)


def test_samples_between_a_slower_clocks_own_tell_nothing_new() -> None:
    """The mean of n readings that were brought from 1/10 of the rate scatters by deviation/√n."""
    rng, t, base = np.random.default_rng(7), np.arange(400) / RATE, np.arange(4000) / (10 * RATE)
    means = [onto(base, trace(t, rng.normal(size=400)), 10 * RATE)[0][1000:3000].mean() for _ in range(100)]
    slower = Alignment("q", RATE, (1, 10), 0.0, 0.0, 0.0, 0.0, 0.0)
    assert slower.deviation(1.0) == pytest.approx(np.sqrt(10))
    assert np.std(means) == pytest.approx(slower.deviation(1.0) / np.sqrt(2000), rel=0.2)
    assert replace(slower, ratio=(10, 1), u_value=0.75).deviation(1.0) == 1.25


def test_the_estimator_sees_noise_and_interpolation() -> None:
    rng, base, t = np.random.default_rng(9), np.arange(4000) / 1000, np.arange(400) / RATE
    found = assembled(trace(base, rng.normal(size=4000)), trace(t, rng.normal(size=400)))
    case = Case(found)
    q = found.alignments[0]
    assert q.u_value > 0.1
    assert case.sigma[0] == case.noise[0]
    assert case.sigma[1] == pytest.approx(np.hypot(case.noise[1] * np.sqrt(10), q.u_value))
