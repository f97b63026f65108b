"""The index page of a campaign, as text and in a real browser with the network off; JUnit held to its schema."""

from __future__ import annotations

import gzip
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import junitparser
import numpy as np
import pytest
from lxml import etree

from campaign_entries import Entry, entries, entry, lake_of
from nineaudit.campaign import lake
from nineaudit.campaign.index import index_page, junit, reporting
from nineaudit.campaign.index.index_page import Section
from nineaudit.campaign.index.index_rows import index
from nineaudit.campaign.results import tables
from nineaudit.campaign.results.compact import compact, stored
from nineaudit.report.chart import Chart, Line
from test_browser import AXE, CONTRAST, WCAG, browser  # noqa: F401  (a fixture)
from test_ci_outputs import HOSTILE, SCHEMA

COUNT = 110
ATTACK = "<img src=x onerror=document.title='owned'><script>document.title='owned'</script>\"'>&amp;{{7*7}}"
CLIPPED = ("a1y:clipping=0.5",)


def sensors() -> Section:
    """A part as `campaign health` gives it."""
    time = np.arange(5.0)
    chart = Chart("gain", "Gain of 4711", "Gain over time.", time, "%", (Line(0.5 * time, "rebuilt", "4711"),))
    rows = [("4711", "2.1 % ± 0.3 %", "recalibrate"), (ATTACK, ATTACK, ATTACK)]
    return Section("sensors", "Sensors", ("40 sensors.",), ("Serial", "Gain", "Verdict"), rows, (chart,))


def doubled(some: Iterator[Entry]) -> Iterator[Entry]:
    """The entries and one more of the content of the first."""
    first = next(some)
    yield first
    yield from some
    yield entry(999, fault=(), uri="copies/T999.csv", sha256=first["result"]["recording"]["sha256"])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> lake.Lake:
    found = lake_of(tmp_path_factory.mktemp("campaign") / "lake", doubled(entries(COUNT)))
    one = next(one for one in entries(COUNT) if one["result"]["verdict"] == "fail")
    lake.write_text(found, lake.report_name(one["uri"], one["key"]), "<title>its report</title>")
    compact(found)
    return found


@pytest.fixture(scope="module")
def page(made: lake.Lake) -> Path:
    path = Path(made.root).parent / "pages" / "index.html"
    reporting.write_index(made, stored(made), path, [sensors()])
    return path


@pytest.fixture
def opened(browser: Any, page: Path) -> Iterator[Any]:  # noqa: F811
    """Opens the page offline; at the end nothing but the file was asked for, and nothing was complained of."""
    contexts, asked, said = [], [], []

    def start(width: int = 1280, path: Path = page, **options: Any) -> Any:
        context = browser.new_context(viewport={"width": width, "height": 900}, offline=True, **options)
        contexts.append(context)
        shown = context.new_page()
        shown.on("request", lambda request: asked.append(request.url))
        shown.on("console", lambda message: said.append(message.text))
        shown.on("pageerror", lambda error: said.append(str(error)))
        shown.goto(path.as_uri())
        return shown

    yield start
    for context in contexts:
        context.close()
    assert len(asked) == len(contexts)
    assert said == []


def visible(shown: Any) -> list[list[str]]:
    """The rows of the table of recordings that are in sight, as the text of their cells."""
    rows = "rows => rows.filter(r => !r.hidden).map(r => [...r.cells].map(c => c.textContent))"
    return shown.locator("#recordings tbody tr").evaluate_all(rows)  # type: ignore[no-any-return]


def verdicts() -> Counter[str]:
    return Counter(one["result"]["verdict"] for one in doubled(entries(COUNT)))


