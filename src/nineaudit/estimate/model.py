"""What the whole-record fit fits: readings, weights, calibration priors, and fault shapes (METHODS.md 2).

ω lives on the nodes between samples, so that with the midpoint rule every sample t has its own, independent noise:

    ω̄_t = (ω_t−½ + ω_t+½)/2,    α_t = (ω_t+½ − ω_t−½)/h_t                                    (dω/dt = α)

    accelerometer i:  y_i = n_i·a0 + (r_i × n_i)·α_t + q_i(ω̄_t) + b_i − s_i dy_i/dt + noise      [Becker75 eq 5]
    rate sensor i:    y_i = n_i·ω̄_t + b_i − s_i dy_i/dt + noise
    n_i = (1 + g)(n + τ_1 u_1 + τ_2 u_2),  r_i = r + e        gain, tilts and place as they are, not as the rig says

Unknown are a0 at every sample, ω (three a node) and θ, calibration errors and fault amplitudes in units of their prior
standard deviations.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nineaudit.array import BoolArray, FloatArray, IntArray, SensorArray
from nineaudit.estimate import calibration
from nineaudit.estimate.instrument import Instrument, instrument

ANY_ALPHA = 1e6
"""rad/s²: where the valid channels do not tell α, it is 0 with this standard deviation, far beyond any impact."""


@dataclass(frozen=True, eq=False)
class Extra:
    """Fault shapes beside the calibration errors: `columns` (e,n) change of a reading by one prior standard
    deviation, `channel` (e,) whose reading."""

    columns: FloatArray
    channel: IntArray


@dataclass(frozen=True, eq=False)
class Between:
    """What a coarse recording does not see between its samples (between_samples.py): at each sample ω and α differ from
    the midpoint rule's by `mean` (n,6), rad/s and rad/s², and by errors of standard deviation `sd` (n,6) that all
    channels share; `omega` (n,3) near which they act."""

    omega: FloatArray
    mean: FloatArray
    sd: FloatArray


@dataclass(frozen=True, eq=False)
class Data:
    """What is fitted: `time` (n,) s, `readings` (n,k) SI zeroed (any number where the weight is 0), `weight` (n,k)
    1/σ or 0, `prior_sd` (k,8) of calibration.PARAMETERS (0: certain), `still` (n+1,) precision (s²/rad²) with which
    ω = 0 is known at each node, 0 where it is not, `extra` fault shapes, and what happens `between` coarse samples."""

    array: SensorArray
    time: FloatArray
    readings: FloatArray
    weight: FloatArray
    prior_sd: FloatArray
    still: FloatArray
    extra: Extra | None = None
    between: Between | None = None

    @cached_property
    def used(self) -> BoolArray:
        """(k,) channels with a valid sample."""
        return np.asarray((self.weight > 0).any(axis=0))

    @cached_property
    def active(self) -> tuple[IntArray, IntArray]:
        """(p,) channel and (p,) parameter of each calibration error that is not certain and whose channel is used."""
        channel, parameter = np.nonzero((self.prior_sd > 0) & self.used[:, None])
        return channel, parameter

    @cached_property
    def channel(self) -> IntArray:
        """(q,) channel of each θ: calibration errors, then fault shapes."""
        extra = np.zeros(0, dtype=np.intp) if self.extra is None else self.extra.channel
        return np.concatenate([self.active[0], extra])

    @cached_property
    def across(self) -> FloatArray:
        """(k,2,3) directions of the tilts."""
        return calibration.perpendiculars(self.array)

    @cached_property
    def step(self) -> FloatArray:
        """(n,) width of each sample's interval, s."""
        return np.asarray(np.gradient(self.time))

    @cached_property
    def rows(self) -> tuple[FloatArray, FloatArray]:
        """(k,n) readings and (k,n) weights, a channel a row."""
        return np.ascontiguousarray(self.readings.T), np.ascontiguousarray(self.weight.T)

    @cached_property
    def _valid(self) -> tuple[BoolArray, IntArray]:
        """(p,k) patterns of valid channels that occur, the first sample's first, and (n,) which each sample has."""
        valid = self.weight > 0
        odd = np.flatnonzero((valid != valid[0]).any(axis=1))
        patterns, which = np.unique(valid[odd], axis=0, return_inverse=True)
        place = np.zeros(len(valid), dtype=np.intp)
        place[odd] = 1 + which.ravel()
        return np.vstack([valid[:1], patterns]), place

    @cached_property
    def bridge(self) -> FloatArray:
        """(n,) precision (s²/rad²) with which ω stays over a sample whose valid channels do not tell α, though those of
        the record do, in five directions at least (of the sixth, products of ω may tell); where they never do, over one
        without any valid channel. Rates on three axes tell α by their slope."""
        patterns, which = self._valid
        as_stated = self.bent(np.zeros(len(self.channel)))
        design = np.hstack([as_stated.axes_a, as_stated.lever])
        every = int(np.linalg.matrix_rank(design[self.used])) if self.used.any() else 0
        rank = [int(np.linalg.matrix_rank(design[p])) if p.any() else 0 for p in patterns]
        rates = [p & ~self.array.is_accelerometer for p in patterns]
        turning = [r.any() and int(np.linalg.matrix_rank(self.array.axes[r])) == 3 for r in rates]
        told = [t or (r >= 6 if every >= 5 else p.any()) for t, r, p in zip(turning, rank, patterns, strict=True)]
        short = ~np.array(told, dtype=bool)
        return np.where(short[which], (ANY_ALPHA * self.step) ** -2, 0.0)

    @cached_property
    def sloped(self) -> BoolArray:
        """(n,) samples at which the slope of a reading may be taken: α is told there and at both neighbours."""
        bridged = np.concatenate([[False], self.bridge > 0, [False]])
        return np.asarray(~(bridged[:-2] | bridged[1:-1] | bridged[2:]))

    @cached_property
    def dof(self) -> int:
        """Expectation of the cost: valid readings less a0 (as far as it is sensed) and ω, save where ω is known or
        no sample beside a node has a valid reading."""
        patterns, which = self._valid
        axes = self.bent(np.zeros(len(self.channel))).axes_a
        rank = [int(np.linalg.matrix_rank(axes[p])) if p.any() else 0 for p in patterns]
        absent = np.asarray(~patterns.any(axis=1))[which]
        lost = np.append(True, absent) & np.append(absent, True)
        sensed = int(np.array(rank)[which].sum())
        return int((self.weight > 0).sum()) - sensed - 3 * int(((self.still == 0) & ~lost).sum())

    def errors(self, theta: FloatArray) -> FloatArray:
        """(k,8) calibration errors, SI, of θ (q,)."""
        out = np.zeros_like(self.prior_sd)
        out[self.active] = theta[: len(self.active[0])] * self.prior_sd[self.active]
        return out

    def bent(self, theta: FloatArray) -> Instrument:
        """The instrument that θ (q,) describes."""
        array = self.array
        return instrument(array.axes, array.positions, array.is_accelerometer, self.across, self.errors(theta))
