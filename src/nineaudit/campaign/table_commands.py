"""The commands `campaign compact`, `query`, `diff` and `report`: what the results of a lake say together.

They return what is to be printed, with the exit code. Heavy modules are imported inside the functions.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nineaudit.campaign.app import campaign_app
from nineaudit.options import example
from nineaudit.progress import Show
from nineaudit.units import counted

if TYPE_CHECKING:
    from nineaudit.campaign.index.index_page import Section
    from nineaudit.campaign.lake import Lake
    from nineaudit.campaign.results.compact import Compaction

LakeOption = Annotated[str, typer.Argument(metavar="LAKE", help="A folder, s3://bucket/lake, any place of fsspec.")]
Edition = Annotated[
    str | None, typer.Option("--edition", metavar="E", help="Rules and tool; default: those of the newest run.")
]
DiffFormat = StrEnum("DiffFormat", ["text", "json"])
QueryFormat = StrEnum("QueryFormat", ["table", "csv", "json", "parquet"])
DAMAGED = 3
"""Exit code where an entry of the lake cannot be used."""
Ended = tuple[list[str], int]
Telling = Callable[[Show, Show], int]
"""What shows and says as it goes, and gives the exit code."""


@campaign_app.command("compact", epilog=example("nineaudit campaign compact lake"))
def compact(lake: LakeOption, edition: Edition = None) -> Ended:
    """Make the tables (Parquet) of a lake from its results.

    The same results give the same bytes. Exit code 3 where a result is damaged: it is named and left out.
    """
    from nineaudit.campaign.lake import open_lake
    from nineaudit.campaign.results import compact as compacting

    return _compacted(compacting.compact(open_lake(lake), edition))


def _compacted(done: Compaction) -> Ended:
    from nineaudit.campaign.results import schema
    from nineaudit.report.numbers import printable

    wrong = [f"{printable(one.place)}: left out: {printable(one.why)}" for one in done.damaged]
    left = f"; {len(wrong)} left out" if wrong else ""
    said = f"{counted(done.recordings, 'recording')} of edition {done.edition}{left}: tables {', '.join(schema.TABLES)}"
    return [*wrong, said], DAMAGED if wrong else 0


@campaign_app.command(
    "query",
    epilog=example(
        'nineaudit campaign query lake "SELECT verdict, count(*) FROM recordings GROUP BY verdict"',
        'nineaudit campaign query lake "DESCRIBE findings"',
    ),
)
def query(
    lake: LakeOption,
    sql: Annotated[str, typer.Argument(metavar="SQL", help="One SELECT; it can change nothing and read nothing else.")],
    format: Annotated[QueryFormat | None, typer.Option(help="Default: a table, or by the suffix of --output.")] = None,
    output: Annotated[Path | None, typer.Option(metavar="F", help="Write the answer to this file.")] = None,
) -> Telling:
    """Ask the tables of a lake in SQL (DuckDB): recordings, findings, candidates, sensors, provenance."""
    from nineaudit.campaign.lake import open_lake
    from nineaudit.campaign.results import answers
    from nineaudit.campaign.results.compact import stored
    from nineaudit.campaign.results.query import select
    from nineaudit.outputs import write_text

    style = answers.style(format, output)
    opened = open_lake(lake)
    tables = stored(opened)
    answer = select(tables.tables, sql)
    if output is None:
        shown = [answers.as_text(answer, style, shutil.get_terminal_size((200, 24)).columns)]
        return _after(opened, tables.edition, shown)
    if style == "parquet":
        answers.write_parquet(answer, output)
    else:
        write_text(output, answers.as_text(answer, style) + "\n")
    return _after(opened, tables.edition, [f"{output}: {counted(answer.num_rows, 'row')}"])


@campaign_app.command(
    "diff",
    epilog=example(
        "nineaudit campaign diff lake-before lake",
        "nineaudit campaign diff lake@0123456789ab lake --format json",
    ),
)
def diff(
    base: Annotated[str, typer.Argument(metavar="BASE", help="LAKE or LAKE@EDITION.")],
    head: Annotated[str, typer.Argument(metavar="HEAD", help="LAKE or LAKE@EDITION.")],
    format: Annotated[DiffFormat, typer.Option(help="Of standard output.")] = DiffFormat.text,
) -> Ended:
    """What changed between two lakes, or two editions (rules and tool) of one: verdicts, culprits, rules.

    Exit code 0 where nothing did, 1 where something did, 3 where a result is damaged.
    """
    from nineaudit.campaign.results import diff as comparing

    found = comparing.difference(comparing.side(base), comparing.side(head))
    if format == DiffFormat.json:
        return [json.dumps(comparing.document(found), indent=2, ensure_ascii=False)], found.exit_code
    return comparing.lines(found), found.exit_code


@campaign_app.command("report", epilog=example("nineaudit campaign report lake --html index.html --junit junit.xml"))
def report(
    lake: LakeOption,
    html: Annotated[
        Path | None, typer.Option(metavar="F", help="Write the index: one page, a row a recording.")
    ] = None,
    junit: Annotated[Path | None, typer.Option(metavar="F", help="Write JUnit XML, a testcase a recording.")] = None,
) -> Telling:
    """Write the index page of a lake, and JUnit XML, from its tables (see `campaign compact`)."""
    from nineaudit.campaign.index import reporting
    from nineaudit.campaign.lake import open_lake
    from nineaudit.campaign.results.compact import stored
    from nineaudit.errors import ConfigurationError
    from nineaudit.outputs import protect

    if html is None and junit is None:
        raise ConfigurationError("nothing to write", expected="--html F, --junit F, or both")
    protect([html, junit], [])
    opened = open_lake(lake)
    tables = stored(opened)
    if html is not None:
        reporting.write_index(opened, tables, html, _sensors(opened, tables.edition))
    if junit is not None:
        reporting.write_junit_file(opened, tables, junit)
    return _after(opened, tables.edition, [str(path) for path in (html, junit) if path is not None])


def _after(lake: Lake, edition: str, lines: list[str]) -> Telling:
    """Show the lines; say where the tables are behind the results."""
    from nineaudit.campaign.results.stale import behind

    def tell(show: Show, say: Show) -> int:
        late = behind(lake, edition)
        if late is not None:
            say(late)
        for line in lines:
            show(line)
        return 0

    return tell


def _sensors(lake: Lake, edition: str) -> list[Section]:
    """What the tests say together of the sensors, where they say something; what is damaged was named by compact."""
    from nineaudit.campaign.entries import current_entries
    from nineaudit.campaign.health.assess import assess
    from nineaudit.campaign.health.page import section

    found = assess(current_entries(lake, edition, []))
    return [section(found)] if found.sensors else []
