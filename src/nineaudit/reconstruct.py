"""A faulty channel from the others, with its standard uncertainty; what was recorded stays as it is.

Whatever the method, `u` is the standard uncertainty of: the value less what a perfect sensor in the place and along the
axis that the rig states would have read, less its own mean over the quiet interval. In it are the noise of the donors,
their calibration errors as far as the whole record leaves them open, and the zero: where it was taken off over a quiet
interval, the rig's u of the zero went with it, and what is left is the noise of that mean. (Counting the rig's 0.1 g_0
on top made u a third too wide.)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.case import Case
from nineaudit.errors import EstimationError
from nineaudit.estimate import condense, samples
from nineaudit.estimate.fault_models import PATIENCE
from nineaudit.estimate.hypotheses import masked
from nineaudit.estimate.model import Data
from nineaudit.estimate.point import point
from nineaudit.estimate.posterior import posterior
from nineaudit.estimate.start import first_omega
from nineaudit.estimate.trajectory import Fit, fit

STRETCHES = 12
"""Stretches of the quiet interval from which slow noise is measured."""
ZERO = 1
"""Column of the zero in calibration.PARAMETERS."""


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """Repaired channels over the whole record, (n,m) SI with the zero taken off.

    `measured` as recorded, `rebuilt` with the standard uncertainty `u`, `replaced` the samples where the rebuilt
    value stands for the measured one. `interval` (s, s) of those, `u_rms` over them, `bound_ratio` the white-noise
    part of u over the Cramér–Rao bound of a channel rebuilt from the others, σ√(h/(1−h)) (METHODS.md 4); for a rate
    sensor the bound is what the whole record tells of n·ω, which the fit attains: 1. `donors`: the channels it is made
    of. `fault`: the word of a fault that was undone by its model, with its `parameters` and their standard uncertainty
    `parameters_u` (SI); None where the waveform was rebuilt from the donors. `fit`: the whole-record fit behind it.
    `zeros` (m,): what is to be added to compare with the recording as it was read; None: each channel's own zero.
    """

    channels: tuple[str, ...]
    interval: tuple[float, float]
    measured: FloatArray
    rebuilt: FloatArray
    u: FloatArray
    replaced: BoolArray
    u_rms: float
    bound_ratio: float
    method: str
    donors: tuple[str, ...]
    fault: str | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    parameters_u: Mapping[str, float] = field(default_factory=dict)
    fit: Fit | None = field(default=None, repr=False)
    zeros: FloatArray | None = None

    @property
    def repaired(self) -> FloatArray:
        """(n,m) measured, with the replaced samples rebuilt."""
        return np.where(self.replaced, self.rebuilt, self.measured)


def rebuild_channel(case: Case, channel: str, replaced: BoolArray | None = None) -> Reconstruction:
    """Rebuild one channel from the whole-record fit without it, at the bandwidth of the recording (samples.py).

    `replaced` (n,) the samples to stand for the measured ones; default all from the first sample after the quiet
    interval; invalid ones always. EstimationError when the others do not determine the channel.
    """
    column = case.array.index(channel)
    where = _default_replaced(case) if replaced is None else replaced
    where = where | ~np.isfinite(case.readings[:, column])
    if not where.any():
        raise EstimationError(f"no sample of {channel} is to be replaced")
    left = left_out(case, event_data(case), column)
    found = from_donors(case, left, column)
    if not np.isfinite(found.u[where]).all():
        raise EstimationError(f"the other channels do not determine {channel} at every sample")
    inside = np.flatnonzero(where)
    return Reconstruction(
        channels=(channel,),
        interval=(float(case.time[inside[0]]), float(case.time[inside[-1]])),
        measured=case.readings[:, [column]],
        rebuilt=found.values[:, None],
        u=found.u[:, None],
        replaced=where[:, None],
        u_rms=rms(found.u[where]),
        bound_ratio=bound_ratio(case, left, column, found.white[where]),
        method="each sample from the others' readings there, ω and calibration from the whole-record fit without it",
        donors=tuple(c for c in case.array.channels if c != channel),
        fit=left,
    )


def event_data(case: Case) -> Data:
    """What is fitted for a reconstruction. A zero that was taken off over the quiet interval is wrong by the noise of
    that mean and no more, and the readings of the interval, used up for it, are not used again. Weights are of slow
    noise, which is what ω and calibration feel."""
    data, colour = case.fit_data, slow_noise(case)
    prior, weight = data.prior_sd.copy(), data.weight / colour
    if case.rest is not None:
        length = case.condensed.length
        first, last = case.rest.start // length, max(case.rest.stop // length, case.rest.start // length + 1)
        prior[:, ZERO] = colour * case.condensed.sigma / np.sqrt(last - first)
        weight[first:last] = 0.0
    return replace(data, prior_sd=prior, weight=weight)


def slow_noise(case: Case) -> float:
    """Noise of many blocks together over what it would be if blocks were independent.

    Behind a channel frequency class neighbouring blocks are not quite; ω and calibration feel the noise of long
    stretches. From a dozen stretches of the quiet interval, median of the channels; 1 where it is too short.
    """
    if case.rest is None:
        return 1.0
    window, length = case.readings[case.rest.samples], case.condensed.length
    longer = len(window) // STRETCHES
    if longer <= length:
        return 1.0
    stretches = condense.block_noise(case.sigma, window, longer)
    return max(float(np.median(stretches * np.sqrt(longer) / (case.condensed.sigma * np.sqrt(length)))), 1.0)


def statistic(case: Case, found: Fit) -> float:
    """Cost per degree of freedom of a fit to event_data, noise of single blocks as it is."""
    data = replace(found.data, weight=found.data.weight * slow_noise(case))
    return point(data, found.omega, found.theta).cost / max(data.dof, 1)


def left_out(case: Case, data: Data, column: int) -> Fit:
    """The fit without a channel. EstimationError where the others do not tell the motion or it does not settle.

    It starts from what the other channels tell of ω, and, if that leads nowhere, from the fit with all channels.
    """
    alone = masked(data, column)
    if alone.dof < 0:
        channel = case.array.channels[column]
        raise EstimationError(f"the motion is not determined without {channel}: more unknowns than readings are left")
    starts: tuple[Callable[[], FloatArray], ...] = (
        lambda: first_omega(masked(case.fit_data, column)),
        lambda: case.healthy.omega,
    )
    found: list[Fit] = []
    errors: list[EstimationError] = []
    for start in starts:
        try:
            found.append(fit(alone, start(), iterations=PATIENCE))
        except EstimationError as error:
            errors.append(error)
            continue
        if found[-1].converged and statistic(case, found[-1]) <= case.statistic_limit:
            return found[-1]
    settled = [f for f in found if f.converged]
    if not settled:
        raise errors[0] if errors else EstimationError("the fit without the channel did not converge")
    return min(settled, key=lambda f: f.cost)


def from_donors(case: Case, found: Fit, column: int, readings: FloatArray | None = None) -> samples.Rebuilt:
    """Every sample of a channel from those of the others (`readings` (n,k) zeroed; as measured), motion of `found`."""
    others = (case.readings if readings is None else readings).copy()
    others[case.recording.made_of_others] = np.nan  # a repair before this one made these: they say nothing new
    others[:, column] = np.nan
    at = samples.at_samples(found, case.time, others, case.sigma)
    return samples.rebuild(at, posterior(found), case.sigma, column)


def bound_ratio(case: Case, found: Fit, column: int, white: FloatArray) -> float:
    """White-noise part of u over the Cramér–Rao bound; NaN where the accelerometers alone do not span the channel."""
    if not case.array.is_accelerometer[column]:
        return 1.0
    least = samples.bound(found, case.sigma, column)
    return rms(white) / least if np.isfinite(least) else float("nan")


def rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _default_replaced(case: Case) -> BoolArray:
    where = np.ones(len(case.time), dtype=np.bool_)
    if case.rest is not None:
        where[: case.rest.stop] = False
    return where
