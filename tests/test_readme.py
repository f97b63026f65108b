"""README.md: every command in it is run, and shows what the README says that it shows.

``python tests/test_readme.py`` writes the real output into README.md.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from nineaudit import cli

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
EXIT_CODES = {"nineaudit check T0001.csv --rig rig.toml --html T0001.html --json T0001.json": 1}
EXIT_CODES["nineaudit campaign run T0001.csv T0001-repaired.csv --rig rig.toml --lake lake"] = 1
"""Of the commands that find something; the others end with 0."""


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def sessions(block: str) -> Iterator[tuple[str, str]]:
    """(command, what the README says it prints) of a console block."""
    for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        command, _, output = part.partition("\n")
        yield command, output


def run(command: str) -> tuple[int, str]:
    """Exit code and standard output of a nineaudit command; ``> FILE`` is a file."""
    line, _, target = command.partition(" > ")
    program, *arguments = shlex.split(line)
    assert program == "nineaudit", command
    out = io.StringIO()
    with contextlib.redirect_stdout(out), pytest.raises(SystemExit) as ended:
        cli.main(arguments)
    if target:
        Path(target).write_text(out.getvalue(), encoding="utf-8")
    return int(ended.value.code or 0), "" if target else out.getvalue()


def test_the_example_shows_what_the_readme_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    commands = [session for block in blocks("console") for session in sessions(block)]
    assert len(commands) >= 6
    for command, expected in commands:
        code, shown = run(command)
        assert code == EXIT_CODES.get(command, 0), command
        assert shown == expected, command
    assert (tmp_path / "T0001.html").stat().st_size > 10_000
    assert (tmp_path / "T0001-repaired.csv.provenance.json").is_file()


def test_the_rig_file_of_the_readme_is_one() -> None:
    from nineaudit.rig import parse_rig

    text, parts = blocks("toml")
    rig = parse_rig(text)
    assert len(rig.array) == 9
    assert rig.array["a1y"].serial == "4711"
    assert [part.offset for part in parse_rig(text + parts).parts] == [0.0, 0.0125]


def test_the_python_of_the_readme_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for block in blocks("console")[:2]:
        for command, _ in sessions(block):
            run(command)
    (code,) = blocks("python")
    exec(compile(code, str(README), "exec"), {})
    assert capsys.readouterr().out.startswith("fail isolated a1y\nclipping ")
    assert (tmp_path / "T0001.html").is_file()


def test_ci_runs_the_readme_test_command_and_the_demo_command() -> None:
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    run_line, test_line = (block.strip() for block in blocks("sh"))
    assert run_line.endswith("nineaudit demo")
    assert test_line.endswith("pytest")
    assert run_line in script
    assert test_line in script


@pytest.mark.parametrize("page", [README, *sorted((ROOT / "docs").glob("*.md"))], ids=lambda p: p.name)
def test_every_link_leads_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8"))
    assert links or page != README
    assert [link for link in links if "://" not in link and not (page.parent / link).exists()] == []


def update(run: Callable[[str], tuple[int, str]] = run) -> None:
    """Write what the commands print into README.md."""
    text = README.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for block in blocks("console"):
            shown = "".join(f"$ {command}\n{run(command)[1]}" for command, _ in sessions(block))
            text = text.replace(f"```console\n{block}```", f"```console\n{shown}```")
        os.chdir(ROOT)
    README.write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    sys.exit(update())
