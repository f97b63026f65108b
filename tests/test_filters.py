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


# --- every class of both standards, and filtering once ------------------------------------------------------------


@pytest.mark.parametrize("standard", ["J211", "ISO6487"])
@pytest.mark.parametrize("class_", filters.CLASSES)
@pytest.mark.parametrize("rate", [10_000.0, 20_000.0, 100_000.0])
def test_corner_is_where_both_passes_leave_3_db(class_: float, rate: float, standard: filters.Standard) -> None:
    corner = filters.corner(class_, rate, standard)
    assert filters.response(np.array([corner]), class_, rate, standard)[0] == pytest.approx(np.sqrt(0.5), rel=1e-9)
    # 5/3 of the class, a third of a per cent wider by ISO 6487, as the sampling grows fast
    design = {"J211": 2.0775, "ISO6487": 1.25 * 5 / 3}[standard] * (np.sqrt(2) - 1) ** 0.25
    bent = (np.pi * corner / rate) ** 2 / 2.0
    assert corner / class_ == pytest.approx(design, rel=bent)


@pytest.mark.parametrize("class_", filters.CLASSES)
def test_padding_is_that_of_both_standards_for_every_class(class_: float) -> None:
    """A straight line that starts high passes to its last sample, but for what is left after 10 ms of padding of the
    lag √2/ωd with which the filter starts: e^(−ωd 10 ms/√2), seen for CFC60 only."""
    line, pole = 40.0 + np.linspace(0.0, 30.0, 3000), np.sqrt(2.0) * np.pi * class_ * 2.0775
    left = 30.0 / 0.15 / pole * np.exp(-pole * 0.010) + 1e-9
    for standard in ("J211", "ISO6487"):
        np.testing.assert_allclose(filters.cfc(line, 20_000.0, class_, standard), line, atol=left, rtol=0.0)


def noise_at_rest(class_: float | None, rate: float = 10_000.0, samples: int = 400, seed: int = 5) -> FloatArray:
    white = np.random.default_rng(seed).normal(0.0, 3.0, (samples + 4000, 9))
    return (white if class_ is None else filters.cfc(white, rate, class_))[2000 : 2000 + samples]


@pytest.mark.parametrize("class_", [None, 180.0, 600.0, 1000.0])
@pytest.mark.parametrize("seed", range(20))
def test_noise_shows_the_class_of_its_filter(class_: float | None, seed: int) -> None:
    assert filters.class_of_noise(noise_at_rest(class_, seed=seed), 10_000.0) == class_


@pytest.mark.parametrize("rate", [10_000.0, 20_000.0])
def test_noise_that_was_filtered_and_then_rounded_shows_its_class(rate: float) -> None:
    """A converter's step of a sixth of the noise before the filter adds white noise of 0.05 of it."""
    rounded = np.round(noise_at_rest(1000.0, rate, 800) / 0.5) * 0.5
    assert filters.class_of_noise(rounded, rate) == 1000.0


def test_noise_says_nothing_where_it_is_short_constant_or_slowly_sampled() -> None:
    assert filters.class_of_noise(noise_at_rest(1000.0, samples=3), 10_000.0) is None
    assert filters.class_of_noise(np.zeros((400, 9)), 10_000.0) is None
    assert filters.class_of_noise(np.full((400, 9), np.nan), 10_000.0) is None
    assert filters.class_of_noise(noise_at_rest(None), 500.0) is None
    assert filters.class_of_noise(noise_at_rest(60.0, samples=200), 10_000.0) != 60.0  # two periods of 100 Hz


def test_a_recording_is_not_filtered_twice() -> None:
    """−6.0 dB at the corner of one class twice; from CFC1000 to CFC600 0.5 dB are lost, which is let pass."""
    values = noise_at_rest(None)
    for class_ in (180.0, 1000.0):
        with pytest.raises(ConfigurationError, match=r"filtered twice.*−6\.0 dB"):
            filters.once(values, 10_000.0, class_, already=class_)
    with pytest.raises(ConfigurationError, match="filtered twice"):
        filters.once(values, 10_000.0, 1000.0, already=180.0)
    for class_, already in ((1000.0, None), (180.0, 1000.0), (600.0, 1000.0)):
        expected = filters.cfc(values, 10_000.0, class_)
        np.testing.assert_array_equal(filters.once(values, 10_000.0, class_, already), expected)


def test_filtering_once_keeps_the_guard_against_slow_sampling() -> None:
    with pytest.raises(EstimationError, match="sampled too slowly"):
        filters.once(noise_at_rest(None), 9_000.0, 1000.0, already=None)
