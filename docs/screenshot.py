"""The pictures of the report in README and tutorial: ``python docs/screenshot.py`` (needs Chromium and playwright).

It is the report of the tutorial's recording, made by the tutorial's own commands.
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright

HERE = Path(__file__).parent
IMAGES = HERE / "images"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
SIZE = {"width": 1100, "height": 880}


def commands() -> list[str]:
    """The tutorial's commands up to the first that writes a page."""
    found = re.findall(r"^\$ nineaudit (.*)$", (HERE / "tutorial.md").read_text(encoding="utf-8"), re.MULTILINE)
    last = next(i for i, command in enumerate(found) if "--html" in command)
    return found[: last + 1]


def report(folder: Path) -> Path:
    """Run them in a folder; the page."""
    for command in commands():
        line, _, target = command.partition(" > ")
        with (folder / target).open("wb") if target else contextlib.nullcontext(subprocess.DEVNULL) as out:
            subprocess.run([sys.executable, "-m", "nineaudit", *shlex.split(line)], cwd=folder, stdout=out, check=False)
    (page,) = folder.glob("*.html")
    return page


def photograph(page: Path, folder: Path) -> None:
    """The top of a page, and its section of the rebuilt channel, as Chromium shows them without network."""
    executable = next(found for name in BROWSERS if (found := shutil.which(name)))
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=executable, args=["--no-sandbox", "--disable-gpu"])
        tab = browser.new_context(viewport=SIZE, offline=True, color_scheme="light").new_page()
        tab.goto(page.as_uri())
        tab.screenshot(path=folder / "report.png")
        tab.locator("#rebuilt").screenshot(path=folder / "rebuilt.png")
        browser.close()


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    IMAGES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as made:
        photograph(report(Path(made)), IMAGES)
