"""Rebuild the example report and result: ``python reports/build.py``. CI rebuilds them and expects no difference.

The recording is that of `nineaudit demo`, its readings rounded to 1e-6 g_0, so that the last bits of another machine's
arithmetic do not reach the file. (A coarser step would put points of the figures exactly between two pixels.) The
Python version is left out of what the report says of its making; numpy and scipy are pinned by constraints.txt.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

import nineaudit as na
from nineaudit import demo
from nineaudit.commands import simulated
from nineaudit.report import result_document, to_json
from nineaudit.rig import preset_text
from nineaudit.units import G0
from nineaudit.writers import write_recording

HERE = Path(__file__).parent
STEP = 1e-6 * G0


def example() -> na.Audit:
    """The audit of the demonstration's recording, the same on every machine."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / demo.RIG).write_text(preset_text(demo.PRESET), encoding="utf-8", newline="\n")
        rig = na.load_rig(folder / demo.RIG)
        recording = simulated(rig, demo.MOTION, (demo.FAULT,), seed=demo.SEED)
        readings = np.round(recording.readings / STEP) * STEP
        write_recording(recording, folder / demo.RECORDING, readings=readings)
        recording = na.read(folder / demo.RECORDING, rig)
    source = replace(recording.source, path=Path(demo.RECORDING))
    audit = na.audit(replace(recording, source=source, rig=replace(rig, path=Path(demo.RIG))))
    return replace(audit, tool={name: version for name, version in audit.tool.items() if name != "python"})


def main() -> None:
    audit = example()
    na.write_report(audit, HERE / "report.html")
    (HERE / "result.json").write_text(to_json(result_document(audit)), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
