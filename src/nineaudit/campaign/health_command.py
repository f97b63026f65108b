"""The commands `campaign health` and `campaign rig`: what the tests of a lake say of its sensors, and of a rig file.

They return what is to be printed, with the exit code. Heavy modules are imported inside the functions.
"""

from __future__ import annotations

import json
from typing import Annotated

import typer

from nineaudit.campaign.commands import campaign_app
from nineaudit.campaign.table_commands import Edition, Ended, LakeOption
from nineaudit.errors import ConfigurationError
from nineaudit.options import example

Tolerance = Annotated[
    float, typer.Option("--tolerance", metavar="R", help="Of a gain, relative: beyond it (less U), recalibrate.")
]


@campaign_app.command(
    "health",
    epilog=example("nineaudit campaign health lake", "nineaudit campaign health lake --tolerance 0.02 --json"),
)
def health(
    lake: LakeOption,
    tolerance: Tolerance = 0.01,
    edition: Edition = None,
    as_json: Annotated[bool, typer.Option("--json", help="A JSON document in place of the table.")] = False,
) -> Ended:
    """Which sensor is going bad? All tests together, by serial number: trend, shock history, what to recalibrate.

    Exit code 1 where a sensor is to be recalibrated, a seat to be measured, or one of several is to be found.
    """
    from nineaudit.campaign.health.assess import assess
    from nineaudit.campaign.health.words import document, text_table
    from nineaudit.campaign.lake import entries, open_lake

    _require_tolerance(tolerance)
    found = assess(entries(open_lake(lake), edition), tolerance)
    said = json.dumps(document(found), indent=2, ensure_ascii=False) if as_json else text_table(found)
    return [said], 1 if found.action else 0


def _require_tolerance(value: float) -> None:
    if not 0.0 < value < 1.0:
        raise ConfigurationError("tolerance", place="--tolerance", found=value, expected="between 0 and 1, as 0.01")
