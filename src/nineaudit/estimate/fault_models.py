"""The parameters of a fault in one channel, from a whole-record fit that has them free, and its readings without it.

With x what the channel would have read:

    gain         y = f x              readings over f, the rest by the gain error; repeated until f stands
    delay        y = x(t − s)         readings shifted back, the rest by the time skew; repeated until s stands
    zero_shift   y = x + b, t ≥ t_0   b beside all else; t_0 from the change point of y less the others' word
    drift        y = x + d ramp       ramp from the onset, or over the whole record less its mean where it was zeroed
    cross_axis   n → n + Σ τ_j u_j    tilts with a prior of 0.1
    position     r → r + e            with a prior of 10 mm
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from nineaudit.array import BoolArray, FloatArray, IntArray
from nineaudit.errors import EstimationError
from nineaudit.estimate import calibration, condense, samples
from nineaudit.estimate.hypotheses import theta_for
from nineaudit.estimate.model import Data, Extra
from nineaudit.estimate.normal import eliminate, normal_equations
from nineaudit.estimate.trajectory import Fit, fit

GAIN, ZERO, TILTS, PLACE, TIMING = 0, 1, slice(2, 4), slice(4, 7), 7
GAIN_SD, TIMING_SD, TILT_SD, PLACE_SD = 0.1, 2e-4, 0.1, 10e-3
"""Priors of the parameters, far wider than the record leaves them."""
LONGEST_DELAY = 5e-3
"""s, of either sign, that is looked for."""
ROUNDS, PATIENCE = 8, 100
"""Times that the readings are put right; iterations of a fit, which may creep along what the record hardly tells."""


@dataclass(frozen=True, eq=False)
class Faulty:
    """A channel (`column`) of the `data` on blocks of `length` samples, the fit `left` without it, and all `readings`
    (n,k) SI zeroed at `time` (n,), noise `sigma` (k,); `onset` (s) when the event may begin, `rest` (n,) where the zero
    was taken; `others` what the others say that the channel reads."""

    data: Data
    left: Fit
    column: int
    length: int
    time: FloatArray
    readings: FloatArray
    sigma: FloatArray
    onset: float
    rest: BoolArray
    others: samples.Rebuilt

    @property
    def trace(self) -> FloatArray:
        """(n,) readings of the channel, NaN where invalid."""
        return self.readings[:, self.column]


@dataclass(frozen=True, eq=False)
class Undone:
    """`values` (n,) without the fault, NaN where there are none; `noise` (n,) that the measured value has in them; the
    `fit` that gave the parameters, and which of its θ they are, `free`; `parameters` and their u, SI."""

    values: FloatArray
    noise: FloatArray
    fit: Fit
    free: IntArray
    parameters: Mapping[str, float]
    parameters_u: Mapping[str, float]


def gain(f: Faulty) -> Undone:
    """Sensitivity, sign or unit."""
    there, seen, weight = f.left.ideal[:, f.column], f.data.readings[:, f.column], f.data.weight[:, f.column] ** 2
    factor = float((weight * there) @ seen) / max(float((weight * there) @ there), 1e-300)
    near = f.left
    for _ in range(ROUNDS):
        if not 1e-4 < abs(factor) < 1e4:
            raise EstimationError("no gain can be told", found=factor)
        near = found = _settled(_scaled(f, factor, _noise_over(f, factor), GAIN_SD), near, f.column, GAIN)
        place = _places(found.data, f.column, [GAIN])
        more = float(found.theta[place[0]]) * GAIN_SD
        factor *= 1.0 + more
        if abs(more) < 1e-3:
            break
    u = abs(factor) * GAIN_SD * _sd(found, place)[0]
    noise = np.full(len(f.time), f.sigma[f.column] / _noise_over(f, factor))
    return Undone(f.trace / factor, noise, found, place, {"factor": factor}, {"factor": u})


def sign(f: Faulty) -> Undone:
    """Reversed, and nothing else: the gain keeps the rig's word."""
    found = fit(_scaled(f, -1.0, 1.0, None), f.left.omega, iterations=PATIENCE)
    noise = np.full(len(f.time), f.sigma[f.column])
    return Undone(-f.trace, noise, found, np.zeros(0, dtype=np.intp), {"factor": -1.0}, {"factor": 0.0})


def delay(f: Faulty) -> Undone:
    """Late by a constant time. EstimationError on a time base that is not even."""
    step = float(np.median(np.diff(f.time)))
    if np.ptp(np.diff(f.time)) > 0.01 * step:
        raise EstimationError("a delay can only be undone on an even time base")
    late = _best_lag(f, step) * step
    prior = f.data.prior_sd.copy()
    prior[f.column, TIMING] = TIMING_SD
    near = f.left
    for _ in range(ROUNDS):
        values = advanced(f.trace, late / step)
        near = found = _settled(_with_trace(replace(f.data, prior_sd=prior), f, values), near, f.column, TIMING)
        place = _places(found.data, f.column, [TIMING])
        more = float(found.theta[place[0]]) * TIMING_SD
        late += more
        if abs(more) < 1e-2 * step:
            break
    u = TIMING_SD * float(_sd(found, place)[0])
    noise = np.full(len(f.time), f.sigma[f.column])
    return Undone(advanced(f.trace, late / step), noise, found, place, {"delay": late}, {"delay": u})


