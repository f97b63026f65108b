"""What a reader could not read, gathered while it reads: many faults of one kind become one Damage with a count."""

from __future__ import annotations

from dataclasses import dataclass, field

from nineaudit.recording import Damage


@dataclass
class _Fault:
    place: str
    count: int = 0
    lost: int = 0


@dataclass
class Losses:
    """Faults by what they are, in the order of their first: place of the first, how many, and what they cost."""

    unit: str = "bytes"
    faults: dict[str, _Fault] = field(default_factory=dict)

    def add(self, what: str, place: str, count: int = 1, lost: int = 0) -> None:
        """Book `count` faults of a kind, which together lost so many units; `what` must be one of few sentences."""
        fault = self.faults.setdefault(what, _Fault(place))
        fault.count += count
        fault.lost += lost

    def __contains__(self, what: str) -> bool:
        return what in self.faults

    def damage(self) -> tuple[Damage, ...]:
        """One Damage for each kind."""
        return tuple(
            Damage(what, f.place, max(f.count, 1), f"{f.lost} {self.unit} lost" if f.lost else "")
            for what, f in self.faults.items()
        )
