"""A faulty channel from the other eight, with its standard uncertainty; what was recorded stays as it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.case import Case
from nineaudit.errors import EstimationError
from nineaudit.estimate import calibration
from nineaudit.estimate.motion import bridge, estimate_motion
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
    """Rebuild one channel of a 3-2-2-2 array by its closed form (METHODS.md 1.1).

    `replaced` (n,) the samples to stand for the measured ones; default all from the first sample after the quiet
    interval. EstimationError when the channel is not one of nine that form an ideal 3-2-2-2.
    """
    if case.nap_layout is None:
        raise EstimationError("only an ideal 3-2-2-2 array can be rebuilt by closed forms")
    columns, arms = case.nap_layout
    index = list(columns)
    column = case.array.index(channel)
    if column not in index:
        raise EstimationError(f"{channel} is not one of the nine channels of the 3-2-2-2 array")
    name = nap.CHANNELS[index.index(column)]
    donors = tuple(case.array.channels[c] for c in index if c != column)
    others = [i for i, c in enumerate(index) if c != column]
    readings = np.zeros((len(case.time), 9))
    readings[:, others] = bridge(case.readings[:, [index[i] for i in others]], case.time)
    rebuilt = nap.rebuild(name, readings, arms, case.time)
    readings[:, index.index(column)] = rebuilt
    u = _uncertainty(case, index, readings, arms, index.index(column))
    where = _default_replaced(case) if replaced is None else replaced
    where = where | ~np.isfinite(case.readings[:, column])
    inside = np.flatnonzero(where)
    if not len(inside):
        raise EstimationError(f"no sample of {channel} is to be replaced")
    return Reconstruction(
        channels=(channel,),
        interval=(float(case.time[inside[0]]), float(case.time[inside[-1]])),
        measured=case.readings[:, [column]],
        rebuilt=rebuilt[:, None],
        u=u[:, None],
        replaced=where[:, None],
        u_rms=float(np.sqrt(np.mean(u[inside] ** 2))),
        bound_ratio=_bound_ratio(case, index, arms, index.index(column)),
        method=f"closed form of {name} from eight channels (METHODS 1.1), ω integrated without {name}",
        donors=donors,
    )


def _default_replaced(case: Case) -> BoolArray:
    where = np.ones(len(case.time), dtype=np.bool_)
    if case.rest is not None:
        where[: case.rest.stop] = False
    return where


def _uncertainty(
    case: Case, index: list[int], readings: FloatArray, arms: FloatArray, missing: int
) -> FloatArray:
    """(n,) standard uncertainty: white noise through the row of the closed form, and every calibration error of
    the donors through the closed form itself (central difference of one standard deviation)."""
    nine, name = case.array.select(index), nap.CHANNELS[missing]
    sigma = case.sigma[index]
    row = nap.closed_form(name, arms).row
    start = None if case.rest is None else case.rest.start
    motion = estimate_motion(nine, case.time, readings, sigma, start)
    variance = np.full(len(case.time), float(row**2 @ sigma**2))
    for i, sensor in enumerate(nine.sensors):
        if i == missing:
            continue
        columns = calibration.columns(sensor, readings[:, i], case.time, motion) * calibration.prior_sd(
            sensor
        )
        for pattern in columns.T[np.any(columns, axis=0)]:
            step = np.zeros_like(readings)
            step[:, i] = pattern
            up, down = (nap.rebuild(name, readings + s * step, arms, case.time) for s in (1.0, -1.0))
            variance += (0.5 * (up - down)) ** 2
    return np.sqrt(variance)


def _bound_ratio(case: Case, index: list[int], arms: FloatArray, missing: int) -> float:
    nine = case.array.select(index)
    bound = rigid_body.missing_channel_bound(rigid_body.design(nine.positions, nine.axes))[missing]
    return float(nap.noise_gain(nap.CHANNELS[missing], arms) / bound)
