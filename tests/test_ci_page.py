"""docs/ci.md: its examples are YAML, and their steps do what the page says on a good and on a bad recording."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from nineaudit.commands import simulated
from nineaudit.rig import load_rig, preset_text
from nineaudit.rulebook import load_rulebook
from nineaudit.waivers import parse_waivers
from nineaudit.writers import write_recording

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "ci.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[Any]:
    load = {"yaml": yaml.safe_load, "toml": tomllib.loads}[language]
    return [load(text) for text in re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)]


GITHUB, GITLAB, HOOKS = blocks("yaml")


def steps_of_github() -> Iterator[str]:
    yield from (step["run"] for step in GITHUB["jobs"]["audit"]["steps"] if "run" in step)


def steps_of_gitlab() -> Iterator[str]:
    yield from GITLAB["recordings"]["script"]


STEPS = {"github": list(steps_of_github()), "gitlab": list(steps_of_gitlab())}


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A repository with a rig file and one good recording."""
    (tmp_path / "recordings").mkdir()
    (tmp_path / "rig.toml").write_text(preset_text("naap-3222"), encoding="utf-8")
    write_recording(simulated(load_rig(tmp_path / "rig.toml"), "oblique", ()), tmp_path / "recordings" / "T0001.csv")
    return tmp_path


def add_bad(repository: Path) -> None:
    bad = simulated(load_rig(repository / "rig.toml"), "oblique", ("a1y:clipping=0.5",))
    write_recording(bad, repository / "recordings" / "T0002.csv")


def run(example: str, repository: Path) -> subprocess.CompletedProcess[str]:
    """The audit step of an example as a runner runs it: bash that stops at the first error, nineaudit on the path."""
    (step,) = [step for step in STEPS[example] if step.startswith("nineaudit ")]
    program = repository / "bin" / "nineaudit"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m nineaudit "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    (repository / "step.md").touch()  # a runner makes it before the step
    paths = {"PATH": f"{program.parent}{os.pathsep}{os.environ['PATH']}"}
    environment = {**os.environ, **paths, "GITHUB_STEP_SUMMARY": str(repository / "step.md"), "CI": "true"}
    command = ["bash", "-eo", "pipefail", "-c", step]
    return subprocess.run(command, cwd=repository, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("example", STEPS)
def test_a_good_recording_passes_and_the_report_is_there(example: str, repository: Path) -> None:
    done = run(example, repository)
    assert (done.returncode, done.stderr) == (0, "")
    assert {"T0001.html", "T0001.json", "junit.xml"} <= {path.name for path in (repository / "report").iterdir()}
    assert "::" not in done.stdout


@pytest.mark.parametrize("example", STEPS)
def test_a_bad_recording_fails_the_job_and_the_report_is_there(example: str, repository: Path) -> None:
    add_bad(repository)
    done = run(example, repository)
    assert done.returncode == 1
    assert (repository / "report" / "T0002.html").stat().st_size > 10_000
    assert "<failure " in (repository / "report" / "junit.xml").read_text(encoding="utf-8")
    summary = repository / ("step.md" if example == "github" else "report/summary.md")
    assert "| T0002.csv | **fail** | a1y is at fault: clipping" in summary.read_text(encoding="utf-8")


def test_annotations_of_a_bad_recording_name_its_file(repository: Path) -> None:
    add_bad(repository)
    lines = run("github", repository).stdout.splitlines()
    assert 1 <= len(lines) <= 10
    assert all(re.match(r"::(error|warning) file=recordings/T0002\.csv,title=", line) for line in lines)


@pytest.mark.parametrize("example", STEPS)
def test_a_recording_that_cannot_be_read_fails_the_job_too(example: str, repository: Path) -> None:
    (repository / "recordings" / "T0003.csv").write_text("", encoding="utf-8")
    assert run(example, repository).returncode == 3
    assert "T0003.csv" in (repository / "report" / "junit.xml").read_text(encoding="utf-8")


def test_both_examples_keep_the_report_of_a_job_that_failed() -> None:
    (keep,) = [s for s in GITHUB["jobs"]["audit"]["steps"] if "upload-artifact" in s.get("uses", "")]
    assert keep["if"] == "${{ !cancelled() }}"
    assert keep["with"]["path"] == "report/"
    kept = GITLAB["recordings"]["artifacts"]
    assert (kept["when"], kept["paths"]) == ("always", ["report/"])
    assert kept["reports"]["junit"] == "report/junit.xml"


def test_the_hooks_of_the_page_are_those_of_the_repository() -> None:
    offered = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))
    assert [hook["id"] for hook in HOOKS["repos"][0]["hooks"]] == [hook["id"] for hook in offered]


def test_the_waiver_of_the_page_is_one() -> None:
    (waiver,) = parse_waivers(blocks("toml")[0], None, load_rulebook().codes)
    assert (waiver.rule, waiver.max_value, waiver.approved_by) == ("RQ202", 600, "A. Engineer")
