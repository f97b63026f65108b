"""A misprinted equation: its printed form, the right one, and both computed on a random motion against the truth.

Which of the two is right is decided by the rigid body, a(r) = a0 + α × r + ω × (ω × r), or by an identity of algebra.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.physics import rigid_body
from nineaudit.selftest.published import Published

ROUNDED: Final = 1e-12
"""Of what is exact, over its size."""


@dataclass(frozen=True, eq=False)
class Misprint:
    """`equation` of `source` for `quantity`, in words as `printed` and `right`; by the one `wrong`, by the other
    `put_right`, and the `truth`, arrays alike. `rounding`: what may be left of the right form's error."""

    source: str
    equation: str
    quantity: str
    printed: str
    right: str
    wrong: FloatArray
    put_right: FloatArray
    truth: FloatArray
    rounding: float = ROUNDED

    @property
    def percent(self) -> float:
        """rms of the printed form's error over rms of the truth, %."""
        return 100.0 * relative(self.wrong, self.truth)

    @property
    def error(self) -> str:
        """The same with two digits, and of what."""
        return f"{self.rounded} of {self.quantity}"

    @property
    def rounded(self) -> str:
        """`percent` with two digits."""
        return f"{float(f'{self.percent:.2g}'):g} %"


class RandomInstants(NamedTuple):
    """ω, α, a0, each (n,3) SI, unrelated to each other."""

    omega: FloatArray
    alpha: FloatArray
    a0: FloatArray

    def at(self, *place: float) -> FloatArray:
        """Acceleration (n,3) of the point at `place`, m."""
        return rigid_body.acceleration_at(np.array(place), self.a0, self.alpha, self.omega)


def random_instants(seed: int, count: int = 500) -> RandomInstants:
    """Standard deviations 30 rad/s, 3000 rad/s² and 500 m/s²: a hard impact of a head."""
    rng = np.random.default_rng(seed)
    return RandomInstants(*(scale * rng.standard_normal((count, 3)) for scale in (30.0, 3000.0, 500.0)))


def put_right(misprints: Iterable[Misprint]) -> list[Published]:
    """The right form of each is exact; what the printed one misses stands in the printed column."""
    return [
        Published(
            m.source,
            f"eq {m.equation} put right, rms relative error of {m.quantity} on random motion",
            f"misprint ({m.rounded} off)",
            relative(m.put_right, m.truth),
            0.0,
            m.rounding,
            "rounding of the sums" if m.rounding == ROUNDED else "integration at 5 µs, ends of the record",
        )
        for m in misprints
    ]


def relative(values: FloatArray, truth: FloatArray) -> float:
    """rms of the error over rms of the truth."""
    return float(np.sqrt(((values - truth) ** 2).mean() / (truth**2).mean()))
