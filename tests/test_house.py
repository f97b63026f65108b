"""The house rules that a machine can hold: floors, sizes, who prints, what never stands in a tracked file."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = sorted((ROOT / "src").rglob("*.py"))
NAMES = [str(path.relative_to(ROOT / "src")) for path in SOURCES]
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in zip(NAMES, SOURCES, strict=True)}
PRINTS = {"print", "echo", "secho"}

# Written in two halves, so that this file does not name them.
HOSTS = [first + second for first, second in (("pypi.", "org"), ("python", "hosted"), ("anaconda.", "org"))]
PLACES = [f"/{folder}/" for folder in ("work", "tmp", "root", "home")]


def tracked() -> list[Path]:
    """The files of the repository; skips where this is not one."""
    done = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip("not a git repository")
    return [ROOT / name for name in done.stdout.split("\0") if name and (ROOT / name).is_file()]


def test_imports_point_down_only() -> None:
    command = [sys.executable, "-c", "from importlinter.cli import lint_imports_command; lint_imports_command()"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_module_of_the_top_stands_on_a_floor() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    floors = {name.strip() for layer in settings["contracts"][0]["layers"] for name in layer.split("|")}
    top = {path.stem for path in (ROOT / "src" / "nineaudit").glob("[!_]*.py")}
    top |= {path.parent.name for path in (ROOT / "src" / "nineaudit").glob("*/__init__.py")}
    assert {f"nineaudit.{name}" for name in top} == floors


@pytest.mark.parametrize("name", NAMES)
def test_modules_and_functions_are_small(name: str) -> None:
    assert len((ROOT / "src" / name).read_text(encoding="utf-8").splitlines()) <= 300
    functions = [node for node in ast.walk(TREES[name]) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    long = {f.name: f.end_lineno - f.lineno + 1 for f in functions if f.end_lineno and f.end_lineno - f.lineno >= 60}
    assert long == {}


@pytest.mark.parametrize("name", NAMES)
def test_every_module_says_what_it_is_and_every_public_function_what_it_gives(name: str) -> None:
    assert ast.get_docstring(TREES[name])
    public = [n for n in TREES[name].body if isinstance(n, ast.FunctionDef) and not n.name.startswith("_")]
    bare = [f.name for f in public if not ast.get_docstring(f) and f.end_lineno and f.end_lineno - f.lineno > 8]
    assert bare == []


@pytest.mark.parametrize("name", [name for name in NAMES if Path(name).name != "cli.py"])
def test_only_the_command_line_prints(name: str) -> None:
    calls = [node for node in ast.walk(TREES[name]) if isinstance(node, ast.Call)]
    called = {getattr(call.func, "id", getattr(call.func, "attr", "")) for call in calls}
    assert called & PRINTS == set()
    streams = {n.attr for n in ast.walk(TREES[name]) if isinstance(n, ast.Attribute) and n.attr in ("stdout", "stderr")}
    assert streams == set()


@pytest.mark.parametrize("name", [name for name in NAMES if Path(name).name != "cli.py"])
def test_nothing_catches_everything(name: str) -> None:
    handlers = [node for node in ast.walk(TREES[name]) if isinstance(node, ast.ExceptHandler)]
    everything = ("Exception", "BaseException")
    broad = [h.lineno for h in handlers if h.type is None or getattr(h.type, "id", "") in everything]
    assert broad == []


def test_no_tracked_file_names_a_registry_host_or_a_place_of_one_machine() -> None:
    named = "|".join(map(re.escape, HOSTS + PLACES))
    pattern = re.compile(rf"(?<![\w.}}])(?:{named})")
    found = []
    for path in tracked():
        text = path.read_bytes().decode("utf-8", errors="replace")
        found += [f"{path.relative_to(ROOT)}: {hit}" for hit in sorted(set(pattern.findall(text)))]
    assert found == []


def test_no_lock_file_is_tracked() -> None:
    assert [path.name for path in tracked() if path.name.endswith(".lock")] == []


def test_every_dependency_is_pinned() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    wanted = [*project["project"]["dependencies"], *project["dependency-groups"]["dev"]]
    wanted += [name for extra in project["project"]["optional-dependencies"].values() for name in extra]
    pins = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    assert [pin for pin in pins if not re.fullmatch(r"[a-z0-9-]+==[0-9][0-9a-z.]*", pin)] == []
    pinned = {pin.partition("==")[0] for pin in pins}
    names = {re.match(r"[\w.-]+", name)[0].lower().replace("_", "-").replace(".", "-") for name in wanted}  # type: ignore[index]
    assert names - pinned == set()


def test_python_of_the_readme_is_that_of_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["requires-python"] == ">=3.11"
    assert "Python 3.11 or newer" in (ROOT / "README.md").read_text(encoding="utf-8")
