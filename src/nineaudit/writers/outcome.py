"""What a writer says about the numbers it wrote."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Outcome:
    """`error`: by channel, the largest difference in SI between a reading and what the file holds; `notes` in words;
    `folders` that were made beside the file."""

    error: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    folders: tuple[Path, ...] = ()
