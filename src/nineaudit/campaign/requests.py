"""What is asked of a worker: one recording, what it is judged by, and where its entry goes.

A request is plain data, so that it can be sent: {"uri", "inputs" (identity of the setting in the lake), "lake",
"folder" (in which relative paths are meant), "test", "resume", "reports"}.
"""

from __future__ import annotations

import os
import socket
from functools import lru_cache
from typing import Any

from nineaudit.campaign import lake as lakes
from nineaudit.campaign import task
from nineaudit.campaign.lake import Lake
from nineaudit.campaign.places import is_local, local_path
from nineaudit.campaign.settings import Document, load
from nineaudit.errors import ConfigurationError

Request = dict[str, Any]


def perform(request: Request) -> task.Summary:
    """Audit the recording of a request into its lake, by its name as seen from the folder of the request; not audited
    where that is not here. ConfigurationError: the lake or its inputs are not there."""
    if not _entered(request["folder"]) and _is_relative(request["uri"]):
        return give_up(request, f"worker {socket.gethostname()} does not see the folder {request['folder']}")
    lake, document = _lake(request["lake"]), _inputs(request["lake"], request["inputs"])
    return task.audit_into(lake, request["uri"], load(document), request["test"], request["resume"], request["reports"])


def give_up(request: Request, reason: str) -> task.Summary:
    """Write the entry of a recording that could not be audited this time."""
    document = _inputs(request["lake"], request["inputs"])
    lake = _lake(request["lake"])
    return task.write_failure(lake, request["uri"], load(document), request["test"], reason, transient=True)


def _entered(folder: str) -> bool:
    """Make a folder the current one, if it can be."""
    try:
        os.chdir(folder)
    except OSError:
        return False
    return True


def _is_relative(uri: str) -> bool:
    """Whether a recording, or the archive that it is in, is named as seen from a folder."""
    outermost = uri.rpartition("::")[2]
    return is_local(outermost) and not local_path(outermost).is_absolute()


@lru_cache(maxsize=4)
def _lake(uri: str) -> Lake:
    return lakes.open_lake(uri)


@lru_cache(maxsize=32)
def _inputs(uri: str, name: str) -> Document:
    found = lakes.read(_lake(uri), f"inputs/{name}.json")
    if found is None:
        raise ConfigurationError("the lake has no such inputs", file=uri, found=name)
    return found
