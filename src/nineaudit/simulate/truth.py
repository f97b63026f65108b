"""What the body really did, and the clock it is told on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nineaudit.array import FloatArray, frozen
from nineaudit.errors import ConfigurationError
from nineaudit.physics.kinematics import orientation
from nineaudit.units import G0, counted

REST_S = 0.025
"""Rest before every event, s: the example rig's pre_trigger begins 20 ms before it (INTERFACE.md)."""

DOWN = (0.0, 0.0, G0)
"""Gravity at the start in the body frame, m/s²: +z is down on a standing dummy (SAE J1733)."""


@dataclass(frozen=True, eq=False)
class Truth:
    """Motion of the body at the array's origin: `time` (n,) s; `omega`, `alpha`, `a0` (n,3) SI."""

    time: FloatArray
    omega: FloatArray
    alpha: FloatArray
    a0: FloatArray

    def __post_init__(self) -> None:
        for name in ("time", "omega", "alpha", "a0"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def rate(self) -> float:
        """Samples per second."""
        return float((len(self.time) - 1) / (self.time[-1] - self.time[0]))


def timeline(rate_hz: float, duration_s: float, rest_s: float) -> FloatArray:
    """(n,) s: whole samples from −`rest_s` (or just before) through exactly 0 to `duration_s`.

    Raises ConfigurationError unless the rate and the duration are positive and hold four samples at least.
    """
    for name, value in (("rate_hz", rate_hz), ("duration_s", duration_s)):
        if not (math.isfinite(value) and value > 0):
            raise ConfigurationError("bad time base", place=name, found=value, expected="a positive number")
    before, after = math.ceil(rest_s * rate_hz - 1e-9), round(duration_s * rate_hz)
    if before + after < 4:
        raise ConfigurationError(
            f"no recording has {counted(before + after + 1, 'sample')}",
            place="rate_hz, duration_s",
            found=[rate_hz, duration_s],
            expected="at least 4 sampling intervals",
        )
    return np.arange(-before, after + 1) / rate_hz


def with_gravity(truth: Truth, down: Sequence[float] = DOWN) -> Truth:
    """The same motion with a0 as accelerometers feel it, the specific force a0 − E g (METHODS.md 1).

    `down` (3,) m/s² is gravity in the body frame at the first sample; E = Cᵀ follows the body from there
    (kinematics.orientation).
    """
    to_inertial = orientation(truth.omega, truth.time)
    pull = np.einsum("nij,i->nj", to_inertial, np.asarray(down, dtype=float))
    return replace(truth, a0=truth.a0 - pull)
