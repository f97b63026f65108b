"""Campaigns on Dask: what does harm costs only itself, nothing that was finished is lost, a lake comes out the same."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from campaigns import campaign, contents, entries, noted, plan, told, until
from nineaudit.campaign import clusters, running
from nineaudit.campaign.guard import Limits
from nineaudit.campaign.requests import Request
from nineaudit.campaign.running import SchedulerLost
from nineaudit.errors import ConfigurationError

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
HERE = Path(__file__).parent


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder; processes find the functions of the tests."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(HERE))
    return tmp_path


@pytest.fixture
def scheduler(folder: Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """A scheduler with two workers, each a process of its own: (scheduler file, process of the scheduler)."""
    file = folder / "scheduler.json"
    dask = [sys.executable, "-m", "distributed.cli.dask_"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    made = [
        subprocess.Popen(
            [*dask[:2], "distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", file],
            **quiet,
        )
    ]
    worker = [*dask[:2], "distributed.cli.dask_worker", "--scheduler-file", file, "--nthreads", "1", "--no-dashboard"]
    made += [subprocess.Popen([*worker, "--death-timeout", "60"], **quiet) for _ in range(2)]
    until(file.is_file)
    yield str(file), made[0]
    for process in reversed(made):
        process.kill()
        process.wait()


def test_a_campaign_is_audited_once_and_counted() -> None:
    campaign(Path())
    code, shown, said = told(plan(Path()))
    verdicts = [entry["result"]["verdict"] for entry in entries(Path("lake")).values()]
    assert len(verdicts) == 4
    assert code == (1 if "fail" in verdicts else 0)
    assert shown[0].startswith("lake: 4 recordings: ")
    assert said == []
    lines = noted(Path("lake"))
    assert {(line["attempts"], line["kept"]) for line in lines} == {(1, False)}
    assert all(line["seconds"] > 0 and line["host"] for line in lines)
    before = contents(Path("lake"), "results")
    code, shown, _ = told(plan(Path(), resume=True))
    assert shown[0].endswith("; 4 of them were audited before")
    assert contents(Path("lake"), "results") == before


@pytest.mark.slow
def test_harm_costs_only_itself() -> None:
    names = [f"{what}{i}.csv" for i, what in enumerate(("T", "T", "kills", "T", "neverends", "T", "crashes", "eats"))]
    campaign(Path(), names)
    limits = Limits(timeout=20.0, memory=500 * 2**20, retries=1)
    code, shown, said = told(plan(Path(), limits=limits, function="campaign_functions:harmful"))
    found = entries(Path("lake"))
    assert set(found) == set(names)
    lost = {re.sub(r"\d+\.csv$", "", name): entry for name, entry in found.items() if "transient" in entry}
    assert set(lost) == {"kills", "neverends", "crashes", "eats"}
    assert all(entry["result"]["verdict"] != "not_audited" for name, entry in found.items() if name[0] == "T")
    for what, reason in (
        ("kills", "every worker that audited it died"),
        ("neverends", "longer than 20 s"),
        ("crashes", "SIGSEGV"),
        ("eats", "more than 500 MiB"),
    ):
        assert reason in lost[what]["reason"]
        assert any(reason in line for line in said)
    assert code == 3
    assert "4 not audited" in shown[0]
    code, shown, _ = told(plan(Path(), resume=True))
    assert "transient" not in str(entries(Path("lake")).values())
    assert shown[0].endswith("; 4 of them were audited before")
    assert len(contents(Path("lake"))) == len(names)


@pytest.mark.slow
def test_a_killed_scheduler_loses_nothing_and_the_lake_comes_out_the_same(
    scheduler: tuple[str, subprocess.Popen[bytes]],
) -> None:
    names = [f"T{i}.csv" for i in range(6)]
    campaign(Path(), names)
    whole = plan(Path(), lake="undisturbed")
    told(whole)
    command = [sys.executable, "-c", _PROGRAM, scheduler[0]]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as run:
        until(lambda: len(contents(Path("lake"))) == 3)
        scheduler[1].kill()
        _, said = run.communicate(timeout=120)
    assert run.returncode == 3, said
    assert "of 6 recordings: run it again with --resume" in said
    assert "the scheduler went away" in said
    assert "Traceback" not in said
    assert "--resume" in said
    done = contents(Path("lake"))
    assert len(done) == 3
    told(plan(Path(), resume=True))
    assert contents(Path("lake")) == contents(Path("undisturbed"))
    assert contents(Path("lake"), "editions") == contents(Path("undisturbed"), "editions")
    assert done.items() <= contents(Path("lake")).items()


_PROGRAM = """
import sys
from nineaudit import cli
from nineaudit.campaign import run_command, running
from nineaudit.campaign.campaigning import Plan

if __name__ == "__main__":
    original = Plan.__init__
    Plan.__init__ = lambda self, **options: original(self, **{**options, "function": "campaign_functions:three"})
    cli.main(["campaign", "run", "./tests", "--rig", "./rig.toml", "--lake", "lake", "--scheduler", sys.argv[1]])
