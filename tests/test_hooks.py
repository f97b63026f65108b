"""The hooks for pre-commit: their entries are run on the files that their patterns choose, as pre-commit runs them."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from nineaudit.rig import preset_text

ROOT = Path(__file__).parents[1]
HOOKS = {hook["id"]: hook for hook in yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))}
SHEET = ROOT / "rules" / "RQ202.toml"


def chosen(hook: str, names: list[str]) -> list[str]:
    """The files of a commit that pre-commit hands to a hook: those in which its pattern is found."""
    return [name for name in names if re.search(HOOKS[hook]["files"], name)]


def run(hook: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """The hook on all files of a folder, from its top, the program beside this Python."""
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    program, *arguments = shlex.split(HOOKS[hook]["entry"])
    assert program == "nineaudit"
    command = [sys.executable, "-m", "nineaudit", *arguments, *chosen(hook, names)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_the_hooks_say_what_pre_commit_asks_for() -> None:
    assert set(HOOKS) == {"nineaudit-rig", "nineaudit-rules"}
    for hook in HOOKS.values():
        assert {"id", "name", "entry", "language", "files"} <= set(hook)
        assert hook["language"] == "python"


def test_which_files_the_hooks_choose() -> None:
    rigs = ["rig.toml", "a/rig.toml", "rigs/sled.toml", "head-rig.toml", "head.rig.toml", "rig_left.toml"]
    sheets = ["RQ202.toml", "rules/RB301.toml"]
    others = ["pyproject.toml", "waivers.toml", "bright.toml", "rig.toml.bak", "recording.csv", "rules/README.md"]
    names = [*rigs, *sheets, *others]
    assert chosen("nineaudit-rig", names) == rigs
    assert chosen("nineaudit-rules", names) == sheets


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two rig files, two folders of sheets, and files that are no business of the hooks."""
    for name, preset in (("rig.toml", "naap-3222"), ("rigs/guard.toml", "triax-3")):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(preset_text(preset), encoding="utf-8")
    for place in ("rules", "more"):
        (tmp_path / place).mkdir()
        shutil.copy(SHEET, tmp_path / place)
    (tmp_path / "pyproject.toml").write_text("[project]\n", encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("hook", HOOKS)
def test_good_files_pass(hook: str, folder: Path) -> None:
    done = run(hook, folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout


def test_every_wrong_rig_file_is_named(folder: Path) -> None:
    for name in ("rig.toml", "rigs/guard.toml"):
        (folder / name).write_text('[rig]\nnmae = "x"\n', encoding="utf-8")
    done = run("nineaudit-rig", folder)
    assert done.returncode == 2
    first, second = done.stderr.splitlines()
    assert "rig.toml" in first
    assert "guard.toml" in second
    assert "nmae" in first


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("max_samples", "max_smaples", "unknown limit; found 'max_smaples'; did you mean 'max_samples'?"),
        ('severity = "error"', 'severity = "fatal"', "unknown value; found 'fatal'"),
        ('code = "RQ202"', 'code = "RQ203"', "is not named after its rule"),
    ],
)
def test_a_wrong_sheet_is_named(old: str, new: str, said: str, folder: Path) -> None:
    sheet = folder / "more" / SHEET.name
    sheet.write_text(sheet.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    done = run("nineaudit-rules", folder)
    assert done.returncode == 2
    assert "RQ202.toml" in done.stderr
    assert said in done.stderr
