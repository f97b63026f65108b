"""Periphery, compact cube, co-planar and NAP schemes [Martin98], their filter, correlation and error tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nineaudit.array import SensorArray, frozen
from nineaudit.errors import EstimationError
from nineaudit.physics.filters import response
from nineaudit.rig import parse_rig, preset_text
from nineaudit.schemes import martin
from nineaudit.selftest import martin98, not_reproducible, record
from nineaudit.simulate import simulate

RATES = '[[sensor]]\nchannel = "{0}"\nkind = "gyroscope"\nposition = [0.0, 0.0, 0.0]\naxis = {1}\n'


@pytest.mark.parametrize("check", martin98.checks(), ids=lambda check: check.quantity)
def test_published_numbers(check):
    assert check.passed, check


def test_what_cannot_be_reproduced_is_said():
    assert any("peripheral α" in text for text in martin98.NOT_REPRODUCED)


def recorded(name, extra="", **options):
    rig = parse_rig(preset_text(name) + extra)
    return simulate(rig, "general", imperfect=False, noise=False, seed=4, **options)


def gyros():
    axes = np.eye(3).tolist()
    return "".join(RATES.format(f"g{a}", axis) for a, axis in zip("xyz", axes, strict=True))


@pytest.mark.parametrize(
    ("preset", "extra", "scheme", "differentiates"),
    [
        ("triax-3", gyros(), martin.periphery, False),
        ("coplanar-3-gyro", "", martin.coplanar, False),
        ("coplanar-3-gyro", "", martin.compact_cube, True),
        ("compact-cube", "", martin.compact_cube, True),
    ],
)
def test_schemes_give_the_motion_back(preset, extra, scheme, differentiates):
    """Exact but for rounding; where α is a central difference of ω, within h²/6 max|ω‴| and the arm times that."""
    made = recorded(preset, extra)
    recording, truth = made.recording, made.truth
    found = scheme(recording.rig.array, recording.time, recording.readings, np.ones(len(recording.rig.array)))
    third = np.abs(np.gradient(np.gradient(truth.alpha, truth.time, axis=0), truth.time, axis=0)).max()
    width = 2.0 * 1e-8 / 6.0 * third if differentiates else 1e-9 * np.abs(truth.alpha).max()
    assert np.abs(found.omega - truth.omega).max() < 1e-9
    assert np.abs(found.alpha - truth.alpha).max() < width
    assert np.abs(found.a0 - truth.a0).max() < 1e-9 * np.abs(truth.a0).max() + 0.1 * width


@pytest.mark.parametrize("turn", [0, 1, 2])
def test_the_plane_of_the_coplanar_scheme_may_be_any(turn):
    """x–y, y–z and z–x by turning the whole array and the motion about (1,1,1)."""
    made = recorded("coplanar-3-gyro")
    array, truth = made.recording.rig.array, made.truth

    def turned(vector):
        return np.roll(vector, turn, axis=-1)

    sensors = tuple(replace(s, position=frozen(turned(s.position)), axis=frozen(turned(s.axis))) for s in array.sensors)
    found = martin.coplanar(SensorArray(sensors), made.recording.time, made.recording.readings, np.ones(12))
    assert np.abs(found.alpha - turned(truth.alpha)).max() < 1e-9 * np.abs(truth.alpha).max()


def test_errors_name_what_is_missing():
    made = recorded("naap-gyro").recording
    given = made.rig.array, made.time, made.readings, np.ones(12)
    with pytest.raises(EstimationError, match=r"expected an accelerometer along \+x at \(50, 0, 0\) mm"):
        martin.periphery(*given)
    with pytest.raises(EstimationError, match="triaxes on two axes"):
        martin.coplanar(*given)
    without = recorded("triax-3").recording
    with pytest.raises(EstimationError, match="0 rate sensors of rank 0"):
        martin.periphery(without.rig.array, without.time, without.readings, np.ones(9))


def test_four_pole_butterworth_halves_the_power_at_its_corner_and_the_cfc_filter_does_not():
    """|H|² = 1/(1 + (f/fc)⁸): −3.01 dB at the corner, −24.1 dB an octave above; CFC is −3 dB at 5/3 of its class."""
    rate, corner = 20_000.0, 300.0
    impulse = np.zeros(20_000)
    impulse[1] = 1.0
    spectrum = np.abs(np.fft.rfft(martin.four_pole_butterworth(impulse, rate, corner)))
    for f, power in ((300, 0.5), (600, 1 / 257), (30, 1.0)):
        assert spectrum[f] ** 2 == pytest.approx(power, rel=0.05)
    assert response(np.array([300.0]), 180.0, rate)[0] ** 2 == pytest.approx(0.5, abs=0.01)
    resting = np.full((50, 2), 7.0)
    assert martin.four_pole_butterworth(resting, rate, corner) == pytest.approx(resting, abs=1e-9)
    with pytest.raises(EstimationError, match="below 10000 Hz"):
        martin.four_pole_butterworth(impulse, rate, 12_000.0)


def test_moving_correlation_is_pearsons_in_every_window():
    rng = np.random.default_rng(1)
    first, second = rng.standard_normal((2, 200))
    found = martin.moving_correlation(first, second, 10_000.0)
    half = 12
    assert np.isnan(found[:half]).all()
    assert np.isnan(found[-half:]).all()
    for i in (half, 77, 200 - half - 1):
        inside = slice(i - half, i + half + 1)
        assert found[i] == pytest.approx(np.corrcoef(first[inside], second[inside])[0, 1], abs=1e-12)
    assert np.nanmin(martin.moving_correlation(first, 3 * first - 2, 10_000.0)) == pytest.approx(1.0)
    assert np.isnan(martin.moving_correlation(first, 0 * first, 10_000.0)).all()
    with pytest.raises(EstimationError, match="1 in the window"):
        martin.moving_correlation(first, second, 500.0)


def test_error_propagation_agrees_with_its_formula_and_with_simulation():
    """f = x y² at (2, 3): u = √((y² ux)² + (2xy uy)²); drawn, to the sampling error of 1/√(2n) and second order."""
    values, u = {"x": 2.0, "y": 3.0}, {"x": 0.01, "y": 0.02}
    total, parts = martin.rss(lambda v: np.array([v["x"] * v["y"] ** 2]), values, u)
    assert parts["x"][0] == pytest.approx(0.09)
    assert parts["y"][0] == pytest.approx(0.24)
    assert total[0] == pytest.approx(np.hypot(0.09, 0.24))
    x, y = np.random.default_rng(0).standard_normal((2, 20_000)) * [[0.01], [0.02]] + [[2.0], [3.0]]
    assert (x * y**2).std() == pytest.approx(total[0], rel=0.03)


def test_the_validation_record_names_what_nobody_can_reproduce():
    text = "\n".join(record.lines(martin98.checks(), "2026-01-31", not_reproducible()))
    assert "Not reproducible from what is printed\n  Martin 1998 Table 4, peripheral α: 7.30, 0.93 and 24.7 %" in text
    assert record.document([], "2026-01-31", not_reproducible())["not_reproducible"] == not_reproducible()
