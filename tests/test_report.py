"""The HTML report: complete, honest about every rule, deterministic, and deaf to hostile names."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import nineaudit
from nineaudit import report
from nineaudit.array import frozen
from nineaudit.diagnose import Diagnosis, Status
from nineaudit.physics.spectrum import density
from nineaudit.provenance import Provenance
from nineaudit.recording import Damage
from nineaudit.report.axes import ticks, time_scale
from nineaudit.report.chart import Band, Chart, Flags, Level, Line
from nineaudit.report.decimate import columns_of, envelope, runs, strokes
from nineaudit.report.samples import COMPUTED, RECORDED, packed, packed_time, unpacked
from nineaudit.report.svg import SCALE, draw
from nineaudit.rig import parse_rig, preset_text
from nineaudit.simulate import parse_fault, simulate
from report_example import ambiguous, bus, example, healthy, on_a_bus

HOSTILE = "<script>alert(1)</script>\"'&{{7*7}}"


class Page(HTMLParser):
    """Tags with their attributes, and the visible text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self._hidden = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._hidden = tag in ("style", "script", "template")

    def handle_data(self, data: str) -> None:
        if not self._hidden:
            self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))

    def every(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module")
def page() -> Page:
    return Page(report.render(on_a_bus(example())))


# ---- what the page says ---------------------------------------------------------------------------------------


def test_verdict_culprit_and_next_best_stand_first(page: Page) -> None:
    head = page.text[: page.text.index("Identification Not stated: Test number, test item,")]
    assert "Channel a1y is at fault: clipping, probability 0.98." in head
    assert "Next best candidate: a2x" in head
    assert "peak α" in head
    assert "8120" in head
    assert "5260" in head


def test_every_rule_and_every_verdict_is_there(page: Page) -> None:
    audit = example()
    assert {t["id"] for t in page.every("tbody") if "id" in t} == {f.rule for f in audit.findings}
    for verdict in {str(f.verdict).replace("_", " ") for f in audit.findings}:
        assert re.search(rf"[✓✕!?~·] {verdict}\b", page.text), verdict


def test_every_channel_of_a_rule_is_there(page: Page) -> None:
    assert "9 results: 1 warn, 8 pass of ZO301" in page.text
    assert sum(t == {"class": "each"} for t in page.every("table")) == 1


def test_original_is_said_to_be_unaltered_with_its_hash(page: Page) -> None:
    assert "The original recording is not altered" in page.text
    assert example().recording.source.sha256 in page.text
    assert "same bytes before and after reading" in page.text


def test_a_recording_that_changed_while_read_is_said_so() -> None:
    audit = example(201)
    source = replace(audit.recording.source, unchanged_after_read=False)
    changed = replace(audit, recording=replace(audit.recording, source=source))
    assert "CHANGED while it was read" in report.render(changed)


def test_a_group_is_not_a_culprit() -> None:
    text = Page(report.render(ambiguous())).text
    assert "The fault is in a1y or a2x, probability > 0.99; this motion cannot tell them apart." in text
    assert "Rebuilt channel" not in text


def test_a_pass_says_what_it_means() -> None:
    text = Page(report.render(healthy())).text
    assert "Uncertainty budget" not in text
    assert "Every identifier" not in text
    assert "can tell apart" not in text
    assert "No channel contradicts the others." in text
    assert "A lasting shift of 0.8 g in any channel would have shown." in text
    assert "Motion of the body" not in text


def test_budget_names_its_largest_contributors(page: Page) -> None:
    assert "Most of it is alignment and noise." in page.text
    assert re.search(r"Source u Share of u² Share as a bar alignment 142.rad/s² 72 %", page.text)


def test_map_names_the_channels_that_cannot_be_told_apart(page: Page) -> None:
    assert "Hardest to tell apart: a1z and a3x (never)." in page.text
    cells = [td for td in page.every("td") if (td.get("class") or "").startswith("n apart-")]
    assert len(cells) == 81
    assert sum(td["class"] == "n apart-3" for td in cells) == 2
    assert sum(td["class"] == "n apart-none" for td in cells) == 9


def test_hypotheses_are_drawn_with_what_they_leave(page: Page) -> None:
    assert "What each hypothesis leaves unexplained: least 1.08, a1y: clipping; the limit is 1.31." in page.text
    assert "no channel at fault 913" in page.text


def test_calibration_has_zeros_and_what_the_fit_found(page: Page) -> None:
    rows = page.text[page.text.index("Zero taken off Gain, %") :]
    assert re.search(r"a0x 0.g \+1.50 ± 0.35 \*", rows)
    assert re.search(r"a1y 0.15.g – – – – – – – –", rows)


def test_bus_damage_waivers_and_origin_are_told(page: Page) -> None:
    for words in (
        "0x24 KINEMATICS 1 yes 2001",
        "A0X_CNT: 3 numbers missing; A0X_CNT: 1 numbers repeated; A0X_CRC: 2 checksums wrong; "
        "A0X: 4 values outside -500 to 500 g; A0X: 5 times not available; 1 frame longer",
        "0x00000123 not in the database",
        "Never came: STATUS.",
        "T0001.blf byte 4711 an object that does not begin with LOBJ 3 about 12 frames",
        "RQ101 a2z 0.02 known gap of logger 7 A. Example, 2026-01-02 2030-01-01",
        "Command nineaudit check tests/T0001.blf --rig rigs/head.toml",
        "UB401 not evaluated the normal matrix is singular",
    ):
        assert words in page.text, words


def test_method_is_ready_to_paste_with_its_references(page: Page) -> None:
    text = page.text[page.text.index("Method The recording T0001.blf") :]
    assert example().recording.source.sha256 in text
    assert "“nine accelerometers" in text
    assert "Repair: a1y was rebuilt from the other channels at" in text
    assert "JCGM 106:2012" in text
    assert "Takhounts E. G." in text
    assert "compliant" not in page.text.lower()


def test_review_says_what_was_reviewed(page: Page) -> None:
    (form,) = page.every("form")
    about = json.loads(form["data-about"] or "")
    assert about["sha256"] == [example().recording.source.sha256]
    assert about["channels"] == ["a1y"]
    assert page.text.rstrip().endswith(f"End of report {about['report']}")


def test_undiagnosed_gives_its_reason() -> None:
    audit = replace(healthy(), verdict="inconclusive", diagnosis=Diagnosis(Status.UNDIAGNOSED, (), (), "no redundancy"))
    assert "No culprit named: no redundancy." in Page(report.render(audit)).text


def test_report_number_is_of_what_the_report_rests_on() -> None:
    def numbers(audit: Any) -> str:
        found = re.search(r"Report number</dt><dd>([0-9a-f]{12})<", report.render(audit))
        assert found
        return found[1]

    audit = example(201)
    other = replace(audit, tool={**audit.tool, "version": "0.2.0"})
    assert numbers(audit) == numbers(example(201)) != numbers(other)


def test_a_real_audit_has_what_reports_ask_of_it() -> None:
    rig = parse_rig(preset_text("naap-3222"))
    made = simulate(rig, "general", faults=(parse_fault("a1y:clipping=0.5"),), seed=1)
    audit = nineaudit.audit(made.recording)
    text = Page(report.render(audit)).text
    assert "Channel a1y is at fault: clipping" in text
    assert text.count("named by the diagnosis") == 1
    Draft202012Validator(report.result_schema()).validate(report.result_document(audit))
    assert {f["rule"] for f in report.result_document(audit)["findings"]} == set(audit.rulebook.codes)


def test_what_an_audit_says_of_calibration_and_of_pairs() -> None:
    rig = parse_rig(preset_text("naap-3222"))
    audit = nineaudit.audit(simulate(rig, "general", seed=3).recording)
    found, apart = audit.calibration, audit.apart
    assert found is not None
    assert apart is not None
    assert np.nanmax(found.u / found.prior) <= 1.0 + 1e-9  # data never widen a prior
    assert np.nanmax(np.abs(found.value / found.prior)) < 4.5
    assert np.isnan(np.diag(apart)).all()
    assert np.nanmin(apart) >= 1.0
    names = audit.recording.channels
    assert {names[i] for i in np.unravel_index(np.nanargmax(apart), apart.shape)} == {"a1z", "a3x"}  # twins: METHODS 3
    attitude = audit.attitude
    assert attitude is not None
    assert np.allclose(np.einsum("nij,nkj->nik", attitude, attitude), np.eye(3))


# ---- form -----------------------------------------------------------------------------------------------------


def test_same_audit_same_bytes() -> None:
    assert report.render(example(501)) == report.render(example(501))


def test_nothing_is_fetched_and_only_the_packages_script_runs(page: Page) -> None:
    assert not {"link", "img", "iframe", "object", "base", "embed"} & {tag for tag, _ in page.tags}
    assert page.every("script") == [{}]
    for tag, attributes in page.tags:
        assert not [name for name in attributes if name.startswith("on") or name in ("style", "action")], tag
        for name in ("src", "href", "xlink:href"):
            assert (attributes.get(name) or "#").startswith("#"), tag


def test_policy_lets_in_just_the_style_and_the_script_of_the_page() -> None:
    text = report.render(example(201))
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)
    assert policy
    allowed = dict(part.strip().split(" ", 1) for part in policy[1].replace("&#39;", "'").split(";"))
    assert allowed.pop("default-src") == allowed.pop("base-uri") == allowed.pop("form-action") == "'none'"
    for kind, tag in (("script-src", "script"), ("style-src", "style")):
        (inside,) = re.findall(rf"<{tag}>(.*?)</{tag}>", text, flags=re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(inside.encode()).digest()).decode()
        assert allowed.pop(kind) == f"'sha256-{digest}'"
    assert allowed == {}


