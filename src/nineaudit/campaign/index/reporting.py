"""`campaign report`: the index page and the JUnit file of a lake, from its tables."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from nineaudit.campaign.index.index_page import Section, render
from nineaudit.campaign.index.index_rows import WORST, index, reasons
from nineaudit.campaign.index.junit import write_junit
from nineaudit.campaign.lake import Lake
from nineaudit.campaign.results.compact import Stored
from nineaudit.files import partial_name, settle
from nineaudit.outputs import make_folder, unwritable, write_text


def write_index(lake: Lake, stored: Stored, path: Path, sections: Sequence[Section] = ()) -> None:
    """Write the index page. ConfigurationError where that cannot be."""
    found = index(stored)
    failed = [row for row in found.recordings if row["verdict"] == "fail"][:WORST]
    page = render(
        found,
        lake_name(lake),
        said=reasons(stored, failed),
        titles=_titles(),
        reports=_reports(lake),
        folder=_seen_from(lake, path),
        sections=sections,
    )
    write_text(path, page)


def write_junit_file(lake: Lake, stored: Stored, path: Path) -> None:
    """Write the JUnit XML, whole or not at all. ConfigurationError where that cannot be."""
    make_folder(path.parent)
    partial = partial_name(path)
    try:
        with partial.open("w", encoding="utf-8", newline="\n") as file:
            write_junit(stored, lake_name(lake), file)
        settle(partial, path)
    except OSError as error:
        raise unwritable(path, error) from error
    finally:
        partial.unlink(missing_ok=True)


def lake_name(lake: Lake) -> str:
    """What a lake is called: the last part of its place."""
    return lake.root.rstrip("/").rpartition("/")[2] or lake.uri


def _titles() -> dict[str, str]:
    """Titles of the rules that nineaudit ships; a laboratory's own rules stand with their codes."""
    from nineaudit.rulebook import load_rulebook

    return {rule.code: rule.title for rule in load_rulebook().rules}


def _reports(lake: Lake) -> frozenset[str]:
    """Names of the reports in the lake."""
    folder = lake.place("reports")
    names = lake.fs.ls(folder, detail=False) if lake.fs.exists(folder) else []
    return frozenset(str(name).rpartition("/")[2] for name in names)


def _seen_from(lake: Lake, path: Path) -> str | None:
    """The folder of the reports as a link from the page; None: a browser does not reach it."""
    if not lake.local:
        return None
    try:
        return Path(os.path.relpath(lake.place("reports"), path.resolve().parent)).as_posix()
    except ValueError:  # another drive of Windows
        return None
