"""The filter of the curves of a comparison: a channel frequency class, or the four-pole Butterworth of Martin98.

Both pass the same guard: a class is named by 0.6 of its corner (SAE J211-1), so the four poles at f are held against
what the recording has been through, and against its sampling, as the class 0.6 f would be.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from nineaudit.array import FloatArray
from nineaudit.errors import ConfigurationError
from nineaudit.physics import filters
from nineaudit.schemes.martin import four_pole_butterworth

CLASS_OF_CORNER: Final = 0.6
FOUR_POLE: Final = "four-pole"


@dataclass(frozen=True)
class CurveFilter:
    """`kind` "cfc" with its class, or "four-pole" with its corner in Hz, as `value`."""

    kind: str
    value: float

    def __str__(self) -> str:
        if self.kind == FOUR_POLE:
            return f"four-pole Butterworth at {self.value:g} Hz, which lags"
        return f"CFC{self.value:g}"

    @property
    def class_(self) -> float:
        """The class that it counts as."""
        return self.value * CLASS_OF_CORNER if self.kind == FOUR_POLE else self.value

    def require(self, rate: float, recorded: float, already: float | None) -> None:
        """ConfigurationError where the recording, at `recorded` Hz, has been through a class `already` that leaves no
        room; EstimationError where curves at `rate` Hz are too slow."""
        filters.require_room(recorded, self.class_, already)
        filters.coefficients(self.class_, rate)

    def __call__(self, values: FloatArray, rate: float, already: float | None) -> FloatArray:
        """`values` (n,m) at `rate` Hz through it; errors as `require`."""
        if self.kind == FOUR_POLE:
            self.require(rate, rate, already)
            return four_pole_butterworth(values, rate, self.value)
        return filters.once(values, rate, self.value, already)


def named(text: str) -> CurveFilter:
    """The filter of ``four-pole:300`` or ``cfc:180``. ConfigurationError where it is none."""
    kind, _, number = text.partition(":")
    try:
        value = float(number)
    except ValueError:
        value = -1.0
    if kind not in (FOUR_POLE, "cfc") or not 0.0 < value < float("inf"):
        raise ConfigurationError(
            "unknown filter", place="--filter", found=text, expected="four-pole:HZ or cfc:CLASS, as four-pole:300"
        )
    return CurveFilter(kind, value)
