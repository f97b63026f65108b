"""Numbers of Takhounts et al. 2009: counter-example, misprints, clipping, the triangle of Fig 10, cross-axis error."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, Sensor, SensorArray, frozen
from nineaudit.physics import nap, rigid_body
from nineaudit.schemes import takhounts
from nineaudit.schemes.rgla import simpson_integral
from nineaudit.selftest.published import Published

SOURCE = "Takhounts 2009"
ARMS: Final = (0.055, 0.048, 0.071)
"""Of the random motion on which METHODS 1.2 weighs the misprints."""
_ROUNDED = "a unit of the last digit of METHODS 1.2"


MISPRINTS: Final = {
    "23": (16.0, 1.0),
    "25": (15.0, 1.0),
    "27": (1.7, 0.1),
    "28b": (16.0, 1.0),
    "29": (27.0, 1.0),
    "31": (161.0, 1.0),
    "33": (2780.0, 10.0),
}
"""Equation -> rms relative error of the printed form on the random motion, %, and a unit of its last digit."""


def checks() -> list[Published]:
    """Counter-example (eqs 15–20), misprints (eqs 23–33), clipping, eq 37 row 2, and what 3 % cross-axis does to α."""
    return [*_counter_example(), *_misprints(), *_clipping(), *_triangle(), *_cross_axis()]


def _counter_example() -> list[Published]:
    """Every arm channel t m/s², the centre 0, at t = 1 s, arms 50, 60, 70 mm."""
    arms, time = np.array([0.05, 0.06, 0.07]), np.linspace(0.0, 1.0, 1001)
    readings = np.zeros((len(time), 9))
    readings[:, 3:] = time[:, None]
    alpha = nap.alpha(readings, arms)[-1]
    omega = nap.omega(readings, arms, time)[-1]
    from_omega = omega[[1, 2, 0]] * omega[[2, 0, 1]]
    told = nap.products(readings, arms)[-1]
    expected = (
        ("α, rad/s²", alpha, (1.1905, -2.8571, 1.6667), 5e-5),
        ("products of the integrated ω, rad²/s²", from_omega, (-1.1905, 0.4960, -0.8503), 5e-5),
        ("products of the constraints, rad²/s²", told, (15.476, 17.143, 18.333), 5e-4),
    )
    digit = "half a unit of the last digit"
    return [
        Published(SOURCE, f"eqs 15-20, t = 1 s: {name} {axis}", value, float(ours[i]), value, width, digit)
        for name, ours, values, width in expected
        for i, (axis, value) in enumerate(zip("xyz", values, strict=True))
    ]


@dataclass(frozen=True, eq=False)
class RandomMotion:
    """The nine channels on a random smooth motion, and those that only a misprint asks for (a1x, a2y)."""

    time: FloatArray
    channel: dict[str, FloatArray]

    def integral(self, values: FloatArray) -> FloatArray:
        """∫values dt from rest."""
        return simpson_integral(values, self.time)


def random_motion(seed: int = 3, count: int = 20001) -> RandomMotion:
    """0.1 s from rest, three sines of 6 to 25 Hz in each of ω and a0."""
    rng, time = np.random.default_rng(seed), np.linspace(0.0, 0.1, count)
    omega, alpha, a0 = (np.zeros((count, 3)) for _ in range(3))
    for axis, size in enumerate((25.0, 35.0, 20.0)):
        for _ in range(3):
            f, phase, height = rng.uniform(6, 25), rng.uniform(0, 2 * np.pi), size * rng.uniform(0.4, 1)
            w = 2 * np.pi * f
            omega[:, axis] += height * (np.sin(w * time + phase) - np.sin(phase))
            alpha[:, axis] += height * w * np.cos(w * time + phase)
            f, phase = rng.uniform(6, 25), rng.uniform(0, 2 * np.pi)
            a0[:, axis] += 800.0 * rng.uniform(0.3, 1) * np.sin(2 * np.pi * f * time + phase)
    points = np.vstack([np.zeros(3), np.diag(ARMS)])
    at = [rigid_body.acceleration_at(p, a0, alpha, omega) for p in points]
    return RandomMotion(time, {f"a{i}{axis}": a[:, j] for i, a in enumerate(at) for j, axis in enumerate("xyz")})


def printed_forms(motion: RandomMotion) -> dict[str, tuple[str, FloatArray]]:
    """Equation -> (channel, its reconstruction as the paper prints it)."""
    (rx, ry, rz), c, integral = ARMS, motion.channel, motion.integral

    def part(channel: str, arm: float) -> FloatArray:
        return np.asarray((c[channel] - c[f"a0{channel[-1]}"]) / (2.0 * arm))

    wx = integral(part("a2z", ry) - part("a3y", rz))
    wy = integral(part("a3x", rz) - part("a1z", rx))
    wz = integral(part("a1y", rx) - part("a2x", ry))
    wy_wrong = integral(part("a3x", rz) - part("a1x", rx))
    wx_wrong = integral(part("a2z", ry) - part("a1z", rz))
    return {
        "23": ("a1y", 2 * rx * (wx_wrong * wy_wrong - part("a2x", ry)) + c["a0y"]),
        "25": ("a2x", 2 * ry * (wx * wy_wrong - part("a1y", rz)) + c["a0x"]),
        "27": ("a3y", 2 * rz * (wy * wz - part("a2z", rx)) + c["a0y"]),
        "28b": ("a0x", -2 * rx * (wx * wy_wrong - part("a1y", rx)) + c["a2x"]),
    }


def printed_velocities(motion: RandomMotion) -> dict[str, tuple[str, FloatArray]]:
    """Eqs 29, 31, 33 -> (centre channel, ∫ of it as the paper prints it); 0/0 where a component of ω passes zero."""
    (rx, ry, rz), c, integral = ARMS, motion.channel, motion.integral

    def part(channel: str, arm: float, lone: bool = False) -> FloatArray:
        return np.asarray((c[channel] - (0.0 if lone else c[f"a0{channel[-1]}"])) / (2.0 * arm))

    y, z = part("a1y", rz), part("a1z", rx)
    xy = integral(part("a3x", rx) - y)
    with np.errstate(divide="ignore", invalid="ignore"):
        eq29 = -2 * rz * integral(y - part("a2x", ry, True)) + 2 * ry * integral(part("a3x", rz, True) - z)
        eq29 = eq29 + (-2 * ry * y + 2 * rx * z - c["a2x"] + c["a3x"]) / xy
        eq31 = -2 * rz * integral(part("a2x", ry) - part("a3y", rz, True))
        eq31 = eq31 + 2 * rx * integral(part("a3x", rz, True) - z)
        eq31 = eq31 + (2 * ry * part("a2x", ry) - 2 * rz * part("a3y", rz) + c["a1y"] - c["a3y"]) / xy
        eq33 = -2 * rz * integral(part("a3x", rz) - part("a1z", rx, True))
        eq33 = eq33 + 2 * ry * integral(part("a2y", ry, True) - part("a3y", rz))
        eq33 = eq33 + (2 * rx * part("a3x", rz) - 2 * ry * part("a2y", rz) + c["a1z"] - c["a3z"]) / integral(
            y - part("a2x", ry)
        )
    return {
        "29": ("a0x", rx * rz / (ry**2 + rz**2) * eq29),
        "31": ("a0y", rx * rz / (rx**2 + rz**2) * eq31),
        "33": ("a0z", rx * ry / (rx**2 + ry**2) * eq33),
    }


def _misprints() -> list[Published]:
    """Right forms to rounding; the printed forms as far off as METHODS 1.2 says."""
    motion = random_motion()
    out = []
    for equation, (channel, values) in printed_forms(motion).items():
        percent, width = MISPRINTS[equation]
        ours = 100.0 * _relative(values, motion.channel[channel])
        label = f"eq {equation} as printed, rms relative error of {channel} on random motion, %"
        out.append(Published(SOURCE, label, f"misprint ({percent:g} %)", ours, percent, width, _ROUNDED))
    nine = np.stack([motion.channel[name] for name in nap.CHANNELS], axis=1)
    turning = np.abs(nap.omega(nine, np.array(ARMS), motion.time)).min(axis=1) > 1.0
    for equation, (channel, values) in printed_velocities(motion).items():
        percent, width = MISPRINTS[equation]
        ours = 100.0 * _relative(values[turning], motion.integral(motion.channel[channel])[turning])
        label = f"eq {equation} as printed, rms relative error of ∫{channel} where |ω| components exceed 1 rad/s, %"
        out.append(Published(SOURCE, label, f"misprint ({percent:g} %)", ours, percent, width, _ROUNDED))
    for name in nap.CHANNELS:
        rebuilt = nap.rebuild(name, nine, np.array(ARMS), motion.time)
        label = f"closed form of {name} put right, rms relative error on random motion"
        error = _relative(rebuilt, motion.channel[name])
        out.append(Published(SOURCE, label, "0 (exact)", error, 0.0, 1e-9, "integration at 5 µs, ends of the record"))
    return out


def _relative(values: FloatArray, truth: FloatArray) -> float:
    return float(np.sqrt(((values - truth) ** 2).mean() / (truth**2).mean()))


def _clipping() -> list[Published]:
    """METHODS 7.4: a1y clipped at half its amplitude in general motion, 0.3 g noise, no calibration error."""
    from nineaudit.auditing import audit
    from nineaudit.rig import parse_rig, preset_text
    from nineaudit.simulate import simulate

    rig = parse_rig(preset_text("naap-3222", [50.0, 55.0, 60.0]))
    certain = tuple(
        replace(s, u_gain=0.0, u_zero=0.0, u_alignment=0.0, u_position=0.0, u_timing=0.0) for s in rig.array.sensors
    )
    rig = replace(rig, array=SensorArray(certain))
    made = simulate(rig, "general", faults=["a1y:clipping=0.5"], seed=0, imperfect=False)
    found = audit(made.recording)
    best, following = found.diagnosis.candidates[:2]
    columns, arms = nap.layout(rig.array) or ((), np.ones(3))
    before = made.recording.readings - found.case.zero
    after = before.copy()
    if found.reconstruction is not None:
        after[:, [rig.array.index(c) for c in found.reconstruction.channels]] = found.reconstruction.repaired
    peak = np.linalg.norm(made.truth.alpha, axis=1).max()
    errors = [
        100.0 * float(np.abs(nap.alpha(y[:, columns], arms) - made.truth.alpha).max() / peak) for y in (before, after)
    ]
    named = float(found.diagnosis.channels == ("a1y",))
    size = "the spread over records that METHODS 7.4 gives"
    return [
        Published(SOURCE, "clipped a1y, general motion: named (1 yes)", 1.0, named, 1.0, 0.0, "yes or no"),
        Published(SOURCE, "its χ²/dof", "1.05 to 1.14", best.statistic, 1.0, 0.14, f"{size}; expectation 1"),
        Published(
            SOURCE,
            "χ²/dof of the next hypothesis over it, at least 10 (log10)",
            "413 without slow noise in the fit",
            float(np.log10(following.statistic / best.statistic)),
            2.0,
            1.0,
            "an order of magnitude about 100; the fit here allows for slow noise",
        ),
        Published(
            SOURCE,
            "error of peak α before over after the repair",
            "54 to 100 % over 5 to 7 %",
            errors[0] / errors[1],
            14.0,
            6.0,
            size,
        ),
        Published(
            SOURCE,
            "error of peak α after the repair, %",
            "5 to 7",
            errors[1],
            5.0,
            5.0,
            "noise: four times σ/r, 0.3 g over 50 mm, is 235 rad/s², 8 to 10 % of the peak",
        ),
    ]


def _triangle() -> list[Published]:
    """Eq 37 put right, row by row, against the rigid body."""
    rng, rx, ry = np.random.default_rng(37), 0.06, 0.05
    omega, alpha, a1 = (s * rng.standard_normal((200, 3)) for s in (30.0, 3000.0, 500.0))
    ours = takhounts.triangle_corner(a1, alpha, omega, rx, ry)
    truth = rigid_body.acceleration_at(np.array([rx / 2.0, ry, 0.0]), a1, alpha, omega)
    wrong = ours[:, 1] + (alpha[:, 0] - alpha[:, 2]) * rx / 2.0
    words = (
        "right as printed",
        f"αx in place of αz, {100 * _relative(wrong, truth[:, 1]):.2g} % off",
        "right as printed",
    )
    return [
        Published(
            SOURCE,
            f"eq 37 row {i + 1} put right, rms relative error on random motion",
            words[i],
            _relative(ours[:, i], truth[:, i]),
            0.0,
            1e-12,
            "rounding of the sums",
        )
        for i in range(3)
    ]


def triangle(rx: float, ry: float) -> SensorArray:
    """Triaxes at the corners (0,0,0), (rx,0,0), (rx/2,ry,0), m: Fig 10."""
    corners = ((0.0, 0.0, 0.0), (rx, 0.0, 0.0), (rx / 2.0, ry, 0.0))
    return SensorArray(
        tuple(
            Sensor(f"a{i}{axis}", "accelerometer", frozen(place), frozen(np.eye(3)[j]), f"a{i}{axis}")
            for i, place in enumerate(corners, 1)
            for j, axis in enumerate("xyz")
        )
    )


def _cross_axis() -> list[Published]:
    """3 % of each axis in the others, ω = 0, equilateral triangle: δα = −0.03(αz, αz, (αx+αy)/2)."""
    side, c = 0.06, 0.03
    array = triangle(side, side * np.sqrt(0.75))
    alpha = np.array([1000.0, 2500.0, -700.0])
    error = takhounts.cross_axis_error(array, np.array([300.0, -200.0, 100.0]), alpha, c * (1.0 - np.eye(3)))
    expected = -c * np.array([alpha[2], alpha[2], (alpha[0] + alpha[1]) / 2.0])
    claim = "0 (optimisation is said to undo it)"
    return [
        Published(SOURCE, f"3 % cross-axis, ω = 0: error of α{a}, rad/s²", claim, float(e), float(x), 1e-9, "rounding")
        for a, e, x in zip("xyz", error, expected, strict=True)
    ]