"""
"""The command, with an audit that ends for the first three recordings only."""


@pytest.mark.slow
def test_ctrl_c_stops_at_once_loses_nothing_and_leaves_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    campaign(Path(), [f"T{i}.csv" for i in range(6)])
    (folder / "tmp").mkdir()
    monkeypatch.setenv("TMPDIR", str(folder / "tmp"))
    with subprocess.Popen(
        [sys.executable, "-c", _PROGRAM, "local"], stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as run:
        until(lambda: len(contents(Path("lake"))) == 3)
        os.killpg(run.pid, signal.SIGINT)
        _, said = run.communicate(timeout=60)
    assert run.returncode == 130, said
    assert "Traceback" not in said, said
    assert "of 6 recordings: run it again with --resume" in said
    until(lambda: not any((folder / "tmp").glob("nineaudit-*")), seconds=10)
    done = contents(Path("lake"))
    assert len(done) == 3
    _, shown, _ = told(plan(Path(), "./tests", resume=True))
    assert done.items() <= contents(Path("lake")).items()
    assert len(contents(Path("lake"))) == 6
    assert "audited before" in shown[0]


@pytest.mark.slow
def test_parts_of_a_campaign_are_the_whole() -> None:
    campaign(Path(), [f"T{i}.csv" for i in range(8)])
    told(plan(Path(), lake="whole"))
    sizes = []
    for i in (1, 2, 3):
        told(plan(Path(), lake="parts", shard=f"{i}/3"))
        sizes.append(len(contents(Path("parts"))))
    assert contents(Path("parts")) == contents(Path("whole"))
    assert sizes == sorted(sizes)
    assert sizes[0] < 8


def test_a_changed_rig_costs_its_own_recordings() -> None:
    campaign(Path(), ["T1.csv", "T2.csv", "T3.csv"])
    rig = Path("rig.toml").read_text(encoding="utf-8")
    for name in ("a.toml", "b.toml"):
        Path(name).write_text(rig, encoding="utf-8")
    Path("t.csv").write_text(
        "recording,rig,number\ntests/T1.csv,a.toml,1\ntests/T2.csv,b.toml,2\ntests/T3.csv,,3\n", encoding="utf-8"
    )
    table = plan(Path(), "t.csv")
    told(table)
    Path("b.toml").write_text(rig.replace('name = "test"', 'name = "other"'), encoding="utf-8")
    told(table)
    last = sorted(Path("lake/runs").iterdir(), key=lambda p: p.stat().st_mtime_ns)[-1].read_text(encoding="utf-8")
    again = [line for line in last.splitlines() if '"kept": false' in line]
    assert len(again) == 1
    assert "T2.csv" in again[0]
    assert {name: entry["test"] for name, entry in entries(Path("lake")).items()} == {
        f"T{n}.csv": {"number": str(n)} for n in (1, 2, 3)
    }


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"shard": "3/2"}, "--shard: no such part; found '3/2'"),
        ({"scheduler": "nowhere.json"}, "--scheduler: no such scheduler; found 'nowhere.json'"),
        ({"scheduler": "half.json"}, "--scheduler: no such scheduler; found 'half.json'"),
        ({"scheduler": "other.json"}, "--scheduler: no such scheduler; found 'other.json'"),
        ({"scheduler": "port.json"}, "--scheduler: no scheduler answers: missing port number in address '8786'"),
        ({"rig": "none.toml"}, "none.toml: cannot read the rig file"),
        ({"rig": None}, "tests/T1.csv: no rig file; name one with --rig, or in the table"),
        ({"lake": "memory://lake"}, "--lake: only this process would see it"),
        ({"lake": "rig.toml"}, "rig.toml"),
    ],
)
def test_a_plan_that_is_wrong_is_a_sentence(change: dict[str, str], said: str) -> None:
    campaign(Path(), ["T1.csv"])
    Path("half.json").write_text('{"address": "tcp:', encoding="utf-8")
    Path("other.json").write_text('["tcp://10.0.0.5:8786"]', encoding="utf-8")
    Path("port.json").write_text('{"address": 8786}', encoding="utf-8")
    with pytest.raises(ConfigurationError) as error:
        told(replace(plan(Path()), **change))  # type: ignore[arg-type]
    assert str(error.value).removeprefix(f"{Path.cwd()}/").startswith(said)


@pytest.mark.parametrize(("answers", "raised"), [(False, SchedulerLost), (True, OSError)])
def test_a_stream_that_closes_is_a_lost_scheduler_where_it_does_not_answer(
    monkeypatch: pytest.MonkeyPatch, answers: bool, raised: type[Exception]
) -> None:
    """Fetching a result meets the end of a scheduler before the client knows that it went: it still says "running"."""

    def asked(_function: object, **_options: object) -> None:
        if not answers:
            raise OSError("connection refused")

    def close() -> None:
        raise TimeoutError("nobody to say it to")

    client = SimpleNamespace(status="running", sync=asked, scheduler=SimpleNamespace(identity=None), close=close)
    monkeypatch.setattr(clusters, "_connected", lambda *_: client)
    monkeypatch.setattr(running, "_windowed", lambda *_: _closes())
    with pytest.raises(raised):
        list(running.run([], "tcp://10.0.0.5:8786"))
    assert SchedulerLost.exit_code == 3


def _closes() -> Iterator[None]:
    raise OSError("stream is closed")
    yield


def test_a_request_that_is_wrong_costs_none_of_those_before_it() -> None:
    def requests() -> Iterator[Request]:
        yield from ({"uri": f"T{i}"} for i in range(3))
        raise ConfigurationError("cannot read the rig file", file="none.toml")

    done = []
    with pytest.raises(ConfigurationError, match=r"none\.toml"):  # noqa: PT012 (what came before is looked at)
        for summary in running.run(requests(), workers=2, function="campaign_functions:answers"):
            done.append(summary["uri"])
    assert sorted(done) == ["T0", "T1", "T2"]


def test_without_the_extra_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    from nineaudit.campaign import extra

    monkeypatch.setattr(extra, "find_spec", lambda name: None if name == "distributed" else name)
    with pytest.raises(
        ConfigurationError, match=r"'distributed'; install nineaudit with the extra: nineaudit\[campaign\]"
    ):
        extra.require("fsspec", "distributed")
