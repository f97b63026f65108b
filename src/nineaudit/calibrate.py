"""The command `calibrate`: from runs with a known input to a rig file with scale, offset, axis and uncertainties.

The subcommands return what is to be printed. Heavy modules are imported inside the functions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nineaudit.errors import ConfigurationError
from nineaudit.options import Force, RigOption, example, group
from nineaudit.units import counted

if TYPE_CHECKING:
    from nineaudit.calibrating.changes import Keys
    from nineaudit.calibrating.inputs import Runs
    from nineaudit.calibrating.sheet import Sheet
    from nineaudit.rig import Rig

calibrate_app = group(
    help="Sensitivity vectors and offsets from a rate table, static flips or a staircase, into a rig file.",
    epilog=example("nineaudit calibrate flips flips.csv --rig rig.toml \\", "    --output calibrated.toml"),
)

Runs_ = Annotated[Path, typer.Argument(metavar="RUNS.csv", help="One row a run; its columns are said below.")]
Calibrated = Annotated[
    Path | None, typer.Option("--output", metavar="F.toml", help="New rig file; default: only print the results.")
]
Gravity = Annotated[float | None, typer.Option(metavar="M/S2", help="Of the place; default: standard, 9.80665.")]
Reference = Annotated[
    float, typer.Option(metavar="U", help="Relative standard uncertainty of the known input, as 0.001.")
]
Confidence = Annotated[float, typer.Option(metavar="P", help="Of the printed limits.")]
Single = Annotated[
    bool, typer.Option("--single-axis", help="Along the rig's axes only, where the runs do not span three directions.")
]
_EACH = (
    "Other columns are channels of the rig by name or signal, their readings as recorded, in the rig's unit, zero not "
    "taken off; an empty cell is a run that this channel was not in. run, note and time_s are not used."
)
_TABLE = (
    "Columns: up and out, the body directions that point up and away from the axis (+x, -z, or three numbers with "
    "spaces between them); rate_rpm, rate_deg_s or rate_rad_s, counter-clockwise seen from above; radius_mm, "
    "radius_cm, radius_m or radius_in, of the rig's origin from the axis."
)
_FLIPS = "Columns: up, the body direction that pointed up (+x, -z, or three numbers with spaces between them)."
_STAIRCASE = "Columns: level, the known input of the path, in the rig's unit of each channel."


def _end(columns: str, method: str, sheet: str) -> str:
    """The end of a help text: what the columns are, and an example that runs."""
    line = f"nineaudit calibrate {method} {sheet} --rig rig.toml \\"
    return f"{columns} {_EACH}\n\n" + example(line, "    --output calibrated.toml")


_SAID = {
    "rate-table": """Several orientations and speeds on a table with a vertical axis: scale, offset, axis of every
    channel.

    Accelerometers feel the centripetal acceleration and gravity, rate sensors the table's rate.
    """,
    "flips": """Six static positions, plus and minus 1 g along every body axis: scale, offset, axis of every
    accelerometer.

    Rate sensors feel nothing in them and stay as they are.
    """,
}


def _of_sensors(method: str) -> Callable[..., str]:
    """The command of a method by which sensors feel known inputs."""

    def calibrated(
        runs: Runs_,
        rig: RigOption,
        output: Calibrated = None,
        gravity: Gravity = None,
        reference_u: Reference = 0.0,
        confidence: Confidence = 0.95,
        single_axis: Single = False,
        force: Force = False,
    ) -> str:
        from nineaudit.calibrating import inputs
        from nineaudit.calibrating.sheet import read_sheet
        from nineaudit.rig import load_rig

        instrument, sheet = load_rig(rig), read_sheet(runs)
        read, columns = inputs.METHODS[method]
        lines, changes = _fitted(instrument, sheet, read(sheet), columns, gravity, reference_u, confidence, single_axis)
        return "\n".join([*lines, *_written(instrument, changes, sheet, method, output, [rig, runs], force)])

    calibrated.__doc__ = _SAID[method]
    return calibrated


calibrate_app.command("rate-table", epilog=_end(_TABLE, "rate-table", "table.csv"))(_of_sensors("rate-table"))
calibrate_app.command("flips", epilog=_end(_FLIPS, "flips", "flips.csv"))(_of_sensors("flips"))


@calibrate_app.command(epilog=_end(_STAIRCASE, "staircase", "staircase.csv"))
def staircase(
    runs: Runs_,
    rig: RigOption,
    output: Calibrated = None,
    reference_u: Reference = 0.0,
    confidence: Confidence = 0.95,
    force: Force = False,
) -> str:
    """Ten known levels at the input of every recording path: its gain, offset and linearity.

    The path's gain and offset are put behind the scale and offset that the rig states for the sensor: once.
    """
    from nineaudit.calibrating import changes, path, table
    from nineaudit.calibrating.sheet import numbers, read_sheet, readings
    from nineaudit.rig import load_rig

    _require_limits(reference_u, confidence)
    instrument, sheet = load_rig(rig), read_sheet(runs)
    _require_new(instrument, sheet)
    level = numbers(sheet, "level")
    found, absent = readings(sheet, instrument.array, ("level",))
    gains = [path.staircase(instrument.array[channel], level, values) for channel, values in found.items()]
    new = {gain.channel: changes.of_path(gain, instrument.array[gain.channel], reference_u) for gain in gains}
    lines = [*table.paths(gains, confidence), *_left(absent)]
    return "\n".join([*lines, *_written(instrument, new, sheet, "staircase", output, [rig, runs], force)])


def _fitted(
    rig: Rig,
    sheet: Sheet,
    runs: Runs,
    columns: Sequence[str],
    gravity: float | None,
    reference_u: float,
    confidence: float,
    single: bool,
) -> tuple[list[str], dict[str, Keys]]:
    """The printed results, and what they change, of every channel that the runs tell something about."""
    from nineaudit.calibrating import changes, table
    from nineaudit.calibrating.fit import fit
    from nineaudit.calibrating.inputs import felt
    from nineaudit.calibrating.sheet import readings
    from nineaudit.units import G0

    _require_limits(reference_u, confidence)
    local = _gravity(gravity, G0)
    found, absent = readings(sheet, rig.array, columns)
    still = [c for c in found if rig.array[c].kind == "gyroscope" and not runs.rate.any()]
    done = [
        fit(rig.array[channel], felt(rig.array[channel], runs, local), values, single=single)
        for channel, values in found.items()
        if channel not in still
    ]
    if not done:
        raise ConfigurationError(
            "rate sensors cannot be calibrated at rest", file=sheet.path, found=", ".join(still),
            advice="put them on a rate table: nineaudit calibrate rate-table",
        )  # fmt: skip
    new = {one.channel: changes.of_sensor(one, reference_u) for one in done}
    return [*table.sensors(done, confidence), *_left([*absent, *still])], new


def _written(
    rig: Rig,
    changes: Mapping[str, Keys],
    sheet: Sheet,
    method: str,
    output: Path | None,
    inputs: Sequence[Path],
    force: bool,
) -> list[str]:
    """Write the rig file, if one is wanted; what was written, as lines."""
    from nineaudit.calibrating.rig_text import calibrated
    from nineaudit.outputs import protect, require_absent, write_text

    if output is None:
        return []
    protect([output], inputs)
    require_absent(output, force)
    notes = [
        f"Calibrated by nineaudit calibrate {method} from {sheet.path.name}, SHA-256 {sheet.sha256},",
        f"in {rig.path.name if rig.path else rig.name}, SHA-256 {rig.sha256}: {', '.join(changes)}.",
        "The uncertainties are those of that day: enlarge gain and zero by what a sensor drifts until the test.",
    ]
    write_text(output, calibrated(rig, changes, notes, output))
    return [f"{output}: the rig with {len(changes)} of {counted(len(rig.array), 'channel')} calibrated"]


def _require_new(rig: Rig, sheet: Sheet) -> None:
    """ConfigurationError where the rig file says that this staircase is in it: it would be put behind itself."""
    if sheet.sha256 in rig.text:
        raise ConfigurationError(
            "this staircase is in the rig file already",
            file=rig.path,
            found=sheet.path.name,
            expected="a rig file from before it",
            advice="a path's gain is put behind the sensor's scale: once",
        )


def _left(channels: Sequence[str]) -> list[str]:
    return [f"left as the rig states them: {', '.join(channels)}"] if channels else []


def _gravity(value: float | None, standard: float) -> float:
    if value is not None and not 9.7 < value < 9.9:
        raise ConfigurationError(
            "gravity", place="--gravity", found=value, expected="m/s², 9.76 to 9.84 on the surface of the earth"
        )
    return standard if value is None else value


def _require_limits(reference_u: float, confidence: float) -> None:
    if not 0.0 < confidence < 1.0:
        raise ConfigurationError("confidence", place="--confidence", found=confidence, expected="between 0 and 1")
    if not 0.0 <= reference_u < 1.0:
        raise ConfigurationError(
            "uncertainty of the input", place="--reference-u", found=reference_u, expected="relative, such as 0.001"
        )