def test_complete_without_script(opened: Any) -> None:
    shown = opened(java_script_enabled=False)
    rows = shown.locator("#recordings tbody tr")
    assert rows.count() == COUNT + 1
    assert not shown.locator("#filters").is_visible()
    counted = shown.locator("#verdicts tbody tr").all_inner_texts()
    found = {" ".join(re.findall(r"[a-z]+", line)): int(re.search(r"\t(\d+)\t", line)[1]) for line in counted}  # type: ignore[index]
    assert found == {verdict.replace("_", " "): n for verdict, n in verdicts().items()}
    assert shown.locator("#sensors svg.chart").count() == 1
    assert "recalibrate" in shown.locator("#sensors").inner_text()
    texts = rows.all_inner_texts()
    assert "fail" in texts[0]
    assert "pass" in texts[-1]
    assert any("is empty" in text for text in texts)


def test_filters_show_what_they_say(opened: Any) -> None:
    shown = opened()
    said = shown.locator("#shown")
    assert said.inner_text() == f"{COUNT + 1} of {COUNT + 1} recordings shown"
    shown.get_by_label("Verdict", exact=True).select_option("fail")
    rows = visible(shown)
    assert len(rows) == verdicts()["fail"]
    assert said.inner_text() == f"{len(rows)} of {COUNT + 1} recordings shown"
    shown.get_by_label("Fault", exact=True).select_option("clipping")
    rows = visible(shown)
    assert rows
    assert {row[5] for row in rows} == {"a1y"}
    shown.get_by_label("Rig", exact=True).select_option("rig 1")
    assert {row[3] for row in visible(shown)} == {"rig 1"}
    shown.get_by_role("button", name="Show all").click()
    said.filter(has_text=f"{COUNT + 1} of {COUNT + 1}").wait_for()
    shown.get_by_label("Any words").fill("series-3 PASS")
    assert {row[0][:13] for row in visible(shown)} == {"data/series-3"}
    shown.get_by_label("Any words").fill("nothing has this")
    assert visible(shown) == []
    assert said.inner_text().startswith("0 of")
    shown.get_by_label("Any words").fill("")
    shown.get_by_label("Since").fill("2026-03-01")
    shown.get_by_label("Until").fill("2026-05-31")
    dates = [row[2] for row in visible(shown)]
    assert dates
    assert all("2026-03-01" <= day <= "2026-05-31" for day in dates)


def test_headings_sort(opened: Any) -> None:
    shown = opened()
    heading = shown.locator("#recordings thead th")
    buttons = shown.locator("#recordings thead button")
    buttons.nth(0).click()
    names = [row[0] for row in visible(shown)]
    assert len(names) == COUNT + 1
    assert names == sorted(names)
    assert heading.nth(0).get_attribute("aria-sort") == "ascending"
    buttons.nth(0).press("Enter")
    assert [row[0] for row in visible(shown)] == names[::-1]
    buttons.nth(7).click()
    assert heading.nth(7).get_attribute("aria-sort") == "descending"
    assert heading.nth(0).get_attribute("aria-sort") is None
    values = [float(row[7].replace("−", "-")) for row in visible(shown) if row[7] and "×" not in row[7]]
    assert len(values) > 50
    assert all(a >= b * 0.99 for a, b in pairwise(values))


def test_links_lead_to_the_reports_that_exist(opened: Any) -> None:
    shown = opened()
    links = shown.locator("#recordings tbody a")
    assert links.count() == 1
    target = links.first.evaluate("a => a.href")
    assert re.fullmatch(r"file://.*/lake/reports/[0-9a-f]{32}-[0-9a-f]{32}\.html", target)
    assert Path(target.removeprefix("file://")).read_text(encoding="utf-8") == "<title>its report</title>"


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_legible_and_accessible(opened: Any, scheme: str, width: int) -> None:
    shown = opened(width, color_scheme=scheme)
    shown.get_by_label("Verdict", exact=True).select_option("fail")
    shown.get_by_role("button", name="Date").click()
    assert shown.evaluate(CONTRAST) == []
    assert shown.evaluate("document.documentElement.scrollWidth") <= width
    shown.evaluate(AXE.read_text(encoding="utf-8"))
    found = shown.evaluate("tags => axe.run({ runOnly: { type: 'tag', values: tags } })", WCAG)
    assert len(found["passes"]) > 15
    assert [(v["id"], [n["html"][:90] for n in v["nodes"]][:3]) for v in found["violations"]] == []


