"""An audit in a process of its own, with a time limit and a memory limit: what goes wrong costs one recording.

The process stays for the next recording, for loading the package costs more than an audit. Memory is what the process
holds (resident set size), looked at every 50 ms: address space (RLIMIT_AS) would count what libraries reserve and never
touch, and would stop good recordings; what the kernel's own out-of-memory killer counts is this.
"""

from __future__ import annotations

import json
import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import IO, Any, Final

FUNCTION: Final = "nineaudit.campaign.requests:perform"
_LOOK: Final = 0.05
"""Seconds between two looks at a process."""
_STARTING: Final = 120.0
"""Seconds in which a process has to be ready: not counted against the time of a recording."""
_ONE_THREAD: Final = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""The matrices are small: threads would wait for each other, and workers for threads."""


@dataclass(frozen=True)
class Limits:
    """`timeout` s and `memory` bytes of one recording, None for none; `retries` after a crash."""

    timeout: float | None = None
    memory: int | None = None
    retries: int = 2


NO_LIMITS: Final = Limits()


class Lost(Exception):
    """The process of an audit ended without an answer. `again`: it may be otherwise the next time."""

    def __init__(self, reason: str, *, again: bool) -> None:
        super().__init__(reason)
        self.again = again


@dataclass(eq=False)
class Child:
    """A process that answers requests; its `answers` arrive line by line, None when it is gone.

    `folder`: its temporary files, which go with it. `ready`: it said so; `used`: it answered a request before.
    """

    process: subprocess.Popen[str]
    requests: IO[str]
    answers: queue.SimpleQueue[str | None]
    errors: IO[bytes]
    folder: str
    ready: bool = False
    used: bool = False


def start(function: str = FUNCTION) -> Child:
    """A process that answers requests with a function, ``module:name``."""
    reading, writing = os.pipe()
    asked, asking = os.pipe()
    errors = tempfile.TemporaryFile()  # noqa: SIM115 (closed by `end`)
    folder = tempfile.mkdtemp(prefix="nineaudit-")
    process = subprocess.Popen(
        [sys.executable, "-m", "nineaudit.campaign.child", function, folder],
        stdin=asked,
        stdout=writing,
        stderr=errors,
        text=True,
        env={**os.environ, **_ONE_THREAD, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), folder)},
        start_new_session=True,  # Ctrl-C is for who asks: what runs may end
    )
    os.close(writing)
    os.close(asked)
    answers: queue.SimpleQueue[str | None] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(os.fdopen(reading, encoding="utf-8"), answers), daemon=True).start()
    return Child(process, os.fdopen(asking, "w", encoding="utf-8"), answers, errors, folder)


def ask(child: Child, request: dict[str, Any], limits: Limits) -> dict[str, Any]:
    """The answer to a request. Lost: the process crashed, was not ready in time, or was ended for time or memory."""
    if not child.ready:
        _line(child, "the start of its process", Limits(timeout=_STARTING), again=True)
        child.ready = True
    try:
        child.requests.write(json.dumps(request) + "\n")
        child.requests.flush()
    except BrokenPipeError as error:
        raise Lost(_cause(child), again=True) from error
    answer = json.loads(_line(child, "the audit", limits, again=False))
    child.used = True
    return dict(answer)


def _line(child: Child, what: str, limits: Limits, *, again: bool) -> str:
    """The next line of a process. Lost; `again` says whether where it takes too long it may be otherwise next time."""
    deadline = None if limits.timeout is None else time.monotonic() + limits.timeout
    while True:
        try:
            line = child.answers.get(timeout=_LOOK if limits.memory else _left(deadline))
        except queue.Empty:
            line = ""
        if line is None:
            raise Lost(_cause(child), again=True)
        if line:
            return line
        if deadline is not None and time.monotonic() >= deadline:
            raise Lost(f"{what} took longer than {limits.timeout:g} s", again=again)
        if limits.memory and _memory(child) > limits.memory:
            reason = f"{what} took more than {limits.memory / 2**20:g} MiB of memory"
            raise Lost(reason, again=child.used)  # part of it may be of the recordings before


def end(child: Child) -> None:
    """End a process, whatever it does; its temporary files go."""
    child.process.kill()
    child.process.wait()
    with suppress(BrokenPipeError):  # what it did not take in is lost with it
        child.requests.close()
    child.errors.close()
    shutil.rmtree(child.folder, ignore_errors=True)


_OWN = threading.local()
"""Each thread of a worker has a process of its own."""


def guarded(request: dict[str, Any], limits: Limits, function: str = FUNCTION) -> dict[str, Any]:
    """Perform a request in the process of this thread; what cannot be done is written as not audited.

    A crash is tried again `limits.retries` times; time and memory are not, for they would be the same again. But what
    is lost in a process that has answered before, for anything but time, does not count: it may be what another
    recording left. The answer has ``attempts``.
    """
    attempt, left, reason = 0, 1 + limits.retries, ""
    while left > 0:
        attempt += 1
        child = _own(function)
        left -= not child.used
        try:
            answer = ask(child, request, limits)
        except Lost as lost:
            _let_go(child)
            reason = str(lost)
            if not lost.again:
                break
        else:
            if limits.memory and _memory(child) > limits.memory / 2:
                _let_go(child)  # what is left of one recording is not counted against the next
            return {**answer, "attempts": attempt}
    from nineaudit.campaign.requests import give_up

    return {**give_up(request, reason), "attempts": attempt}


def _own(function: str) -> Child:
    child: Child | None = getattr(_OWN, "child", None)
    if child is None or _OWN.function != function:
        child = _OWN.child = start(function)
        _OWN.function = function
    return child


def _let_go(child: Child) -> None:
    _OWN.child = None
    end(child)


def _listen(lines: IO[str], answers: queue.SimpleQueue[str | None]) -> None:
    with lines:
        for line in lines:
            answers.put(line)
    answers.put(None)


def _left(deadline: float | None) -> float | None:
    return None if deadline is None else max(deadline - time.monotonic(), 0.0)


def _memory(child: Child) -> int:
    """Bytes that the process holds; 0 where it is gone."""
    import psutil

    try:
        return int(psutil.Process(child.process.pid).memory_info().rss)
    except psutil.NoSuchProcess:
        return 0


def _cause(child: Child) -> str:
    """How a process ended."""
    code = child.process.wait()
    if code < 0:
        return f"the process of the audit was ended by {signal.Signals(-code).name}"
    child.errors.seek(0)
    said = child.errors.read().decode("utf-8", "replace").strip().splitlines()
    return f"the process of the audit ended with code {code}" + (f": {said[-1]}" if code and said else "")
