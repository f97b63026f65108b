"""The command `compare`: every scheme that a recording's sensors allow, side by side. It returns what to print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nineaudit.errors import ConfigurationError
from nineaudit.options import Channels, Dbc, Recording, RigOption, example

EXAMPLE = example("nineaudit compare T0001.csv --rig rig.toml --html schemes.html --json schemes.json")

Reference = Annotated[str | None, typer.Option(metavar="SCHEME", help="Default: map, the whole-record fit.")]
Draws = Annotated[int, typer.Option(help="Of the instrument, for the budgets of the differences.")]
Class = Annotated[
    float | None,
    typer.Option(metavar="CLASS", help="Of all curves; default 180, unless the recording went through it; 0: none."),
]
Filter = Annotated[
    str | None,
    typer.Option(
        "--filter",
        metavar="KIND:VALUE",
        help="Of all curves, in place of --cfc: four-pole:HZ, the Butterworth of Martin 1998, as four-pole:300.",
    ),
]
Html = Annotated[Path | None, typer.Option(metavar="F", help="Write the page with the curves.")]
Json = Annotated[Path | None, typer.Option(metavar="F", help="Write the result for machines.")]


def compare(
    recording: Recording,
    rig: RigOption,
    reference: Reference = None,
    draws: Draws = 16,
    cfc: Class = None,
    curve_filter: Filter = None,
    channels: Channels = None,
    dbc: Dbc = None,
    html: Html = None,
    json: Json = None,
) -> tuple[list[str], int]:
    """Run every scheme that the sensors allow and compare α, ω and the acceleration of every point: correlation,
    ISO 18571 rating, differences against what the rig's uncertainties explain.

    The exit code is 0 also where a difference is not explained: `nineaudit check` judges.
    """
    from nineaudit import comparison
    from nineaudit.case import Case
    from nineaudit.commands import only_channels
    from nineaudit.curve_filter import named
    from nineaudit.outputs import protect, write_text
    from nineaudit.readers import read
    from nineaudit.report import comparison_document, comparison_page
    from nineaudit.report.machine import to_json
    from nineaudit.rig import load_rig

    if cfc is not None and curve_filter is not None:
        raise ConfigurationError("two filters", place="--filter", found="--cfc too", expected="one of them")
    other = None if curve_filter is None else named(curve_filter)
    instrument = load_rig(rig)
    protect([html, json], [*instrument.files(recording), rig, *(dbc or instrument.dbc)])
    found = only_channels(read(recording, instrument, dbc=dbc or ()), channels)
    compared = comparison.compare(Case(found), reference, draws, cfc=cfc, other=other)
    lines = comparison_page.lines(compared, found)
    if html is not None:
        write_text(html, comparison_page.render(compared, found))
        lines.append(str(html))
    if json is not None:
        write_text(json, to_json(comparison_document.document(compared, found)))
        lines.append(str(json))
    return lines, 0
