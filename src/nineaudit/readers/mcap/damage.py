"""What of an MCAP log could not be read, as it is found: one entry a kind, however many there are."""

from __future__ import annotations

from dataclasses import dataclass, field

from nineaudit.recording import Damage


@dataclass
class _Kind:
    """Damage of one kind: the byte of the first, how many, the messages lost (None: nobody knows) and in words."""

    at: int
    count: int = 0
    lost: int | None = 0
    words: str = ""


@dataclass
class Damages:
    """Kinds of damage in the order in which they were found. `what` must be one of few sentences."""

    kinds: dict[str, _Kind] = field(default_factory=dict)

    def add(self, what: str, at: int, *, count: int = 1, lost: int | None = 0, words: str = "") -> None:
        """Damage at byte `at`, by which `lost` messages are lost: None where their number is not known."""
        kind = self.kinds.setdefault(what, _Kind(at, words=words))
        kind.count += count
        kind.lost = None if lost is None or kind.lost is None else kind.lost + lost

    def __bool__(self) -> bool:
        return bool(self.kinds)

    def all(self) -> tuple[Damage, ...]:
        """Every kind of damage, with its count, the byte of the first, and what is lost by it."""
        return tuple(Damage(what, f"byte {k.at}", k.count, _lost(k)) for what, k in self.kinds.items())


def _lost(kind: _Kind) -> str:
    messages = f"{kind.lost} message{'s' if kind.lost != 1 else ''} lost" if kind.lost else ""
    if kind.lost is None:
        messages = "an unknown number of messages lost"
    return "; ".join(part for part in (messages, kind.words) if part)
