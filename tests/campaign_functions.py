"""What the tests of campaigns put in the place of an audit: recordings that do harm, by their names."""

from __future__ import annotations

import os
import signal
import tempfile
import time
from pathlib import Path
from typing import Any

from nineaudit.campaign import requests

KEPT: list[bytearray] = []


def harmful(request: dict[str, Any]) -> dict[str, Any]:
    """An audit, but for recordings whose names say what they do to the process or to the worker."""
    name = request["uri"]
    _fill(name)
    if "crashes" in name:
        os.kill(os.getpid(), signal.SIGSEGV)
    if "leaves" in name:
        os._exit(7)
    if "raises" in name:
        raise ZeroDivisionError("this is what it said")
    if "neverends" in name:
        time.sleep(1e6)
    if "kills" in name:
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(1e6)
    if "eats" in name:
        KEPT.append(_held(800))
        time.sleep(1e6)
    if "keeps" in name:
        KEPT.append(_held(220))
    if "needs" in name:
        held = _held(530)
        time.sleep(0.5)
        del held
    return requests.perform(request)


def answers(request: dict[str, Any]) -> dict[str, Any]:
    """An audit that takes no time, or never ends."""
    _fill(request["uri"])
    if "neverends" in request["uri"]:
        time.sleep(1e6)
    return {"uri": request["uri"]}


def _fill(name: str) -> None:
    """A recording that is fetched, as files of a megabyte until its audit ends."""
    if "fetches" in name:
        (Path(tempfile.mkdtemp(prefix="fetched-")) / "recording").write_bytes(bytes(2**20))


def _held(mebibytes: int) -> bytearray:
    """So much memory, touched."""
    held = bytearray(mebibytes * 2**20)
    held[::4096] = b"\1" * len(held[::4096])
    return held


def three(request: dict[str, Any]) -> dict[str, Any]:
    """The audit of T0, T1 and T2; of others one that never ends."""
    if not request["uri"].endswith(("T0.csv", "T1.csv", "T2.csv")):
        time.sleep(1e6)
    return requests.perform(request)
