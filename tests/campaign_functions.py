"""What the tests of campaigns put in the place of an audit: recordings that do harm, by their names."""

from __future__ import annotations

import os
import signal
import time
from typing import Any

from nineaudit.campaign import requests


def harmful(request: dict[str, Any]) -> dict[str, Any]:
    """An audit, but for recordings whose names say what they do to the process or to the worker."""
    name = request["uri"]
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
        held = bytearray(600 * 2**20)
        held[::4096] = b"\1" * len(held[::4096])
        time.sleep(1e6)
    return requests.perform(request)


def three(request: dict[str, Any]) -> dict[str, Any]:
    """The audit of T0, T1 and T2; of others one that never ends."""
    if not request["uri"].endswith(("T0.csv", "T1.csv", "T2.csv")):
        time.sleep(1e6)
    return requests.perform(request)
