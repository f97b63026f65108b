"""The command `motion`: what the body did, by a method, as a summary, a file and a page. It returns what to print."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nineaudit.errors import ConfigurationError
from nineaudit.options import Channels, Dbc, Force, Recording, RigOption, example
from nineaudit.units import counted

if TYPE_CHECKING:
    from nineaudit.case import Case
    from nineaudit.motion import Kinematics, Start
    from nineaudit.rig import Point, Rig

EXAMPLE = example(
    "nineaudit motion healthy.csv --rig rig.toml --point 10,0,-5 --output motion.csv",
)

Triple = tuple[float, float, float]


Points = Annotated[
    list[str] | None,
    typer.Option(
        "--point", metavar="[NAME=]X,Y,Z", help="In the rig's length unit, in place of its points; may be repeated."
    ),
]
MethodName = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="map, padgaonkar, ninacc, six-accelerometers, product-free, rates, periphery, co-planar, compact-cube, "
        "rgla, rgla-fourier, rgla-lanczos.",
    ),
]
Curves = Annotated[
    Path | None,
    typer.Option(metavar="F", help="All curves: .csv, .parquet, .mcap with poses, .blf or .asc with a database."),
]
Html = Annotated[Path | None, typer.Option(metavar="F", help="A page with plots.")]
Omega = Annotated[str | None, typer.Option(metavar="X,Y,Z", help="ω at the first sample, rad/s, if not 0.")]
Angles = Annotated[str, typer.Option(metavar="Y,P,R", help="Yaw, pitch, roll at first, degrees.")]
Velocity = Annotated[str, typer.Option(metavar="X,Y,Z", help="Of the origin at first, m/s.")]
Position = Annotated[str, typer.Option(metavar="X,Y,Z", help="Of the origin at first, m.")]
Gravity = Annotated[
    bool,
    typer.Option(
        "--gravity",
        help="The sensors feel gravity (laboratory +z): put it right by the attitude, from --angles on. Without it "
        "gravity stays as the zero leaves it: none at first, up to 2 g once the body has turned over.",
    ),
]
WorstCase = Annotated[
    str | None,
    typer.Option(metavar="[CH,..=]U", help="Six accelerometers: how far these errors of gain can take ω: 0.005"),
]
GyroResponse = Annotated[
    str | None, typer.Option(metavar="HZ,ZETA", help="Compare ω with the rate sensors through their response: 37,0.5")
]
Class = Annotated[
    float | None,
    typer.Option(metavar="CLASS", help="Filter the readings first (SAE J211-1), as 180; refused if they were before."),
]
Frame = Annotated[
    str | None,
    typer.Option(metavar="X,Y,Z,Y,P,R", help="Anatomical frame of results: origin, yaw, pitch, roll (°) in the rig's."),
]
CheckTriax = Annotated[
    str | None, typer.Option(metavar="PREFIX", help="Predict this extra triax from the others; HIC, GSI deviations.")
]


def motion(
    recording: Recording,
    rig: RigOption,
    point: Points = None,
    method: MethodName = "map",
    output: Curves = None,
    html: Html = None,
    omega: Omega = None,
    angles: Angles = "0,0,0",
    velocity: Velocity = "0,0,0",
    position: Position = "0,0,0",
    gravity: Gravity = False,
    frame: Frame = None,
    cfc: Class = None,
    channels: Channels = None,
    check_triax: CheckTriax = None,
    worst_case: WorstCase = None,
    gyro_response: GyroResponse = None,
    dbc: Dbc = None,
    force: Force = False,
) -> tuple[list[str], int]:
    """Motion of the body: ω, α, attitude; acceleration, velocity, position of points; HIC, GSI, a3ms, BrIC with their
    uncertainty.

    Exit code 1: the unit of all accelerations or rates is not the rig's, as the record itself shows; or the triax of
    --check-triax deviates by more than in the paper (HIC 0.29 %, GSI 0.80 %, Alem 1977) and than the stated
    uncertainties explain.
    """
    from nineaudit.case import Case
    from nineaudit.commands import only_channels
    from nineaudit.motion import motion_of
    from nineaudit.motion_files import files_of, writer_of
    from nineaudit.motion_methods import method_named
    from nineaudit.motion_text import gyro_lines, summary, triax_lines, worst_case_lines
    from nineaudit.outputs import protect, require_absent
    from nineaudit.readers import read
    from nineaudit.rig import load_rig

    method_named(method)
    instrument = load_rig(rig)
    outputs = () if output is None else files_of(output)
    protect([*outputs, html], [*instrument.files(recording), rig, *(dbc or instrument.dbc)])
    if output is not None:
        writer_of(output)
    for place in outputs:
        require_absent(place, force)
    instrument = _framed(with_points(instrument, point or []), frame)
    start = _start(omega, angles, velocity, position, gravity)
    chosen = only_channels(read(recording, instrument, dbc=dbc or ()), channels)
    case, notes = _filtered(Case(chosen), cfc)
    found = motion_of(case, method, start)
    found = replace(found, notes=(*notes, *found.notes))
    lines = [*summary(found, instrument, recording.name), *_written(found, instrument, recording, output, html, force)]
    lines += [*worst_case_lines(case, found, worst_case), *gyro_lines(case, found, gyro_response)]
    if check_triax is None:
        return lines, int(found.wrong_unit)
    said, passed = triax_lines(case, check_triax, method, start)
    return [*lines, *said], int(found.wrong_unit or not passed)


def _framed(rig: Rig, text: str | None) -> Rig:
    """The rig in an anatomical frame, if one is wanted."""
    if text is None:
        return rig
    import numpy as np

    from nineaudit.schemes.anatomical import in_frame
    from nineaudit.units import factor

    found = np.array(_finite(text, "--frame", "six", "x,y,z,yaw,pitch,roll"))
    return in_frame(rig, found[:3] * factor(rig.units.length, "length"), np.radians(found[3:]))


def _filtered(case: Case, class_: float | None) -> tuple[Case, list[str]]:
    """The case through a class, if one is wanted, and what is to be said of filters."""
    from nineaudit.case import Case
    from nineaudit.filtering import filtered, note
    from nineaudit.schemes.requirements import require_readings

    require_readings(case.array, case.recording.readings)
    said = note(case)
    if class_ is None:
        return case, [said or "no filter is stated or seen: peaks and injury values are those of unfiltered readings"]
    behind = Case(filtered(case.recording, class_))
    unstated = [said] if said and case.recording.rig.cfc is None else []
    return behind, [*unstated, behind.recording.source.notes[-1]]


def with_points(rig: Rig, texts: list[str]) -> Rig:
    """The rig with the points that `texts` ([NAME=]x,y,z, in its length unit) name, in place of its own if any.

    ConfigurationError where one is no three numbers, or two have one name.
    """
    import numpy as np

    from nineaudit.rig import Point
    from nineaudit.units import factor

    points: list[Point] = []
    for i, text in enumerate(texts, 1):
        name, _, numbers = text.rpartition("=")
        place = np.array(_triple(numbers, "--point")) * factor(rig.units.length, "length")
        points.append(Point(name or ("point" if len(texts) == 1 else f"point {i}"), place))
    if len({p.name for p in points}) < len(points):
        raise ConfigurationError("two points of one name", place="--point", found=[p.name for p in points])
    return replace(rig, points=tuple(points)) if points else rig


def _written(
    found: Kinematics, rig: Rig, recording: Path, output: Path | None, html: Path | None, force: bool
) -> list[str]:
    said = []
    if output is not None:
        from nineaudit.motion_files import files_of, write_motion

        notes = write_motion(found, output, force)
        said.append("; ".join([f"{output}: {counted(len(found.time), 'sample')} of every curve, SI units", *notes]))
        said += [f"{database}: its database" for database in files_of(output)[1:]]
    if html is not None:
        from nineaudit.outputs import write_text
        from nineaudit.report.motion_page import render_motion

        write_text(html, render_motion(found, rig, recording.name))
        said.append(f"{html}: values and plots")
    return said


def _start(omega: str | None, angles: str, velocity: str, position: str, gravity: bool) -> Start:
    from nineaudit.motion import Start

    yaw, pitch, roll = _triple(angles, "--angles")
    return Start(
        omega=None if omega is None else _triple(omega, "--omega"),
        euler=(math.radians(yaw), math.radians(pitch), math.radians(roll)),
        velocity=_triple(velocity, "--velocity"),
        position=_triple(position, "--position"),
        gravity=gravity,
    )


def _triple(text: str, option: str) -> Triple:
    x, y, z = _finite(text, option, "three", "x,y,z")
    return x, y, z


def _finite(text: str, option: str, count: str, form: str) -> list[float]:
    """As many finite numbers as `form` names. ConfigurationError where they are not."""
    from nineaudit.commands import numbers

    found = numbers(text, option) or []
    if len(found) != len(form.split(",")) or not all(map(math.isfinite, found)):
        raise ConfigurationError(f"not {count} numbers", place=option, found=text, expected=form)
    return found
