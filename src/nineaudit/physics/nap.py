"""The nine-accelerometer package 3-2-2-2 (NAP, NAAP): closed forms of METHODS.md 1.1.

Point 1 on x at r_x, 2 on y at r_y, 3 on z at r_z from the centre 0 (either sign), nine channels:

    a0x a0y a0z  a1y a1z  a2x a2z  a3x a3y

With the half differences U = up, D = down of each axis,

    x:  U = (a2z − a0z)/2ry   D = (a3y − a0y)/2rz
    y:  U = (a3x − a0x)/2rz   D = (a1z − a0z)/2rx
    z:  U = (a1y − a0y)/2rx   D = (a2x − a0x)/2ry

rigid-body motion gives  α = U − D  and  (ωyωz, ωzωx, ωxωy) = U + D  [Takhounts09 eqs 12, 14; Padgaonkar 1975]
α is free of products of ω, so ω = ω(0) + ∫α, and the three products are three constraints on nine channels.
All rows over the nine channels, in the order of CHANNELS. Readings (n,9) m/s², arms (3,) m.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from nineaudit.array import FloatArray, Sensor, SensorArray
from nineaudit.errors import ConfigurationError, EstimationError
from nineaudit.physics.kinematics import integrate

CHANNELS: Final = ("a0x", "a0y", "a0z", "a1y", "a1z", "a2x", "a2z", "a3x", "a3y")

# Per axis: (arm channel, centre channel, arm) of U, then of D.
_HALF_DIFFERENCES: Final = (
    (("a2z", "a0z", 1), ("a3y", "a0y", 2)),
    (("a3x", "a0x", 2), ("a1z", "a0z", 0)),
    (("a1y", "a0y", 0), ("a2x", "a0x", 1)),
)


def _half_difference_rows(arms: FloatArray) -> tuple[FloatArray, FloatArray]:
    """U and D, each (3,9) 1/m."""
    arms = np.asarray(arms, dtype=np.float64)
    if arms.shape != (3,) or not np.isfinite(arms).all() or (arms == 0.0).any():
        raise EstimationError("arms of a 3-2-2-2 array", found=arms.tolist(), expected="three lengths in m, none zero")
    rows = np.zeros((2, 3, 9))
    for axis, pair in enumerate(_HALF_DIFFERENCES):
        for side, (arm_channel, centre_channel, arm) in enumerate(pair):
            rows[side, axis, CHANNELS.index(arm_channel)] = 0.5 / arms[arm]
            rows[side, axis, CHANNELS.index(centre_channel)] = -0.5 / arms[arm]
    return rows[0], rows[1]


def alpha_rows(arms: FloatArray) -> FloatArray:
    """(3,9) 1/m: α = rows · readings [Takhounts09 eq 12]. EstimationError unless three arms, none zero."""
    up, down = _half_difference_rows(arms)
    return up - down


def product_rows(arms: FloatArray) -> FloatArray:
    """(3,9) 1/m: (ωyωz, ωzωx, ωxωy) = rows · readings [Takhounts09 eq 14]. Errors as `alpha_rows`."""
    up, down = _half_difference_rows(arms)
    return up + down


def alpha(readings: FloatArray, arms: FloatArray) -> FloatArray:
    """α (n,3) rad/s², free of products of ω [Takhounts09 eq 12]; white-noise sd σ/r for equal arms."""
    return np.asarray(readings @ alpha_rows(arms).T)


def products(readings: FloatArray, arms: FloatArray) -> FloatArray:
    """(ωyωz, ωzωx, ωxωy) (n,3) (rad/s)² as the accelerometers have them [Takhounts09 eq 14]."""
    return np.asarray(readings @ product_rows(arms).T)


def omega(readings: FloatArray, arms: FloatArray, time: FloatArray, omega0: FloatArray | float = 0.0) -> FloatArray:
    """ω (n,3) rad/s = `omega0` + ∫α, with `omega0` (3,) the ω of time[0]; `kinematics.integrate` rules."""
    return integrate(alpha(readings, arms), time, omega0)


def constraint_residuals(
    readings: FloatArray,
    arms: FloatArray,
    time: FloatArray,
    omega0: FloatArray | float = 0.0,
    omega_known: FloatArray | None = None,
) -> FloatArray:
    """Products of the accelerometers less products of ω (n,3) (rad/s)²; zero for a rigid body [eq 14].

    ω is integrated from `omega0`, or is `omega_known` (n,3) where something better is at hand.
    """
    rate = omega(readings, arms, time, omega0) if omega_known is None else omega_known
    return products(readings, arms) - rate[:, [1, 2, 0]] * rate[:, [2, 0, 1]]


class ClosedForm(NamedTuple):
    """channel = row · readings + ω[axis] direction·ω, `row` (9,) with 0 for the channel, `direction` (3,) m.

    At ω ≈ 0 the row is the white-noise sensitivity of the rebuilt channel.
    """

    row: FloatArray
    axis: int
    direction: FloatArray


def closed_form(channel: str, arms: FloatArray) -> ClosedForm:
    """Closed form of one channel from the other eight (METHODS.md 1.1).

    A combination w of the constraints P whose products factor as ω_k (v·ω), neither α_k nor v·α containing
    the channel c, is solved for c:  w·P y = ω_k (v·ω)  ⇒  y_c = [ω_k (v·ω) − Σ_{i≠c} (wP)_i y_i] / (wP)_c.
    - arm:    the one constraint that contains it, e.g. a2z = 2ry{ωyωz − (a3y−a0y)/2rz} + a0z.
    - centre: two constraints contain a0x. αx is free of a0x, and so is rz αy + ry αz; hence v = (0, rz, ry):
      ry (ωzωx) + rz (ωxωy) = ωx (rz ωy + ry ωz), the weighted sum of METHODS.md 1.1, whose ry Z + rz Y is
      rz ωy + ry ωz. Algebraic and regular where ω passes zero, unlike Takhounts09 eqs 29, 31, 33.
    Raises ConfigurationError for another channel name, EstimationError as `alpha_rows`.
    """
    if channel not in CHANNELS:
        raise ConfigurationError("not a 3-2-2-2 channel", found=channel, expected="one of " + ", ".join(CHANNELS))
    column, rows = CHANNELS.index(channel), product_rows(arms)
    holding = np.flatnonzero(rows[:, column])
    weights, direction = np.zeros(3), np.zeros(3)
    if len(holding) == 1:
        axis, other = (i for i in range(3) if i not in holding)
        weights[holding], direction[other] = 1.0, 1.0
    else:
        axis = next(i for i in range(3) if i not in holding)
        weights[holding] = np.asarray(arms)[holding]
        direction[holding] = weights[holding[::-1]]
    combined = weights @ rows
    row = -combined / combined[column]
    row[column] = 0.0
    return ClosedForm(row, axis, direction / combined[column])


def rebuild(
    channel: str,
    readings: FloatArray,
    arms: FloatArray,
    time: FloatArray,
    omega0: FloatArray | float = 0.0,
    omega_known: FloatArray | None = None,
) -> FloatArray:
    """One channel (n,) m/s² from the other eight; its own column is not looked at and may be NaN.

    ω is integrated from `omega0` by those combinations that do not contain the channel, or is `omega_known`
    (n,3), which then must not come from the channel either. Exact on ideal rigid-body readings; white noise:
    `noise_gain`. Raises as `closed_form` and `kinematics.integrate`.
    """
    form = closed_form(channel, arms)
    factors = np.stack([np.eye(3)[form.axis], form.direction])
    known = np.where(np.arange(9) == CHANNELS.index(channel), 0.0, readings)
    if omega_known is None:
        start = factors @ np.broadcast_to(omega0, 3)
        rates = integrate(known @ (factors @ alpha_rows(arms)).T, time, start)
    else:
        rates = omega_known @ factors.T
    return np.asarray(known @ form.row + rates[:, 0] * rates[:, 1])


def noise_gain(channel: str, arms: FloatArray) -> float:
    """sd of the rebuilt channel over the white-noise sd of one channel at ω ≈ 0: length of the row.

    Equal arms: √3 for arm channels and √1.5 for centre channels, 1.07 and 1.10 of the bound (METHODS.md 4).
    With |ω| > 0 the integrated noise adds about r |ω| sd(ω).
    """
    return float(np.linalg.norm(closed_form(channel, arms).row))


def layout(
    array: SensorArray, position_tolerance: float = 1e-5, angle_tolerance: float = 1e-4
) -> tuple[tuple[int, ...], FloatArray] | None:
    """Columns of `array` that are an ideal 3-2-2-2, in the order of CHANNELS, and its arms (3,) m, or None.

    By geometry alone: axes along +x, +y, +z of the body within `angle_tolerance` rad, positions within
    `position_tolerance` m; the centre may be anywhere, arms have either sign, other sensors are passed over.
    Of several packages the one with the longest shortest arm is taken.
    """
    pointing: tuple[list[int], ...] = ([], [], [])
    for column, sensor in enumerate(array.sensors):
        axis = _axis(sensor, angle_tolerance)
        if axis is not None:
            pointing[axis].append(column)
    found = [
        package
        for column in pointing[0]
        if (package := _package(array.positions, pointing, array.positions[column], position_tolerance))
    ]
    return max(found, key=lambda package: np.abs(package[1]).min(), default=None)


def _axis(sensor: Sensor, tolerance: float) -> int | None:
    """0, 1, 2 for an accelerometer along +x, +y, +z."""
    axis = int(np.argmax(sensor.axis))
    tilt = float(np.linalg.norm(np.cross(sensor.axis, np.eye(3)[axis])))
    return axis if sensor.kind == "accelerometer" and sensor.axis[axis] > 0.0 and tilt <= tolerance else None


def _package(
    positions: FloatArray, pointing: tuple[list[int], ...], centre: FloatArray, tolerance: float
) -> tuple[tuple[int, ...], FloatArray] | None:
    """The 3-2-2-2 about `centre` with the longest arms, from the columns that point along each axis."""

    def at(axis: int, point: FloatArray) -> int | None:
        return next((c for c in pointing[axis] if np.abs(positions[c] - point).max() <= tolerance), None)

    columns, arms = [at(axis, centre) for axis in range(3)], np.zeros(3)
    for arm in range(3):
        first, second = (axis for axis in range(3) if axis != arm)
        pairs = []
        for column in pointing[first]:
            offset = positions[column] - centre
            across = np.delete(offset, arm)
            partner = at(second, positions[column])
            if partner is not None and abs(offset[arm]) > 10.0 * tolerance >= 10.0 * np.abs(across).max():
                pairs.append((float(offset[arm]), column, partner))
        if not pairs:
            return None
        arms[arm], *pair = max(pairs, key=lambda pair: abs(pair[0]))
        columns += pair
    complete = tuple(c for c in columns if c is not None)
    return (complete, arms) if len(complete) == 9 else None