def zero_shift(f: Faulty, about: float) -> Undone:
    """`about`: the instant, s, to a twelfth of the event."""
    begun = _begun(f, about)
    found, place, scale = _beside(f, begun)
    size, u = scale * float(found.theta[place[0]]), scale * float(_sd(found, place)[0])
    noise = np.sqrt(f.sigma[f.column] ** 2 + size**2 * begun * (1.0 - begun))
    at = float(f.time[int(np.searchsorted(begun, 0.5))])
    return Undone(f.trace - size * begun, noise, found, place, {"size": size, "at": at}, {"size": u})


def drift(f: Faulty) -> Undone:
    """A straight line, `size` its height at the end."""
    span = f.time[-1] - f.time
    zeroed = float(f.time[f.rest].mean()) if f.rest.any() else float(f.time[0])
    late = np.clip(1.0 - span / max(float(f.time[-1]) - f.onset, 1e-12), 0.0, None)
    whole = 1.0 - span / (float(f.time[-1]) - zeroed)
    tried = [(ramp, *_beside(f, ramp)) for ramp in (late, whole)]
    ramp, found, place, scale = min(tried, key=lambda item: item[1].cost)
    size, u = scale * float(found.theta[place[0]]), scale * float(_sd(found, place)[0])
    noise = np.full(len(f.time), f.sigma[f.column])
    return Undone(f.trace - size * ramp, noise, found, place, {"size": size}, {"size": u})


def cross_axis(f: Faulty) -> Undone:
    return _of_instrument(f, TILTS, TILT_SD)


def position(f: Faulty) -> Undone:
    return _of_instrument(f, PLACE, PLACE_SD)


def _of_instrument(f: Faulty, which: slice, sd: float) -> Undone:
    """Tilts or place: what they add to a perfect reading, from the motion at each sample without the channel."""
    prior = f.data.prior_sd.copy()
    prior[f.column, which] = sd
    data = replace(f.data, prior_sd=prior)
    found = fit(data, f.left.omega, theta_for(data, f.left), PATIENCE)
    place = _places(data, f.column, range(8)[which])
    error = found.data.errors(found.theta)[f.column]
    others = f.readings.copy()
    others[:, f.column] = np.nan
    motion = samples.at_samples(found, f.time, others, f.sigma).motion
    one = f.data.array.select([f.column])
    by = calibration.columns(one, np.zeros((len(f.time), 1)), f.time, motion)[:, 0, which]
    told = np.isfinite(motion.alpha).all(axis=1)
    values = np.where(told, f.trace - (1.0 + error[GAIN]) * by @ error[which], np.nan)
    size = float(np.linalg.norm(error[which]))
    along = error[which] / max(size, 1e-300)
    spread = _covariance(found, place) * sd**2
    noise = np.full(len(f.time), f.sigma[f.column])
    return Undone(values, noise, found, place, {"size": size}, {"size": float(np.sqrt(along @ spread @ along))})


def advanced(values: FloatArray, late: float) -> FloatArray:
    """y(t + s), `late` = s in samples: band-limited (sinc of 64 samples, Kaiser window). NaN where the record has no
    such time, or a sample within reach is invalid."""
    reach, whole = 32, round(late)
    part, lag = late - whole, np.arange(-reach, reach + 1)
    window = np.i0(9.0 * np.sqrt(np.maximum(1.0 - ((lag - part) / (reach + 1)) ** 2, 0.0))) / np.i0(9.0)
    kernel = np.sinc(lag - part) * window
    valid = np.isfinite(values)
    where = np.arange(len(values))
    filled = np.interp(where, where[valid], values[valid])
    padded = np.pad(filled, reach, mode="reflect", reflect_type="odd")
    moved = np.convolve(padded, (kernel / kernel.sum())[::-1], mode="valid")
    source = where + whole
    inside = (source >= 0) & (source < len(values))
    source = np.clip(source, 0, len(values) - 1)
    near = np.convolve(~valid, np.ones(5), mode="same") > 0  # the kernel has all but a few per cent within two samples
    return np.where(inside & ~near[source], moved[source], np.nan)


def _settled(data: Data, near: Fit, column: int, parameter: int) -> Fit:
    """The fit from another one near by, with one parameter of the channel, which is in the readings already, at 0."""
    theta = theta_for(data, near)
    theta[_places(data, column, [parameter])] = 0.0
    return fit(data, near.omega, theta, PATIENCE)


