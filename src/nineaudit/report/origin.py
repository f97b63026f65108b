"""What was audited, and all that a report rests on: files, hashes, versions."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from nineaudit.report.numbers import quantity, seconds
from nineaudit.units import counted

if TYPE_CHECKING:
    from nineaudit.auditing import Audit
    from nineaudit.recording import Source

_PACKAGES = {"version": "nineaudit", "python": "Python"}


def identity(audit: Audit) -> list[tuple[str, str]]:
    """What was audited."""
    recording, source = audit.recording, audit.recording.source
    time = recording.time
    rate = f" at {quantity(recording.rate, 'Hz', 5)}" if len(time) > 1 else ""
    return [
        ("Recording", source.path.name),
        ("Format", source.format),
        ("Rig", recording.rig.name),
        ("Channels", str(len(recording.channels))),
        ("Samples", f"{len(time)}{rate}"),
        ("Time", f"{seconds(float(time[0]))} to {seconds(float(time[-1]))}"),
        ("Filter class", recording.rig.filter_class),
        *(("Reconstructed, not measured", made.channel) for made in recording.remade),
        ("Report number", number(audit)),
    ]


def number(audit: Audit) -> str:
    """The same for the same recording, rig, rules and versions, and for nothing else."""
    files = (source.sha256 for source in audit.recording.source.files)
    rests_on = (*files, audit.recording.rig.sha256, audit.rulebook.sha256)
    text = " ".join((*rests_on, *(f"{name}={version}" for name, version in sorted(audit.tool.items()))))
    return hashlib.sha256(text.encode("utf-8")).hexdigest()[:12]


def provenance(audit: Audit) -> list[tuple[str, str, bool]]:
    """(name, value, whether it is a hash or path) of all that this report rests on."""
    source, rig = audit.recording.source, audit.recording.rig
    altered = "no: same bytes before and after reading" if source.unchanged_after_read else "CHANGED while it was read"
    return [
        *(row for file in source.files for row in _file(file)),
        ("Original altered", altered, False),
        *(row for made in _remade(audit) for row in made),
        *((f"Reader's note {i}", note, False) for i, note in enumerate(source.notes, 1)),
        ("Rig file", rig.path.as_posix() if rig.path else "given as text", True),
        ("SHA-256 of the rig file", rig.sha256, True),
        ("SHA-256 of the rules", audit.rulebook.sha256, True),
        *((_PACKAGES.get(name, name), version, False) for name, version in audit.tool.items()),
    ]


def _remade(audit: Audit) -> list[list[tuple[str, str, bool]]]:
    """What of the recording is made, not measured: rows of each repair."""
    return [
        [
            ("Reconstructed, not measured", f"{made.channel}: {counted(made.samples, 'sample')}; {made.method}", False),
            ("SHA-256 of the original of that", made.original, True),
        ]
        for made in audit.recording.remade
    ]


def _file(source: Source) -> list[tuple[str, str, bool]]:
    return [
        ("Recording", source.path.as_posix(), True),
        ("Bytes", f"{source.size}", False),
        ("SHA-256 of the recording", source.sha256, True),
    ]
