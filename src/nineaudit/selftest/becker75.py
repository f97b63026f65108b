"""Becker and Willems 1975: six accelerometers, how errors grow, how far ±0.5 % takes ω (METHODS 1.3, 7.5).

The head's motion behind the printed "about 5 %" is not printed: it is set up here as METHODS 7.5 did, a planar pitch
of 82° on a 10 g sled, and solved by the whole scheme with ω fed back.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.physics import rigid_body
from nineaudit.presets import PRESETS
from nineaudit.schemes import envelope, growth, rate_gyro
from nineaudit.schemes.six_accelerometers import Package, solve
from nineaudit.selftest.published import Published
from nineaudit.units import G0

SOURCE: Final = "Becker75"
ENVELOPE: Final = {5.0: 6.8, 7.0: 4.8, 10.0: 3.3}
"""Per cent of the peak of ω at 250 ms, by arm in cm (METHODS 7.5)."""
_PITCH: Final = math.radians(82.0)
_PLACE: Final = (0.08, 0.0, 0.12)
"""Where the package sits from the pivot of the neck, m."""
_DIGIT = "half of the last printed digit"
_STEPS = "a step takes one sample of 0.05 ms to rise: ωn h = 0.012, squared"


def six(arm: float) -> Package:
    """The 3-2-1 layout with both arms of `arm` m, sensors ideal."""
    sensors = PRESETS["3-2-1"].sensors([arm, arm])
    return Package(np.array([s.position for s in sensors]), np.array([s.axis for s in sensors]), np.zeros(6))


def sled_pitch(rate: float = 10_000.0) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Time (n,), and a0, α, ω (n,3) at the package: pitch to 82° at 170 ms and back to 57° at 250 ms, sled 10 g."""
    time = np.arange(round(0.25 * rate) + 1) / rate
    corners = np.interp(time, [0.0, 0.05, 0.17, 0.25], [0.0, 0.0, 1.0, 0.7])
    window = np.hanning(round(0.05 * rate) + 1)
    padded = np.pad(corners, len(window) // 2, mode="edge")
    angle = np.convolve(padded, window / window.sum(), mode="valid")
    angle *= _PITCH / angle.max()
    rate_y = np.gradient(angle, time)
    slope_y = np.gradient(rate_y, time)
    pushed = -10.0 * G0 * np.exp(-0.5 * ((time - 0.08) / 0.03) ** 4)
    nothing = np.zeros_like(time)
    pivot = np.column_stack([np.cos(angle) * pushed, nothing, np.sin(angle) * pushed])
    omega, alpha = (np.column_stack([nothing, part, nothing]) for part in (rate_y, slope_y))
    return time, rigid_body.acceleration_at(np.array(_PLACE), pivot, alpha, omega), alpha, omega


def pitch_envelope(arm: float) -> float:
    """Per cent of the peak of ωy that ±0.5 % on the two channels that see pitch can do to it at 250 ms."""
    time, a0, alpha, omega = sled_pitch()
    package = six(arm)
    every = np.ones(6, dtype=np.bool_)
    outputs = rigid_body.predict(package.positions, package.sensitivity, every, a0, alpha, omega)
    solution = solve(package, outputs, time, omega[0])
    chosen = np.array([name in ("a0z", "a1z") for name in PRESETS["3-2-1"].channels])
    reached = envelope.worst_case(envelope.gain_sensitivity(solution, outputs), envelope.BECKER_GAIN * chosen)
    return float(100.0 * reached[-1, 1] / np.abs(omega[:, 1]).max())


def quarter_turn(rate: float = 10_000.0, duration: float = 0.2) -> tuple[float, float]:
    """Growth of an error of ω in a quarter turn about X, and of what a constant wrong α adds up to.

    By the scheme itself: exact readings solved from a wrong ω(0), and readings of a wrong α from the right one.
    The second is a turn at constant speed, over the error without feedback.
    """
    time = np.arange(round(duration * rate) + 1) / rate
    turned = 0.25 * 2.0 * math.pi / duration
    phase = 2.0 * math.pi * time / duration
    smooth = _spin(turned * (1.0 - np.cos(phase)), turned * 2.0 * math.pi / duration * np.sin(phase))
    package, wrong = six(0.05), 1e-6 * np.array([0.0, 1.0, 1.0])
    exact = solve(package, _outputs(package, *smooth), time, smooth[1][0] + wrong)
    grown = (exact.omega[-1] - smooth[1][-1])[1] / wrong[1]
    steady = _spin(np.full_like(time, turned), np.zeros_like(time))
    forced = solve(package, _outputs(package, *steady) + _of_alpha(package, wrong / duration), time, steady[1][0])
    return float(grown), float((forced.omega[-1] - steady[1][-1])[1] / wrong[1])


def _spin(rate_x: FloatArray, slope_x: FloatArray) -> tuple[FloatArray, FloatArray]:
    nothing = np.zeros_like(rate_x)
    return np.column_stack([slope_x, nothing, nothing]), np.column_stack([rate_x, nothing, nothing])


def _outputs(package: Package, alpha: FloatArray, omega: FloatArray) -> FloatArray:
    every = np.ones(6, dtype=np.bool_)
    return rigid_body.predict(package.positions, package.sensitivity, every, np.zeros_like(omega), alpha, omega)


def _of_alpha(package: Package, alpha: FloatArray) -> FloatArray:
    return np.asarray(rigid_body.design(package.positions, package.sensitivity)[:, 3:] @ alpha)


def checks() -> list[Published]:
    """Growth in a quarter turn, the off-axis penalty, the growth rate, three envelopes, the gyro's response."""
    grown, forced = quarter_turn()
    package = six(0.05)
    rate = growth.growth_rate(package.positions, package.sensitivity)
    out = [
        Published(SOURCE, "growth of an error of ω, quarter turn about X", 4.8105, grown, 4.8105, 5e-5, _DIGIT),
        Published(SOURCE, "the same in closed form, e^(π/2)", 4.8105, growth.LARGEST_GROWTH, 4.8105, 5e-5, _DIGIT),
        Published(SOURCE, "off-axis penalty at 90°, constant forcing", "3 to 4", forced, 2.43, 5e-3, _DIGIT),
        Published(SOURCE, "fastest growth per rad, 3-2-1, any axis", 1.0, rate, 1.0, 1e-6, "search of the worst axis"),
    ]
    for arm, printed in ENVELOPE.items():
        quantity = f"±0.5 % on both pitch channels, {arm:g} cm arms, % of peak ω at 250 ms"
        out.append(Published(SOURCE, quantity, "about 5", pitch_envelope(arm / 100.0), printed, 0.05, _DIGIT))
    return [*out, *_gyro()]


def _gyro() -> list[Published]:
    """Of a second-order system [any textbook]: overshoot of a step e^(−πζ/√(1−ζ²)), amplitude 1/2ζ at ωn."""
    time = np.arange(20_001) / 20_000.0
    step = rate_gyro.second_order((time > 0.0).astype(float), time)
    sine = rate_gyro.second_order(np.sin(2.0 * math.pi * rate_gyro.NATURAL_HZ * time), time)
    overshoot = math.exp(-math.pi * rate_gyro.DAMPING / math.sqrt(1.0 - rate_gyro.DAMPING**2))
    settled = float(np.abs(sine[len(time) // 2 :]).max())
    where = f"response of {rate_gyro.NATURAL_HZ:g} Hz, ζ = {rate_gyro.DAMPING:g}"
    return [
        Published(SOURCE, f"{where}, overshoot of a step", overshoot, float(step.max()) - 1.0, overshoot, 1e-4, _STEPS),
        Published(SOURCE, f"{where}, amplitude at its natural frequency", 1.0, settled, 1.0, 1e-4, _STEPS),
    ]
