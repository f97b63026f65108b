"""A fault undone by its model, where the record says which: what was measured stays, and its noise with it.

    gain, polarity, unit     ŷ = y / f                             f fitted beside the calibration of all channels
    delay                    ŷ = y(t + s)                          shifted back in the frequency domain
    zero_shift               ŷ = y − b P(begun by t)               the instant from the step in y less the others' word
    drift                    ŷ = y − d ramp(t)
    cross_axis, position     ŷ = y − Σ τ_j u_j·a  or  y − n·(α × e + ω × (ω × e))
    swap                     ŷ_i = y_j, ŷ_j = y_i

The parameters come from one whole-record fit in which this channel has them free, and the fault counts as undone only
when that fit finds the record whole; otherwise the channel is rebuilt from the others. `u` has the channel's noise
(over f), the covariance of the parameters (the same error for many samples together), and the channel's other
calibration errors, which are not corrected; of what it is the uncertainty, see reconstruct.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from nineaudit.array import FloatArray, IntArray
from nineaudit.case import Case
from nineaudit.diagnosis import Candidate
from nineaudit.errors import EstimationError
from nineaudit.estimate import fault_models
from nineaudit.estimate.fault_models import PATIENCE, Faulty, Undone
from nineaudit.estimate.posterior import posterior
from nineaudit.estimate.start import first_omega
from nineaudit.estimate.trajectory import Fit, fit
from nineaudit.reconstruct import ZERO, Reconstruction, bound_ratio, event_data, from_donors, left_out, rms, statistic
from nineaudit.units import counted, display

Model = Callable[[Faulty], Undone]

UNDONE: Mapping[str, Sequence[str]] = {
    "gain": ("gain",),
    "unit": ("gain",),
    "polarity": ("sign", "gain"),
    "delay": ("delay",),
    "zero_shift": ("zero_shift",),
    "drift": ("drift",),
    "cross_axis": ("cross_axis",),
    "position": ("position",),
}
"""Fault word -> models of it, the first that makes the record whole is taken. A swap has no parameter."""


def undo(case: Case, candidate: Candidate) -> Reconstruction | None:
    """The channel (two for a swap) without the fault; None where there is no model of the fault or the record is not
    whole with it undone. EstimationError where the others do not tell the motion or the channel too little."""
    columns = [case.array.index(c) for c in candidate.channels]
    if candidate.fault == "swap" and len(columns) == 2:
        return _swap(case, columns)
    if candidate.fault not in UNDONE or len(columns) != 1:
        return None
    faulty = _faulty(case, columns[0])
    for name in UNDONE[candidate.fault]:
        done = _model(name, candidate, faulty.onset)(faulty)
        if done.fit.converged and statistic(case, done.fit) <= case.statistic_limit:
            return _reconstruction(case, columns[0], candidate.fault, done)
    return None


def _model(name: str, candidate: Candidate, onset: float) -> Model:
    if name == "zero_shift":
        return partial(fault_models.zero_shift, about=candidate.parameters.get("at", onset))
    model: Model = getattr(fault_models, name)
    return model


def _faulty(case: Case, column: int) -> Faulty:
    data = event_data(case)
    left = left_out(case, data, column)
    rest = np.zeros(len(case.time), dtype=np.bool_)
    if case.rest is not None:
        rest[case.rest.samples] = True
    return Faulty(
        data=data,
        left=left,
        column=column,
        length=case.condensed.length,
        time=case.time,
        readings=case.readings,
        sigma=case.sigma,
        onset=float(data.time[case.onset]),
        rest=rest,
        others=from_donors(case, left, column),
    )


def _reconstruction(case: Case, column: int, fault: str, done: Undone) -> Reconstruction:
    """The undone channel; samples that the model does not give are filled from the others."""
    channel, measured = case.array.channels[column], case.readings[:, column]
    spread = posterior(done.fit)
    u = np.hypot(done.noise, _slow(case, done.fit, spread.theta, column, done.free))
    lost = ~np.isfinite(done.values)
    values = done.values
    if lost.any():
        others = from_donors(case, done.fit, column)
        values, u = np.where(lost, others.values, values), np.where(lost, others.u, u)
    replaced = values != measured
    inside = np.flatnonzero(replaced)
    if not len(inside) or not np.isfinite(u[replaced]).all():
        raise EstimationError(f"{channel} is not determined at every sample")
    return Reconstruction(
        channels=(channel,),
        interval=(float(case.time[inside[0]]), float(case.time[inside[-1]])),
        measured=measured[:, None],
        rebuilt=values[:, None],
        u=u[:, None],
        replaced=replaced[:, None],
        u_rms=rms(u[replaced]),
        bound_ratio=bound_ratio(case, done.fit, column, done.noise[replaced]),
        method=_in_words(case, fault, done.parameters, done.parameters_u, column, int(lost.sum())),
        donors=tuple(c for c in case.array.channels if c != channel),
        fault=fault,
        parameters=done.parameters,
        parameters_u=done.parameters_u,
        fit=done.fit,
    )


def _slow(case: Case, fit: Fit, covariance: FloatArray, column: int, free: IntArray) -> FloatArray:
    """(n,) standard uncertainty by the channel's own calibration errors and the parameters of its fault.

    With θ ~ (θ̂, C), the parameters `free` corrected by their estimate and the others not: D (C + μμᵀ) Dᵀ, μ = θ̂ save
    0 for the free ones. The reading as it is stays as traceable as every other channel's.
    """
    mine = np.flatnonzero(fit.data.channel == column)
    by = fit.point.columns[mine]
    mean = np.where(np.isin(mine, free), 0.0, fit.theta[mine])
    moment = covariance[np.ix_(mine, mine)] + np.outer(mean, mean)
    variance = np.einsum("pm,pq,qm->m", by, moment, by)
    return np.asarray(np.interp(case.time, fit.data.time, np.sqrt(np.maximum(variance, 0.0))))


def _swap(case: Case, columns: list[int]) -> Reconstruction | None:
    """Both channels, each with what was recorded as the other's."""
    order = np.arange(len(case.array))
    order[columns] = order[columns[::-1]]
    data, plain = event_data(case), case.fit_data
    prior = data.prior_sd.copy()
    prior[:, ZERO] = prior[order, ZERO]
    back = replace(data, readings=data.readings[:, order], weight=data.weight[:, order], prior_sd=prior)
    start = first_omega(replace(plain, readings=plain.readings[:, order], weight=plain.weight[:, order]))
    found = fit(back, start, iterations=PATIENCE)
    if not found.converged or statistic(case, found) > case.statistic_limit:
        return None
    none, theta = np.zeros(0, dtype=np.intp), posterior(found).theta
    slow = [_slow(case, found, theta, c, none) for c in columns]
    noise = case.sigma[columns[::-1]]
    u = np.hypot(np.stack(slow, axis=1), noise)
    values = case.readings[:, columns[::-1]]
    replaced = ~((values == case.readings[:, columns]) | np.isnan(values))
    ratios = [bound_ratio(case, found, c, np.full(1, s)) for c, s in zip(columns, noise, strict=True)]
    first, second = (case.array.channels[c] for c in columns)
    return Reconstruction(
        channels=(first, second),
        interval=(float(case.time[0]), float(case.time[-1])),
        measured=case.readings[:, columns],
        rebuilt=values,
        u=u,
        replaced=replaced,
        u_rms=rms(u),
        bound_ratio=rms(np.array(ratios)),
        method=f"swap undone: {first} is what was recorded as {second}, {second} what was recorded as {first}",
        donors=(first, second),
        fault="swap",
        fit=found,
        zeros=case.zero[columns[::-1]],
    )


