"""Schemes side by side: ratings, budgets of differences, the command and its page."""

from __future__ import annotations

import base64
import hashlib
import json
import re

import numpy as np
import pytest

from nineaudit import cli
from nineaudit.case import Case
from nineaudit.comparison import EXPLAINED, compare, outputs
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.report import scheme_styles
from nineaudit.report.comparison_document import document
from nineaudit.report.comparison_page import HEADERS, lines, render
from nineaudit.report.machine import to_json
from nineaudit.rig import parse_rig, preset_text
from nineaudit.scheme_runs import schemes_of
from nineaudit.schemes import rating, rgla
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
    rgla = {"rgla", "rgla-fourier", "rgla-lanczos"}
    assert set(found.curves) == {"map", "optimised", "product-free", "ninacc", "rates", "compact-cube", *rgla}
    assert {"periphery", "co-planar"} <= set(found.refused)
    assert "triaxes on two axes" in found.refused["co-planar"]
    assert found.reference == "map"
    assert len(found.rows) == 8 * 4 * 3


def test_a_healthy_recording_is_explained_by_its_budget(healthy):
    """Ratios of normal errors to their sd: 5 % are beyond 2; of 96 related rows, four fifths are surely within."""
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
    assert page.count('class="chart"') == 2 * 12  # five schemes of accelerometers and rates, three derivatives
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
    code, shown = run("compare", "T.csv", "--rig", "rig.toml", "--draws", "3", "--html", "o.html", "--json", "o.json")
    assert code == 0
    assert shown.out.splitlines()[-2:] == ["o.html", "o.json"]
    assert json.loads((tmp_path / "o.json").read_text(encoding="utf-8"))["reference"] == "map"
    assert "4 schemes, against map" in shown.out.splitlines()[0]
    assert (tmp_path / "o.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert run("compare", "T.csv", "--rig", "rig.toml", "--reference", "rgla")[0] == 2


def test_an_array_whose_accelerometers_do_not_tell_alpha_is_compared_by_its_rates():
    """A fit would leave α to differences of ω at the noise's mercy: the reference is the smoother of the rates, and the
    fit at its word, optimised, is refused with the rank."""
    found = compare(Case(recorded("rgla")), draws=3)
    assert found.reference == "map"
    assert "smoother of the rates" in found.methods["map"]
    assert "H of rank" in found.refused["optimised"]


def test_a_class_that_the_recording_has_been_through_is_refused():
    """A second CFC180 takes another 3 dB at its corner. Unasked, curves then stay as they are."""
    rig = parse_rig(preset_text("naap-gyro").replace('"CFC1000"', '"CFC180"'))
    case = Case(simulate(rig, "drop", seed=1, rate_hz=20_000.0).recording)
    with pytest.raises(ConfigurationError, match="filtered twice: CFC180 after CFC180"):
        compare(case, draws=2, cfc=180.0)
    assert compare(case, draws=2).cfc is None


def test_the_document_holds_every_row_and_no_number_that_is_none(healthy):
    recording, found = healthy
    made = json.loads(to_json(document(found, recording)))
    assert made["schema"] == "nineaudit/comparison/1"
    assert made["recording"]["sha256"] == recording.source.sha256
    assert (set(made["schemes"]), set(made["not_run"])) == (set(found.curves), set(found.refused))
    assert len(made["differences"]) == len(found.rows)
    for one, row in zip(made["differences"], found.rows, strict=True):
        assert (one["scheme"], one["quantity"], one["axis"]) == (row.scheme, row.quantity, row.axis)
        one_si = 9.80665 if one["unit"] == "g_0" else 1.0
        assert one["U"] * one_si == pytest.approx(2.0 * row.u, rel=1e-5)
        assert one["largest_difference"] * one_si == pytest.approx(row.difference, rel=1e-5)
        assert one["explained"] == (one["ratio"] <= made["explained_up_to"])
        assert (one["iso_18571"] or {}).get("overall") == pytest.approx(row.rating and row.rating.overall, rel=1e-5)


def test_derivatives_of_the_rates_agree_with_the_truth_where_the_class_passes():
    """Five points, Fourier and Lanczos through CFC180, each within three times its own noise of the true α: noise of
    the rate sensors behind a derivative cut at f is σ·2πf/√3 at most, f = 300 Hz, in 2·300 Hz of the rate."""
    made = simulate(parse_rig(preset_text("rgla")), "general", seed=3, imperfect=False)
    case = Case(made.recording)
    found = compare(case, "rgla", draws=2)
    sigma = case.condensed.sigma[3:].max()
    rms = sigma * 2 * np.pi * 300.0 / np.sqrt(3.0) * np.sqrt(2 * 300.0 / found.rate)
    true = np.stack([np.interp(found.time, made.truth.time, made.truth.alpha[:, i]) for i in range(3)], axis=1)
    for name in ("rgla", "rgla-fourier", "rgla-lanczos"):
        assert np.sqrt(((found.curves[name]["alpha"] - true)[20:-20] ** 2).mean()) < 3.0 * rms
    assert not np.array_equal(found.curves["rgla-fourier"]["alpha"], found.curves["rgla-lanczos"]["alpha"])


def test_harmonics_in_white_noise_are_counted_up_to_the_last_that_was_put_in():
    """Sine 30 stands at 20 σ√(2/N); √(2 ln N) of the noise is passed by less than one record in five at N = 400·3."""
    time = np.arange(401) * 1e-3
    clean = np.stack([np.sin(np.pi * 30 * time / 0.4), np.sin(np.pi * 7 * time / 0.4), 0 * time], axis=1)
    sigma = np.full(3, np.sqrt(400 / 2) / 20.0)
    counts = [
        rgla.signal_terms(clean + sigma * np.random.default_rng(seed).standard_normal(clean.shape), time, sigma)
        for seed in range(40)
    ]
    assert min(counts) == 30
    assert np.mean(np.array(counts) == 30) > 0.6
    assert rgla.signal_terms(0.0 * clean, time, sigma) == 1


# --- lines of the page ----------------------------------------------------------------------------------------------

DICHROMATS = {
    "all cones": (1, 0, 0, 0, 1, 0, 0, 0, 1),
    "protanope": (0.152286, 1.052583, -0.204868, 0.114503, 0.786281, 0.099216, -0.003882, -0.048116, 1.051998),
    "deuteranope": (0.367322, 0.860646, -0.227968, 0.280085, 0.672501, 0.047413, -0.011820, 0.042940, 0.968881),
    "tritanope": (1.255528, -0.076749, -0.178779, -0.078411, 0.930809, 0.147602, 0.004733, 0.691367, 0.303900),
}
"""Machado, Oliveira, Fernandes 2009, severity 1, of linear RGB."""
XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)


