"""Missing samples of channels, and which channels are whole enough for a method that needs every sample.

A straight line over a gap of T misses what a sine of frequency f and amplitude A does in it by A(1 − cos πfT), at most:
5 % of A for 100 Hz, a fast head impact, over 1 ms. A longer gap takes its channel out; what needs it is refused. The
whole-record fit bridges nothing: to it a missing sample is absent.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.errors import EstimationError
from nineaudit.recording import Recording
from nineaudit.units import counted

SHORT: Final = 1e-3
"""Longest gap that a straight line may bridge, s."""
_ROUNDING: Final = 1e-9


@dataclass(frozen=True)
class Gaps:
    """The missing samples of one channel: their `count` of `total`, the first and last valid sample about them, `start`
    and `end` (s), how many `stretches`, and the `longest` of them, s."""

    channel: str
    count: int
    total: int
    start: float
    end: float
    stretches: int
    longest: float

    def __str__(self) -> str:
        if self.count == self.total:
            return f"channel {self.channel} without a valid sample"
        parts = (
            "" if self.stretches == 1 else f" in {self.stretches} stretches, the longest {1e3 * self.longest:.3g} ms"
        )
        return (
            f"channel {self.channel}: {self.count} of {counted(self.total, 'sample')} missing, "
            f"{self.start:.5g} to {self.end:.5g} s{parts}"
        )


def gaps(recording: Recording) -> tuple[Gaps, ...]:
    """The channels of a recording that miss samples on its common time base, in its order."""
    found = (_gaps(c, recording.time, recording.valid[:, k]) for k, c in enumerate(recording.channels))
    return tuple(one for one in found if one is not None)


def long(found: tuple[Gaps, ...]) -> tuple[Gaps, ...]:
    """Those that a straight line may not bridge, dead channels left out: what becomes of them is for each method."""
    return tuple(one for one in found if one.longest > SHORT * (1.0 + _ROUNDING) and one.count < one.total)


def require_short(recording: Recording) -> None:
    """EstimationError, naming channel, count and interval, where a channel has a gap too long for a straight line."""
    found = long(gaps(recording))
    if found:
        raise refused(found)


def refused(found: tuple[Gaps, ...], reason: str = "") -> EstimationError:
    """What is said where gaps keep a method from running, and the `reason` it cannot do without the channels."""
    return EstimationError(
        "; ".join(map(str, found)),
        expected=f"gaps of at most {1e3 * SHORT:g} ms, which a straight line may bridge",
        advice="use --method map, to which missing samples are absent"
        + (f"; without the channel: {reason}" * bool(reason)),
    )


def _gaps(channel: str, time: FloatArray, valid: BoolArray) -> Gaps | None:
    if valid.all():
        return None
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ~valid, [False]]).astype(np.int8)))
    first, last = np.maximum(edges[::2] - 1, 0), np.minimum(edges[1::2], len(time) - 1)
    longest = float((time[last] - time[first]).max())
    return Gaps(
        channel,
        int((~valid).sum()),
        len(valid),
        float(time[first[0]]),
        float(time[last[-1]]),
        len(first),
        longest,
    )
