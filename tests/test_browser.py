"""The report in a real browser, from disk, with the network off: complete, silent, legible in every dress."""

from __future__ import annotations

import json
import os
import re
import shutil
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nineaudit import report
from nineaudit.recording import Damage
from nineaudit.units import G0
from report_example import bus, example, on_a_bus

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
ARGUMENTS = ("--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--force-color-profile=srgb")

CHARTS = 2 * 9 + 3 + 3 + 3
"""Raw curves and spectra of nine channels, a rebuilt channel, constraints, motion."""
AXE = Path(__file__).parent / "vendor" / "axe-core" / "axe.min.js"
WCAG = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"]

CONTRAST = """() => {
  const parse = c => { const m = c.match(/[\\d.]+/g).map(Number); return m.length > 3 ? m : [...m, 1]; };
  const channel = v => { v /= 255; return v <= .03928 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4; };
  const luminance = c => .2126 * channel(c[0]) + .7152 * channel(c[1]) + .0722 * channel(c[2]);
  const ground = node => {
    for (let n = node; n; n = n.parentElement) {
      const c = parse(getComputedStyle(n).backgroundColor);
      if (c[3] === 1) return c;
    }
    return [255, 255, 255, 1];
  };
  const poor = [];
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const node = walk.currentNode.parentElement;
    if (!walk.currentNode.data.trim() || !node.checkVisibility()) continue;
    const style = getComputedStyle(node), isSvg = node instanceof SVGElement;
    const a = luminance(parse(isSvg ? style.fill : style.color)), b = luminance(ground(node));
    const ratio = (Math.max(a, b) + .05) / (Math.min(a, b) + .05);
    const size = parseFloat(style.fontSize);
    if (ratio < 4.5 || size < 11) poor.push([walk.currentNode.data.trim().slice(0, 30), ratio, size]);
  }
  return poor;
}"""
"""Visible texts with a contrast below 4.5 (WCAG 2.2, 1.4.3) or smaller than 11 px."""

INK = """() => [...document.querySelectorAll('svg.chart')].map(chart => {
  const box = chart.getBoundingClientRect();
  const drawn = [...chart.querySelectorAll('path.line')].map(p => [p.getTotalLength(), getComputedStyle(p).stroke]);
  return [box.width, box.height, Math.max(0, ...drawn.map(d => d[0])), drawn.every(d => d[1] !== 'none')];
})"""
"""Per chart: its size on the screen, the length of its longest curve, and that every curve has a colour."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    executable = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if executable is None:
        told = f"no Chromium on this machine (looked for {', '.join(BROWSERS)})"
        (pytest.fail if os.environ.get("CI") else pytest.skip)(told)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=executable, args=list(ARGUMENTS))
        yield started
        started.close()


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return report.write_report(on_a_bus(example(4001)), tmp_path_factory.mktemp("report") / "T0001.html")


Opener = Callable[..., Any]


@pytest.fixture
def opened(browser: Any, file: Path) -> Iterator[Opener]:
    """Opens the report offline; at the end nothing but the file was asked for, and nothing was complained of."""
    contexts, asked, said = [], [], []

    def start(width: int = 1280, **options: Any) -> Any:
        context = browser.new_context(viewport={"width": width, "height": 900}, offline=True, **options)
        contexts.append(context)
        page = context.new_page()
        page.on("request", lambda request: asked.append(request.url))
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(file.as_uri())
        return page

    yield start
    for context in contexts:
        context.close()
    assert asked == [file.as_uri()] * len(contexts)
    assert said == []


def test_every_figure_has_ink(opened: Opener) -> None:
    charts = opened().evaluate(INK)
    assert len(charts) == CHARTS
    for width, height, longest, coloured in charts:
        assert width > 250
        assert height > 100
        assert longest > 1000
        assert coloured


def test_complete_without_script(opened: Opener) -> None:
    page = opened(java_script_enabled=False)
    assert page.locator("svg.chart").count() == CHARTS
    assert page.locator("svg.view").count() == 4
    assert not page.locator("button").first.is_visible()
    assert page.locator("#verdict h2").inner_text().strip().endswith("Fail")
    page.locator("#ZO301 summary").click()
    assert page.locator("#ZO301 table.each tbody tr").first.is_visible()


def test_flagged_samples_are_painted(opened: Opener) -> None:
    """Strokes of no length show only as round caps: look at the pixels."""
    page = opened()
    figure = page.locator("figure.marked svg.chart")
    figure.scroll_into_view_if_needed()
    page.evaluate("document.querySelectorAll('.zoom-open').forEach(e => e.remove())")
    with_flags = figure.screenshot()
    page.evaluate("document.querySelectorAll('.flag').forEach(e => e.remove())")
    assert figure.screenshot() != with_flags


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_legible(opened: Opener, scheme: str, width: int) -> None:
    page = opened(width, color_scheme=scheme)
    page.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    assert page.evaluate(CONTRAST) == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert all(chart[0] <= width for chart in page.evaluate(INK))
    ends = page.locator("caption").evaluate_all("all => all.map(c => c.getBoundingClientRect().right)")
    assert max(ends) <= width  # to be read without scrolling the table


def test_dark_is_dark(opened: Opener) -> None:
    ground = "getComputedStyle(document.documentElement).backgroundColor"
    assert opened(color_scheme="dark").evaluate(ground) != opened(color_scheme="light").evaluate(ground)


def test_print_shows_every_plot_and_every_result(opened: Opener, tmp_path: Path) -> None:
    page = opened(700, color_scheme="dark")
    page.emulate_media(media="print")
    assert page.evaluate("getComputedStyle(document.documentElement).backgroundColor") == "rgb(255, 255, 255)"
    assert all(height > 100 for _, height, _, _ in page.evaluate(INK))
    rows = page.locator("table.each tbody tr")
    assert all(rows.nth(i).bounding_box()["height"] > 5 for i in range(rows.count()))
    pdf = page.pdf(path=str(tmp_path / "report.pdf"), format="A4", tagged=True)
    titles = page.locator("svg[role=img] > title").evaluate_all("all => all.map(t => t.textContent)")
    assert len(titles) == CHARTS + 1 + 4
    named = alternatives(pdf)
    assert [title for title in titles if not any(told.startswith(title) for told in named)] == []
    assert strokes(pdf) > page.locator("path.line").count()


def alternatives(pdf: bytes) -> list[str]:
    """What a tagged PDF says for its figures: each that it shows has one."""
    written = re.findall(rb"/Alt (?:<([0-9A-F]+)>|\(((?:[^\\)]|\\.)*)\))", pdf)
    found = [bytes.fromhex(u.decode()).decode("utf-16") if u else plain.decode("latin-1") for u, plain in written]
    return [re.sub(r"\\(.)", r"\1", told) for told in found]


def strokes(pdf: bytes) -> int:
    """How many paths its pages stroke."""
    streams = re.findall(rb"/FlateDecode[^>]*>>\s*stream\r?\n(.*?)\r?\nendstream", pdf, flags=re.DOTALL)
    return sum(len(re.findall(rb"^S$", zlib.decompress(s), flags=re.MULTILINE)) for s in streams)


def ink_of_zoom(page: Any) -> int:
    """How many pixels of the zoomed plot's canvas are painted."""
    count = """canvas => { const c = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
      let n = 0; for (let i = 3; i < c.length; i += 4) n += c[i] > 0; return n; }"""
    return int(page.locator(".zoom-area canvas").evaluate(count))