def test_print_is_white_and_has_what_was_chosen(opened: Any) -> None:
    shown = opened(700, color_scheme="dark")
    shown.get_by_label("Verdict", exact=True).select_option("fail")
    shown.emulate_media(media="print")
    assert shown.evaluate("getComputedStyle(document.documentElement).backgroundColor") == "rgb(255, 255, 255)"
    assert not shown.locator("#filters").is_visible()
    assert shown.locator("#recordings tbody tr:visible").count() == verdicts()["fail"]


def hostile(tmp_path: Path) -> lake.Lake:
    some = [
        entry(1, fault=CLIPPED, uri=f"a/{ATTACK}.csv", rig=ATTACK, item=ATTACK, finding=ATTACK),
        entry(2, fault=CLIPPED, uri=f"javascript:{ATTACK}", rig=ATTACK, test={"number": ATTACK, "date": ATTACK}),
        entry(49, uri=f"b/{ATTACK}", reason=ATTACK),
        entry(3, fault=(), uri="c", sha256=entry(1, fault=CLIPPED)["result"]["recording"]["sha256"]),
    ]
    found = lake_of(tmp_path / "lake", some)
    for one in some[:2]:
        lake.write_text(found, lake.report_name(one["uri"], one["key"]), "")
    compact(found)
    return found


def test_hostile_names_run_nothing(opened: Any, tmp_path: Path) -> None:
    attacked = hostile(tmp_path)
    path = tmp_path / "index.html"
    reporting.write_index(attacked, stored(attacked), path, [sensors()])
    shown = opened(path=path)
    shown.get_by_label("Rig", exact=True).select_option(ATTACK)
    shown.get_by_role("button", name="Recording", exact=True).click()
    assert len(visible(shown)) == 2
    assert shown.locator("img").count() == 0
    assert shown.locator("script").count() == 1
    assert shown.title() != "owned"
    hrefs = shown.locator("main a").evaluate_all("all => all.map(a => a.getAttribute('href'))")
    assert hrefs
    assert all(re.fullmatch(r"lake/reports/[0-9a-f-]+\.html", href) for href in hrefs)
    assert "49" not in shown.locator("h1").inner_text()


