"""What each channel of a recording shows by itself, with the rest of the array as witness.

The other channels only answer whether the body was moving (a channel that rests may be flat) and whether they
were jolted at the same instant (then a spike is no spike but a shock). No physics enters.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.estimate.evidence import (
    Moving,
    Stretch,
    always,
    dropouts,
    mask,
    moves,
    resolution,
    spikes,
    stuck,
    true_runs,
)
from nineaudit.estimate.flat_tops import FlatTop, flat_tops, is_rail
from nineaudit.recording import Recording, Trace

DEAD_FACTOR = 16.0
"""Times how much more than usual (three steps or noise deviations) another channel of the same kind must scatter
before one that never changes in the whole record is called dead: about 50 steps, of which a misalignment of one
degree shows one. In a planar motion, a coarse channel may well stay at one code."""


@dataclass(frozen=True)
class ChannelEvidence:
    """Stretches of a channel's native trace that its own samples show to be wrong, by kind.

    `stuck_limit` is the longest run of identical values (samples) that noise and resolution explain. A longer
    run of exactly 0 that ends again is a dropout, even where the signal was too small for a jump to be seen.
    """

    channel: str
    flat_tops: tuple[FlatTop, ...]
    dropouts: tuple[Stretch, ...]
    stuck: tuple[Stretch, ...]
    stuck_limit: float
    spikes: tuple[Stretch, ...]

    @property
    def clipped(self) -> tuple[Stretch, ...]:
        """Stretches of all flat tops, in order of time."""
        return tuple(sorted((s for top in self.flat_tops for s in top.stretches), key=lambda s: s.start))

    @property
    def stretches(self) -> tuple[Stretch, ...]:
        """All of them."""
        return (*self.clipped, *self.dropouts, *self.stuck, *self.spikes)

    @property
    def fault(self) -> str | None:
        """The fault word of what there is most of, by samples; None for a clean trace."""
        words = {
            "clipping": self.clipped,
            "dropout": self.dropouts,
            "stuck": self.stuck,
            "spikes": self.spikes,
        }
        samples = {word: sum(len(s) for s in found) for word, found in words.items()}
        worst = max(samples, key=lambda word: samples[word])
        return worst if samples[worst] else None


def find_evidence(recording: Recording, sigma: FloatArray) -> tuple[ChannelEvidence, ...]:
    """The evidence of every channel, in the order of the array; `sigma` (k,) noise standard deviation, SI."""
    floors = np.maximum(sigma, [resolution(column) for column in recording.readings.T])
    jolted = _jolts(recording.readings, floors) & ~recording.made_of_others
    traces = {trace.channel: trace for trace in recording.native}
    return tuple(
        _of_channel(recording, traces[name], i, sigma, floors, jolted) for i, name in enumerate(recording.channels)
    )


def flagged(recording: Recording, evidence: Sequence[ChannelEvidence]) -> BoolArray:
    """(n,k) samples of the common time base that lie in a stretch of the channel's evidence."""
    out = np.zeros(recording.readings.shape, dtype=np.bool_)
    traces = {trace.channel: trace for trace in recording.native}
    for i, found in enumerate(evidence):
        time = traces[found.channel].time
        for s in found.stretches:
            out[_between(recording.time, time[s.start], time[s.stop - 1]), i] = True
    return out


def _of_channel(
    recording: Recording, trace: Trace, column: int, sigma: FloatArray, floors: FloatArray, jolted: BoolArray
) -> ChannelEvidence:
    values, noise = trace.values, float(sigma[column])
    moving = _witness(recording, trace, column, floors)
    tops = flat_tops(values, noise, full_scale=recording.rig.array.sensors[column].full_scale, moving=moving)
    lost = dropouts(values, noise)
    explained = (*(s for top in tops for s in top.stretches), *lost)
    frozen, limit = stuck(
        values,
        moving=moving,
        hurrying=_witness(recording, trace, column, DEAD_FACTOR * floors),
        excluded=mask(explained, values.size),
    )
    inner = tuple(s for s in frozen if s.start > 0 and s.stop < values.size)
    cut_off = tuple(s for s in inner if s.level == 0.0)
    cut_flat = tuple(s for s in inner if s not in cut_off and s.level in (np.nanmin(values), np.nanmax(values)))
    tops = (*tops, *_at_extremes(values, cut_flat, recording.rig.array.sensors[column].full_scale))
    frozen = tuple(s for s in frozen if s not in cut_off and s not in cut_flat)
    alone = _unwitnessed(recording, trace, column, jolted, spikes(values, noise))
    return ChannelEvidence(trace.channel, tops, (*lost, *cut_off), frozen, limit, tuple(alone))


def _at_extremes(values: FloatArray, runs: Sequence[Stretch], full_scale: float | None) -> Iterator[FlatTop]:
    """Runs that noise does not explain, at the highest or lowest value of the trace, as flat tops: the signal eases
    in there, but a channel whose noise vanishes at its extreme is cut off, not at rest."""
    for level in sorted({s.level for s in runs}):
        stretches = tuple(Stretch(int(a), int(b), level) for a, b in zip(*true_runs(values == level), strict=True))
        yield FlatTop(level, stretches, 0.0, is_rail(level, full_scale))


def _witness(recording: Recording, trace: Trace, column: int, floors: FloatArray) -> Moving:
    """Whether the other channels (of the same kind where there are two such) move during samples of a trace."""
    kinds = recording.rig.array.is_accelerometer
    others = np.arange(kinds.size) != column
    if not others.any():
        return always
    same = others & (kinds == kinds[column])
    columns = np.flatnonzero(same if same.any() else others)

    def moving(start: int, stop: int) -> bool:
        ends = trace.time[max(start, 0)], trace.time[min(stop, trace.time.size) - 1]
        window = recording.readings[_between(recording.time, *ends)]
        return moves(window[:, columns], floors[columns])

    return moving


def _jolts(readings: FloatArray, floors: FloatArray) -> BoolArray:
    """(n,k) where a reading lies eight times its noise off the middle of its two neighbours, or next to it."""
    off = np.zeros(readings.shape, dtype=np.bool_)
    middle = 0.5 * (readings[2:] + readings[:-2])
    off[1:-1] = np.abs(readings[1:-1] - middle) > 8.0 * floors
    wide = off.copy()
    wide[1:] |= off[:-1]
    wide[:-1] |= off[1:]
    return wide


def _unwitnessed(
    recording: Recording, trace: Trace, column: int, jolted: BoolArray, found: tuple[Stretch, ...]
) -> Iterator[Stretch]:
    """The spikes during which no other channel is jolted."""
    for s in found:
        window = jolted[_between(recording.time, trace.time[s.start], trace.time[s.stop - 1])]
        if not np.delete(window, column, axis=1).any():
            yield s


def _between(time: FloatArray, start: float, end: float) -> slice:
    """Samples of `time` from `start` to `end`, both included."""
    return slice(int(np.searchsorted(time, start, "left")), int(np.searchsorted(time, end, "right")))