def test_structure_for_people_who_listen(page: Page) -> None:
    assert [t for t, _ in page.tags].count("h1") == 1
    levels = [int(tag[1]) for tag, _ in page.tags if re.fullmatch(r"h[1-6]", tag)]
    assert all(b - a <= 1 for a, b in pairwise(levels))
    assert page.every("html")[0]["lang"] == "en"
    assert len(page.every("table")) == len(page.every("caption"))
    assert all("scope" in th for th in page.every("th"))
    charts = [s for s in page.every("svg") if s.get("role") == "img"]
    ids = [a["id"] for _, a in page.tags if "id" in a]
    assert len(ids) == len(set(ids))
    for chart in charts:
        assert set((chart["aria-labelledby"] or "").split()) <= set(ids)
    assert len(charts) == 2 * 9 + 3 + 3 + 3 + 1 + 4
    targets = {(a["href"] or "")[1:] for a in page.every("a")}
    assert targets <= set(ids)


@pytest.mark.parametrize("where", ["channel", "rig", "path", "bus", "waiver", "command", "damage", "note"])
def test_hostile_names_are_only_text(where: str) -> None:
    page = Page(report.render(hostile(where)))
    assert HOSTILE in page.text
    assert page.every("script") == [{}]
    assert "49" not in page.text.replace(HOSTILE, "").split()
    for plot in page.every("div"):
        json.loads(plot.get("data-plot") or "{}")