def _in_words(
    case: Case, fault: str, values: Mapping[str, float], u: Mapping[str, float], column: int, filled: int
) -> str:
    """What was undone, with its parameter and that one's standard uncertainty, in the rig's units."""
    units = case.recording.rig.units
    unit = "m/s^2" if case.array.is_accelerometer[column] else "rad/s"
    if fault == "polarity" and values["factor"] == -1.0:
        text = "polarity undone: every sample times −1"
    elif "factor" in values:
        text = f"{fault} undone: every sample divided by {values['factor']:.5g} (u {u['factor']:.2g})"
    elif fault == "delay":
        text = f"delay undone: shifted back by {values['delay'] * 1e3:.4g} ms (u {u['delay'] * 1e3:.2g} ms)"
    elif fault in ("zero_shift", "drift"):
        size, error = (display(v["size"], unit, units, d) for v, d in ((values, 4), (u, 2)))
        when = f" from {values['at']:.5g} s on" if "at" in values else " in a straight line to the end"
        text = f"{fault.replace('_', ' ')} undone: {size} (u {error}) subtracted{when}"
    elif fault == "cross_axis":
        text = f"cross axis sensitivity undone: {values['size']:.2%} (u {u['size']:.2%})"
    else:
        size, error = (display(v["size"], "m", units, d) for v, d in ((values, 3), (u, 2)))
        text = f"{fault} undone: {size} (u {error}) from its place in the rig"
    return f"{text}; {counted(filled, 'sample')} filled from the others" if filled else text
