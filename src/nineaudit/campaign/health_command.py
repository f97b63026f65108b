"""The commands `campaign health` and `campaign rig`: what the tests of a lake say of its sensors, and of a rig file.

They return what is to be printed, with the exit code. Heavy modules are imported inside the functions.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nineaudit.campaign.app import campaign_app
from nineaudit.campaign.entries import Damaged, chosen, current_entries
from nineaudit.campaign.table_commands import Edition, Ended, LakeOption
from nineaudit.errors import ConfigurationError, RecordingError
from nineaudit.options import Force, example
from nineaudit.units import counted

if TYPE_CHECKING:
    from nineaudit.calibrating.changes import Keys
    from nineaudit.campaign.health.assess import Health
    from nineaudit.campaign.health.rig_file import Told
    from nineaudit.campaign.lake import Lake
    from nineaudit.rig import Rig

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
    from nineaudit.campaign.lake import open_lake

    _require_tolerance(tolerance)
    opened = open_lake(lake)
    found = assess(_sound(opened, chosen(opened, edition)), tolerance)
    said = json.dumps(document(found), indent=2, ensure_ascii=False) if as_json else text_table(found)
    return [said], 1 if found.action else 0


def _sound(lake: Lake, edition: str) -> Iterator[dict[str, Any]]:
    """The entries of an edition. RecordingError where one is damaged: a sensor is judged by all of its tests."""
    damaged: list[Damaged] = []
    yield from current_entries(lake, edition, damaged)
    for one in damaged[:1]:
        advice = f"{len(damaged)} damaged: remove those that `campaign compact` names, and run the campaign again"
        raise RecordingError(f"cannot be used: {one.why}", file=one.place, advice=advice)


def _require_tolerance(value: float) -> None:
    if not 0.0 < value < 1.0:
        raise ConfigurationError("tolerance", place="--tolerance", found=value, expected="between 0 and 1, as 0.01")


@campaign_app.command("rig", epilog=example("nineaudit campaign rig lake rig.toml --output improved.toml"))
def rig(
    lake: LakeOption,
    rig: Annotated[Path, typer.Argument(metavar="RIG.toml", help="Rig file to start from.")],
    output: Annotated[Path, typer.Option("--output", metavar="F.toml", help="New rig file.")],
    edition: Edition = None,
    force: Force = False,
) -> Ended:
    """Write what the tests found of a rig's scales, axes and positions into a new rig file, with its evidence.

    Only numbers that the tests tell; beside it F.toml.evidence.json says where each comes from.
    """
    from nineaudit.calibrating.rig_text import calibrated
    from nineaudit.campaign.health.assess import assess
    from nineaudit.campaign.health.rig_file import evidence, improved
    from nineaudit.campaign.index.reporting import lake_name
    from nineaudit.campaign.lake import open_lake
    from nineaudit.outputs import protect, require_absent, write_text
    from nineaudit.report.machine import to_json
    from nineaudit.rig import load_rig

    beside = output.with_name(f"{output.name}.evidence.json")
    protect([output, beside], [rig])
    for path in (output, beside):
        require_absent(path, force)
    opened, stated = open_lake(lake), load_rig(rig)
    edition = chosen(opened, edition)
    found = assess(_sound(opened, edition))
    changes, told = improved(found, stated)
    if not changes:
        return [f"the tests tell nothing that {rig} does not say: {output} is not written"], 0
    about = {"name": lake_name(opened), "edition": edition}
    notes = _notes(changes, told, found, stated, about)
    write_text(output, calibrated(stated, changes, notes, output))
    write_text(beside, to_json(evidence(told, changes, found, stated, about)))
    return [
        *notes,
        f"{output}: the rig with {len(changes)} of {counted(len(stated.array), 'channel')} improved",
        str(beside),
    ], 0


def _notes(
    changes: Mapping[str, Keys], told: Sequence[Told], health: Health, rig: Rig, about: Mapping[str, str | None]
) -> list[str]:
    """Comments on top of the rig file: a line for every number that changed."""
    from nineaudit.campaign.health.words import amount
    from nineaudit.report.numbers import printable

    dates = sorted({d for m in health.sensors for d in (m.first, m.last) if d})
    lines = [
        f"Improved by nineaudit campaign rig from lake {about['name']}, edition {about['edition']}, "
        f"{counted(health.tests, 'test')}, {dates[0]} to {dates[-1]},",
        f"in {rig.path.name if rig.path else rig.name}, SHA-256 {rig.sha256}. Errors that they found, ± at k = 2:",
    ]
    for one in (one for one in told if one.channel in changes):
        said = [f"{p} {amount(p, one.value[p], 2.0 * one.told[p])}" for p in one.value if one.significant(p)]
        lines.append(f"{one.channel} (sensor {one.sensor}, {counted(one.tests, 'test')}): {', '.join(said)}")
    left = [one.channel for one in told if one.undecided]
    if left:
        lines.append(f"left as they were, for a change that may be another's: {', '.join(left)}")
    return [printable(line) for line in lines]
