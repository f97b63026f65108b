"""What a writer says about the numbers it wrote."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Outcome:
    """`error`: by channel, the largest difference in SI between a reading and what the file holds; `notes` in
    words."""

    error: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
