"""How the program feels: a bar where somebody watches and nowhere else, old code pages, completion, Ctrl-C, pipes."""

from __future__ import annotations

import os
import re
import select
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import pytest

from nineaudit import plain_text, progress
from nineaudit.rig import preset_text

pty = pytest.importorskip("pty", reason="no pseudo-terminals on this system")

PROGRAM = [sys.executable, "-m", "nineaudit"]
TWO = ["check", "one.csv", "two.csv", "--rig", "rig.toml"]
QUIET = {"CI", "NO_COLOR", "FORCE_COLOR", "TERM", "COLUMNS", "PYTHONIOENCODING"}


def environment(**more: str) -> dict[str, str]:
    """This one, without what tells a program of a terminal."""
    return {k: v for k, v in os.environ.items() if k not in QUIET} | {"TERM": "xterm-256color"} | more


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A rig; the recordings are not there, which is found out fast."""
    (tmp_path / "rig.toml").write_text(preset_text("naap-3222"), encoding="utf-8")
    return tmp_path


def on_terminal(folder: Path, env: Mapping[str, str], *, both: bool = False) -> tuple[int, str, str]:
    """(exit code, standard output, what the terminal got) of `check`, standard error (or both) on a pseudo-terminal."""
    master, slave = pty.openpty()
    out = slave if both else subprocess.PIPE
    process = subprocess.Popen([*PROGRAM, *TWO], cwd=folder, env=dict(env), stdout=out, stderr=slave)
    os.close(slave)
    shown, deadline = b"", time.monotonic() + 120
    while time.monotonic() < deadline:
        if select.select([master], [], [], 0.2)[0]:
            try:
                shown += os.read(master, 65536)
            except OSError:  # the other end is closed
                break
        elif process.poll() is not None:
            break
    os.close(master)
    piped = process.communicate(timeout=10)[0] or b""
    return process.returncode, piped.decode(), shown.decode()


def test_a_bar_where_somebody_watches_and_results_stay_whole(folder: Path) -> None:
    code, out, shown = on_terminal(folder, environment())
    assert code == 3
    assert "recordings" in shown
    assert "0/2" in shown
    assert "\x1b[" in shown
    assert out.splitlines() == ["one.csv: NOT AUDITED", "two.csv: NOT AUDITED"]
    code, _, shown = on_terminal(folder, environment(), both=True)
    assert code == 3
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown).replace("\r", "\n").splitlines()
    assert [line for line in plain if "NOT AUDITED" in line] == ["one.csv: NOT AUDITED", "two.csv: NOT AUDITED"]


COLOUR = re.compile(r"\x1b\[(?:[0-9]+;)*(?:3[0-7]|9[0-7]|38;[0-9;]+)(?:;[0-9]+)*m")


def test_colours_follow_no_color(folder: Path) -> None:
    assert COLOUR.search(on_terminal(folder, environment())[2])
    assert not COLOUR.search(on_terminal(folder, environment(NO_COLOR="1"))[2])


@pytest.mark.parametrize("more", [{"CI": "true"}, {"TERM": "dumb"}])
def test_quiet_in_ci_and_on_a_dumb_terminal(folder: Path, more: dict[str, str]) -> None:
    code, _, shown = on_terminal(folder, environment(**more))
    assert code == 3
    assert "\x1b" not in shown
    assert "0/2" not in shown
    assert "2 recordings: 2 not audited" in shown


def test_quiet_in_a_pipe(folder: Path) -> None:
    done = subprocess.run([*PROGRAM, *TWO], cwd=folder, env=environment(), capture_output=True, text=True, check=False)
    assert done.returncode == 3
    assert "\x1b" not in done.stdout + done.stderr
    assert done.stderr.splitlines()[-1] == "nineaudit: 2 recordings: 2 not audited"


@pytest.mark.parametrize(
    ("total", "terminal", "env", "wanted"),
    [(2, True, {}, True), (1, True, {}, False), (2, False, {}, False), (2, True, {"CI": "1"}, False)],
)
def test_when_a_bar_is_wanted(total: int, terminal: bool, env: dict[str, str], wanted: bool) -> None:
    assert progress.wanted(total, terminal, env) is wanted


# --- code pages ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("page", ["cp1252", "cp437", "cp932", "utf-8"])
def test_no_code_page_stops_a_command(page: str, folder: Path) -> None:
    """Greek letters, signs and file names that the code page does not have."""
    env = environment(PYTHONIOENCODING=page)
    name = "T – ω Ж 漢.csv"
    for arguments in (["rules", "explain", "RB301"], ["motion", "--help"], ["check", name, "--rig", "rig.toml"]):
        done = subprocess.run([*PROGRAM, *arguments], cwd=folder, env=env, capture_output=True, check=False)
        assert done.returncode == (3 if arguments[0] == "check" else 0), done.stderr
        text, said = done.stdout.decode(page), done.stderr.decode(page)
        assert "Traceback" not in said
        assert text
        if arguments[0] == "rules" and page == "utf-8":
            assert "ω" in text
        if arguments[0] == "rules" and page == "cp1252":
            assert "omega" in text
            assert "?" not in text.partition("Computed:")[2].partition("\n")[0]


def test_a_pipe_without_a_stated_encoding_is_utf_8(folder: Path) -> None:
    """As on Windows, where the code page of a pipe would be cp1252."""
    env = environment(PYTHONUTF8="0", LC_ALL="C", PYTHONCOERCECLOCALE="0")
    done = subprocess.run([*PROGRAM, "rules", "explain", "RB301"], cwd=folder, env=env, capture_output=True, check=True)
    assert "ω" in done.stdout.decode("utf-8")


def test_signs_have_a_spelling() -> None:
    handler = plain_text.install()
    assert "11.3 g ≤ 12.3 g, ωxωy −1 µs".encode("ascii", handler) == b"11.3 g <= 12.3 g, omegaxomegay -1 us"
    assert "漢".encode("cp1252", handler) == b"?"
    with pytest.raises(UnicodeDecodeError):
        b"\xff".decode("ascii", handler)


# --- completion ---------------------------------------------------------------------------------------------------


def complete(shell: str, **words: str) -> str:
    env = environment(_NINEAUDIT_COMPLETE=f"complete_{shell}", **words)
    return subprocess.run(PROGRAM, env=env, capture_output=True, text=True, check=True, timeout=60).stdout


def test_completion_of_commands_and_options() -> None:
    assert complete("bash", COMP_WORDS="nineaudit ver", COMP_CWORD="1").split() == ["verify"]
    found = complete("bash", COMP_WORDS="nineaudit check --l", COMP_CWORD="2").split()
    assert found == ["--log"]
    assert "verify" in complete("zsh", _TYPER_COMPLETE_ARGS="nineaudit ver")
    assert "verify" in complete("fish", _TYPER_COMPLETE_ARGS="nineaudit ver", _TYPER_COMPLETE_FISH_ACTION="get-args")


def test_completion_is_shown_and_installed(tmp_path: Path) -> None:
    env = environment(_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION="1", HOME=str(tmp_path), USERPROFILE=str(tmp_path))
    shown = subprocess.run([*PROGRAM, "--show-completion", "bash"], env=env, capture_output=True, text=True, check=True)
    assert "_NINEAUDIT_COMPLETE=complete_bash" in shown.stdout
    subprocess.run([*PROGRAM, "--install-completion", "bash"], env=env, capture_output=True, text=True, check=True)
    scripts = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert any("_NINEAUDIT_COMPLETE" in path.read_text(encoding="utf-8") for path in scripts)