def zoomed(page: Any, title: str) -> Any:
    """The plot of that name, opened for zooming."""
    page.get_by_role("button", name=f"Zoom into {title}", exact=True).click()
    page.locator(".is-zoomed .u-over").wait_for()
    return page.locator(".is-zoomed")


def shown(plot: Any) -> tuple[float, float]:
    """First and last time in sight, ms, as the page says it."""
    found = re.match(r"shown: (\S+) to (\S+);", plot.locator(".zoom-said").inner_text().replace("−", "-"))
    assert found
    return float(found[1]), float(found[2])


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_plot_over_time_can_be_zoomed(opened: Opener, scheme: str) -> None:
    page = opened(color_scheme=scheme)
    buttons = page.locator(".zoom-open")
    assert buttons.count() == CHARTS - 9 - 1  # not the spectra, not what is a closer look already
    for k in range(buttons.count()):
        buttons.nth(k).dblclick()
        page.locator(".is-zoomed .u-over").nth(k).wait_for(state="attached")
    assert page.locator(".is-zoomed").count() == buttons.count()
    for k in range(buttons.count()):
        assert page.locator(".zoom-area canvas").nth(k).evaluate("c => c.width * c.height") > 10_000


def test_zoom_and_pan_by_buttons_and_by_mouse(opened: Opener) -> None:
    page = opened()
    plot = zoomed(page, "a1y as recorded")
    assert shown(plot) == (-20.0, 180.0)
    assert ink_of_zoom(page) > 1000
    whole = plot.locator("canvas").screenshot()
    page.keyboard.press("Enter")  # the first button has the focus
    assert shown(plot) == (30.0, 130.0)
    assert plot.locator("canvas").screenshot() != whole
    plot.get_by_role("button", name="Later").click()
    assert shown(plot) == (80.0, 180.0)
    plot.get_by_role("button", name="Whole record").click()
    assert shown(plot) == (-20.0, 180.0)
    plot.scroll_into_view_if_needed()
    over = plot.locator(".u-over").bounding_box()
    left, width, y = over["x"], over["width"], over["y"] + over["height"] / 2
    page.mouse.move(left + 0.25 * width, y)
    page.mouse.down()
    page.mouse.move(left + 0.75 * width, y, steps=4)
    page.mouse.up()
    page.mouse.move(5, 5)
    assert shown(plot) == pytest.approx((30.0, 130.0), abs=1.0)
    page.keyboard.down("Shift")
    page.mouse.move(left + 0.5 * width, y)
    page.mouse.down()
    page.mouse.move(left + 0.7 * width, y, steps=4)
    page.mouse.up()
    page.keyboard.up("Shift")
    page.mouse.move(5, 5)
    assert shown(plot) == pytest.approx((10.0, 110.0), abs=1.5)
    plot.get_by_role("button", name="Close").click()
    assert page.locator(".is-zoomed").count() == 0
    assert page.locator("figure.marked svg.chart").is_visible()


