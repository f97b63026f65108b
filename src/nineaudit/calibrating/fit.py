"""Sensitivity vector and offset of a sensor from runs with a known input, by least squares [Becker75].

    v_j = S·f_j + V + e_j,   x̂ = (XᵀX)⁻¹Xᵀv,   X rows [f_jᵀ 1],   cov x̂ = s²(XᵀX)⁻¹,   s² = Σe²/(n − p)

Scale |S| and axis S/|S| follow, with the uncertainty along S for the scale and across it for the axis. Confidence
limits are Student's t with n − p degrees of freedom times the standard uncertainty.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray, Kind, Sensor
from nineaudit.calibrating.sheet import unit_si
from nineaudit.errors import EstimationError
from nineaudit.units import FACTORS, counted

UNIT_SHARE = 0.15
"""How near, as a logarithm, a scale comes to the ratio of two units to be taken for it."""
_LEAST_SCALE = 1e-6
"""Of a connected sensor: a millionth of what the rig says."""
WORST_CONDITION = 1000.0
"""Largest ratio of the best to the worst varied direction of the input: beyond, a direction counts as not varied."""


@dataclass(frozen=True, eq=False)
class Line:
    """A least-squares solution: `x` (p,), its `covariance` (p,p), residual sd `rms`, `dof`, largest |residual|."""

    x: FloatArray
    covariance: FloatArray
    rms: float
    dof: int
    largest: float


@dataclass(frozen=True, eq=False)
class Calibration:
    """One sensor: true = (reading − `offset`)/`scale` along `axis`; standard uncertainties `u_...`, all in the unit of
    the reading, `u_tilt` in rad (each of two tilts).

    `vector` (3,) is `scale`·`axis`. `u_tilt` is None where the rig's axis was taken for granted, but for its sign.
    `tilt` rad from the rig's axis. `largest`: the largest residual. `runs` that were used.
    """

    channel: str
    kind: Kind
    unit: str
    scale: float
    u_scale: float
    offset: float
    u_offset: float
    axis: FloatArray
    u_tilt: float | None
    tilt: float
    rms: float
    largest: float
    dof: int
    runs: int

    @property
    def vector(self) -> FloatArray:
        return self.scale * self.axis


def student(dof: int, confidence: float) -> float:
    """The factor of a two-sided confidence limit, such as 0.95."""
    from scipy.stats import t

    return float(t.ppf(0.5 + 0.5 * confidence, dof))


def least_squares(inputs: FloatArray, outputs: FloatArray) -> Line:
    """[S; V] of `outputs` (n,) on `inputs` (n,p−1) and a constant, n > p, the inputs known to span."""
    rows = np.column_stack([inputs, np.ones(len(inputs))])
    basis, triangle = np.linalg.qr(rows)
    x = np.linalg.solve(triangle, basis.T @ outputs)
    residual = outputs - rows @ x
    dof = len(outputs) - len(x)
    variance = float(residual @ residual) / dof
    back = np.linalg.inv(triangle)
    return Line(x, variance * back @ back.T, math.sqrt(variance), dof, float(np.abs(residual).max()))


def fit(sensor: Sensor, felt: FloatArray, readings: FloatArray, *, single: bool = False) -> Calibration:
    """Calibration of a sensor from what it `felt` (n,3) SI and its `readings` (n,) in its unit, NaN where not read.

    `single`: along the rig's axis only. Raises EstimationError: too few runs, or runs in which a direction of the
    input does not vary, which it names.
    """
    read = np.isfinite(readings)
    force, values = felt[read] / unit_si(sensor), readings[read]
    inputs = (force @ sensor.axis)[:, None] if single else force
    _require_span(sensor, inputs, single)
    line = least_squares(inputs, values)
    slope, covariance = line.x[:-1], line.covariance[:-1, :-1]
    scale = float(np.linalg.norm(slope))
    _require_signal(sensor, scale, line)
    _require_unit(sensor, scale)
    along = slope / scale
    axis = along[0] * sensor.axis if single else along
    spread = float(along @ covariance @ along)
    across = max(float(np.trace(covariance)) - spread, 0.0)
    return Calibration(
        channel=sensor.channel,
        kind=sensor.kind,
        unit=sensor.unit,
        scale=scale,
        u_scale=math.sqrt(spread),
        offset=float(line.x[-1]),
        u_offset=math.sqrt(float(line.covariance[-1, -1])),
        axis=axis,
        u_tilt=None if single else math.sqrt(across / 2.0) / scale,
        tilt=math.atan2(float(np.linalg.norm(np.cross(axis, sensor.axis))), float(axis @ sensor.axis)),
        rms=line.rms,
        largest=line.largest,
        dof=line.dof,
        runs=len(values),
    )


def _require_signal(sensor: Sensor, scale: float, line: Line) -> None:
    """EstimationError where the readings do not follow the input at all."""
    if not scale > _LEAST_SCALE + 3.0 * math.sqrt(float(np.diag(line.covariance)[:-1].max())):
        raise EstimationError(
            "the readings do not follow the input",
            place=f"channel {sensor.channel}",
            found=f"sensitivity {scale:.3g}, no more than 3 times its uncertainty",
            expected="a sensitivity near 1",
            advice="is it the right column, is the channel connected?",
        )


def _require_unit(sensor: Sensor, scale: float) -> None:
    """EstimationError where the readings are in another unit, as it seems: the scale, over what the rig states, is
    within UNIT_SHARE of the ratio of two units. A sensor that has such a scale states it in the rig file."""
    known = FACTORS["acceleration" if sensor.kind == "accelerometer" else "angular_rate"]
    for unit, factor in known.items():
        ratio = known.get(sensor.unit, factor) / factor
        if ratio != 1.0 and abs(math.log(scale / sensor.scale / ratio)) < UNIT_SHARE:
            raise EstimationError(
                f"the readings are in {unit}, it seems, not in {sensor.unit}",
                place=f"channel {sensor.channel}",
                found=f"scale {scale:.4g}, {ratio:.4g} is 1 {sensor.unit} in {unit}",
                expected=f"a scale near {sensor.scale:g}",
                advice=f"state the unit {unit} in the rig file, or scale = {scale:.3g} where the sensor has that",
            )


def _require_span(sensor: Sensor, inputs: FloatArray, single: bool) -> None:
    """EstimationError, with rank, condition number and the missing directions, where the inputs do not span."""
    count, size = inputs.shape
    centred = inputs - inputs.mean(axis=0) if count else np.zeros((1, size))
    values = np.zeros(size)
    singular, turned = np.linalg.svd(centred)[1:]
    values[: len(singular)] = singular
    largest = float(values[0])
    unit = 1.0 / unit_si(sensor)
    still = values <= max(largest / WORST_CONDITION, 1e-6 * unit)
    rank = size - int(np.count_nonzero(still))
    if rank < size:
        condition = largest / values[-1] if values[-1] > 0.0 else math.inf
        missing = " and ".join(_direction(sensor.axis if single else turned[i]) for i in np.flatnonzero(still))
        what = "specific force" if sensor.kind == "accelerometer" else "angular rate"
        advice = f"add runs in which the {what} along {missing} differs"
        if not single and rank:
            advice += ", or take the rig's axes for granted with --single-axis"
        raise EstimationError(
            f"the runs do not vary the {what} along {missing}",
            place=f"channel {sensor.channel}",
            found=f"{counted(count, 'run')}, rank {rank} of {size}, condition number {condition:.3g}",
            expected=f"rank {size}, condition number below {WORST_CONDITION:g}",
            advice=advice,
        )
    if count < size + 2:
        raise EstimationError(
            "too few runs to say how good the fit is",
            place=f"channel {sensor.channel}",
            found=f"{counted(count, 'run')} for {size + 1} unknowns",
            expected=f"{size + 2} or more",
            advice="repeat some of them",
        )


def _direction(vector: FloatArray) -> str:
    """``z``, or ``(0.71, 0.71, 0)`` where it is no body axis."""
    largest = int(np.argmax(np.abs(vector)))
    if abs(vector[largest]) > 0.999:
        return "xyz"[largest]
    signed = vector * np.sign(vector[largest])
    return "(" + ", ".join(f"{round(float(c), 2):g}" for c in signed) + ")"
