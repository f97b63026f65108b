"""A recording with the zero and the noise of its channels, and what each channel shows by itself.

The zero of a channel is its mean over the quiet interval before the event (SAE J1727); the mean of the gravity
that the accelerometers see there goes with it, which the constraints do not feel (METHODS.md 1).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nineaudit.array import BoolArray, FloatArray, SensorArray
from nineaudit.errors import EstimationError
from nineaudit.estimate.motion import has_rates
from nineaudit.estimate.quiet import Quiet, find_quiet, noise_level
from nineaudit.estimate.single_channel import ChannelEvidence, find_evidence, flagged
from nineaudit.recording import Recording

NOMINAL_NOISE = 1e-3
"""Last resort for a noise level, as a part of the channel's peak, where neither rig nor recording tells."""


@dataclass(frozen=True, eq=False)
class Zeroed:
    """`recording`, zero taken off; SI, columns in the order of ``recording.rig.array``."""

    recording: Recording

    @property
    def array(self) -> SensorArray:
        return self.recording.rig.array

    @property
    def time(self) -> FloatArray:
        """(n,) s."""
        return self.recording.time

    @cached_property
    def rest(self) -> Quiet | None:
        """The quiet interval: the rig's pre_trigger, or the quietest stretch that looks like rest, or None."""
        stated = self.recording.rig.pre_trigger
        noise, anywhere = self.array.values("noise"), has_rates(self.array)
        return find_quiet(self.time, self.recording.readings, noise, stated, anywhere)

    @property
    def required_rest(self) -> Quiet:
        """The quiet interval; EstimationError where there is none."""
        if self.rest is None:
            raise EstimationError(
                "no quiet interval was found",
                advice="state [recording] pre_trigger in the rig file, with the body at rest",
            )
        return self.rest

    @cached_property
    def zero(self) -> FloatArray:
        """(k,) mean over the quiet interval; 0 where there is none, or no valid sample in it."""
        if self.rest is None:
            return np.zeros(len(self.array))
        window = self.recording.readings[self.rest.samples]
        count = np.isfinite(window).sum(axis=0)
        return np.asarray(np.nansum(window, axis=0) / np.maximum(count, 1))

    @cached_property
    def readings(self) -> FloatArray:
        """(n,k) with the zero taken off; NaN where invalid."""
        return np.asarray(self.recording.readings - self.zero)

    @property
    def valid(self) -> BoolArray:
        """(n,k)"""
        return self.recording.valid

    @cached_property
    def sigma(self) -> FloatArray:
        """(k,) deviation of a reading in the fits: `noise`, and more for channels of other clocks (Alignment)."""
        found = self.noise.copy()
        for a in (a for a in self.recording.alignments if a.channel in self.array.channels):
            found[self.array.index(a.channel)] = a.deviation(found[self.array.index(a.channel)])
        return found

    @cached_property
    def noise(self) -> FloatArray:
        """(k,) noise standard deviation: the rig's, else measured in the quiet interval, else from differences.

        Never below a quarter of the channel's quantisation step over √3 (uniform rounding noise, GUM F.2.2.1
        gives step/√12), so that no weight is infinite.
        """
        stated = self.array.values("noise")
        measured = noise_level(self.recording.readings, None if self.rest is None else self.rest.samples)
        with np.errstate(invalid="ignore"):
            peak = np.nan_to_num(np.nanmax(np.abs(self.readings), axis=0, initial=0.0))
        floor = np.maximum(NOMINAL_NOISE * peak, 1e-9)
        return np.where(np.isfinite(stated) & (stated > 0), stated, np.where(measured > 0, measured, floor))

    @cached_property
    def evidence(self) -> tuple[ChannelEvidence, ...]:
        """What each channel's own trace shows: flat tops, dropouts, stuck stretches, spikes."""
        return find_evidence(self.recording, self.sigma)

    @cached_property
    def flagged(self) -> BoolArray:
        """(n,k) samples of the common time base that the evidence speaks of."""
        return flagged(self.recording, self.evidence)