def linear(colour: str) -> np.ndarray:
    c = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    x = XYZ @ rgb / [0.95047, 1.0, 1.08883]
    f = np.where(x > (6 / 29) ** 3, np.cbrt(x), x / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize(("ground", "column"), [("#ffffff", 0), ("#14181c", 1)], ids=["light", "dark"])
@pytest.mark.parametrize("eyes", DICHROMATS)
def test_every_scheme_has_a_colour_of_its_own_for_all_eyes(ground, column, eyes):
    """3:1 against the ground (WCAG 2.1, 1.4.11); 2.3 in CIELAB is just noticeable (Mahy 1994), 9.2 is plain."""
    colours = [style[column] for style in scheme_styles.STYLES.values()]
    light = [float(XYZ[1] @ linear(colour)) + 0.05 for colour in (ground, *colours)]
    assert min(max(one / light[0], light[0] / one) for one in light[1:]) >= 3.0
    seen = [lab(np.clip(np.reshape(DICHROMATS[eyes], (3, 3)) @ linear(colour), 0.0, 1.0)) for colour in colours]
    apart = [float(np.linalg.norm(a - b)) for i, a in enumerate(seen) for b in seen[:i]]
    assert min(apart) > 4 * 2.3


def test_every_scheme_has_a_dash_pattern_of_its_own_and_a_place_in_a_chart(healthy):
    styles = scheme_styles.STYLES
    assert set(styles) == set(schemes_of(Case(healthy[0])))
    assert len({style.dash for style in styles.values()}) == len(styles)
    assert sorted(name for family in scheme_styles.FAMILIES for name in family) == sorted(styles)
    assert max(map(len, scheme_styles.groups(styles))) <= scheme_styles.MOST
    assert sorted(name for group in scheme_styles.groups(styles) for name in group) == sorted(styles)


def test_the_page_draws_every_scheme_in_its_own_line_and_its_sheet_is_allowed(healthy):
    recording, found = healthy
    page = render(found, recording)
    for name in found.curves:
        assert f"--scheme-{name}: {scheme_styles.STYLES[name].light}" in page
        drawn = re.findall(rf'<path class="line scheme-{name}( reference)?" d="M', page)
        assert len(drawn) == (2 * 24 if name == "map" else 2 * 12)  # in the chart, and the key to it
        assert all(bool(one) == (name == "map") for one in drawn)
    sheet = page.partition("<style>")[2].partition("</style>")[0]
    assert base64.b64encode(hashlib.sha256(sheet.encode()).digest()).decode() in page


def test_rates_alone_have_their_whole_record_smoother_beside_the_derivatives_of_hu():
    """α of the smoother against five points, Fourier and Lanczos, all of the same three rate sensors."""
    made = simulate(parse_rig(preset_text("rgla")), "general", seed=1)
    found = compare(Case(made.recording), draws=2)
    assert found.reference == "map"
    assert {"rgla", "rgla-fourier", "rgla-lanczos"} <= {row.scheme for row in found.rows if row.quantity == "alpha"}
    assert "smoother" in found.methods["map"]
    true = np.stack([np.interp(found.time, made.truth.time, a) for a in made.truth.alpha.T], axis=1)
    size = np.abs(true).max()
    assert np.sqrt(((found.curves["map"]["alpha"] - true) ** 2).mean()) < 0.1 * size


def test_each_recording_has_draws_of_its_own_and_always_the_same():
    """Drawn alike for all, a budget small by chance is small for every record: 1.63 for rms over ten, 8 draws."""
    from nineaudit.comparison import SEED, own_generator

    one, other = (Case(simulate(parse_rig(preset_text("naap-gyro")), "general", seed=s).recording) for s in (1, 2))
    first = own_generator(one, SEED).standard_normal(8)
    np.testing.assert_array_equal(first, own_generator(one, SEED).standard_normal(8))
    assert np.abs(first - own_generator(other, SEED).standard_normal(8)).min() > 0.0


@pytest.mark.slow
def test_differences_of_healthy_rates_are_as_large_as_their_budget(monkeypatch):
    """rms over 10 records of the ratio of ω of the rates against the fit: √(8/6) = 1.15 is expected of a variance that
    8 draws estimate; some 15 independent ratios, so 1.15·(1 ± 0.2)."""
    from nineaudit import comparison

    def two(case):
        return {name: run for name, run in schemes_of(case).items() if name in ("map", "rates")}

    monkeypatch.setattr(comparison, "schemes_of", two)
    rig = parse_rig(preset_text("naap-gyro"))
    found = [compare(Case(simulate(rig, "general", seed=s).recording), draws=8) for s in range(10)]
    ratios = [row.ratio for one in found for row in one.rows if row.quantity == "omega"]
    assert 0.75 < np.sqrt(np.mean(np.square(ratios))) < 1.55


def test_four_poles_are_offered_through_the_guard_of_the_classes():
    from nineaudit.curve_filter import CurveFilter, named

    case = Case(simulate(parse_rig(preset_text("rgla")), "general", seed=1).recording)
    found = compare(case, draws=2, other=named("four-pole:300"))
    assert found.filter.startswith("four-pole Butterworth at 300 Hz")
    assert found.cfc is None
    plain = compare(case, draws=2)  # CFC180 has no phase, −3 dB at 300 Hz too: four poles lag by about 2.61/(2π 300) s
    peaks = [float(np.argmax(np.abs(c.curves["rates"]["omega"][:, 0])) / c.rate) for c in (found, plain)]
    assert peaks[0] - peaks[1] == pytest.approx(2.61 / (2.0 * np.pi * 300.0), abs=2.0 / plain.rate)
    with pytest.raises(ConfigurationError, match="filtered twice"):
        compare(case, draws=2, other=CurveFilter("four-pole", 1600.0))
    with pytest.raises(ConfigurationError, match="--filter: unknown filter"):
        named("butter:300")


def test_a_comparison_of_torn_channels_is_refused_by_name():
    from dataclasses import replace

    one = simulate(parse_rig(preset_text("rgla")), "general", seed=1).recording
    readings = one.readings.copy()
    readings[900:1200, 0] = np.nan
    with pytest.raises(EstimationError, match="300 of 2251 samples missing"):
        compare(Case(replace(one, readings=readings, valid=np.isfinite(readings))), draws=2)


def test_channels_are_chosen_by_name():
    from nineaudit.commands import only_channels

    one = simulate(parse_rig(preset_text("naap-gyro")), "general", seed=1).recording
    assert only_channels(one, "a1y, gx").channels == ("a1y", "gx")
    assert only_channels(one, None) is one
    with pytest.raises(ConfigurationError, match=r"--channels: no such channel; found 'b'"):
        only_channels(one, "a1y,b")
