"""A faulty channel from the others, with its standard uncertainty; what was recorded stays as it is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.case import Case
from nineaudit.errors import EstimationError
from nineaudit.estimate import closed_form
from nineaudit.estimate.hypotheses import without
from nineaudit.estimate.motion import bridge
from nineaudit.estimate.posterior import posterior
from nineaudit.estimate.trajectory import fit
from nineaudit.physics import nap, rigid_body


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """Rebuilt channels over the whole record, (n,m) SI with the zero taken off.

    `measured` as recorded, `rebuilt` with the standard uncertainty `u`, `replaced` the samples where the rebuilt
    value stands for the measured one. `interval` (s, s) of those, `u_rms` over them, `bound_ratio` the white-noise
    part of u over the Cramér–Rao bound σ√(h/(1−h)) (METHODS.md 4). `donors`: the channels it is made of.
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

    @property
    def repaired(self) -> FloatArray:
        """(n,m) measured, with the replaced samples rebuilt."""
        return np.where(self.replaced, self.rebuilt, self.measured)


def rebuild_channel(case: Case, channel: str, replaced: BoolArray | None = None) -> Reconstruction:
    """Rebuild one channel: by its closed form for nine accelerometers in the 3-2-2-2 layout, else from the whole-record
    fit without it.

    `replaced` (n,) the samples to stand for the measured ones; default all from the first sample after the quiet
    interval; invalid ones always. EstimationError when the others do not determine the channel.
    """
    column = case.array.index(channel)
    where = _default_replaced(case) if replaced is None else replaced
    where = where | ~np.isfinite(case.readings[:, column])
    inside = np.flatnonzero(where)
    if not len(inside):
        raise EstimationError(f"no sample of {channel} is to be replaced")
    by = _by_closed_form if case.closed_forms_apply else _by_fit
    rebuilt, u, ratio, method = by(case, column)
    return Reconstruction(
        channels=(channel,),
        interval=(float(case.time[inside[0]]), float(case.time[inside[-1]])),
        measured=case.readings[:, [column]],
        rebuilt=rebuilt[:, None],
        u=u[:, None],
        replaced=where[:, None],
        u_rms=float(np.sqrt(np.mean(u[inside] ** 2))),
        bound_ratio=ratio,
        method=method,
        donors=tuple(c for c in case.array.channels if c != channel),
    )


def _by_closed_form(case: Case, column: int) -> tuple[FloatArray, FloatArray, float, str]:
    """(n,) rebuilt, (n,) standard uncertainty, ratio to the bound, and the method in words (METHODS.md 1.1)."""
    index, arms = nap_columns(case)
    place = index.index(column)
    others = [i for i in range(9) if i != place]
    name = nap.CHANNELS[place]
    readings = np.zeros((len(case.time), 9))
    readings[:, others] = bridge(case.readings[:, [index[i] for i in others]], case.time)
    rebuilt = nap.rebuild(name, readings, arms, case.time)
    u = _uncertainty(case, case.required_nap_problem, rebuilt, place)
    method = f"closed form of {name} from eight channels (METHODS 1.1), ω integrated without {name}"
    return rebuilt, u, _bound_ratio(case, index, arms, place), method


def _by_fit(case: Case, column: int) -> tuple[FloatArray, FloatArray, float, str]:
    """The same from the whole-record fit without the channel: what a perfect sensor in its place would have read.

    Fitted on blocks and carried to the samples by a cubic spline; white-noise part against the bound σ√(h/(1−h)) of
    a block's noise (METHODS.md 4; below 1: the smoother knows ω from the whole record).
    """
    from scipy.interpolate import CubicSpline

    data = case.fit_data
    found = without(data, case.healthy, column)
    if not found.converged:
        raise EstimationError("the fit without the channel did not converge")
    certain = replace(found.data, prior_sd=np.zeros_like(data.prior_sd))
    noise = posterior(fit(certain, found.omega)).channel_sd(column)
    rebuilt = CubicSpline(data.time, found.ideal[:, column])(case.time)
    u = np.interp(case.time, data.time, posterior(found).channel_sd(column))
    return np.asarray(rebuilt), u, _noise_ratio(case, column, noise), "whole-record fit without the channel (METHODS 2)"


def _noise_ratio(case: Case, column: int, noise: FloatArray) -> float:
    """Root mean square of the smoother's noise over the bound; NaN where the bound does not exist (rate sensors)."""
    held = np.flatnonzero(case.array.is_accelerometer).tolist()
    if column not in held:
        return float("nan")
    design = rigid_body.design(case.array.positions[held], case.array.axes[held])
    bound = float(rigid_body.missing_channel_bound(design)[held.index(column)]) * float(case.condensed.sigma[column])
    return float(np.sqrt(np.mean(noise**2)) / bound) if np.isfinite(bound) else float("nan")


def _default_replaced(case: Case) -> BoolArray:
    where = np.ones(len(case.time), dtype=np.bool_)
    if case.rest is not None:
        where[: case.rest.stop] = False
    return where


def _uncertainty(case: Case, problem: closed_form.Problem, rebuilt: FloatArray, missing: int) -> FloatArray:
    """(n,) standard uncertainty: white noise through the row of the closed form, and every calibration error of
    the donors through its derivative, computed on the blocks of the problem and interpolated."""
    readings = problem.readings.copy()
    readings[:, missing] = np.interp(problem.time, case.time, rebuilt)
    omega = nap.omega(readings, problem.arms, problem.time)
    moved = closed_form.rebuilt_response(problem, missing, omega, problem.patterns, problem.turned)
    calibration = np.interp(case.time, problem.time, (moved**2).sum(axis=(0, 2)))
    columns, _ = nap_columns(case)
    row = nap.closed_form(nap.CHANNELS[missing], problem.arms).row
    return np.asarray(np.sqrt(calibration + row**2 @ case.sigma[columns] ** 2))


def nap_columns(case: Case) -> tuple[list[int], FloatArray]:
    """Columns of the nine channels, and the arms. EstimationError where the array holds no ideal 3-2-2-2."""
    if case.nap_layout is None:
        raise EstimationError("only an ideal 3-2-2-2 array can be rebuilt by closed forms")
    return list(case.nap_layout[0]), case.nap_layout[1]


def _bound_ratio(case: Case, index: list[int], arms: FloatArray, missing: int) -> float:
    nine = case.array.select(index)
    bound = rigid_body.missing_channel_bound(rigid_body.design(nine.positions, nine.axes))[missing]
    return float(nap.noise_gain(nap.CHANNELS[missing], arms) / bound)
