"""Many audits on Dask: a bounded window of tasks; entries are written where the audits are made, not here.

So that this process holds no results, and nothing that was finished is lost with it, with a worker or the scheduler.
"""

from __future__ import annotations

import socket
import time
import uuid
from collections.abc import Iterable, Iterator
from importlib.metadata import version
from itertools import islice
from typing import TYPE_CHECKING, Final

from nineaudit.campaign import clusters
from nineaudit.campaign.guard import FUNCTION, NO_LIMITS, Limits, guarded
from nineaudit.campaign.requests import Request, give_up
from nineaudit.errors import ConfigurationError, NineauditError

if TYPE_CHECKING:
    from distributed import Client, Future

    from nineaudit.campaign.task import Summary

LOCAL: Final = clusters.LOCAL
Suspect = tuple[Request, int]
"""A request whose workers died, and how many of them."""
_AHEAD: Final = 2
"""Tasks in flight for each thread of the workers: the next one is there when one ends."""
_COUNTED: Final = 2.0
"""Seconds after which the workers are counted again: a cluster may grow."""


class SchedulerLost(NineauditError):
    """The scheduler went away; what was finished is in the lake (exit code 3)."""


def run(
    requests: Iterable[Request],
    scheduler: str = LOCAL,
    workers: int | None = None,
    limits: Limits = NO_LIMITS,
    function: str = FUNCTION,
) -> Iterator[Summary]:
    """The summary of each request, as they are done: uri, key, verdict, gate, kept, and what varies (seconds, host,
    attempts).

    `scheduler`: ``local`` (with `workers` processes; default: one a core), an address (``tcp://...``) or a scheduler
    file. `function` (``module:name``) does the work, in a process of its own. A recording whose worker dies is tried
    again by Dask, at last alone, then written as not audited. ConfigurationError: no such scheduler, or one of a
    request, which is raised when those before it are done; SchedulerLost.
    """
    wrong: list[NineauditError] = []
    suspects: list[Suspect] = []
    with clusters.client(scheduler, workers, limits.retries) as client:
        try:
            yield from _windowed(client, scheduler, _until_wrong(requests, wrong), limits, function, suspects)
            for request, _ in suspects:  # one at a time: who dies now dies by its own recording
                again: list[Suspect] = []
                yield from _windowed(client, scheduler, iter([request]), limits, function, again)
                for one, deaths in again:
                    reason = f"every worker that audited it died ({deaths} of them, then as many again)"
                    yield {**give_up(one, reason), "attempts": 2 * deaths}
        except clusters.GOING as error:
            if clusters.gone(client):
                raise _lost(scheduler) from error
            raise
    if wrong:
        raise wrong[0]


def _until_wrong(requests: Iterable[Request], wrong: list[NineauditError]) -> Iterator[Request]:
    """The requests up to one that cannot be made, whose error is put to `wrong`."""
    try:
        yield from requests
    except NineauditError as error:
        wrong.append(error)


def perform(request: Request, limits: Limits, function: str) -> Summary:
    """On a worker: the request in a process of its own, and how long it took where."""
    _require_version(request)
    began = time.perf_counter()
    done = guarded(request, limits, function)
    return {**done, "seconds": round(time.perf_counter() - began, 3), "host": socket.gethostname()}


def _require_version(request: Request) -> None:
    """ConfigurationError on a worker with another version: its entries would be of another edition."""
    here, asked = version("nineaudit"), request.get("version")
    if asked not in (None, here):
        advice = "install the same version on the nodes of the cluster"
        place = f"worker {socket.gethostname()}"
        raise ConfigurationError("another nineaudit", place=place, found=here, expected=asked, advice=advice)


def _windowed(
    client: Client,
    scheduler: str,
    requests: Iterator[Request],
    limits: Limits,
    function: str,
    suspects: list[Suspect],
) -> Iterator[Summary]:
    """The summaries; requests whose workers died are put to the `suspects`."""
    from distributed import KilledWorker, as_completed

    pending: dict[str, Request] = {}
    done = as_completed([])
    count, counted = _window(client), time.monotonic()
    futures = _submit(client, requests, count, limits, function, pending)
    done.update(futures)
    del futures
    for future in done:
        request = pending.pop(future.key)
        if future.status == "cancelled" or client.status != "running":
            raise _lost(scheduler)
        if future.status not in ("finished", "error"):  # its worker died before the summary was here: done again
            pending[future.key] = request
            done.add(future)
            continue
        error = future.exception() if future.status == "error" else None
        if isinstance(error, KilledWorker):
            suspects.append((request, error.allowed_failures + 1))
        elif error is not None:
            raise error
        else:
            yield future.result()
        future.release()
        if time.monotonic() - counted > _COUNTED:
            count, counted = _window(client), time.monotonic()
        done.update(_submit(client, requests, count - len(pending), limits, function, pending))


def _submit(
    client: Client,
    requests: Iterator[Request],
    count: int,
    limits: Limits,
    function: str,
    pending: dict[str, Request],
) -> list[Future[Summary]]:
    """Futures of up to `count` more requests."""
    futures = []
    for request in islice(requests, max(count, 0)):
        key = f"audit-{uuid.uuid4().hex}"
        pending[key] = request
        futures.append(client.submit(perform, request, limits, function, key=key, pure=False))
    return futures


def _window(client: Client) -> int:
    """How many tasks are in flight."""
    return _AHEAD * max(int(sum(client.nthreads().values())), 1)


def _lost(scheduler: str) -> SchedulerLost:
    return SchedulerLost(
        "the scheduler went away",
        place="--scheduler",
        found=scheduler,
        advice="what was finished is in the lake: run the command again with --resume",
    )
