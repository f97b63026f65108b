"""The comparison and the budget in a real browser, from disk, with the network off: their curves can be zoomed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from nineaudit.budgets import page as budget_page
from nineaudit.budgets import typical
from nineaudit.case import Case
from nineaudit.comparison import compare
from nineaudit.report import comparison_page
from nineaudit.rig import Rig, parse_rig, preset_text
from nineaudit.simulate import simulate
from test_browser import AXE, CONTRAST, INK, WCAG, browser, ink_of_zoom  # noqa: F401  (a fixture)

ATTACK = "<img src=x onerror=document.title='owned'></template></script><script>document.title='owned'</script>\"'"


def hostile() -> Rig:
    """Nine accelerometers, the first and the rig named by an attacker."""
    rig = parse_rig(preset_text("naap-3222"))
    first, *others = rig.array.sensors
    array = type(rig.array)((replace(first, channel=ATTACK), *others))
    return replace(rig, name=ATTACK, array=array)


DASHES = """const plain = CanvasRenderingContext2D.prototype.setLineDash;
window.dashes = new Set();
CanvasRenderingContext2D.prototype.setLineDash = function (d) { dashes.add(String(d)); plain.call(this, d); };"""
"""Notes every dash pattern that a canvas is drawn with."""


@pytest.fixture(scope="module", params=["comparison", "budget"])
def page(request: pytest.FixtureRequest, browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:  # noqa: F811
    """A page opened offline; at the end nothing but the file was asked for, and nothing was complained of."""
    file = tmp_path_factory.mktemp(request.param) / f"{request.param}.html"
    file.write_text(MADE[request.param](), encoding="utf-8")
    context = browser.new_context(viewport={"width": 1000, "height": 900}, offline=True)
    context.set_default_timeout(10_000)
    opened, asked, said = context.new_page(), [], []
    opened.on("request", lambda request: asked.append(request.url))
    opened.on("console", lambda message: said.append(message.text))
    opened.on("pageerror", lambda error: said.append(str(error)))
    opened.add_init_script(DASHES)
    opened.goto(file.as_uri())
    yield opened
    context.close()
    assert asked == [file.as_uri()]
    assert said == []


def comparison() -> str:
    recording = simulate(hostile(), "general", seed=1).recording
    return comparison_page.render(compare(Case(recording), draws=2), recording)


def budget() -> str:
    return budget_page.render(typical(hostile()))


MADE = {"comparison": comparison, "budget": budget}


def test_every_curve_can_be_zoomed_in_its_own_colour_and_pattern(page: Any) -> None:
    charts = page.evaluate(INK)
    assert len(charts) >= 3
    assert all(longest > 100 and coloured for _, _, longest, coloured in charts)
    buttons = page.locator(".zoom-open")
    assert buttons.count() == len(charts)
    for k in range(buttons.count()):
        plot = page.locator("[data-plot]").nth(k)
        lines = plot.locator("path.line").count()
        buttons.nth(k).click()
        plot.locator(".u-over").wait_for()
        assert plot.locator("canvas").evaluate("c => c.width * c.height") > 10_000
        assert ink_of_zoom(plot) > 1000
        own = plot.locator("path.line").evaluate_all("all => all.map(p => getComputedStyle(p).strokeDasharray)")
        drawn = page.evaluate("[...dashes]")
        assert {re.sub("px| ", "", dash) for dash in own if dash != "none"} <= set(drawn)
        assert plot.locator(".zoom-said").inner_text().startswith("shown: ")
        plot.locator(".u-over").scroll_into_view_if_needed()
        over = plot.locator(".u-over").bounding_box()
        page.mouse.move(over["x"] + over["width"] / 2, over["y"] + over["height"] / 2)
        plot.locator(".zoom-said", has_text="(time, ms)").wait_for()
        assert plot.locator(".zoom-said").inner_text().count(", ") == lines  # one in the parenthesis, one between each
        page.mouse.move(1, 1)
        before = plot.locator("canvas").screenshot()
        plot.get_by_role("button", name="Zoom in").click()
        assert plot.locator("canvas").screenshot() != before
        plot.get_by_role("button", name="Close").click()


def test_names_run_nothing_and_all_is_legible(page: Any) -> None:
    page.locator(".zoom-open").first.click()
    page.locator(".u-over").wait_for()
    assert page.title() != "owned"
    assert page.locator("img").count() == 0
    assert page.evaluate(CONTRAST) == []
    page.evaluate(AXE.read_text(encoding="utf-8"))
    found = page.evaluate("tags => axe.run({ runOnly: { type: 'tag', values: tags } })", WCAG)
    assert [(v["id"], [n["html"][:90] for n in v["nodes"]][:3]) for v in found["violations"]] == []
    page.locator(".is-zoomed").get_by_role("button", name="Close").click()
