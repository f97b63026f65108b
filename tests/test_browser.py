"""The report in a real browser, from disk, with the network off: complete, silent, legible in every dress."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from nineaudit import report
from report_example import example

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
ARGUMENTS = ("--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--force-color-profile=srgb")

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
    return report.write_report(example(4001), tmp_path_factory.mktemp("report") / "T0001.html")


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
    assert len(charts) == 18
    for width, height, longest, coloured in charts:
        assert width > 250
        assert height > 100
        assert longest > 1000
        assert coloured


def test_complete_without_script(opened: Opener) -> None:
    page = opened(java_script_enabled=False)
    assert page.locator("svg.chart").count() == 18
    assert page.locator("#verdict h2").inner_text().strip().endswith("Fail")
    page.locator("#ZO301 summary").click()
    assert page.locator("#ZO301 table.each tbody tr").first.is_visible()


def test_flagged_samples_are_painted(opened: Opener) -> None:
    """Strokes of no length show only as round caps: look at the pixels."""
    page = opened()
    figure = page.locator("figure.marked svg.chart")
    figure.scroll_into_view_if_needed()
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
    pdf = page.pdf(path=str(tmp_path / "report.pdf"), format="A4")
    assert pdf.startswith(b"%PDF")
    assert len(pdf) > 50_000


def test_reached_by_keyboard(opened: Opener) -> None:
    page = opened()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Skip to the verdict"
    assert page.evaluate("document.activeElement.getBoundingClientRect().left") >= 0
