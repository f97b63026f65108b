"""A campaign as the command line asks for it: which recordings, judged by what, and what is said of it."""

from __future__ import annotations

import datetime as dt
import json
import os
import uuid
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from nineaudit import progress
from nineaudit.campaign import lake as lakes
from nineaudit.campaign import running, task
from nineaudit.campaign.guard import FUNCTION, NO_LIMITS, Limits
from nineaudit.campaign.lake import Lake
from nineaudit.campaign.places import is_local, local_path
from nineaudit.campaign.settings import collect, load
from nineaudit.campaign.sources import Found, find
from nineaudit.campaign.waiving import unmatched
from nineaudit.errors import ConfigurationError, NineauditError

if TYPE_CHECKING:
    from nineaudit.campaign.requests import Request
    from nineaudit.campaign.task import Summary
    from nineaudit.parts import Part
    from nineaudit.waivers import Waiver

_LINES: Final = 500
"""Lines of a run that are kept before they are written."""


@dataclass(frozen=True)
class Plan:
    """What `campaign run` is asked for; the options are explained there. `function` (``module:name``) audits."""

    sources: tuple[str, ...]
    lake: str
    rig: str | None = None
    scheduler: str = running.LOCAL
    workers: int | None = None
    exclude: tuple[str, ...] = ()
    shard: str | None = None
    resume: bool = False
    limits: Limits = NO_LIMITS
    reports: str = "failed"
    dbc: tuple[str, ...] = ()
    rules: str | os.PathLike[str] | None = None
    select: str | None = None
    ignore: str | None = None
    waivers: str | os.PathLike[str] | None = None
    fail_on: str = "error"
    function: str = FUNCTION

    def run(self, show: progress.Show, say: progress.Show) -> int:
        """Run it: `show` the tally, `say` what could not be audited; the exit code.

        ConfigurationError: a source, a rig, rules, waivers, the lake, the scheduler. SchedulerLost."""
        return _run(self, show, say)


@dataclass
class Judged:
    """The settings of a plan by what names them, each collected and put into the lake once."""

    plan: Plan
    lake: Lake
    known: dict[tuple[str | None, tuple[str, ...]], tuple[str, Sequence[Part]]] = field(default_factory=dict)
    waivers: Sequence[Waiver] = ()
    """Those of the plan, which are in each setting."""

    def of(self, rig: str | None, dbc: tuple[str, ...] = (), place: str = "") -> tuple[str, Sequence[Part]]:
        """(identity of the setting, parts of its rig). ConfigurationError: no rig, or one that is wrong."""
        plan, named = self.plan, rig or self.plan.rig
        if named is None:
            raise ConfigurationError("no rig file", file=place or None, advice="name one with --rig, or in the table")
        if (named, dbc) not in self.known:
            document = collect(
                named,
                dbc=dbc or plan.dbc,
                rules=plan.rules,
                select=plan.select,
                ignore=plan.ignore,
                waivers=plan.waivers,
            )
            setting = load(document)
            self.known[named, dbc] = task.prepare(self.lake, document), setting.rig.parts
            self.waivers = setting.waivers or ()
        return self.known[named, dbc]

    def parts(self, found: Found) -> Sequence[Part]:
        """The files of a recording, as its rig has them."""
        return self.of(found.rig, found.dbc, found.place or found.uri)[1]


def _run(plan: Plan, show: progress.Show, say: progress.Show) -> int:
    task.require_reports(plan.reports)
    lake = _lake(plan)
    judged = Judged(plan, lake)
    everything = list(find(plan.sources, judged.parts, without=lake.root, exclude=plan.exclude))
    found = _of_shard(everything, plan.shard)
    lost = unmatched(judged.waivers, [one.uri for one in everything])
    done = running.run(_requests(plan, judged, found), plan.scheduler, plan.workers, plan.limits, plan.function)
    code = _watched(plan, lake, done, len(found), show, say)
    for waiver in lost:
        say(f"{waiver} matches no recording of this campaign")
    return max(code, 1) if lost and plan.fail_on != "never" else code


