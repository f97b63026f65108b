"""The demonstration: nine accelerometers, one of them clipped at half its peak; found, rebuilt, reported."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from nineaudit.checking import Outcome, write_page
from nineaudit.commands import audit_one, repaired, simulated, written
from nineaudit.errors import ConfigurationError
from nineaudit.outputs import make_folder, write_text

if TYPE_CHECKING:
    from nineaudit.auditing import Audit

FOLDER = Path("nineaudit-demo")
PRESET, MOTION, FAULT, SEED = "naap-3222", "general", "a1y:clipping=0.5", 0
RECORDING, REPAIRED, RIG = "recording.csv", "repaired.csv", "rig.toml"


def fresh_folder(wanted: Path | None) -> Path:
    """The folder for a demonstration, made: `wanted`, which must be empty, or nineaudit-demo, -2, -3, ...

    Raises ConfigurationError: `wanted` holds something, or no folder can be made.
    """
    folder = wanted or next(f for f in _names() if not f.exists() or _is_empty(f))
    if folder.exists() and not _is_empty(folder):
        raise ConfigurationError("is not an empty folder", file=folder, place="--output", advice="name another")
    make_folder(folder)
    return folder


def _names() -> Iterator[Path]:
    yield FOLDER
    number = 2
    while True:
        yield FOLDER.with_name(f"{FOLDER.name}-{number}")
        number += 1


def _is_empty(folder: Path) -> bool:
    return folder.is_dir() and not any(folder.iterdir())


def run(folder: Path) -> Iterator[str]:
    """Write rig, recording, report, result and repair into `folder`; yields what happened, a sentence a step."""
    from nineaudit.report import to_json
    from nineaudit.rig import load_rig, preset_text

    write_text(folder / RIG, preset_text(PRESET))
    rig = load_rig(folder / RIG)
    written(simulated(rig, MOTION, (FAULT,), seed=SEED), folder / RECORDING)
    yield f"Simulated a recording of {len(rig.array)} accelerometers in which a1y clips at half its peak."
    audit = audit_one(folder / RECORDING, rig)
    write_text(folder / "result.json", to_json(Outcome(audit.recording.source.path, audit).document()))
    write_page(audit, folder / "report.html")
    yield f"Checked it.    {_verdict(audit)}"
    repaired(audit, folder / REPAIRED, reason="demonstration", by="nineaudit demo")
    yield f"Repaired it.   {_change(audit)}"
    yield f"Checked again. {_verdict(audit_one(folder / REPAIRED, rig))}"
    yield f"Open {folder / 'report.html'}; beside it are the recording, the result as JSON, and the repair."


def _verdict(audit: Audit) -> str:
    from nineaudit.report.text import summary

    return summary(audit)


def _change(audit: Audit) -> str:
    """What the repair did to one result that people look at."""
    from nineaudit.units import display

    change, units = audit.impact["peak α"], audit.recording.rig.units
    before, after, expanded = (display(v, change.unit, units) for v in (change.before, change.after, 2 * change.u))
    return f"Peak α was {before} and is {after} (U {expanded}, k=2)."