def _best_lag(f: Faulty, step: float) -> int:
    """Whole samples by which the channel is late of what the others say."""
    most = min(int(LONGEST_DELAY / step), len(f.time) // 4)
    there, seen = f.others.values, f.trace

    def apart(lag: int) -> float:
        moved = seen[max(lag, 0) : len(seen) + min(lag, 0)] - there[max(-lag, 0) : len(seen) - max(lag, 0)]
        return float(np.nanmean(moved**2))

    return min(range(-most, most + 1), key=apart)


def _begun(f: Faulty, about: float) -> FloatArray:
    """(n,) probability that the shift has begun: posterior of the change point of y less the others' word, levels
    before and after free, within a ninth of the event about the instant that is roughly known."""
    reach = (float(f.time[-1]) - f.onset) / 9.0
    off = f.trace - f.others.values
    near = np.flatnonzero((np.abs(f.time - about) <= reach) & np.isfinite(off))
    if len(near) < 8:
        raise EstimationError("too few samples about the shift")
    r, count = off[near], np.arange(1, len(near))
    first, total = np.cumsum(r)[:-1], float(r.sum())
    explained = first**2 / count + (total - first) ** 2 / (len(near) - count)
    coloured = f.length / float(f.data.weight[:, f.column].max()) ** 2  # what a sample of white noise would have
    variance = max(coloured, f.sigma[f.column] ** 2) + float(np.nanmedian(f.others.noise)) ** 2
    odds = np.exp(np.maximum(0.5 * (explained - explained.max()) / variance, -700.0))
    begun = np.zeros(len(f.time))
    begun[near[1:]] = odds / odds.sum()
    return np.minimum(np.cumsum(begun), 1.0)


def _beside(f: Faulty, shape: FloatArray) -> tuple[Fit, IntArray, float]:
    """The fit with `shape` (n,) in the channel, the place of its amplitude in θ, and the scale of that."""
    scale = 3.0 * float(np.abs(f.data.readings[:, f.column] - f.left.ideal[:, f.column]).max())
    extra = Extra(scale * condense.block_means(shape, f.length)[None], np.array([f.column]))
    data = replace(f.data, extra=extra)
    found = fit(data, f.left.omega, theta_for(data, f.left), PATIENCE)
    return found, np.array([len(found.theta) - 1]), scale


def _noise_over(f: Faulty, factor: float) -> float:
    """What the stated noise is to be divided by when the readings are: |factor|, or 1 where what multiplied the signal
    multiplied the noise too, as a wrong unit does: whichever the noise at rest is nearer to."""
    at_rest = f.trace[f.rest & np.isfinite(f.trace)]
    if len(at_rest) < 2 or not at_rest.any():
        return 1.0
    size = np.log(float(np.std(at_rest, ddof=1)) / float(f.sigma[f.column]))
    return 1.0 if abs(size - np.log(abs(factor))) < abs(size) else abs(factor)


def _scaled(f: Faulty, factor: float, noise: float, prior: float | None) -> Data:
    """Readings over `factor`, their noise over `noise`, and the gain's `prior` sd (None: as stated)."""
    readings, weight, sd = f.data.readings.copy(), f.data.weight.copy(), f.data.prior_sd.copy()
    readings[:, f.column] /= factor
    weight[:, f.column] *= noise
    sd[f.column, ZERO] /= noise
    if prior is not None:
        sd[f.column, GAIN] = prior
    return replace(f.data, readings=readings, weight=weight, prior_sd=sd)


def _with_trace(data: Data, f: Faulty, values: FloatArray) -> Data:
    """`data` with another trace (n,) of the channel; NaN has no weight."""
    blocks = condense.block_means(np.where(np.isfinite(values), values, 0.0), f.length)
    whole = condense.block_means(np.isfinite(values).astype(float), f.length) == 1.0
    readings, weight = data.readings.copy(), data.weight.copy()
    readings[:, f.column] = np.where(whole, blocks, 0.0)
    weight[~whole, f.column] = 0.0
    return replace(data, readings=readings, weight=weight)


def _places(data: Data, column: int, parameters: range | list[int]) -> IntArray:
    """Where in θ these calibration parameters of a channel are."""
    channel, parameter = data.active
    return np.flatnonzero((channel == column) & np.isin(parameter, list(parameters)))


def _covariance(found: Fit, place: IntArray) -> FloatArray:
    """Posterior covariance of some θ."""
    whole = np.linalg.inv(eliminate(normal_equations(found.point)).schur)
    return np.asarray(whole[np.ix_(place, place)])


def _sd(found: Fit, place: IntArray) -> FloatArray:
    return np.asarray(np.sqrt(np.diag(_covariance(found, place))))