@pytest.mark.parametrize("where", ["channel", "rig", "path"])
def test_hostile_names_do_not_break_machine_outputs(where: str) -> None:
    audit = hostile(where)
    document = report.result_document(audit)
    assert json.loads(report.to_json(document)) == document
    assert ElementTree.fromstring(report.junit([audit])).tag == "testsuites"


def hostile(where: str) -> Any:
    """The example with a name that is a script in one place where a file may put one."""
    text = preset_text("naap-3222")
    toml = HOSTILE.replace('"', '\\"')
    if where == "rig":
        text = re.sub(r'name = "nine[^"]*"', f'name = "{toml}"', text)
    audit = example(201, rig_text=text, path=f"runs/{HOSTILE}.blf" if where == "path" else "runs/T.blf")
    source = audit.recording.source
    changed = {
        "bus": {"recording": replace(audit.recording, bus=bus(HOSTILE, HOSTILE, HOSTILE))},
        "waiver": {"waivers": (replace(audit.waivers[0], reason=HOSTILE, approved_by=HOSTILE, channels=(HOSTILE,)),)},
        "command": {"command": HOSTILE},
        "damage": {"recording": replace(audit.recording, source=replace(source, damage=(Damage(HOSTILE, HOSTILE),)))},
        "note": {"recording": replace(audit.recording, source=replace(source, notes=(HOSTILE,)))},
    }
    audit = replace(audit, **changed.get(where, {}))
    return _renamed(audit, HOSTILE) if where == "channel" else audit


