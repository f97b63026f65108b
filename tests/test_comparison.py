"""Schemes side by side: ratings, budgets of differences, the command and its page."""

from __future__ import annotations

import numpy as np
import pytest

from nineaudit import cli
from nineaudit.case import Case
from nineaudit.comparison import EXPLAINED, compare, outputs
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.report.comparison_page import HEADERS, lines, render
from nineaudit.rig import parse_rig, preset_text
from nineaudit.schemes import rating
from nineaudit.simulate import simulate

TIME = np.arange(1001) * 1e-4
PULSE = 100.0 * np.exp(-(((TIME - 0.04) / 0.012) ** 2))
ROUGH = 90.0 * np.exp(-(((TIME - 0.041) / 0.011) ** 2)) + 5.0 * np.sin(2 * np.pi * 90 * TIME)
# corridor, phase, magnitude, slope, overall of the public package objective-rating-metrics (ISO 18571), same curves.
LIBRARY = [
    (100.0 * np.exp(-(((TIME - 0.043) / 0.012) ** 2)), (0.86038302, 0.85014985, 1.0, 1.0, 0.91418318)),
    (0.8 * PULSE, (0.90561077, 1.0, 0.88707903, 0.9, 0.91966011)),
    (ROUGH, (0.92191816, 0.95004995, 0.80913056, 0.55675174, 0.83195371)),
]


@pytest.mark.parametrize(("curve", "expected"), LIBRARY, ids=["late", "low", "rough"])
def test_rating_is_that_of_the_public_library(curve, expected):
    assert tuple(rating.rate(curve, PULSE)) == pytest.approx(expected, abs=1e-7)


def test_a_curve_rates_itself_perfect_and_its_opposite_poor():
    assert tuple(rating.rate(PULSE, PULSE)) == (1.0,) * 5
    assert rating.rate(PULSE, PULSE).grade == "excellent"
    opposite = rating.rate(-PULSE, PULSE)
    assert opposite.magnitude == 0.0
    assert opposite.grade == "poor"
    assert sum(rating.WEIGHTS) == pytest.approx(1.0)


def test_rating_refuses_what_cannot_be_rated():
    with pytest.raises(EstimationError, match="constant curve"):
        rating.rate(0 * PULSE, PULSE)
    with pytest.raises(EstimationError, match="20 finite samples"):
        rating.rate(PULSE[:10], PULSE[:10])


def test_warping_finds_the_path_of_brute_force():
    """Least summed squared difference over all monotone paths in the band, by plain dynamic programming."""
    rng = np.random.default_rng(5)
    a, b = rng.standard_normal((2, 30))
    for width in (3, 29):
        total = np.full((30, 30), np.inf)
        for i in range(30):
            for j in range(max(0, i - width), min(30, i + width + 1)):
                before = [total[p] for p in ((i - 1, j), (i, j - 1), (i - 1, j - 1)) if min(p) >= 0]
                total[i, j] = (a[i] - b[j]) ** 2 + (min(before) if before else 0.0)
        i, j = rating.warping_path(a, b, width)
        assert ((a[i] - b[j]) ** 2).sum() == pytest.approx(total[-1, -1])
        assert np.abs(i - j).max() <= width
        assert (i[0], j[0], i[-1], j[-1]) == (0, 0, 29, 29)


def recorded(preset="naap-gyro", faults=(), seed=1):
    return simulate(parse_rig(preset_text(preset)), "oblique", faults=faults, seed=seed, duration_s=0.06).recording


@pytest.fixture(scope="module")
def healthy():
    recording = recorded()
    return recording, compare(Case(recording), draws=8)


def test_every_scheme_that_the_sensors_allow_runs(healthy):
    _, found = healthy
    assert set(found.curves) == {"map", "optimised", "product-free", "ninacc", "rates", "compact-cube", "rgla"}
    assert {"periphery", "co-planar"} <= set(found.refused)
    assert "triaxes on two axes" in found.refused["co-planar"]
    assert found.reference == "map"
    assert len(found.rows) == 6 * 4 * 3


def test_a_healthy_recording_is_explained_by_its_budget(healthy):
    """Ratios of normal errors to their sd: 5 % are beyond 2; of 72 related rows, four fifths are surely within."""
    _, found = healthy
    assert np.mean([row.explained for row in found.rows]) > 0.8
    assert np.median([row.ratio for row in found.rows]) < 1.5


