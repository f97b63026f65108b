"""What [Becker75] asks of a motion: its worst case for small errors of chosen gains, and whether rate gyros agree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.estimate.motion import bridge, has_rates
from nineaudit.schemes import envelope, rate_gyro
from nineaudit.schemes.six_accelerometers import package, solve


@dataclass(frozen=True)
class WorstCase:
    """How far errors of gain up to `limit` of `channels` take ω, rad/s about x, y, z: at the last sample, and at
    most; `of_peak`: the largest of the last over the peak of |ω|."""

    channels: tuple[str, ...]
    limit: float
    at_end: tuple[float, float, float]
    at_most: tuple[float, float, float]
    of_peak: float


def chosen(text: str, case: Case) -> tuple[tuple[str, ...], float]:
    """Channels and relative limit of ``a0z,a1z=0.005``, or of ``0.005``: every accelerometer. ConfigurationError."""
    names, _, number = text.rpartition("=")
    known = [s.channel for s in case.array.sensors if s.kind == "accelerometer"]
    picked = tuple(name.strip() for name in names.split(",")) if names else tuple(known)
    unknown = [name for name in picked if name not in known]
    if unknown:
        raise ConfigurationError(
            "no such accelerometer", place="--worst-case", found=unknown[0], expected="one of " + ", ".join(known)
        )
    try:
        limit = float(number)
    except ValueError:
        limit = -1.0
    if not 0.0 < limit < 1.0:
        raise ConfigurationError(
            "limit of the errors of gain",
            place="--worst-case",
            found=number,
            expected="a share of 1, as in a0z,a1z=0.005 for half a per cent of two channels",
        )
    return picked, limit


def worst_case(case: Case, initial: FloatArray, channels: tuple[str, ...], limit: float) -> WorstCase:
    """The envelope of six accelerometers with ω = `initial` (3,) at first. EstimationError as the scheme itself."""
    six = package(case.array)
    held = np.flatnonzero(case.array.is_accelerometer)
    outputs = bridge(case.readings[:, held], case.time)
    solution = solve(six, outputs, case.time, initial)
    limits = np.array([limit * (case.array.channels[c] in channels) for c in held])
    reached = envelope.worst_case(envelope.gain_sensitivity(solution, outputs), limits)
    peak = float(np.linalg.norm(solution.omega, axis=1).max())
    if not peak > 0.0:
        raise EstimationError("the body does not turn", found="ω = 0 throughout", expected="a motion")
    most = reached.max(axis=0)
    return WorstCase(channels, limit, _three(reached[-1]), _three(most), float(reached[-1].max()) / peak)


def agreement(case: Case, omega: FloatArray, natural_hz: float, damping: float) -> rate_gyro.Agreement:
    """`omega` (n,3) of a method through the response of the rig's rate sensors, against what they read.

    EstimationError: no rate sensors on three axes, an uneven time base.
    """
    if not has_rates(case.array):
        raise EstimationError(
            "no rate sensors on three axes to compare with",
            found=f"{int((~case.array.is_accelerometer).sum())} rate sensors",
            expected="three, or more, that span",
        )
    rates = np.flatnonzero(~case.array.is_accelerometer)
    read = bridge(case.readings[:, rates], case.time) @ np.linalg.pinv(case.array.axes[rates]).T
    return rate_gyro.compare(omega, read, case.time, natural_hz, damping)


def _three(values: FloatArray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
