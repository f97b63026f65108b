"""The report's size, the time to build it, and the time until a browser shows it: ``python benchmarks/report.py``.

Nine and 48 channels of 20,000 samples. Building starts from an audit; what a page asks of the audit first (the map of
what can be told apart, the posterior of the calibration) counts as building. Ready is when headless Chromium has loaded
the file from disk with the network off: layout and script done, as its own clock has it.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does

import shutil
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import nineaudit as na
from nineaudit import report
from nineaudit.commands import simulated
from nineaudit.rig import Rig, parse_rig, preset_text

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
READY = "() => { const t = performance.getEntriesByType('navigation')[0]; return t.loadEventEnd - t.startTime; }"


def nine(samples: int) -> na.Audit:
    """The demonstration's array and fault, `samples` long."""
    rig = parse_rig(preset_text("naap-3222"))
    return na.audit(simulated(rig, "general", ("a1y:clipping=0.5",), rate=samples / 0.225, duration=0.225))


def many(samples: int, channels: int = 48) -> na.Audit:
    """An audit of as many accelerometers, in places and along axes drawn at random."""
    rng = np.random.default_rng(6)
    sensors = []
    for k, (place, axis) in enumerate(
        zip(80 * rng.standard_normal((channels, 3)), rng.standard_normal((channels, 3)), strict=True)
    ):
        sensors.append(f'[[sensor]]\nchannel = "c{k}"\nkind = "accelerometer"\n'
                       f"position = {place.round(1).tolist()}\naxis = {axis.round(3).tolist()}\n")  # fmt: skip
    head = '[rig]\nname = "48 accelerometers"\n[units]\nlength = "mm"\nacceleration = "g_0"\n'
    return na.audit(
        simulated(_fine(parse_rig(head + "".join(sensors))), "general", (), rate=samples / 0.225, duration=0.225)
    )


def _fine(rig: Rig) -> Rig:
    return replace(rig, filter_class="none")


def built(audit: na.Audit) -> tuple[str, float, float]:
    """The page, and processor seconds of the first build and of the next: an audit keeps what it was asked for."""
    times = []
    for _ in range(2):
        start = time.process_time()
        page = report.render(audit)
        times.append(time.process_time() - start)
    return page, times[0], times[1]


def ready(path: Path, runs: int = 5) -> float | None:
    """Median seconds until Chromium has loaded the page; None where there is no Chromium."""
    executable = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if executable is None:
        return None
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=executable, args=["--no-sandbox", "--disable-gpu"])
        found = [_loaded(browser, path) for _ in range(runs)]
        browser.close()
    return statistics.median(found)


def _loaded(browser: Any, path: Path) -> float:
    page = browser.new_context(offline=True).new_page()
    page.goto(path.as_uri())
    page.wait_for_function("performance.getEntriesByType('navigation')[0].loadEventEnd > 0")
    seconds = float(page.evaluate(READY)) / 1e3
    page.context.close()
    return seconds


def line(name: str, audit: na.Audit) -> str:
    """One line of the table."""
    page, first, again = built(audit)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "report.html"
        path.write_text(page, encoding="utf-8")
        shown = ready(path)
    told = "no Chromium" if shown is None else f"ready in {shown:.2f} s"
    building = f"built in {first:.2f} s of processor time, again in {again:.2f} s"
    return f"{name}: {len(page.encode()) / 1e6:.2f} MB, {building}, {told}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=20_000)
    parser.add_argument("--nine-only", action="store_true")
    chosen = parser.parse_args()
    report.render(nine(400))  # imports and the template's compilation are no part of it
    print(line(f"9 channels x {chosen.samples}", nine(chosen.samples)))
    if not chosen.nine_only:
        print(line(f"48 channels x {chosen.samples}", many(chosen.samples)))


if __name__ == "__main__":
    main()
