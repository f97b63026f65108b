"""The help of every campaign command ends with examples that run."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
import typer.main

from campaign_entries import entry, lake_of
from nineaudit import cli
from nineaudit.campaign.results.compact import compact
from nineaudit.commands import simulated, written
from nineaudit.rig import parse_rig, preset_text

GROUP = typer.main.get_command(cli.app).commands["campaign"]  # type: ignore[attr-defined]
COMMANDS = [(), *((name,) for name in GROUP.commands)]
FAR = ("s3://", "tcp://")
"""Examples that need a bucket or a cluster; test_campaign_s3 and test_campaign_run have both."""
FOUND = {"diff": 1, "health": 0}
"""Exit codes of those that say something by it, for what is made here."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rig, a folder of one healthy recording, lakes with their tables."""
    folder = tmp_path_factory.mktemp("examples")
    rig = preset_text("naap-3222")
    name = parse_rig(rig).name
    (folder / "rig.toml").write_text(rig, encoding="utf-8")
    (folder / "tests").mkdir()
    written(simulated(parse_rig(rig), "general", (), seed=3), folder / "tests" / "T1.csv", (), False)
    kinds = ((), ("a1y:clipping=0.5",))
    before = [entry(n, edition="0123456789ab", fault=()) for n in range(3)]
    lake_of(folder / "lake-before", before, "0123456789ab")
    compact(lake_of(folder / "lake", [*before, *(entry(n, fault=kinds[n % 2], rig=name) for n in range(3))]))
    return folder


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_the_examples_run(
    command: tuple[str, ...], made: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(made)
    assert called("campaign", *command, "--help") == 0
    examples = capsys.readouterr().out.partition("Example:\n")[2].replace("\\\n", " ").splitlines()
    near = [line for line in map(str.strip, examples) if line and not any(far in line for far in FAR)]
    assert near
    for line in near:
        program, group, name, *arguments = shlex.split(line)
        assert (program, group) == ("nineaudit", "campaign")
        if name == "run":
            arguments = [*arguments[:-1], f"new-{'-'.join(command)}"]
        assert called(group, name, *arguments) == FOUND.get(name, 0), capsys.readouterr().err
        assert capsys.readouterr().out


def called(*arguments: str) -> int:
    with pytest.raises(SystemExit) as ended:
        cli.main(arguments)
    return int(ended.value.code or 0)
