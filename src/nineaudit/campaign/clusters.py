"""Where audits run: a Dask cluster of this machine, or one that is there; and whether its scheduler still is."""

from __future__ import annotations

import json
import logging
import signal
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from nineaudit.errors import ConfigurationError

if TYPE_CHECKING:
    from distributed import Client

LOCAL: Final = "local"
_ASKED: Final = 0.5
"""Seconds after which a scheduler is asked again whether it is there."""
_PATIENCE: Final = 30.0
"""Seconds in which a scheduler has to answer."""
GOING: Final = (OSError, RuntimeError, LookupError, AttributeError, CancelledError)
"""What Dask raises when a scheduler goes: which depends on what was under way."""


@contextmanager
def client(scheduler: str, workers: int | None, retries: int) -> Iterator[Client]:
    """A client of a scheduler: ``local`` (with `workers` processes, of which one task may cost `retries` before it is
    given up), an address, or a scheduler file. ConfigurationError: there is none."""
    import dask
    from distributed import Client, LocalCluster
    from distributed.utils import silence_logging_cmgr

    with ExitStack() as stack:
        stack.enter_context(silence_logging_cmgr(logging.CRITICAL))  # what is wrong is told in sentences
        if scheduler == LOCAL:
            stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": retries}))
            cluster = stack.enter_context(
                LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    processes=True,
                    memory_limit=0,  # audits are in processes of their own: see guard.py
                    dashboard_address="127.0.0.1:0",
                    silence_logs=logging.CRITICAL,
                    preload=[__name__],  # dask_setup
                )
            )
            yield stack.enter_context(Client(cluster))
        else:
            yield stack.enter_context(_closed(_connected(scheduler, Client)))


@contextmanager
def _closed(client: Client) -> Iterator[Client]:
    """A client that is closed at the end; with a scheduler that went, as far as it can be."""
    try:
        yield client
    finally:
        with suppress(*GOING):
            client.close()


def _connected(scheduler: str, connect: Any) -> Client:
    try:
        client: Client = connect(_address(scheduler), timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"no scheduler answers: {error}", place="--scheduler", found=scheduler) from error
    return client


def _address(scheduler: str) -> str:
    """The address of a scheduler; of a file, the one in it."""
    if "://" in scheduler:
        return scheduler
    try:
        return str(json.loads(Path(scheduler).read_bytes())["address"])
    except (OSError, ValueError, LookupError, TypeError) as error:
        expected = "local, an address such as tcp://10.0.0.5:8786, or a scheduler file that is there"
        raise ConfigurationError(
            "no such scheduler", place="--scheduler", found=scheduler, expected=expected
        ) from error


def dask_setup(worker: object) -> None:  # noqa: ARG001
    """On a local worker, when it starts: Ctrl-C is for the command, which ends its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def gone(client: Client) -> bool:
    """Whether the scheduler went away: it is asked, for what the client says of itself lags behind what it meets."""
    end = time.monotonic() + _PATIENCE
    while client.status == "running" and time.monotonic() < end:
        try:
            client.sync(client.scheduler.identity, callback_timeout=_ASKED)  # type: ignore[union-attr]
        except TimeoutError:
            continue
        except GOING:
            return True
        return client.status != "running"
    return True
