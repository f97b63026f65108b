"""Misprinted closed forms of Takhounts et al. 2009, eqs 23 to 33, as printed and put right, on one random motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.physics import nap, rigid_body
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


def checks() -> list[Published]:
    """Right forms to rounding; the printed forms as far off as METHODS 1.2 says."""
    motion = random_motion()
    out = []
    for equation, (channel, values) in printed_forms(motion).items():
        percent, width = MISPRINTS[equation]
        ours = 100.0 * relative(values, motion.channel[channel])
        label = f"eq {equation} as printed, rms relative error of {channel} on random motion, %"
        out.append(Published(SOURCE, label, f"misprint ({percent:g} %)", ours, percent, width, _ROUNDED))
    nine = np.stack([motion.channel[name] for name in nap.CHANNELS], axis=1)
    turning = np.abs(nap.omega(nine, np.array(ARMS), motion.time)).min(axis=1) > 1.0
    for equation, (channel, values) in printed_velocities(motion).items():
        percent, width = MISPRINTS[equation]
        ours = 100.0 * relative(values[turning], motion.integral(motion.channel[channel])[turning])
        label = f"eq {equation} as printed, rms relative error of ∫{channel} where |ω| components exceed 1 rad/s, %"
        out.append(Published(SOURCE, label, f"misprint ({percent:g} %)", ours, percent, width, _ROUNDED))
    for name in nap.CHANNELS:
        rebuilt = nap.rebuild(name, nine, np.array(ARMS), motion.time)
        label = f"closed form of {name} put right, rms relative error on random motion"
        error = relative(rebuilt, motion.channel[name])
        out.append(Published(SOURCE, label, "0 (exact)", error, 0.0, 1e-9, "integration at 5 µs, ends of the record"))
    return out


def relative(values: FloatArray, truth: FloatArray) -> float:
    """rms of the error over rms of the truth."""
    return float(np.sqrt(((values - truth) ** 2).mean() / (truth**2).mean()))
