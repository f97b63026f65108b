"""CFC filters against the figures of METHODS.md 6 (SAE J211-1 Appendix C, ISO 6487 Annex A)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.signal import filtfilt

from nineaudit.array import FloatArray
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.physics import filters


@pytest.mark.parametrize(
    ("class_", "rate", "b0", "a1", "a2"),
    [
        (180, 10_000, 0.01179627, 1.67011746, -0.71730255),
        (1000, 10_000, 0.21923142, 0.31189654, -0.18882221),
        (1000, 20_000, 0.07189310, 1.11158618, -0.39915856),
    ],
)
def test_coefficients(class_: float, rate: float, b0: float, a1: float, a2: float) -> None:
    b, a = filters.coefficients(class_, rate)
    np.testing.assert_allclose(b, [b0, 2 * b0, b0], atol=1e-8)
    np.testing.assert_allclose(a, [a1, a2], atol=5e-9)
    assert sum(b) + sum(a) == pytest.approx(1.0, abs=1e-14)  # unit gain at zero frequency


def minus_3_db(class_: float, rate: float) -> float:
    def over(frequency: float) -> float:
        return float(filters.response(np.array([frequency]), class_, rate)[0] - np.sqrt(0.5))

    return float(brentq(over, 0.1 * class_, 0.49 * rate))


@pytest.mark.parametrize(
    ("rate", "frequencies"),
    [(10_000, (100.0, 300.5, 1018, 1751)), (20_000, (100.0, 300.1, 1005, 1688))],
)
def test_minus_3_db_points(rate: float, frequencies: tuple[float, ...]) -> None:
    for class_, expected in zip((60, 180, 600, 1000), frequencies, strict=True):
        assert minus_3_db(class_, rate) == pytest.approx(expected, abs=0.05 if expected < 1000 else 0.5)


def test_iso_6487_is_the_slightly_wider_one() -> None:
    frequency = np.array([100.0, 300.0, 500.0])
    sae, iso = (filters.response(frequency, 180, 10_000, s) for s in ("J211", "ISO6487"))
    assert (iso > sae).all()
    assert np.abs(iso / sae - 1.0).max() < 0.02


@pytest.mark.parametrize("frequency", [50.0, 300.0, 700.0])
def test_a_sine_keeps_its_phase_and_takes_the_response(frequency: float) -> None:
    time = np.arange(20_000) / 20_000.0
    sine = np.sin(2 * np.pi * frequency * time)
    inside = slice(4000, -4000)
    expected = filters.response(np.array([frequency]), 180, 20_000)[0] * sine
    np.testing.assert_allclose(filters.cfc(sine, 20_000, 180)[inside], expected[inside], atol=1e-9)


@pytest.mark.parametrize("standard", ["J211", "ISO6487"])
@pytest.mark.parametrize(
    ("shape", "rate", "padded"),
    [((3000,), 20_000.0, 200), ((3000, 4), 6000.0, 100), ((40, 2), 6000.0, 39)],  # 10 ms, 100 samples, all
)
def test_is_the_forward_and_backward_filter_of_scipy(
    shape: tuple[int, ...], rate: float, padded: int, standard: filters.Standard
) -> None:
    """Odd reflection over 10 ms or 100 samples, whichever is more (ISO 6487 Annex A)."""
    values = np.random.default_rng(1).normal(5.0, 100.0, shape)
    b, a = filters.coefficients(60, rate, standard)  # a low class: the length of the padding shows at the ends
    expected = filtfilt(b, [1.0, -a[0], -a[1]], values, axis=0, padlen=padded)
    np.testing.assert_allclose(filters.cfc(values, rate, 60, standard), expected, atol=1e-9)


def test_constants_and_straight_lines_pass_unchanged_to_the_last_sample() -> None:
    """What odd reflection is for."""
    line = np.stack([np.full(500, 7.0), np.linspace(-40.0, 90.0, 500)], axis=1)
    np.testing.assert_allclose(filters.cfc(line, 10_000, 1000), line, atol=1e-10)


def test_filter_is_linear_and_leaves_its_input() -> None:
    f, g = np.random.default_rng(2).normal(size=(2, 400))
    before = f.copy()
    both = filters.cfc(2.0 * f - 3.0 * g, 10_000, 600)
    np.testing.assert_allclose(both, 2.0 * filters.cfc(f, 10_000, 600) - 3.0 * filters.cfc(g, 10_000, 600), atol=1e-12)
    np.testing.assert_array_equal(f, before)


def test_too_slow_sampling_is_told_with_its_numbers() -> None:
    with pytest.raises(EstimationError, match="CFC1000; found '5000 Hz'; expected at least 10000 Hz"):
        filters.cfc(np.zeros(100), 5000.0, 1000)
    filters.cfc(np.zeros(100), 10_000.0, 1000)


@pytest.mark.parametrize("values", [np.array([1.0, np.nan, 2.0]), np.array([1.0, np.inf]), np.array([1.0])])
def test_what_is_no_signal_is_refused(values: FloatArray) -> None:
    with pytest.raises(EstimationError, match="cannot be filtered"):
        filters.cfc(values, 20_000.0, 180)


def test_unknown_standard_and_class_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="'DIN'; expected one of J211, ISO6487"):
        filters.coefficients(180, 10_000, "DIN")  # type: ignore[arg-type]
    with pytest.raises(ConfigurationError, match="channel frequency class"):
        filters.coefficients(float("nan"), 10_000)
