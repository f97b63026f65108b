"""The subcommand `campaign run`."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nineaudit.campaign.app import campaign_app
from nineaudit.errors import ConfigurationError
from nineaudit.options import Rules, example
from nineaudit.progress import Show

if TYPE_CHECKING:
    from nineaudit.campaign.guard import Limits

FailOn = StrEnum("FailOn", ["error", "warning", "never"])
Reports = StrEnum("Reports", ["failed", "all", "none"])
Exclude = Annotated[
    list[str] | None, typer.Option(metavar="GLOB", help="Not these files of folders: '*.log'; may be repeated.")
]
_SOURCES = (
    "Folders, globs, ZIP archives, tables with a column `recording`, recordings; s3:// and all that fsspec knows."
)


@campaign_app.command(
    epilog=example(
        "nineaudit campaign run tests --rig rig.toml --lake lake",
        "nineaudit campaign run tests.csv --lake s3://bucket/lake \\",
        "    --scheduler tcp://10.0.0.5:8786 --resume",
    )
)
def run(
    sources: Annotated[list[str], typer.Argument(metavar="SOURCE...", help=_SOURCES)],
    lake: Annotated[str, typer.Option(metavar="URI", help="Where the results are kept; made where there is none.")],
    rig: Annotated[
        str | None, typer.Option(metavar="RIG.toml", help="Rig file of recordings for which no table names one.")
    ] = None,
    scheduler: Annotated[
        str, typer.Option(metavar="local|ADDRESS|FILE", help="Dask: local, tcp://HOST:PORT, or a scheduler file.")
    ] = "local",
    workers: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Of a local run; default: one a core.")
    ] = None,
    exclude: Exclude = None,
    shard: Annotated[str | None, typer.Option(metavar="I/N", help="Only part I of N, for job arrays.")] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Trust size and time of recordings that were read before.")
    ] = False,
    timeout: Annotated[float | None, typer.Option(metavar="S", min=0.1, help="Longest audit of one recording.")] = None,
    memory: Annotated[
        str | None, typer.Option(metavar="SIZE", help="Most memory of one audit, as 2GiB or 500MB.")
    ] = None,
    retries: Annotated[int, typer.Option(metavar="N", min=0, help="After an audit that crashed.")] = 2,
    reports: Annotated[Reports, typer.Option(help="Of which recordings an HTML report is kept.")] = Reports.failed,
    dbc: Annotated[
        list[str] | None, typer.Option(metavar="F", help="CAN database in place of the rig's; may be repeated.")
    ] = None,
    rules: Rules = None,
    select: Annotated[str | None, typer.Option(metavar="CODES", help="Only these rules: RB301,RQ")] = None,
    ignore: Annotated[str | None, typer.Option(metavar="CODES", help="Not these rules: ZO,RQ203")] = None,
    waivers: Annotated[Path | None, typer.Option(metavar="W.toml", help="Violations that were accepted.")] = None,
    fail_on: Annotated[FailOn, typer.Option(help="Findings for which the exit code is 1.")] = FailOn.error,
) -> Callable[[Show, Show], int]:
    """Audit thousands of recordings on Dask into a lake. What is there already is not done again.

    Exit codes: 0 every gate passed, 1 findings at or above --fail-on, 3 at least one could not be audited or the
    scheduler went away, 130 after Ctrl-C. Nothing that was finished is lost: run it again with --resume.
    """
    from nineaudit.campaign.campaigning import Plan
    from nineaudit.campaign.extra import require

    require("dask", "distributed", "fsspec", "psutil")
    return Plan(
        sources=tuple(sources),
        lake=lake,
        rig=rig,
        scheduler=scheduler,
        workers=workers,
        exclude=tuple(exclude or ()),
        shard=shard,
        resume=resume,
        limits=_limits(timeout, memory, retries),
        reports=str(reports),
        dbc=tuple(dbc or ()),
        rules=rules,
        select=select,
        ignore=ignore,
        waivers=waivers,
        fail_on=str(fail_on),
    ).run


def _limits(timeout: float | None, memory: str | None, retries: int) -> Limits:
    """ConfigurationError where `memory` is no size."""
    from dask.utils import parse_bytes

    from nineaudit.campaign.guard import Limits

    try:
        return Limits(timeout, None if memory is None else parse_bytes(memory), retries)
    except ValueError as error:
        raise ConfigurationError("no size", place="--memory", found=memory, expected="as 2GiB or 500MB") from error