def test_a_fault_is_not_explained():
    """An arm channel with a quarter of its gain missing, 50 standard uncertainties: in product-free α, not in ω."""
    found = compare(Case(recorded(faults=["a1y:gain=0.75"])), "rates", draws=8)
    by = {(row.scheme, row.quantity, row.axis): row for row in found.rows}
    assert by["product-free", "omega", "z"].ratio > 2 * EXPLAINED
    assert by["compact-cube", "omega", "z"].difference == 0.0
    assert by["compact-cube", "omega", "z"].explained


def test_points_follow_the_rigid_body(healthy):
    case = Case(healthy[0])
    recording, found = case.recording, compare(case, draws=2, cfc=0.0)
    assert found.cfc is None
    curves = outputs(case.healthy.motion, recording.rig.points)
    assert set(curves) == {"alpha", "omega", "a0", "a(CG)"}
    assert found.curves["map"]["a(CG)"] == pytest.approx(curves["a(CG)"])


def test_text_and_page_hold_every_row(healthy):
    recording, found = healthy
    text = lines(found, recording)
    assert len(text) == 2 + len(found.rows) + len(found.remarks) + len(found.refused)
    assert any(line.startswith("cross-axis sensitivity, fitted with the motion: rank ") for line in text)
    assert any(line.startswith("bandwidth of ω: ") and "harmonics" in line for line in text)
    assert text[1].split()[0] == HEADERS[0]
    assert any(line.startswith("not run: periphery: ") for line in text)
    page = render(found, recording)
    assert page.count("<tr>") == 1 + len(found.rows)
    assert page.count('class="chart"') == 2 * 12  # six schemes, four to a figure
    assert "CFC180" in text[0]
    assert "a(CG) z" in page


def test_wrong_questions_are_answered_in_a_sentence():
    case = Case(recorded("3-2-1"))
    with pytest.raises(ConfigurationError, match=r"no such scheme.*'nap'"):
        compare(Case(recorded()), "nap", draws=2)
    with pytest.raises(ConfigurationError, match="the scheme cannot run"):
        compare(Case(recorded()), "periphery", draws=2)
    with pytest.raises(EstimationError, match="sampled too slowly for CFC3000"):
        compare(case, cfc=3000.0)
    with pytest.raises(ConfigurationError, match="too few draws"):
        compare(case, draws=1)


def test_the_command_prints_the_table_and_writes_the_page(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.toml").write_text(preset_text("naap-3222"), encoding="utf-8")

    def run(*arguments):
        with pytest.raises(SystemExit) as ended:
            cli.main(arguments)
        return ended.value.code or 0, capsys.readouterr()

    simulated = ("simulate", "rig.toml", "--motion", "oblique", "--duration", "0.06", "--output", "T.csv")
    assert run(*simulated)[0] == 0
    code, shown = run("compare", "T.csv", "--rig", "rig.toml", "--draws", "3", "--html", "o.html")
    assert code == 0
    assert "4 schemes, against map" in shown.out.splitlines()[0]
    assert (tmp_path / "o.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert run("compare", "T.csv", "--rig", "rig.toml", "--reference", "rgla")[0] == 2


def test_an_array_whose_accelerometers_do_not_tell_alpha_is_compared_by_its_rates():
    """The whole-record fit would leave α to differences of ω at the noise's mercy: it is refused, with the rank."""
    found = compare(Case(recorded("rgla")), draws=3)
    assert found.reference == "rates"
    assert set(found.curves) == {"rates", "compact-cube", "rgla"}
    assert "rank 3" in found.refused["map"]


def test_a_class_that_the_recording_has_been_through_is_refused():
    """A second CFC180 takes another 3 dB at its corner. Unasked, curves then stay as they are."""
    rig = parse_rig(preset_text("naap-gyro").replace('"CFC1000"', '"CFC180"'))
    case = Case(simulate(rig, "drop", seed=1, rate_hz=20_000.0).recording)
    with pytest.raises(ConfigurationError, match="filtered twice: CFC180 after CFC180"):
        compare(case, draws=2, cfc=180.0)
    assert compare(case, draws=2).cfc is None
