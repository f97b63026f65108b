"""A recording as it came from the rig: traces with their own clocks, and one common time base."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import hypot, nan, sqrt
from pathlib import Path

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.bus import Bus
from nineaudit.identity import Identity, Stated
from nineaudit.provenance import Provenance, Remade
from nineaudit.rig import Rig


@dataclass(frozen=True, eq=False)
class Trace:
    """One signal with its own clock as recorded: `time` (m,) s, `values` (m,) in `unit`.

    `unit` is what the file says, None where it does not say. `signal` is its name in the file; `message` that of what
    its samples came in together with those of other signals (CAN message, topic, group, file of several), None where
    all came alike.
    """

    channel: str
    signal: str
    time: FloatArray
    values: FloatArray
    unit: str | None = None
    message: str | None = None


@dataclass(frozen=True)
class Message:
    """What the samples of some channels (`columns` of the recording) came in together."""

    name: str
    columns: tuple[int, ...]


@dataclass(frozen=True)
class Clock:
    """What the time stamps of one trace did. Times in s, rate in Hz.

    `gaps` are intervals longer than 1.5 sampling intervals, as (start, end); `lost` is about how many samples
    they hold. Duplicate and backward samples are not in the recording's arrays: they are counted here.
    """

    rate: float
    jitter: float
    gaps: tuple[tuple[float, float], ...] = ()
    lost: int = 0
    duplicates: int = 0
    backward: int = 0
    first_disorder: float | None = None


@dataclass(frozen=True)
class Alignment:
    """How a channel that was sampled by another clock came onto the common time base (readers/clocks/alignment.py).

    `rate` Hz; `ratio` (p, q): p of its samples to q of the base's, the nominal ratio of the rates; `drift` (1) by how
    much faster than that it runs, as the stamps tell, and its standard uncertainty `u_drift`. `skew` s: how long after
    the base's nearest its samples are stamped, NaN where that changes along the record. `u_timing` s: standard
    uncertainty of its time against the base that came with the alignment (it is in the rig's u_timing already);
    `u_value` SI: rms error of the interpolation. `slip` s: by how much the skew departs from the straight line that a
    steady drift makes of it, from one part of the record to another, and its standard uncertainty `u_slip`; NaN where
    its rate is no whole part of the base's, or the record is too short to tell.
    """

    channel: str
    rate: float
    ratio: tuple[int, int]
    drift: float
    u_drift: float
    skew: float
    u_timing: float
    u_value: float
    slip: float = nan
    u_slip: float = nan

    def deviation(self, noise: float) -> float:
        """What counts as the deviation of each reading on the common time base, `noise` that of one as it was taken.

        Readings between the samples of a slower clock tell nothing new: white noise of the same density on the faster
        clock is √(ratio of the rates) times as large. The error of interpolation comes with it.
        """
        p, q = self.ratio
        return hypot(noise * sqrt(max(q / p, 1.0)), self.u_value)


@dataclass(frozen=True)
class Damage:
    """What of a file could not be read, `place` (byte, line) of the first and how many there are. What was good is
    kept: `lost` says in words what is not."""

    what: str
    place: str
    count: int = 1
    lost: str = ""

    def __str__(self) -> str:
        times = f" ({self.count} times, first there)" if self.count > 1 else ""
        return f"{self.place}: {self.what}{times}" + (f"; {self.lost}" if self.lost else "")


@dataclass(frozen=True)
class Source:
    """The file that was read. `counts`: what its container held (frames, error frames, ...); `notes`: in words;
    `damage`: what of it could not be read. `parts`: every file, where the recording has several; `path`, `sha256` and
    `size` are then those of the first. `provenance`: the record that says which readings are made, not measured; None
    where there is none. `stated`: what it says of the test."""

    path: Path
    format: str
    sha256: str
    size: int
    unchanged_after_read: bool = True
    counts: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    damage: tuple[Damage, ...] = ()
    parts: tuple[Source, ...] = ()
    provenance: Provenance | None = None
    stated: tuple[Stated, ...] = ()

    @property
    def files(self) -> tuple[Source, ...]:
        """The file, or each of the parts."""
        return self.parts or (self,)


@dataclass(frozen=True, eq=False)
class Recording:
    """Readings of a rig on one time base: `time` (n,) s increasing, `readings` (n,k) SI, `valid` (n,k).

    Columns follow ``rig.array``. Invalid readings are NaN. `native` are the traces in SI on their own clocks
    (the same arrays where the clocks agree), for checks that must see samples as they were taken; `resampled`
    names the channels whose readings were interpolated onto the common time base, `alignments` how. `rig` is the rig
    as it was in this recording: its file's, with the timing uncertainty of the alignment added. `test`: which test
    it is of.
    """

    time: FloatArray
    readings: FloatArray
    valid: BoolArray
    rig: Rig
    source: Source
    native: tuple[Trace, ...]
    clocks: tuple[Clock, ...]
    resampled: tuple[str, ...] = ()
    bus: Bus | None = None
    alignments: tuple[Alignment, ...] = ()
    test: Identity = field(default_factory=Identity)

    @property
    def channels(self) -> tuple[str, ...]:
        return self.rig.array.channels

    @property
    def messages(self) -> tuple[Message, ...]:
        """Every message with its channels, where the recording has messages."""
        alike: dict[str, list[int]] = {}
        for column, trace in enumerate(self.native):
            if trace.message is not None:
                alike.setdefault(trace.message, []).append(column)
        return tuple(Message(name, tuple(columns)) for name, columns in alike.items())

    @property
    def remade(self) -> tuple[Remade, ...]:
        """What repairs made in the channels, the oldest first."""
        found = [made for file in self.source.files if file.provenance for made in file.provenance.remade]
        return tuple(made for made in found if made.channel in self.channels)

    @cached_property
    def made_of_others(self) -> BoolArray:
        """(n,k) samples that a repair made of the other channels: that they agree with those is no evidence."""
        made, half = np.zeros(self.readings.shape, dtype=np.bool_), 0.5 / self.rate
        for remade in self.remade:
            if remade.from_others:
                inside = [(self.time > a - half) & (self.time < b + half) for a, b in remade.stretches]
                made[:, self.rig.array.index(remade.channel)] |= np.logical_or.reduce(inside) if inside else True
        return made

    @property
    def rate(self) -> float:
        """Samples per second of the common time base: that of the clock whose stamps it has."""
        base = [c.rate for t, c in zip(self.native, self.clocks, strict=True) if t.channel not in self.resampled]
        return max(base) if base else float((len(self.time) - 1) / (self.time[-1] - self.time[0]))

    def column(self, channel: str) -> FloatArray:
        """(n,) readings of one channel, SI."""
        return self.readings[:, self.rig.array.index(channel)]

    def only(self, columns: Sequence[int]) -> Recording:
        """The recording of some channels (`columns` of the arrays, in that order), with the rig of these."""
        held = list(columns)
        rig = replace(self.rig, array=self.rig.array.select(held))
        return replace(
            self,
            rig=rig,
            readings=self.readings[:, held],
            valid=self.valid[:, held],
            native=tuple(self.native[k] for k in held),
            clocks=tuple(self.clocks[k] for k in held),
            resampled=tuple(c for c in self.resampled if c in rig.array.channels),
            alignments=tuple(a for a in self.alignments if a.channel in rig.array.channels),
        )
