"""The process in which recordings are audited: requests as JSON lines on its input, answers as lines on its output.

``python -m nineaudit.campaign.child MODULE:FUNCTION FOLDER``. The first line of its output says that it is ready. It
ends when who asks is gone, and its temporary FOLDER goes with it: a thread sees the end of the input, also while a
recording is read that never ends. What a library prints goes to the error stream.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from typing import IO, Any, Final

_INPUT, _OUTPUT, _ERRORS = 0, 1, 2
_NEEDED: Final = ("fsspec", "jinja2", "nineaudit.auditing", "nineaudit.report", "nineaudit.rig_schema", "pyarrow")
"""What every audit imports: before the first, not on its time."""
_REMOVE: Final = "import shutil, sys; shutil.rmtree(sys.argv[1], ignore_errors=True)"


def main(function: str, folder: str) -> None:
    """Answer requests with a function, until there are none."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # where all of a job are told to end, who asks does, and this with it
    answers = os.fdopen(os.dup(_OUTPUT), "w", encoding="utf-8")
    os.dup2(_ERRORS, _OUTPUT)
    requests: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
    asked = os.fdopen(_INPUT, encoding="utf-8")
    receiver = threading.Thread(target=_receive, args=(asked, requests, folder), daemon=True)
    receiver.start()
    answer = _imported(function)
    with suppress(BrokenPipeError):
        _say(answers, "ready")
        while True:
            _say(answers, answer(requests.get()))
    receiver.join()  # who asks is gone: it ends the process


def _imported(function: str) -> Callable[[dict[str, Any]], Any]:
    for name in _NEEDED:
        import_module(name)
    module, _, name = function.partition(":")
    found: Callable[[dict[str, Any]], Any] = getattr(import_module(module), name)
    return found


def _say(answers: IO[str], line: Any) -> None:
    answers.write(json.dumps(line, ensure_ascii=False) + "\n")
    answers.flush()


def _receive(asked: IO[str], requests: queue.SimpleQueue[dict[str, Any]], folder: str) -> None:
    for line in asked:
        requests.put(json.loads(line))
    try:  # by another process, for in this one an audit may still write
        subprocess.Popen([sys.executable, "-I", "-c", _REMOVE, folder], stdin=subprocess.DEVNULL)
    finally:
        os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