def _watched(
    plan: Plan, lake: Lake, done: Iterable[Summary], total: int, show: progress.Show, say: progress.Show
) -> int:
    """Count the summaries and say what could not be audited; the exit code."""
    verdicts: Counter[str] = Counter()
    kept, code = 0, 0
    if progress.wanted(total, os.isatty(2)):
        done, (show, say) = progress.along(done, total, (show, say), rate=True)
    try:
        for summary in _noted(lake, done):
            verdicts[summary["verdict"]] += 1
            kept += summary["kept"]
            code = max(code, exit_code(summary, plan.fail_on))
            if "reason" in summary:
                say(summary["reason"])
    except (KeyboardInterrupt, NineauditError):
        say(f"stopped after {verdicts.total()} of {total} recordings: run it again with --resume to go on")
        raise
    show(_tally(plan.lake, verdicts, kept))
    return code


def exit_code(summary: Mapping[str, Any], fail_on: str) -> int:
    """0 gate passed, 1 gate failed, 3 not audited, as of `check`."""
    if summary["verdict"] == "not_audited":
        return 3
    return int(summary["gate"] in {"error": ("error",), "warning": ("error", "warning"), "never": ()}[fail_on])


def _requests(plan: Plan, judged: Judged, found: Iterable[Found]) -> Iterator[Request]:
    for one in found:
        yield {
            "uri": one.uri,
            "inputs": judged.of(one.rig, one.dbc, one.place)[0],
            "lake": judged.lake.uri,
            "folder": str(Path.cwd()),
            "test": dict(one.test),
            "resume": plan.resume,
            "reports": plan.reports,
            "version": version("nineaudit"),
        }


def _lake(plan: Plan) -> Lake:
    """The lake, by a name that is the same from every folder."""
    if plan.lake.startswith("memory://"):
        raise ConfigurationError("only this process would see it", place="--lake", found=plan.lake, expected="a folder")
    uri = _whole(plan.lake)
    if any(f"{_whole(source)}/".startswith(f"{uri}/") for source in plan.sources):
        advice = "a folder beside the recordings, or one below them"
        raise ConfigurationError("the recordings are in it", place="--lake", found=plan.lake, advice=advice)
    return lakes.open_lake(uri, create=True)


def _whole(uri: str) -> str:
    """A name that is the same from every folder, without a slash at its end."""
    return str(local_path(uri).absolute()) if is_local(uri) else uri.rstrip("/")


def _of_shard(found: list[Found], shard: str | None) -> list[Found]:
    """The recordings of the I-th of N parts, by the hash of their uris."""
    if shard is None:
        return found
    i, _, n = shard.partition("/")
    if not (i.isdigit() and n.isdigit() and 1 <= int(i) <= int(n)):
        raise ConfigurationError("no such part", place="--shard", found=shard, expected="I/N, as 1/8 to 8/8")
    return [one for one in found if int(lakes.hashed(one.uri)[3:], 16) % int(n) == int(i) - 1]


def _noted(lake: Lake, done: Iterable[Summary]) -> Iterator[Summary]:
    """The summaries as they are; what varies from run to run is written to runs/, some hundred lines at once. The
    edition becomes the newest when there is something in it."""
    name = f"runs/{dt.datetime.now(dt.UTC):%Y%m%dT%H%M%SZ}-{uuid.uuid4().hex[:8]}"
    lines: list[str] = []
    count, newest = 0, None
    try:
        for summary in done:
            if summary["edition"] != newest:
                newest = summary["edition"]
                lakes.make_newest(lake, newest)
            lines.append(json.dumps(summary, ensure_ascii=False) + "\n")
            if len(lines) == _LINES:
                count += 1
                lakes.write_text(lake, f"{name}-{count}.jsonl", "".join(lines))
                lines.clear()
            yield summary
    finally:
        if lines:
            lakes.write_text(lake, f"{name}-{count + 1}.jsonl", "".join(lines))


def _tally(lake: str, verdicts: Mapping[str, int], kept: int) -> str:
    """``lake: 12 recordings: 2 fail, 1 not audited, 9 pass; 3 of them from before``."""
    from nineaudit.checking import tally

    return f"{lake}: {tally(verdicts)}" + (f"; {kept} of them were audited before" if kept else "")