def _renamed(audit: Any, name: str) -> Any:
    """The audit with its culprit under another name."""
    rig = audit.recording.rig
    sensors = tuple(replace(s, channel=name) if s.channel == "a1y" else s for s in rig.array.sensors)
    array = type(rig.array)(sensors)
    recording = replace(audit.recording, rig=replace(rig, array=array))
    best = replace(audit.diagnosis.candidates[0], channels=(name,))
    diagnosis = replace(
        audit.diagnosis,
        channels=(name,),
        candidates=(best, *audit.diagnosis.candidates[1:]),
        smallest_detectable={name: 1.0},
        smallest_isolable={name: 2.0},
    )
    finding = replace(audit.findings[1], channels=(name,), reason=f"{name} is flat", measure=None)
    return replace(
        audit,
        recording=recording,
        diagnosis=diagnosis,
        findings=(finding,),
        reconstruction=replace(audit.reconstruction, channels=(name,)),
        flagged={name: audit.flagged["a1y"]},
    )


def test_nine_channels_of_twenty_thousand_samples_are_small() -> None:
    assert len(report.render(example(20_000)).encode()) < 3_000_000


def test_worst_case_of_flags_and_noise_is_small() -> None:
    audit = example(20_000)
    everything = {c: np.ones(20_000, dtype=bool) for c in audit.recording.channels}
    rng = np.random.default_rng(1)
    recording = replace(audit.recording, readings=rng.standard_normal((20_000, 9)))
    assert len(report.render(replace(audit, recording=recording, flagged=everything)).encode()) < 3_000_000


@pytest.mark.parametrize("samples", [2, 3])
def test_records_of_a_few_samples(samples: int) -> None:
    audit = healthy(401)
    recording = replace(
        audit.recording,
        time=audit.recording.time[:samples],
        readings=audit.recording.readings[:samples],
        valid=audit.recording.valid[:samples],
    )
    assert "End of report" in report.render(replace(audit, recording=recording))


def test_a_channel_without_a_valid_sample() -> None:
    audit = healthy(201)
    readings = audit.recording.readings.copy()
    readings[:, 2] = np.nan
    text = report.render(replace(audit, recording=replace(audit.recording, readings=readings)))
    assert "no valid sample" in text
    assert "nan" not in text.lower().split()


def test_forty_eight_channels_are_small() -> None:
    sensors = [
        f'[[sensor]]\nchannel = "c{k}"\nkind = "accelerometer"\nposition = [{5 * k}, {k}, {3 * k}]\n'
        f"axis = [{k % 2}, 1, 0.5]\n"
        for k in range(48)
    ]
    text = '[rig]\nname = "large"\n[units]\nlength = "mm"\nacceleration = "g_0"\n' + "\n".join(sensors)
    assert len(report.render(example(20_000, rig_text=text)).encode()) < 12_000_000


# ---- samples for the script -----------------------------------------------------------------------------------


@pytest.mark.parametrize("steps", [COMPUTED, RECORDED])
def test_samples_come_back_within_half_a_step(steps: int) -> None:
    _, values = curve(5_000, 8)
    values[100:200] = np.nan
    data = packed(values, steps)
    again = unpacked(data)
    assert np.array_equal(np.isnan(again), np.isnan(values))
    assert np.nanmax(np.abs(again - values)) <= 0.5 * data.step * (1 + 1e-9)
    assert data.step * steps == pytest.approx(np.ptp(values[np.isfinite(values)]), rel=1e-3)
    assert data == packed(values.copy(), steps)


