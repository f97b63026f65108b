"""Periphery, compact cube, co-planar and NAP schemes, and their error tables [Martin98], misprints put right.

Points 1, 2, 3 lie on x, y, z at the signed arms rX, rY, rZ from the inaccessible point 0; A1X: the x reading at 1.

    eqs 2–4    A0 = A_P − ω' × r − ω × (ω × r)         (eq 2 is printed with −ω'y in its last bracket)
    eqs 8–10   A0X = A1X + rX(ωy²+ωz²),  A0Y = A2Y + rY(ωx²+ωz²),  A0Z = A3Z + rZ(ωx²+ωy²)
    eq 11      ω'x = (A2Y−A3Y)/rZ + ωyωz + rY(ωx²+ωz²)/rZ
    eq 12      ω'y = (A3X−A1X)/rZ − ωxωz − rX(ωy²+ωz²)/rZ       (printed with the arms and signs of a Z form)
    eq 13      ω'z = (A1Y−A2Y)/rX − ωxωy − rY(ωx²+ωz²)/rX       (printed with A3Y)
    eqs 14–16  ω' = dω/dt,  A0Y = A1Y − rX(ωxωy+ω'z),  A0Z = A1Z − rX(ωxωz−ω'y)       compact cube, with eq 8
    eqs 17–19  ω'x = (A2Z−A0Z)/rY − ωyωz,  ω'y = (A3X−A0X)/rZ − ωxωz,  ω'z = −(A2X−A0X)/rY + ωxωy     co-planar
               (18 is printed with +ωxωz, 19 with −ωxωz)
    eq 22      u² = Σ (∂f/∂x_i u_i)²

The NAP, eqs 5–7 with ρX and ρY changed over, is physics/nap.py. ω is that of rate sensors in all the others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.errors import EstimationError
from nineaudit.estimate.motion import Motion, bridge, has_rates, rates_omega
from nineaudit.physics import kinematics
from nineaudit.units import counted

WINDOW: Final = 2.5e-3
"""Window of the moving correlation, s [Martin98]."""
_PLACE, _ANGLE = 1e-5, 1e-4


def periphery(array: SensorArray, time: FloatArray, readings: FloatArray, sigma: FloatArray) -> Motion:
    """Motion at the origin from A1X A1Y A2Y A3X A3Y A3Z and rate sensors, eqs 8–13.

    `readings` (n,k) SI zeroed, `sigma` (k,). EstimationError names what the array lacks.
    """
    omega = gyro_omega(array, time, readings, sigma)
    rx, ry, rz = (_arm(array, axis) for axis in range(3))
    a1x, a1y = _reading(array, time, readings, rx, 0), _reading(array, time, readings, rx, 1)
    a2y = _reading(array, time, readings, ry, 1)
    a3x, a3y, a3z = (_reading(array, time, readings, rz, axis) for axis in range(3))
    accelerations = np.stack([a1x, a1y, a2y, a3x, a3y, a3z], axis=1)
    a0, alpha = periphery_equations(accelerations, omega, (rx[0], ry[1], rz[2]))
    return Motion(omega, alpha, a0, "periphery [Martin98 eqs 8-13]")


def periphery_equations(
    accelerations: FloatArray, omega: FloatArray, arms: tuple[float, float, float]
) -> tuple[FloatArray, FloatArray]:
    """a0 and α, each (n,3), from (n,6) A1X A1Y A2Y A3X A3Y A3Z m/s², `omega` (n,3), signed `arms` m; eqs 8–13."""
    a1x, a1y, a2y, a3x, a3y, a3z = accelerations.T
    (x, y, z), (rx, ry, rz) = omega.T, arms
    pulled = ry * (x**2 + z**2)
    a0 = [a1x + rx * (y**2 + z**2), a2y + pulled, a3z + rz * (x**2 + y**2)]
    alpha = [
        (a2y - a3y + pulled) / rz + y * z,
        (a3x - a1x - rx * (y**2 + z**2)) / rz - x * z,
        (a1y - a2y - pulled) / rx - x * y,
    ]
    return np.stack(a0, axis=1), np.stack(alpha, axis=1)


def compact_cube(array: SensorArray, time: FloatArray, readings: FloatArray, sigma: FloatArray) -> Motion:
    """Motion at the origin from one triax anywhere and rate sensors, α by differentiation: eqs 14 and 2–4 (on the
    x axis: 8, 15, 16). Arguments as `periphery`. EstimationError names what the array lacks."""
    omega = gyro_omega(array, time, readings, sigma)
    alpha = kinematics.differentiate(omega, time)
    place = _triax_place(array)
    a = np.stack([_reading(array, time, readings, place, axis) for axis in range(3)], axis=1)
    return Motion(omega, alpha, at_origin(a, place, omega, alpha), "compact cube [Martin98 eqs 8, 14-16]")


def at_origin(accelerations: FloatArray, place: FloatArray, omega: FloatArray, alpha: FloatArray) -> FloatArray:
    """A0 (n,3) from `accelerations` (n,3) at `place` (3,) m: eqs 2–4."""
    return np.asarray(accelerations - np.cross(alpha, place) - np.cross(omega, np.cross(omega, place)))


def coplanar(array: SensorArray, time: FloatArray, readings: FloatArray, sigma: FloatArray) -> Motion:
    """Motion from triaxes at the origin and on two axes, and rate sensors: eqs 17–19, turned to the plane of the
    array (y–z in the paper). Arguments as `periphery`. EstimationError names what the array lacks."""
    omega = gyro_omega(array, time, readings, sigma)
    p = next((p for p in ((1, 2, 0), (0, 1, 2), (2, 0, 1)) if all(_has_triax(array, axis) for axis in p[:2])), None)
    if p is None:
        raise _lacking("triaxes on two axes of the body", array)
    i, j, k = p  # the plane's axes i, j play y, z; k plays x: a right-handed turn
    arms = _arm(array, i), _arm(array, j)
    centre = [_reading(array, time, readings, np.zeros(3), axis) for axis in range(3)]
    a2k, a2i_axis = (_reading(array, time, readings, arms[0], axis) for axis in (j, k))
    a3k = _reading(array, time, readings, arms[1], k)
    turned = coplanar_equations(
        np.stack([a2k - centre[j], a2i_axis - centre[k], a3k - centre[k]], axis=1),
        omega[:, [k, i, j]],
        (float(arms[0][i]), float(arms[1][j])),
    )
    alpha = np.empty_like(turned)
    alpha[:, [k, i, j]] = turned
    return Motion(omega, alpha, np.stack(centre, axis=1), "co-planar [Martin98 eqs 17-19]")


def coplanar_equations(differences: FloatArray, omega: FloatArray, arms: tuple[float, float]) -> FloatArray:
    """α (n,3) from (n,3) A2Z−A0Z, A2X−A0X, A3X−A0X m/s², `omega` (n,3) and signed arms rY, rZ m; eqs 17–19."""
    (dz, dx2, dx3), (x, y, z), (ry, rz) = differences.T, omega.T, arms
    return np.stack([dz / ry - y * z, dx3 / rz - x * z, -dx2 / ry + x * y], axis=1)


def gyro_omega(array: SensorArray, time: FloatArray, readings: FloatArray, sigma: FloatArray) -> FloatArray:
    """ω (n,3) rad/s of the rate sensors, gaps bridged; EstimationError where they do not span three axes."""
    if not has_rates(array):
        gyros = array.axes[~array.is_accelerometer]
        raise EstimationError(
            "angular velocity is not measured",
            found=f"{len(gyros)} rate sensors of rank {np.linalg.matrix_rank(gyros) if len(gyros) else 0}",
            expected="rate sensors on three axes",
        )
    rates = ~array.is_accelerometer
    valid = np.isfinite(readings[:, rates])
    return bridge(rates_omega(array.axes[rates], readings[:, rates], sigma[rates], valid), time)


def _column(array: SensorArray, place: FloatArray, axis: int) -> int | None:
    near = np.abs(array.positions - place).max(axis=1) <= _PLACE
    along = np.abs(array.axes - np.eye(3)[axis]).max(axis=1) <= _ANGLE
    found = np.flatnonzero(near & along & array.is_accelerometer)
    return int(found[0]) if found.size else None


def _reading(array: SensorArray, time: FloatArray, readings: FloatArray, place: FloatArray, axis: int) -> FloatArray:
    column = _column(array, place, axis)
    if column is None:
        spelled = ", ".join(f"{1e3 * x:g}" for x in place)
        raise _lacking(f"an accelerometer along +{'xyz'[axis]} at ({spelled}) mm", array)
    return bridge(readings[:, [column]], time)[:, 0]


def _lacking(what: str, array: SensorArray) -> EstimationError:
    held = " ".join(s.channel for s in array.sensors)
    return EstimationError("the scheme needs another array", found=held, expected=what)


def _on_axis(array: SensorArray, axis: int) -> list[FloatArray]:
    """Places of accelerometers on one body axis, away from the origin, farthest first."""
    rest = [i for i in range(3) if i != axis]
    places = [
        s.position
        for s in array.sensors
        if s.kind == "accelerometer" and abs(s.position[axis]) > 10 * _PLACE and np.abs(s.position[rest]).max() < _PLACE
    ]
    return sorted(places, key=lambda p: -abs(float(p[axis])))


def _arm(array: SensorArray, axis: int) -> FloatArray:
    """(3,) the farthest place on a body axis."""
    places = _on_axis(array, axis)
    if not places:
        raise _lacking(f"accelerometers on the {'xyz'[axis]} axis, away from the origin", array)
    return places[0]


def _has_triax(array: SensorArray, axis: int) -> bool:
    places = _on_axis(array, axis)
    return bool(places) and all(_column(array, places[0], along) is not None for along in range(3))


def _triax_place(array: SensorArray) -> FloatArray:
    """(3,) a place with accelerometers along all three axes, the one nearest to the origin."""
    places = [
        s.position for s in array.sensors if all(_column(array, s.position, axis) is not None for axis in range(3))
    ]
    if not places:
        raise _lacking("one triaxial accelerometer along x, y, z", array)
    return min(places, key=lambda p: float(np.linalg.norm(p)))


def four_pole_butterworth(values: FloatArray, rate: float, corner: float) -> FloatArray:
    """`values` (n,) or (n,m) through a four-pole low-pass, −3 dB at `corner` Hz, forward only: it lags. The CFC filter
    (physics/filters.py) also has four poles, but no phase, and is named by a class 0.6 of its corner.

    EstimationError unless the corner is under half the `rate` (Hz).
    """
    from scipy.signal import butter, sosfilt, sosfilt_zi

    if not 0.0 < corner < rate / 2.0:
        raise EstimationError(
            "filter corner out of range", found=f"{corner:g} Hz", expected=f"above 0 and below {rate / 2.0:g} Hz"
        )
    sections = butter(4, corner, fs=rate, output="sos")
    rest = np.multiply.outer(sosfilt_zi(sections), values[0])
    return np.asarray(sosfilt(sections, values, axis=0, zi=np.moveaxis(rest, 1, 1))[0])


def moving_correlation(first: FloatArray, second: FloatArray, rate: float, window: float = WINDOW) -> FloatArray:
    """(n,) Pearson correlation of two curves (n,) in a window (s) about each sample; NaN where a curve is constant in
    it and at the ends, where the window is not full. EstimationError where it holds fewer than three samples."""
    count = 2 * int(window * rate / 2.0 + 1e-6) + 1
    if count < 3 or count > len(first) or first.shape != second.shape:
        raise EstimationError(
            "curves cannot be correlated in the window",
            found=f"{len(first)} and {counted(len(second), 'sample')}, {count} in the window of {window:g} s",
            expected="equal lengths, 3 samples in the window or more, and no more than there are",
        )
    x, y = (np.lib.stride_tricks.sliding_window_view(v, count) for v in (first, second))
    x, y = x - x.mean(axis=1, keepdims=True), y - y.mean(axis=1, keepdims=True)
    size = np.sqrt((x**2).sum(axis=1) * (y**2).sum(axis=1))
    out = np.full(len(first), np.nan)
    inner = out[count // 2 : len(first) - count // 2]
    np.divide((x * y).sum(axis=1), size, out=inner, where=size > 0.0)
    return out


def rss(
    function: Callable[[Mapping[str, float]], FloatArray], values: Mapping[str, float], u: Mapping[str, float]
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Standard uncertainty (m,) of `function`(values) (m,), and the part (m,) of each source: eq 22.

    Sensitivities by central differences over ±u, exact for the quadratics above.
    """
    parts = {}
    for name, width in u.items():
        up, down = (function({**values, name: values[name] + side * width}) for side in (1.0, -1.0))
        parts[name] = np.asarray((up - down) / 2.0)
    return np.sqrt(np.sum([part**2 for part in parts.values()], axis=0)), parts
