"""The process in which recordings are audited: requests as JSON lines on its input, answers as lines on its output.

``python -m nineaudit.campaign.child MODULE:FUNCTION``. It ends when who asks is gone: a thread sees the end of the
input, also while a recording is read that never ends. What a library prints goes to the error stream.
"""

from __future__ import annotations

import json
import os
import queue
import sys
import threading
from importlib import import_module
from typing import IO, Any

_INPUT, _OUTPUT, _ERRORS = 0, 1, 2


def main(function: str) -> None:
    """Answer requests with a function, until there are none."""
    module, _, name = function.partition(":")
    answer = getattr(import_module(module), name)
    answers = os.fdopen(os.dup(_OUTPUT), "w", encoding="utf-8")
    os.dup2(_ERRORS, _OUTPUT)
    requests: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
    asked = os.fdopen(_INPUT, encoding="utf-8")
    threading.Thread(target=_receive, args=(asked, requests), daemon=True).start()
    while True:
        done = answer(requests.get())
        answers.write(json.dumps(done, ensure_ascii=False) + "\n")
        answers.flush()


def _receive(asked: IO[str], requests: queue.SimpleQueue[dict[str, Any]]) -> None:
    for line in asked:
        requests.put(json.loads(line))
    os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1])
