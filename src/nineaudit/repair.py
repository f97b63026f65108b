"""A new file with the faulty channel rebuilt, and beside it what was done. The original is never written to."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.auditing import Audit, mend
from nineaudit.diagnose import Status
from nineaudit.errors import ConfigurationError, RecordingError
from nineaudit.readers import fingerprint
from nineaudit.reconstruct import Reconstruction
from nineaudit.recording import Source
from nineaudit.writers import write_recording

SCHEMA = "nineaudit/provenance/1"


def repair(
    audit: Audit,
    output: Path,
    *,
    channel: str | None = None,
    reason: str = "",
    by: str = "",
    dbc: Sequence[Path] | None = None,
    force: bool = False,
    now: datetime | None = None,
) -> Path:
    """Write the recording with one channel (two that were swapped) repaired to `output`, and `output`.provenance.json;
    returns the latter.

    `channel` None: what the diagnosis isolated. ConfigurationError when nothing was isolated and no
    channel is given (a group is never repaired on its own), or when a file is in the way and `force` is not set;
    EstimationError when the channel cannot be rebuilt; RecordingError when the original changed meanwhile.
    """
    made = provenance_path(output)
    for path in (output, made):
        if path.exists() and not force:
            raise ConfigurationError(
                "the file exists", file=path, advice="choose another --output, or overwrite it with --force"
            )
    rebuilt = _reconstruction(audit, channel)
    write_recording(audit.recording, output, dbc=dbc, readings=repaired_readings(audit, rebuilt), force=force)
    original = audit.recording.source
    if original.path.exists() and fingerprint(original.path)[1] != original.sha256:
        output.unlink()
        raise RecordingError(
            "the original has changed since it was read, and the repair was taken back",
            file=original.path,
            advice="run the repair again",
        )
    document = provenance(audit, rebuilt, output, reason, by, datetime.now(UTC) if now is None else now)
    _write_atomically(made, json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    return made


def provenance_path(output: Path) -> Path:
    return output.with_name(output.name + ".provenance.json")


def repaired_readings(audit: Audit, rebuilt: Reconstruction) -> FloatArray:
    """(n,k) SI: the recording as it was read, with the replaced samples rebuilt and their zero put back."""
    out = audit.recording.readings.copy()
    columns = [audit.recording.rig.array.index(c) for c in rebuilt.channels]
    values = rebuilt.rebuilt + (audit.case.zero[columns] if rebuilt.zeros is None else rebuilt.zeros)
    out[:, columns] = np.where(rebuilt.replaced, values, out[:, columns])
    return out


def _original(source: Source) -> dict[str, Any]:
    return {"path": source.path.name, "sha256": source.sha256, "bytes": source.size, "altered": False}


def provenance(
    audit: Audit, rebuilt: Reconstruction, output: Path, reason: str, by: str, now: datetime
) -> dict[str, Any]:
    """What, from what, how, how well, by whom, when and with which software (ISO/IEC 17025 7.5, 7.11)."""
    source, rig, diagnosis = audit.recording.source, audit.recording.rig, audit.diagnosis
    return {
        "schema": SCHEMA,
        "original": _original(source) | ({"parts": [_original(part) for part in source.parts]} if source.parts else {}),
        "output": {"path": output.name, "sha256": fingerprint(output)[1]},
        "rig": {"name": rig.name, "sha256": rig.sha256},
        "rulebook": {"sha256": audit.rulebook.sha256},
        "channels": list(rebuilt.channels),
        "interval_s": list(rebuilt.interval),
        "samples_replaced": int(rebuilt.replaced.any(axis=1).sum()),
        "samples": int(rebuilt.replaced.shape[0]),
        "method": rebuilt.method,
        "undone": _undone(rebuilt),
        "donors": list(rebuilt.donors),
        "u_rms": rebuilt.u_rms,
        "unit": "m/s^2" if rig.array[rebuilt.channels[0]].kind == "accelerometer" else "rad/s",
        "bound_ratio": rebuilt.bound_ratio if math.isfinite(rebuilt.bound_ratio) else None,
        "diagnosis": {
            "status": str(diagnosis.status),
            "channels": list(diagnosis.channels),
            "reason": diagnosis.reason,
        },
        "reason": reason,
        "by": by,
        "utc": now.astimezone(UTC).isoformat(timespec="seconds"),
        "tool": dict(audit.tool),
    }


def _undone(rebuilt: Reconstruction) -> dict[str, Any] | None:
    """The fault that was undone by its model, its parameters and their standard uncertainties (SI); None: rebuilt."""
    if rebuilt.fault is None:
        return None
    return {"fault": rebuilt.fault, "parameters": dict(rebuilt.parameters), "u": dict(rebuilt.parameters_u)}


def _reconstruction(audit: Audit, channel: str | None) -> Reconstruction:
    known = audit.recording.channels
    if channel is not None and channel not in known:
        raise ConfigurationError(
            "no such channel", place="--channel", found=channel, expected="one of " + ", ".join(known)
        )
    if audit.reconstruction is not None and channel in (None, *audit.reconstruction.channels):
        return audit.reconstruction
    status, group = audit.diagnosis.status, ", ".join(audit.diagnosis.channels)
    if channel is None and status is Status.ISOLATED and len(audit.diagnosis.channels) == 1:
        channel = audit.diagnosis.channels[0]  # mend says why it could not be rebuilt
    if channel is not None:
        return mend(audit.case, channel)
    what = {
        Status.HEALTHY: "no channel is faulty: there is nothing to repair",
        Status.ISOLATED: f"{group} are at fault together; nothing undoes it, and one channel can be rebuilt at a time",
        Status.AMBIGUOUS: f"the culprit is one of {group}, and this recording cannot tell which",
    }.get(status, f"no channel was isolated: {audit.diagnosis.reason}")
    raise ConfigurationError(
        what,
        file=audit.recording.source.path,
        advice="" if status is Status.HEALTHY else "if you know the channel from elsewhere, name it with --channel",
    )


def _write_atomically(path: Path, text: str) -> None:
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    temporary.write_text(text, encoding="utf-8")
    os.replace(temporary, path)