def test_the_script_has_the_samples_that_were_recorded(opened: Opener) -> None:
    """Under the cursor stands the value of the recording to the step that the caption states."""
    page = opened()
    plot = zoomed(page, "a1y as recorded")
    plot.scroll_into_view_if_needed()
    over = plot.locator(".u-over").bounding_box()
    page.mouse.move(over["x"] + 0.33 * over["width"], over["y"] + 20)
    page.mouse.move(over["x"] + 0.34 * over["width"], over["y"] + 25)
    plot.locator(".zoom-said", has_text="(time, ms)").wait_for()
    told = plot.locator(".zoom-said").inner_text().replace("−", "-")
    found = re.match(r"(\S+) \(time, ms\): (\S+) g$", told)
    assert found
    recording = example(4001).recording
    at = int(np.argmin(np.abs(recording.time - 1e-3 * float(found[1]))))
    near = recording.column("a1y")[at - 1 : at + 2] / G0
    assert np.abs(near - float(found[2])).min() < 0.05


def test_print_shows_the_whole_plot_even_where_it_was_zoomed(opened: Opener) -> None:
    page = opened(700)
    zoomed(page, "a1y as recorded")
    page.emulate_media(media="print")
    assert not page.locator(".zoomed").is_visible()
    assert page.locator("figure.marked svg.chart").is_visible()
    assert page.locator(".zoom-open:visible").count() == 0


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_axe_finds_no_violation_of_wcag_a_and_aa(opened: Opener, scheme: str, width: int) -> None:
    page = opened(width, color_scheme=scheme)
    page.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    zoomed(page, "a1y as recorded")
    page.evaluate(AXE.read_text(encoding="utf-8"))
    found = page.evaluate("tags => axe.run({ runOnly: { type: 'tag', values: tags } })", WCAG)
    assert len(found["passes"]) > 20
    told = [(v["id"], [n["html"][:90] for n in v["nodes"]][:3], v["help"]) for v in found["violations"]]
    assert told == []


def test_review_is_exported_as_json(opened: Opener, tmp_path: Path) -> None:
    page = opened(accept_downloads=True)
    page.get_by_label("Reviewer", exact=True).fill("A. Reviewer </script>")
    page.get_by_label("Date of the test").fill("2026-01-02")
    page.get_by_label("Decision").select_option("accepted with repair")
    with page.expect_download() as waited:
        page.get_by_role("button", name="Export the review as JSON").click()
    waited.value.save_as(tmp_path / "review.json")
    review = json.loads((tmp_path / "review.json").read_text(encoding="utf-8"))
    assert review["schema"] == "nineaudit/review/1"
    assert review["sha256"] == [example(4001).recording.source.sha256]
    assert review["review"]["reviewer"] == "A. Reviewer </script>"
    assert review["review"]["tested_on"] == "2026-01-02"
    assert review["review"]["decision"] == "accepted with repair"
    assert page.locator("#review-said").inner_text() == f"Saved as review-{review['report']}.json."


def test_hostile_names_run_nothing_in_the_browser(browser: Any, tmp_path: Path) -> None:
    attack = "<img src=x onerror=document.title='owned'><script>document.title='owned'</script>\"'>"
    audit = on_a_bus(example(401, path=f"runs/{attack}.blf".replace("/script", "\\script")))
    source = replace(audit.recording.source, notes=(attack,), damage=(Damage(attack, attack),))
    recording = replace(audit.recording, bus=bus(attack, attack, attack), source=source)
    array = recording.rig.array
    sensors = tuple(replace(s, channel=attack) if s.channel == "a0x" else s for s in array.sensors)
    named = replace(recording, rig=replace(recording.rig, name=attack, array=type(array)(sensors)))
    waivers = (replace(audit.waivers[0], reason=attack, channels=(attack,)),)
    diagnosis = replace(audit.diagnosis, smallest_detectable={attack: 1.0}, smallest_isolable={attack: 2.0})
    hostile = replace(audit, recording=named, waivers=waivers, command=attack, diagnosis=diagnosis)
    path = report.write_report(hostile, tmp_path / "r.html")
    page = browser.new_context(offline=True).new_page()
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.goto(path.as_uri())
    before = page.title()
    for k in range(page.locator(".zoom-open").count()):
        page.locator(".zoom-open").nth(k).evaluate("button => button.click()")
    page.locator(".u-over").last.wait_for()
    assert page.title() == before != "owned"
    assert page.locator("img").count() == 0
    assert said == []
    page.context.close()


def test_reached_by_keyboard(opened: Opener) -> None:
    page = opened()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Skip to the verdict"
    assert page.evaluate("document.activeElement.getBoundingClientRect().left") >= 0
