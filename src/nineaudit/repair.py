"""A new file with the faulty channel rebuilt, and beside it what was done. The original is never written to.

An MCAP log keeps every byte: what is rebuilt gets a topic of its own, and the record stands in the log as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.auditing import Audit, mend
from nineaudit.diagnose import Status
from nineaudit.errors import ConfigurationError, RecordingError
from nineaudit.files import partial_name, sealed, write_whole
from nineaudit.provenance import path_beside, to_text
from nineaudit.readers import fingerprint
from nineaudit.reconstruct import Reconstruction
from nineaudit.recording import Recording
from nineaudit.repair_record import provenance, readings_to_write
from nineaudit.signals import in_unit
from nineaudit.writers import Outcome, encode, mcap_summary, place
from nineaudit.writers.mcap_rebuilt import Column, add_rebuilt, log_time_of_zero

__all__ = ["provenance_path", "repair", "repaired_readings"]

provenance_path = path_beside
repaired_readings = readings_to_write


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
    returns the latter. Both appear whole, or what was there stays.

    `channel` None: what the diagnosis isolated. ConfigurationError when nothing was isolated and no
    channel is given (a group is never repaired on its own), or when a file is in the way and `force` is not set;
    EstimationError when the channel cannot be rebuilt; RecordingError when the original changed meanwhile.
    """
    beside = path_beside(output)
    for path in (output, beside):
        if path.exists() and not force:
            raise ConfigurationError(
                "the file exists", file=path, advice="choose another --output, or overwrite it with --force"
            )
    rebuilt = _reconstruction(audit, channel)
    document = provenance(audit, rebuilt, output, reason, by, datetime.now(UTC) if now is None else now)

    def make(unnamed: Path) -> Outcome:
        outcome = _written(audit, rebuilt, unnamed, dbc, document)
        _require_unchanged(audit.recording)
        _record(beside, document, output.name, unnamed)
        return outcome

    with _kept(beside):
        place(output, audit.recording, make, force=force)
    return beside


def _record(beside: Path, document: Mapping[str, Any], name: str, file: Path) -> None:
    """Write the record of a file that is to be called `name`."""
    original = {key: document[key] for key in ("schema", "original")}
    output = {"path": name, "sha256": fingerprint(file)[1]}
    write_whole(beside, to_text(sealed({**original, "output": output, **document})))


@contextmanager
def _kept(path: Path) -> Iterator[None]:
    """What follows may write a file; if it fails, the file is as it was."""
    before = path.read_bytes() if path.exists() else None
    done = False
    try:
        yield
        done = True
    finally:
        if not done and before is not None:
            path.write_bytes(before)
        elif not done:
            path.unlink(missing_ok=True)


def _require_unchanged(recording: Recording) -> None:
    """RecordingError when a file of the recording is not what it was when it was read."""
    for source in recording.source.files:
        there = source.path.exists()
        if source.format == "simulation" and not there:
            continue
        if not there or fingerprint(source.path)[1] != source.sha256:
            raise RecordingError(
                "the original has changed since it was read, and the repair was taken back",
                file=source.path,
                found="no file" if not there else "another SHA-256",
                expected=source.sha256,
                advice="run the repair again",
            )


def _written(
    audit: Audit, rebuilt: Reconstruction, path: Path, dbc: Sequence[Path] | None, document: Mapping[str, Any]
) -> Outcome:
    if path.suffix.lower() != ".mcap":
        return encode(audit.recording, path, dbc, readings_to_write(audit, rebuilt))
    source = audit.recording.source
    whole = source.format == "mcap" and not source.parts and source.path.exists()
    if whole and mcap_summary.read(source.path) is not None:
        return _added(audit, rebuilt, source.path, path, document)
    as_measured = partial_name(path)
    try:
        encode(audit.recording, as_measured)
        return _added(audit, rebuilt, as_measured, path, document)
    finally:
        as_measured.unlink(missing_ok=True)


def _added(audit: Audit, rebuilt: Reconstruction, log: Path, path: Path, document: Mapping[str, Any]) -> Outcome:
    """The log with the rebuilt channels on topics of their own."""
    recording = audit.recording
    topics = {s.signal.partition(":")[0] for s in recording.rig.array.sensors if ":" in s.signal}
    first = min(float(trace.time[0]) for trace in recording.native)
    readings = readings_to_write(audit, rebuilt)
    columns = [_column(audit, rebuilt, readings, k) for k in range(len(rebuilt.channels))]
    add_rebuilt(log, path, columns, document, log_time_of_zero(log, sorted(topics), first))
    return Outcome()


def _column(audit: Audit, rebuilt: Reconstruction, readings: FloatArray, k: int) -> Column:
    """A rebuilt channel in the rig's unit."""
    recording, channel = audit.recording, rebuilt.channels[k]
    sensor = recording.rig.array[channel]
    return Column(
        channel=channel,
        unit=sensor.unit,
        time=recording.time,
        values=in_unit(readings[:, recording.rig.array.index(channel)], sensor.to_si, sensor.offset),
        u=np.abs(rebuilt.u[:, k] / sensor.to_si),
        replaced=rebuilt.replaced[:, k],
    )


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
