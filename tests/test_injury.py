"""HIC, GSI, 3 ms and BrIC: exact values of pulses (METHODS.md 6) and brute force."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from nineaudit.array import FloatArray
from nineaudit.errors import EstimationError
from nineaudit.physics import injury
from nineaudit.units import G0

Pulse = Callable[[FloatArray], FloatArray]
PEAK_G, LENGTH = 100.0, 0.010


def half_sine(s: FloatArray) -> FloatArray:
    return np.sin(np.pi * s)


def triangle(s: FloatArray) -> FloatArray:
    return 1.0 - np.abs(2.0 * s - 1.0)


def haversine(s: FloatArray) -> FloatArray:
    return np.sin(np.pi * s) ** 2


def square(s: FloatArray) -> FloatArray:
    return np.ones_like(s)


def pulse(shape: Pulse, samples: int = 1001) -> tuple[FloatArray, FloatArray]:
    """The resultant (m/s²) of a 100 g, 10 ms pulse, and time."""
    s = np.linspace(0.0, 1.0, samples)
    return np.abs(shape(s)) * PEAK_G * G0, s * LENGTH


@pytest.mark.parametrize(
    ("shape", "hic", "gsi"),
    [
        (half_sine, 0.414646, 0.457656),
        (triangle, 0.246401, 0.285714),
        (haversine, 0.302939, 0.339531),
        (square, 1.0, 1.0),
    ],
)
def test_exact_values_of_pulses(shape: Pulse, hic: float, gsi: float) -> None:
    unit = PEAK_G**2.5 * LENGTH
    assert injury.hic(*pulse(shape)).value / unit == pytest.approx(hic, rel=1e-5)
    assert injury.gsi(*pulse(shape)) / unit == pytest.approx(gsi, rel=1e-5)


def test_half_sine_of_100_g_and_10_ms() -> None:
    found = injury.hic(*pulse(half_sine, 201))  # 20 kHz
    assert found.value == pytest.approx(414.6, abs=0.1)
    assert found.start + found.end == pytest.approx(LENGTH, abs=1e-9)  # about the peak
    assert injury.gsi(*pulse(half_sine, 201)) == pytest.approx(457.7, abs=0.1)


def brute_hic(acceleration: FloatArray, time: FloatArray, window: float) -> float:
    g = acceleration / G0
    velocity = np.r_[0.0, np.cumsum(np.diff(time) * (g[1:] + g[:-1]) / 2)]
    return max(
        (time[j] - time[i]) * ((velocity[j] - velocity[i]) / (time[j] - time[i])) ** 2.5
        for i in range(len(time))
        for j in range(i + 1, len(time))
        if time[j] - time[i] <= window
    )


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("window", [0.015, 0.036])
def test_hic_is_the_maximum_over_all_pairs_of_samples(seed: int, window: float) -> None:
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.2e-3, 1.8e-3, 150))
    acceleration = 100.0 * rng.gamma(1.5, 2.0, 150)
    found = injury.hic(acceleration, time, window)
    assert found.value == pytest.approx(brute_hic(acceleration, time, window), rel=1e-12)
    assert 0.0 < found.end - found.start <= window


def test_hic_window_is_used_to_the_full_on_a_uniform_time_base() -> None:
    time = np.arange(2001) / 20_000.0
    for window in (0.015, 0.036):
        found = injury.hic(np.full(2001, 50.0 * G0), time, window)
        assert found.end - found.start == pytest.approx(window, abs=1e-9)
        assert found.value == pytest.approx(50.0**2.5 * window, rel=1e-9)


def test_hic_scales_as_the_power_of_the_acceleration_and_of_time() -> None:
    a, t = pulse(haversine)
    once = injury.hic(a, t).value
    assert injury.hic(2.0 * a, t).value == pytest.approx(2.0**2.5 * once)
    assert injury.hic(a, 0.5 * t).value == pytest.approx(0.5 * once)
    assert injury.hic(0.0 * a, t) == (0.0, t[0], t[0])


@pytest.mark.parametrize("seed", range(3))
def test_of_many_resultants_each_has_the_values_of_its_own(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.2e-3, 1.8e-3, 150))
    many = 100.0 * rng.gamma(1.5, 2.0, (7, 150)) * rng.uniform(0.0, 3.0, (7, 1))
    for window in (0.015, 0.036):
        alone = [injury.hic(a, time, window).value for a in many]
        assert injury.hic_of_each(many, time, window) == pytest.approx(alone, rel=1e-14)
    for cumulative in (False, True):
        alone = [injury.a3ms(a, time, cumulative=cumulative) for a in many]
        assert injury.a3ms_of_each(many, time, cumulative=cumulative) == pytest.approx(alone, rel=1e-12)
    with pytest.raises(EstimationError, match="do not fit"):
        injury.hic(many, time)
    with pytest.raises(EstimationError, match="not a resultant"):
        injury.hic_of_each(-many, time)


def test_hic_of_20_000_samples_needs_little_memory() -> None:
    import tracemalloc

    rng = np.random.default_rng(3)
    time = np.arange(20_000) / 20_000.0
    tracemalloc.start()
    injury.hic(np.abs(rng.normal(0, 500, 20_000)), time, 0.036)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20 * 20_000 * 8  # some vectors of n, no table of n × window


@pytest.mark.parametrize(
    ("shape", "level"),
    [
        (half_sine, np.cos(0.15 * np.pi)),
        (triangle, 0.7),
        (haversine, np.cos(0.15 * np.pi) ** 2),
        (square, 1.0),
    ],
)
def test_3_ms_level_of_pulses(shape: Pulse, level: float) -> None:
    for cumulative in (False, True):
        found = injury.a3ms(*pulse(shape), cumulative=cumulative)
        assert found / (PEAK_G * G0) == pytest.approx(level, rel=1e-5)


def test_3_ms_in_one_piece_or_summed() -> None:
    """Two triangles of 4 ms: one holds 3 ms at a quarter of the peak, both sum to 3 ms at five eighths."""
    time = np.array([0.0, 2.0, 4.0, 6.0, 8.0]) * 1e-3
    acceleration = np.array([0.0, 100.0, 0.0, 100.0, 0.0])
    assert injury.a3ms(acceleration, time) == pytest.approx(25.0, rel=1e-9)
    assert injury.a3ms(acceleration, time, cumulative=True) == pytest.approx(62.5, rel=1e-9)
    with pytest.raises(EstimationError, match="shorter than the window"):
        injury.a3ms(acceleration, time, duration=0.009)


def test_bric_takes_each_maximum_separately() -> None:
    critical = np.diag([66.25, -56.45, 42.87])  # one at a time, of either sign
    assert injury.bric(critical) == pytest.approx(np.sqrt(3.0), rel=1e-12)
    assert injury.bric(critical, (132.5, 112.9, 85.74)) == pytest.approx(np.sqrt(0.75), rel=1e-12)


def test_peak_and_its_time() -> None:
    time = np.array([0.0, 0.1, 0.2])
    assert injury.peak(np.array([1.0, -5.0, 2.0]), time) == (5.0, 0.1)
    assert injury.peak(np.array([[0.0, 0, 0], [1, 1, 1], [3, 4, 12]]), time) == (13.0, 0.2)


def test_gaps_and_what_is_no_resultant_are_refused() -> None:
    time = np.arange(3) * 0.01
    for bad in (np.array([1.0, np.nan, 1.0]), np.array([1.0, -2.0, 1.0])):
        for function in (injury.hic, injury.gsi, injury.a3ms):
            with pytest.raises(EstimationError, match="not a resultant"):
                function(bad, time)
    with pytest.raises(EstimationError, match="time increasing"):
        injury.hic(np.ones(3), time[::-1])
    with pytest.raises(EstimationError, match="gaps"):
        injury.bric(np.full((2, 3), np.nan))
    with pytest.raises(EstimationError, match="gaps"):
        injury.peak(np.full(3, np.nan), time)
