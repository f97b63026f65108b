"""What the other commands do, as functions that return what is to be said. Nothing here prints.

Heavy modules are imported inside the functions, so that ``nineaudit --help`` does not pay for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nineaudit.errors import ConfigurationError
from nineaudit.outputs import require_absent, write_text
from nineaudit.units import counted

if TYPE_CHECKING:
    from nineaudit.array import Sensor
    from nineaudit.auditing import Audit
    from nineaudit.recording import Recording
    from nineaudit.rig import Rig
    from nineaudit.rulebook import Rulebook

_CAN = (".blf", ".asc")


def audit_one(path: Path, rig: Rig, dbc: Sequence[Path] = ()) -> Audit:
    """Read and audit one recording by the packaged rules. NineauditError where that cannot be."""
    from nineaudit.auditing import audit
    from nineaudit.readers import read

    return audit(read(path, rig, dbc=dbc))


def repaired(
    audit: Audit,
    output: Path,
    *,
    channel: str | None = None,
    reason: str = "",
    by: str = "",
    dbc: Sequence[Path] = (),
    force: bool = False,
) -> list[str]:
    """Write the repair of an audited recording and its provenance; what was done, as lines."""
    import json

    from nineaudit.repair import repair
    from nineaudit.units import display

    made = repair(audit, output, channel=channel, reason=reason, by=by, force=force, dbc=dbc or None)
    done = json.loads(made.read_text(encoding="utf-8"))
    u = display(done["u_rms"], done["unit"], audit.recording.rig.units, 2)
    return [
        f"{output}: {' and '.join(done['channels'])} {_how(done)}, {done['samples_replaced']} of "
        f"{counted(done['samples'], 'sample')}, standard uncertainty {u}",
        *(f"{output}: not carried over from {lost}" for lost in done["not_carried_over"]),
        f"{made}: what was done, how well, from what, by whom",
    ]


def _how(done: dict[str, Any]) -> str:
    return f"repaired ({done['method']})" if done["undone"] else "rebuilt from the other channels"


def simulated(
    rig: Rig,
    motion: str,
    faults: Sequence[str],
    *,
    seed: int = 0,
    rate: float = 10_000.0,
    duration: float | None = None,
) -> Recording:
    """A recording of a motion by the rig as it is drawn from its uncertainty, with faults."""
    from nineaudit.simulate import simulate

    return simulate(rig, motion, faults=faults, seed=seed, rate_hz=rate, duration_s=duration).recording


def written(recording: Recording, output: Path, dbc: Sequence[Path] = (), force: bool = False) -> list[str]:
    """Write a simulated recording; what was written, as lines.

    A CAN format for which there is no database gets one that is made for the rig, beside it.
    """
    from nineaudit.writers import make_dbc, write_recording

    require_absent(output, force)
    said = []
    if output.suffix.lower() in _CAN and not dbc and not recording.rig.dbc:
        database = output.with_suffix(".dbc")
        require_absent(database, force)
        write_text(database, make_dbc(recording.rig))
        said = [f"{database}: its database, to be named with --dbc"]
        dbc = (database,)
    done = write_recording(recording, output, dbc=list(dbc) or None, force=force)
    size = f"{counted(len(recording.channels), 'channel')}, {len(recording.time)} samples at {recording.rate:g} Hz"
    return [f"{output}: {'; '.join((size, *recording.source.notes, *done.notes))}", *said]


def budgeted(
    rig: Rig, recording: Path | None, *, motion: str = "general", html: Path | None = None, dbc: Sequence[Path] = ()
) -> list[str]:
    """The budget of a rig in a typical motion, or of a recording, as lines; as a page where `html` is given."""
    from nineaudit.budgets import budget_of, text, typical
    from nineaudit.case import Case
    from nineaudit.readers import read

    found = (
        typical(rig, motion) if recording is None else budget_of(Case(read(recording, rig, dbc=dbc)), str(recording))
    )
    said = list(text.lines(found))
    if html is not None:
        from nineaudit.budgets import page

        write_text(html, page.render(found))
        said += ["", str(html)]
    return said


def selftested(date: str | None = None, json: Path | None = None) -> tuple[list[str], bool]:
    """The validation record as lines, and whether every published number came out."""
    from nineaudit.selftest import all_checks, not_reproducible, record

    when = record.day(date)
    checks, absent = all_checks(), not_reproducible()
    if json is not None:
        write_text(json, as_json(record.document(checks, when, absent)) + "\n")
    return record.lines(checks, when, absent), all(check.passed for check in checks)


def rules_lines(book: Rulebook) -> list[str]:
    """Code, severity and title of every rule."""
    return [f"{rule.code}  {rule.severity:<7}  {rule.title}" for rule in book.rules]


def rig_lines(rig: Rig) -> list[str]:
    """A rig file as it was understood: one line, then one line a channel."""
    from nineaudit.units import FACTORS, display

    kinds = [sensor.kind for sensor in rig.array.sensors]
    accelerometers, gyroscopes = kinds.count("accelerometer"), kinds.count("gyroscope")
    sensors = f"{counted(accelerometers, 'accelerometer')}, {counted(gyroscopes, 'rate sensor')}"
    out = [f"{rig.name}: {sensors}, filter class {rig.filter_class}"]
    for sensor in rig.array.sensors:
        place = ", ".join(f"{x / FACTORS['length'][rig.units.length]:.4g}" for x in sensor.position)
        axis = ", ".join(f"{x:.4g}" for x in sensor.axis)
        si = "m/s^2" if sensor.kind == "accelerometer" else "rad/s"
        full = "" if sensor.full_scale is None else f", range {display(sensor.full_scale, si, rig.units)}"
        said = f"  {sensor.channel}: {sensor.kind}, at ({place}) {rig.units.length}, along ({axis}){full}"
        out.append(said + _calibrated(sensor))
    return out


def _calibrated(sensor: Sensor) -> str:
    """Scale and offset as the rig file states them, where they are not 1 and 0."""
    if (sensor.scale, sensor.offset) == (1.0, 0.0):
        return ""
    return f", scale {sensor.scale:.6g}, offset {sensor.offset / sensor.to_si:.4g} {sensor.unit}"


def preset_lines() -> list[str]:
    """Name and title of every preset."""
    from nineaudit.presets import PRESETS

    width = max(map(len, PRESETS))
    return [f"{name:<{width}}  {preset.title}" for name, preset in PRESETS.items()]


def as_json(document: dict[str, Any]) -> str:
    """A schema, to be read by people and editors."""
    import json

    return json.dumps(document, indent=2, ensure_ascii=False)


def numbers(text: str | None, option: str) -> list[float] | None:
    """``50,50,50`` as numbers. ConfigurationError where one is not."""
    try:
        return None if text is None else [float(part) for part in text.split(",")]
    except ValueError as error:
        raise ConfigurationError(
            "not a list of numbers", place=option, found=text, expected="numbers with commas between them"
        ) from error


def only_channels(recording: Recording, text: str | None) -> Recording:
    """The recording with the channels that `text` names (CH,..), all without. ConfigurationError: one is not known."""
    if text is None:
        return recording
    names, known = [name.strip() for name in text.split(",")], recording.channels
    unknown = [name for name in names if name not in known]
    if unknown or len(set(names)) < len(names):
        raise ConfigurationError(
            "no such channel" if unknown else "a channel twice",
            place="--channels",
            found=unknown[0] if unknown else text,
            expected="some of " + ", ".join(known),
        )
    return recording.only([known.index(name) for name in names])