@pytest.mark.parametrize("values", [np.full(7, 3.25), np.full(7, np.nan), np.array([0.0]), np.array([-1e9, 1e-9, 1e9])])
def test_flat_and_empty_samples(values: np.ndarray) -> None:
    data = packed(values)
    assert unpacked(data) == pytest.approx(values, abs=0.5 * data.step, nan_ok=True)


def test_time_stamps_come_back_with_their_jitter_and_gaps() -> None:
    rng = np.random.default_rng(3)
    time = 1.7e9 + np.cumsum(np.where(np.arange(3_000) == 1_000, 2.0, 1e-3) + 1e-5 * rng.random(3_000))
    data = packed_time(time)
    assert np.abs(unpacked(data) - data.middle - (time - time[0])).max() <= 0.5 * data.step * 1.001 + 1e-6
    assert data.step == pytest.approx(1e-6, rel=0.02)


def test_every_plot_over_time_can_be_zoomed_and_says_its_step(page: Page) -> None:
    plots = [json.loads(div["data-plot"]) for div in page.every("div") if "data-plot" in div]
    stored = {t["id"] for t in page.every("template")}
    assert len(plots) == 9 + 3 + 3 + 2
    for plot in plots:
        assert {s["key"] for s in (plot["time"], *plot["lines"])} <= stored
    assert page.text.count("(zoom in steps of") == len(plots)
    flagged = next(plot for plot in plots if plot["title"] == "a1y as recorded")["flags"]
    assert sum(last - first + 1 for first, last in flagged) == example().flagged["a1y"].sum()


def test_density_of_white_noise_and_of_a_tone() -> None:
    rng = np.random.default_rng(5)
    noise = rng.standard_normal(100_000)
    f, d = density(noise, 10_000.0)
    assert np.mean(d**2) == pytest.approx(2.0 / 10_000.0, rel=0.02)  # one-sided: variance over half the rate
    tone = np.sin(2 * np.pi * 500.0 * np.arange(100_000) / 10_000.0)
    f, d = density(tone, 10_000.0)
    assert f[np.argmax(d)] == pytest.approx(500.0, abs=10.0)
    assert np.sum(d**2) * (f[1] - f[0]) == pytest.approx(0.5, rel=0.01)  # Parseval


# ---- writing --------------------------------------------------------------------------------------------------


def test_write_leaves_one_whole_file(tmp_path: Path) -> None:
    path = report.write_report(example(201), tmp_path / "T0001.html")
    assert path.read_text(encoding="utf-8") == report.render(example(201))
    assert list(tmp_path.iterdir()) == [path]


