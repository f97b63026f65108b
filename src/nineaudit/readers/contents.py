"""What a reader hands to assemble, and the sentence for a file that cannot be read to its end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from nineaudit.bus import Bus
from nineaudit.errors import RecordingError
from nineaudit.identity import Stated
from nineaudit.recording import Damage, Trace


@dataclass(frozen=True)
class Contents:
    """Signals of a file, one a channel, as recorded; what its container held; what there is to say about it; what
    of it could not be read; the record of a repair that stands in it; and what it says of the test."""

    traces: tuple[Trace, ...]
    counts: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    damage: tuple[Damage, ...] = ()
    bus: Bus | None = None
    provenance: Mapping[str, Any] | None = None
    stated: tuple[Stated, ...] = ()


def cut_short(path: Path, why: str, what_was_read: str, *, place: str | None = None) -> RecordingError:
    """The error for a truncated or damaged file: it says what could be read, and nothing of it is used."""
    return RecordingError(
        f"the file is cut short or damaged: {why}",
        file=path,
        place=place,
        advice=f"{what_was_read} could be read; record or copy the file again",
    )
