"""An audit in a process of its own, with limits: what goes wrong costs one recording and leaves nothing behind."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from campaigns import campaign, contents, entries, until
from nineaudit.campaign import guard, task
from nineaudit.campaign import lake as lakes
from nineaudit.campaign.guard import NO_LIMITS, Limits
from nineaudit.campaign.settings import collect, load

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
MIB = 2**20


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A campaign in the current folder; processes find the functions of the tests, and end with each."""
    monkeypatch.chdir(campaign(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent), prepend=os.pathsep)
    yield tmp_path
    if getattr(guard._OWN, "child", None) is not None:
        guard._let_go(guard._OWN.child)


@pytest.fixture
def temporary(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for temporary files, with nothing else in it."""
    (folder / "tmp").mkdir()
    monkeypatch.setenv("TMPDIR", str(folder / "tmp"))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return folder / "tmp"


@pytest.fixture
def requests_to(folder: Path) -> Any:
    """Performs a request of a recording in a process of its own, as a worker does."""
    lake, document = lakes.open_lake("lake", create=True), collect("rig.toml")
    name = task.prepare(lake, document)
    lakes.make_newest(lake, load(document).edition)

    def perform(
        uri: str, limits: Limits = NO_LIMITS, function: str = "campaign_functions:harmful", home: Path = folder
    ) -> dict[str, Any]:
        request = {"uri": uri, "inputs": name, "lake": str(folder / "lake"), "folder": str(home), "test": {}}
        return guard.guarded({**request, "resume": False, "reports": "failed"}, limits, function)

    return perform


@pytest.mark.parametrize(
    ("name", "reason", "attempts"),
    [
        ("crashes.csv", "ended by SIGSEGV", 2),
        ("leaves.csv", "ended with code 7", 2),
        ("raises.csv", "ZeroDivisionError: this is what it said", 2),
        ("neverends.csv", "longer than 3 s", 1),
        ("eats.csv", "more than 500 MiB of memory", 1),
    ],
)
def test_harm_costs_one_recording(requests_to: Any, folder: Path, name: str, reason: str, attempts: int) -> None:
    limits = Limits(timeout=3.0 if name == "neverends.csv" else 60.0, memory=500 * 2**20, retries=1)
    done = requests_to(f"tests/{name}", limits)
    assert (done["verdict"], done["transient"], done["attempts"]) == ("not_audited", True, attempts)
    assert reason in done["reason"]
    entry = entries(folder / "lake")[name]
    assert entry["transient"]
    assert reason in entry["reason"] == entry["result"]["reason"]
    good = requests_to("tests/T1.csv")
    assert (good["kept"], good["attempts"], good["transient"]) == (False, 1, False)


def test_a_pipe_without_end_is_given_up_and_tried_again_later(requests_to: Any, folder: Path) -> None:
    os.mkfifo("tests/P.csv")
    done = requests_to("tests/P.csv", Limits(timeout=4.0), guard.FUNCTION)
    assert "longer than 4 s" in done["reason"]
    Path("tests/P.csv").unlink()
    Path("tests/T1.csv").rename("tests/P.csv")
    later = requests_to("tests/P.csv", Limits(timeout=60.0), guard.FUNCTION)
    assert not later["transient"]
    assert len(contents(folder / "lake")) == 1, "the entry of the attempt goes when there is a better one"


def test_a_process_ends_with_the_one_that_asks() -> None:
    child = guard.start("campaign_functions:harmful")
    child.requests.write(json.dumps({"uri": "neverends"}) + "\n")
    child.requests.close()
    assert child.process.wait(timeout=60) == 0
    child.errors.close()


@pytest.mark.parametrize("uri", ["T.csv", "zip://T.csv::year.zip", "zip://T.csv::file://year.zip"])
def test_a_name_is_meant_as_seen_from_the_folder_of_its_run(requests_to: Any, folder: Path, uri: str) -> None:
    for name in ("T1", "T2"):
        (folder / name).mkdir()
        shutil.copy(f"tests/{name}.csv", f"{name}/T.csv")
        with zipfile.ZipFile(f"{name}/year.zip", "w") as archive:
            archive.write(f"tests/{name}.csv", "T.csv")
    first = requests_to(uri, home=folder / "T1")
    child = guard._OWN.child
    for name, key in (("T1", first["key"]), ("T2", task.audit_one("T2/T.csv", "rig.toml")["key"])):
        done = requests_to(uri, home=folder / name)
        assert (done["verdict"] == "not_audited", done["key"]) == (False, key)
    gone = requests_to(uri, home=folder / "T3")
    assert (gone["verdict"], gone["transient"], gone["attempts"]) == ("not_audited", True, 1)
    assert f"worker {socket.gethostname()} does not see the folder {folder / 'T3'}" in gone["reason"]
    assert requests_to(str(folder / "T1" / "T.csv"), home=folder / "T3")["key"] == first["key"]
    assert guard._OWN.child is child


@pytest.mark.parametrize("name", ["neverends", "crashes", "eats"])
def test_temporary_files_go_with_a_process_that_is_lost(requests_to: Any, temporary: Path, name: str) -> None:
    limits = Limits(timeout=3.0 if name == "neverends" else 60.0, memory=500 * MIB, retries=0)
    assert requests_to(f"tests/fetches-{name}.csv", limits)["transient"]
    assert list(temporary.iterdir()) == []


_ASKS = """
import sys
from nineaudit.campaign import guard
guard.guarded({"uri": sys.argv[1]}, guard.Limits(timeout=50.0), "campaign_functions:answers")
"""
"""A worker with one recording."""


@pytest.mark.parametrize(("end", "code"), [(None, 0), ("SIGINT", -2), ("SIGTERM", -15), ("SIGKILL", -9)])
def test_temporary_files_go_with_who_asked(temporary: Path, end: str | None, code: int) -> None:
    uri = "fetches" if end is None else "fetches-neverends"
    with subprocess.Popen([sys.executable, "-c", _ASKS, uri], stderr=subprocess.DEVNULL) as asks:
        if end is not None:
            until(lambda: any(temporary.glob("*/*/recording")) or asks.poll() is not None)
            for child in psutil.Process(asks.pid).children() if end == "SIGTERM" else ():
                child.terminate()  # all of a job are
            asks.send_signal(signal.Signals[end])
        assert asks.wait(timeout=60) == code
    until(lambda: not any(temporary.iterdir()), seconds=10)


def test_the_start_of_a_process_is_not_counted() -> None:
    began = time.monotonic()
    done = guard.guarded({"uri": "any"}, Limits(timeout=1.0), "campaign_slow:answers")
    assert time.monotonic() - began > 2.0
    assert done == {"uri": "any", "attempts": 1}


def test_a_process_that_is_never_ready_is_told(requests_to: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "_STARTING", 0.2)
    done = requests_to("tests/T1.csv", Limits(retries=1), "campaign_slow:answers")
    assert (done["transient"], done["attempts"]) == (True, 2)
    assert "the start of its process took longer than 0.2 s" in done["reason"]


def test_memory_that_another_recording_left_is_not_counted(requests_to: Any) -> None:
    limits = Limits(memory=800 * MIB, retries=0)
    Path("tests/T1.csv").rename("tests/keeps.csv")
    Path("tests/T2.csv").rename("tests/needs.csv")
    assert requests_to("tests/keeps.csv", limits)["attempts"] == 1
    first = guard._OWN.child
    done = requests_to("tests/needs.csv", limits)
    assert guard._OWN.child is not first
    assert (done["transient"], done["attempts"]) == (False, 2)
    alone = requests_to("tests/eats.csv", limits)
    assert (alone["transient"], alone["attempts"]) == (True, 2), "once more, and no more"