def test_write_that_fails_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "T0001.html"
    path.write_text("old")

    def refuse(_: Path, target: Path) -> None:
        raise PermissionError(str(target))

    monkeypatch.setattr("os.replace", refuse)
    with pytest.raises(PermissionError):
        report.write_report(example(201), path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


# ---- figures: laws of the decimation --------------------------------------------------------------------------


def curve(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    values = np.cumsum(rng.standard_normal(n))
    values[rng.integers(0, n, 3)] += 50.0 * rng.standard_normal(3)  # spikes that LTTB would lose
    return np.linspace(-1.0, 2.0, n), values


@pytest.mark.parametrize(("n", "columns"), [(20_000, 900), (5_000, 600), (1_801, 900), (700, 900)])
def test_decimation_keeps_the_envelope_of_every_column(n: int, columns: int) -> None:
    time, values = curve(n, 3)
    column = columns_of(time, (time[0], time[-1]), columns)
    kept = np.concatenate(strokes(time, values, column))
    assert len(kept) <= 2 * columns
    assert np.all(np.diff(kept) > 0)
    for c in np.unique(column):
        inside, drawn = values[column == c], values[kept[column[kept] == c]]
        assert drawn.min() == inside.min()
        assert drawn.max() == inside.max()


def test_decimation_breaks_at_missing_samples_and_gaps_of_the_clock() -> None:
    time, values = curve(20_000, 4)
    values[4_000:4_500] = np.nan
    late = np.where(np.arange(20_000) >= 12_000, time + 0.3, time)
    column = columns_of(late, (late[0], late[-1]), 900)
    pieces = strokes(late, values, column)
    assert [p[-1] < 4_000 for p in pieces] == [True, False, False]
    assert pieces[1][0] >= 4_500
    assert pieces[1][-1] < 12_000 <= pieces[2][0]


def test_a_lone_sample_is_still_a_stroke() -> None:
    time = np.linspace(0.0, 1.0, 11)
    values = np.full(11, np.nan)
    values[5] = 1.0
    assert [p.tolist() for p in strokes(time, values, columns_of(time, (0.0, 1.0), 100))] == [[5]]
    assert strokes(time, np.full(11, np.nan), columns_of(time, (0.0, 1.0), 100)) == []


def test_band_holds_every_sample_of_both_edges() -> None:
    time, middle = curve(20_000, 5)
    column = columns_of(time, (time[0], time[-1]), 300)
    lower, upper = middle - 1.0, middle + 2.0
    ((at, low, high),) = envelope(lower, upper, column)
    assert at.tolist() == list(range(300))
    assert np.all(low[column] <= lower)
    assert np.all(high[column] >= upper)


def test_runs() -> None:
    assert runs(np.array([True, True, False, True])) == [(0, 1), (3, 3)]
    assert runs(np.zeros(3, dtype=bool)) == []


def chart(n: int = 5_000, **changes: Any) -> Chart:
    time, values = curve(n, 6)
    plain = Chart("k", "Title", "What it shows.", time, "g", (Line(values, "measured", "a"),))
    return replace(plain, **changes)


def test_drawn_path_reaches_the_extremes_to_a_tenth_of_a_pixel() -> None:
    plot = chart(flags=())
    found = re.search(r'class="line measured" d="([^"]+)"', draw(plot))
    assert found
    points = []
    for piece in found[1].split("M")[1:]:
        start, steps = piece.split("l")
        moves = np.array(steps.split(), dtype=int).reshape(-1, 2)
        points.append(np.array(start.split(), dtype=int) + np.vstack([[0, 0], np.cumsum(moves, axis=0)]))
    y = np.concatenate(points)[:, 1]
    values = plot.lines[0].values
    pad = 0.06 * np.ptp(values)
    expected = plot.height * SCALE * pad / (np.ptp(values) + 2 * pad)
    assert y.min() == pytest.approx(expected, abs=1.0)
    assert plot.height * SCALE - y.max() == pytest.approx(expected, abs=1.0)


@pytest.mark.parametrize("n", [300, 20_000])
def test_every_flagged_sample_is_drawn(n: int) -> None:
    time, values = curve(n, 7)
    mask = np.random.default_rng(2).random(n) < 0.01
    plot = chart(n, lines=(Line(values, "measured", "a"),), flags=(Flags(values, mask, "flagged"),))
    found = re.search(r'class="flag" d="([^"]+)"', draw(plot))
    assert found
    drawn = {tuple(map(int, p.removesuffix("h0").split())) for p in found[1].split("M")[1:]}
    low, high = values.min(), values.max()
    pad = 0.06 * (high - low)
    x = np.rint((time - time[0]) / (time[-1] - time[0]) * 9000)[mask]
    y = np.rint((high + pad - values) / (high - low + 2 * pad) * 2000)[mask]
    reached = np.array(sorted(drawn), dtype=float)
    for point in np.stack([x, y], axis=1):
        assert np.abs(reached - point).max(axis=1).min() <= SCALE


def test_chart_text_is_escaped_and_levels_out_of_sight_are_left_out() -> None:
    text = draw(chart(title=HOSTILE, unit="<g>", levels=(Level(1e9, "range"), Level(0.0, "<zero>"))))
    assert "<script" not in text
    assert "&lt;g&gt;" in text
    assert "&lt;zero&gt;" in text
    assert ">range<" not in text


def test_flat_and_empty_curves_can_be_drawn() -> None:
    time = np.linspace(0.0, 1.0, 50)
    for values in (np.zeros(50), np.full(50, 7.0), np.full(50, np.nan)):
        band = Band(values, values, "band", "b")
        text = draw(Chart("k", "t", "d", time, "g", (Line(values, "measured", "", name_at_peak=True),), (band,)))
        assert "nan" not in text


@pytest.mark.parametrize(("low", "high"), [(-1.0, 1.0), (0.013, 0.47), (-3900.0, 3200.0), (1e6, 1.1e6), (-0.02, 0.18)])
@pytest.mark.parametrize("about", [4, 6, 9])
def test_ticks_are_round_inside_and_enough(low: float, high: float, about: int) -> None:
    found = ticks(low, high, about)
    assert 3 <= len(found) <= 3 * about
    assert low - 1e-9 * abs(low) <= found[0] <= found[-1] <= high * (1 + 1e-9)
    step = found[1] - found[0]
    assert min(abs(step / 10 ** np.floor(np.log10(step) + 1e-9) - m) for m in (1, 2, 5)) < 1e-6


def test_time_axis_counts_from_zero_unless_the_clock_is_far_away() -> None:
    assert time_scale(np.array([-0.02, 0.18])) == (0.0, 1e-3, "time, ms")
    assert time_scale(np.array([0.0, 60.0]))[1:] == (1.0, "time, s")
    origin, _, label = time_scale(1.7e9 + np.array([0.0, 10.0]))
    assert origin == 1.7e9
    assert "since the first sample" in label


def test_a_recording_without_a_quiet_interval_has_a_report() -> None:
    made = simulate(parse_rig('[rig]\npreset = "naap-3222"\n'), "general", seed=1).recording
    cut = frozen(made.time[600:])
    native = tuple(replace(trace, time=cut, values=frozen(trace.values[600:])) for trace in made.native)
    moving = replace(made, time=cut, readings=frozen(made.readings[600:]), valid=made.valid[600:], native=native)
    done = nineaudit.audit(moving)
    assert done.rest is None
    assert "No quiet interval was found or stated: no zero was taken off." in report.render(done)


def mended_page(fault: str) -> tuple[nineaudit.Audit, str]:
    rig = parse_rig(preset_text("naap-3222"))
    done = nineaudit.audit(simulate(rig, "general", faults=[fault], seed=2).recording)
    assert done.reconstruction is not None
    return done, Page(report.render(done)).text


def test_a_shift_that_was_undone_is_not_called_rebuilt() -> None:
    done, text = mended_page("a2x:zero_shift=20")
    assert done.reconstruction is not None
    assert done.reconstruction.fault == "zero_shift"
    assert "Corrected channel The original recording is not altered. The channel was not rebuilt:" in text
    assert "only the zero shift was undone" in text
    assert "estimate from the other channels" not in text
    assert "Rebuilt" not in text
    verdict = text[: text.index("Identification Not stated")]
    assert "Repair: in a2x the zero shift was undone at" in verdict


def test_a_clipped_channel_is_called_rebuilt_and_the_verdict_says_so() -> None:
    done, text = mended_page("a1y:clipping=0.5")
    assert done.reconstruction is not None
    assert done.reconstruction.fault is None
    assert "Rebuilt channel The original recording is not altered." in text
    verdict = text[: text.index("Identification Not stated")]
    count = int(done.reconstruction.replaced.sum())
    assert f"Repair: a1y was rebuilt from the other channels at {count} of 2251 samples." in verdict
    assert done.motion is not None
    assert f"every channel at its word ({done.motion.method})" in text


def test_channels_that_an_earlier_repair_made_are_named_in_the_verdict() -> None:
    done = healthy()
    record = {
        "original": {"sha256": "0" * 64}, "channels": ["a1y"], "method": "rebuilt", "donors": [], "samples_replaced": 3,
    }  # fmt: skip
    source = replace(done.recording.source, provenance=Provenance(record, "beside"))
    text = Page(report.render(replace(done, recording=replace(done.recording, source=source)))).text
    assert (
        "Not as measured in this recording: a1y, by an earlier repair."
        in text[: text.index("Identification Not stated")]
    )
