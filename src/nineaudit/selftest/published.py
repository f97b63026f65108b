"""One published number beside ours: what `nineaudit selftest` prints a line of."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Published:
    """A number of a source, as it is `printed` there and as it is `expected` once misprints are put right, and `ours`.

    `why` says where the `tolerance` comes from: printed digits, a step of integration, the size of a sample. It is
    never taken from our own output.
    """

    source: str
    quantity: str
    printed: float | str
    ours: float
    expected: float
    tolerance: float
    why: str

    @property
    def passed(self) -> bool:
        """Whether ours is within the tolerance of what is expected; a number that is not one never is."""
        return bool(abs(self.ours - self.expected) <= self.tolerance)
