"""What a diagnosis says: status, culprit or group, candidates, and what the recording could have shown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

SEPARATION = 21.7
"""λ at which the wrong one of two channels is preferred once in a hundred: Φ(−√λ/2) = 1 % (METHODS.md 3)."""


class Status(StrEnum):
    HEALTHY = "healthy"
    ISOLATED = "isolated"
    AMBIGUOUS = "ambiguous"
    UNDIAGNOSED = "undiagnosed"


@dataclass(frozen=True)
class Candidate:
    """A hypothesis that stays possible: `statistic` is its cost per degree of freedom (1 for one that holds)."""

    channels: tuple[str, ...]
    fault: str
    probability: float
    statistic: float
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Diagnosis:
    """`channels`: the culprit when isolated, the group when ambiguous. `smallest_*`: size in SI of a zero shift
    at the event that this recording would have shown (detectable) or pinned to its channel (isolable)."""

    status: Status
    channels: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    reason: str
    smallest_detectable: Mapping[str, float] = field(default_factory=dict)
    smallest_isolable: Mapping[str, float] = field(default_factory=dict)
    healthy_statistic: float | None = None
    limit: float | None = None
    interval: tuple[float, float] | None = None
