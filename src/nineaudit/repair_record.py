"""The record of a repair: what, from what, how, how well, by which rules and rig, by whom, when, which software."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.auditing import Audit
from nineaudit.files import sha256
from nineaudit.provenance import SCHEMA
from nineaudit.reconstruct import Reconstruction
from nineaudit.recording import Source
from nineaudit.writers import mcap_summary


def readings_to_write(audit: Audit, rebuilt: Reconstruction) -> FloatArray:
    """(n,k) SI: the recording as it was read, with the replaced samples rebuilt and their zero put back."""
    out = audit.recording.readings.copy()
    columns = [audit.recording.rig.array.index(c) for c in rebuilt.channels]
    values = rebuilt.rebuilt + (audit.case.zero[columns] if rebuilt.zeros is None else rebuilt.zeros)
    out[:, columns] = np.where(rebuilt.replaced, values, out[:, columns])
    return out


def provenance(
    audit: Audit, rebuilt: Reconstruction, output: Path, reason: str, by: str, now: datetime
) -> dict[str, Any]:
    """The record (nineaudit/provenance/1) but for the hash of `output` (ISO/IEC 17025 7.5, 7.11); SI units."""
    source, rig, diagnosis = audit.recording.source, audit.recording.rig, audit.diagnosis
    previous = source.provenance.document if source.provenance is not None else None
    return {
        "schema": SCHEMA,
        "original": _original(source) | ({"parts": [_original(part) for part in source.parts]} if source.parts else {}),
        "not_carried_over": left_behind(source, output),
        "rig": {"name": rig.name, "sha256": rig.sha256},
        "rulebook": {"sha256": audit.rulebook.sha256, "rules": len(audit.rulebook.rules)},
        "databases": [{"path": path.name, "sha256": sha256(path)} for path in rig.dbc if path.is_file()],
        "channels": list(rebuilt.channels),
        "interval_s": list(rebuilt.interval),
        "stretches_s": {c: _stretches(audit, rebuilt, k) for k, c in enumerate(rebuilt.channels)},
        "samples_replaced": int(rebuilt.replaced.any(axis=1).sum()),
        "samples": int(rebuilt.replaced.shape[0]),
        "method": rebuilt.method,
        "undone": _undone(rebuilt),
        "donors": list(rebuilt.donors),
        "u_rms": rebuilt.u_rms,
        "u_max": float(rebuilt.u[rebuilt.replaced].max()),
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
    } | ({} if previous is None else {"previous": previous})


def _original(source: Source) -> dict[str, Any]:
    kept = {"path": source.path.name, "sha256": source.sha256, "bytes": source.size, "altered": False}
    return kept | ({"damage": [str(damage) for damage in source.damage]} if source.damage else {})


def left_behind(source: Source, output: Path) -> list[str]:
    """What of the original could not be carried over into `output`: in an MCAP log that is continued every byte is;
    else what could not be read is not, and of an MCAP log that had to be written anew, whatever is not the rig's."""
    damage = [f"{file.path.name}: {damage}" for file in source.files for damage in file.damage]
    if source.format != "mcap" or output.suffix.lower() != ".mcap" or source.parts:
        return damage
    if source.path.exists() and mcap_summary.read(source.path) is not None:
        return []
    anew = "the log cannot be continued and was written anew: topics that are not the rig's, attachments and metadata"
    return [f"{source.path.name}: {anew}", *damage]


def _stretches(audit: Audit, rebuilt: Reconstruction, k: int) -> list[list[float]]:
    """First and last time of each run of replaced samples; of a fault that was undone, of all of them."""
    if rebuilt.fault is not None:
        return [list(rebuilt.interval)]
    time = audit.recording.time
    return [[float(time[first]), float(time[last])] for first, last in _runs(rebuilt.replaced[:, k])]


def _runs(marked: BoolArray) -> list[tuple[int, int]]:
    """(first, last) of each run of marked samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]


def _undone(rebuilt: Reconstruction) -> dict[str, Any] | None:
    """The fault that was undone by its model, its parameters and their standard uncertainties (SI); None: rebuilt."""
    if rebuilt.fault is None:
        return None
    return {"fault": rebuilt.fault, "parameters": dict(rebuilt.parameters), "u": dict(rebuilt.parameters_u)}