def test_the_policy_lets_in_one_script_and_one_style_by_hash(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', text)
    assert policy
    allowed = policy[1].replace("&#39;", "'")
    assert re.fullmatch(
        r"default-src 'none'; script-src 'sha256-[^']+'; style-src 'sha256-[^']+'; base-uri 'none'; form-action 'none'",
        allowed,
    )
    assert (text.count("<script"), text.count("<style"), text.count("style=")) == (1, 1, 0)


def test_equal_content_is_told(page: Path) -> None:
    first = next(entries(COUNT))
    text = page.read_text(encoding="utf-8")
    part = text.partition('id="doubles-h"')[2].partition("</section>")[0]
    assert f"copies/T999.csv, {first['uri']}" in part
    assert part.count("<tr>") == 2


def test_worst_cases_rules_and_channels(made: lake.Lake, page: Path) -> None:
    found = index(stored(made))
    results = [one["result"] for one in doubled(entries(COUNT))]
    failed = Counter(r for one in results for r in {f["rule"] for f in one["findings"] if f["verdict"] == "fail"})
    assert dict(found.rules) == failed
    assert [n for _, n in found.rules] == sorted(failed.values(), reverse=True)
    statistics = [row["statistic"] for row in found.recordings if row["verdict"] == "fail"]
    assert statistics == sorted(statistics, reverse=True)
    clipped = sum(one.get("diagnosis", {}).get("channels") == ["a1y"] for one in results)
    assert sum(n for _, channel, n, _ in found.channels if channel == "a1y") == clipped
    part = page.read_text(encoding="utf-8").partition('id="worst-h"')[2].partition("</section>")[0]
    assert part.count("<tr>") == 13
    assert "a1y: clipping, probability" in part
    assert "with the rebuilt channel" in part


def test_a_larger_campaign_shows_the_worst_and_says_so(
    made: lake.Lake, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(index_page, "ROWS", 20)
    reporting.write_index(made, stored(made), tmp_path / "index.html")
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert f"The {COUNT + 1 - 20} least of them are not in this page" in text
    assert text.partition('id="recordings"')[2].count("<tr><th") == 1 + 20
    assert f"{COUNT + 1} recordings" in text


def test_five_thousand_recordings_are_small(tmp_path: Path) -> None:
    """From rows of the table, for audits of as many would take hours: 5 MB, and no curve."""
    lake_of(tmp_path / "lake", entries(60))
    opened = lake.open_lake(tmp_path / "lake")
    compact(opened)
    found = index(stored(opened))
    rows = [
        {**found.recordings[n % 60], "uri": f"campaign-2026/laboratory-{n % 9}/series-{n % 80:03d}/T{n:06d}.mcap"}
        for n in range(5_000)
    ]
    reports = {lake.report_name(row["uri"], row["key"]).partition("/")[2] for row in rows}
    page = index_page.render(
        replace(found, recordings=rows), "large", said={}, titles={}, reports=reports, folder="lake/reports"
    )
    assert page.count("<a href") > 5_000
    assert len(page.encode()) < 5_000_000
    assert len(gzip.compress(page.encode())) < 1_000_000
    assert "<path" not in page


def cases(path: Path) -> dict[str, list[str]]:
    """Name of each testcase -> what junitparser says became of it; the XML meets the schema."""
    SCHEMA.assertValid(etree.parse(str(path)))
    suites = junitparser.JUnitXml.fromfile(str(path))
    return {case.name: [type(result).__name__ for result in case.result] for suite in suites for case in suite}


def test_junit_has_a_case_for_each_recording(made: lake.Lake, tmp_path: Path) -> None:
    reporting.write_junit_file(made, stored(made), tmp_path / "junit.xml")
    found = cases(tmp_path / "junit.xml")
    became = {"fail": ["Failure"], "pass": [], "inconclusive": ["Error"], "not_audited": ["Error"]}
    assert found == {one["uri"]: became[one["result"]["verdict"]] for one in doubled(entries(COUNT))}
    suite = next(iter(junitparser.JUnitXml.fromfile(str(tmp_path / "junit.xml"))))
    assert (suite.tests, suite.failures, suite.errors) == (
        COUNT + 1, verdicts()["fail"], verdicts()["not_audited"] + verdicts()["inconclusive"],
    )  # fmt: skip
    text = (tmp_path / "junit.xml").read_text(encoding="utf-8")
    assert 'message="isolated, a1y: clipping"' in text
    assert "error RQ202 a1y: flat-topped" in text


def test_junit_of_several_row_groups_has_each_finding_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "GROUP", 7)
    made = lake_of(tmp_path / "lake", entries(40))
    compact(made)
    reporting.write_junit_file(made, stored(made), tmp_path / "junit.xml")
    text = (tmp_path / "junit.xml").read_text(encoding="utf-8")
    failed = sum(f["verdict"] == "fail" for one in entries(40) for f in one["result"]["findings"])
    assert len(re.findall(r"error [A-Z]{2}\d{3}", text)) == failed


@pytest.mark.parametrize("attack", HOSTILE)
def test_no_input_breaks_junit(attack: str) -> None:
    row = {"uri": attack, "verdict": "fail", "reason": None, "rig": attack, "status": "isolated"}
    finding = {"rule": "RB301", "verdict": "fail", "severity": "error", "channels": [attack], "reason": attack}
    case = junit.testcase({**row, "culprits": [attack], "fault": "gain"}, [finding])
    suite = etree.fromstring('<testsuites><testsuite name="x" tests="1" failures="1" errors="0"/></testsuites>')
    suite[0].append(etree.fromstring(junit.ET.tostring(case)))
    SCHEMA.assertValid(suite)
