"""Misprinted equations of Takhounts et al. 2009, 22a to 33 and 37, as printed and put right, on one random motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.physics import nap, rigid_body
from nineaudit.schemes import takhounts
from nineaudit.schemes.rgla import simpson_integral
from nineaudit.selftest.misprints import Misprint, put_right, random_instants, relative
from nineaudit.selftest.published import Published

SOURCE = "Takhounts 2009"
ARMS: Final = (0.055, 0.048, 0.071)
"""Of the random motion on which METHODS 1.2 weighs the misprints."""
_ROUNDED = "a unit of the last digit of METHODS 1.2"
_INTEGRATED: Final = 1e-9
"""Error of integration at 5 µs, over the size of what is integrated."""
_PROFUSE: Final = ("nearly every term", "do not use it: see below")
_WORDS: Final = {
    "23": (
        "ωx = ∫[… − (a1z−a0z)/2rz], ωy = ∫[… − (a1x−a0x)/2rx]",
        "ωx needs (a3y−a0y)/2rz, ωy needs (a1z−a0z)/2rx",
    ),
    "25": ("(a1x−a0x)/2rx in ωy; (a1y−a0y)/2rz", "a1z; 2rx, twice"),
    "27": ("(a2z−a0z)/2rx, twice", "2ry"),
    "28b": ("prefactor 2rx, a1x in ωy", "a0x = a2x − 2ry{ωxωy − (a1y−a0y)/2rx}"),
    "30a": ("ωyωz with 2rx in its first and 2rz in its second integral", "2rz in the first, 2rx in the second"),
    "30b": ("ωx from (a2x−a0x)/2ry; the sum has (a2z−a0z)/2ry", "ωxωy; (a2x−a0x)/2ry in the sum"),
    "32a": ("ωyωz with 2rx in its first and 2rz in its second integral", "2rz in the first, 2rx in the second"),
    "32b": ("ωz with (a1y−a0y)/2rz; the sum has (a3y−a0y)/2rz", "ωzωx; (a3x−a0x)/2rz in the sum"),
    "29": _PROFUSE,
    "31": _PROFUSE,
    "33": _PROFUSE,
}
"""Equation: what is printed, what is right."""

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
    wy_30, wz_30 = integral(part("a3x", rx) - part("a1z", rx)), integral(part("a1y", rz) - part("a2x", ry))
    wx_30 = integral(part("a2x", ry) - part("a3y", rz))
    return {
        "23": ("a1y", 2 * rx * (wx_wrong * wy_wrong - part("a2x", ry)) + c["a0y"]),
        "25": ("a2x", 2 * ry * (wx * wy_wrong - part("a1y", rz)) + c["a0x"]),
        "27": ("a3y", 2 * rz * (wy * wz - part("a2z", rx)) + c["a0y"]),
        "28b": ("a0x", -2 * rx * (wx * wy_wrong - part("a1y", rx)) + c["a2x"]),
        "30a": ("a0y", -2 * rz * (wy_30 * wz_30 - part("a2z", ry)) + c["a3y"]),
        "30b": ("a0y", -2 * rx * (wx_30 * wy - part("a2z", ry)) + c["a1y"]),
        "32a": ("a0z", -2 * ry * (wy_30 * wz_30 - part("a3y", rz)) + c["a2z"]),
        "32b": ("a0z", -2 * rx * (wz_30 * wy - part("a3y", rz)) + c["a1z"]),
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


def misprints() -> list[Misprint]:
    """Every equation as printed and as it should be, against the rigid body."""
    motion = random_motion()
    nine = np.stack([motion.channel[name] for name in nap.CHANNELS], axis=1)
    turning = np.abs(nap.omega(nine, np.array(ARMS), motion.time)).min(axis=1) > 1.0
    right = {name: nap.rebuild(name, nine, np.array(ARMS), motion.time) for name in nap.CHANNELS}
    found = [_eq22a()]
    for equation, (name, values) in printed_forms(motion).items():
        sides = values, right[name], motion.channel[name]
        found.append(Misprint(SOURCE, equation, name, *_WORDS[equation], *sides, _INTEGRATED))
    for equation, (name, values) in printed_velocities(motion).items():
        sums = (values, motion.integral(right[name]), motion.integral(motion.channel[name]))
        wrong, ours, truth = (part[turning] for part in sums)
        quantity = f"∫{name} where components of ω exceed 1 rad/s"
        found.append(Misprint(SOURCE, equation, quantity, *_WORDS[equation], wrong, ours, truth, _INTEGRATED))
    return [*found, _eq37()]


def _eq22a() -> Misprint:
    """αz of eq 12 where a1x and a2y stand for a1y and a2x: along the arms, which feel no α at all."""
    motion, (rx, ry, _) = random_instants(22), ARMS
    on_x, on_y = motion.at(rx, 0.0, 0.0) - motion.a0, motion.at(0.0, ry, 0.0) - motion.a0
    wrong = on_x[:, 0] / (2 * rx) - on_y[:, 1] / (2 * ry)
    right = on_x[:, 1] / (2 * rx) - on_y[:, 0] / (2 * ry)
    words = ("a1x, a2y among the nine channels", "no such channels: a1y, a2x")
    return Misprint(SOURCE, "22a", "αz", *words, wrong, right, motion.alpha[:, 2])


def _eq37() -> Misprint:
    """Row 2: the y reading of the far corner of the triangle of Fig 10."""
    motion, rx, ry = random_instants(37), 0.06, 0.05
    right = takhounts.triangle_corner(motion.a0, motion.alpha, motion.omega, rx, ry)[:, 1]
    wrong = right + (motion.alpha[:, 0] - motion.alpha[:, 2]) * rx / 2.0
    return Misprint(SOURCE, "37 row 2", "that row", "αx", "αz", wrong, right, motion.at(rx / 2.0, ry, 0.0)[:, 1])


def rank_as_listed() -> int:
    """Rank of H of the nine channels with a1x and a2y in place of a1y and a2x, as eq 22a lists them."""
    places = dict(zip("0123", np.vstack([np.zeros(3), np.diag(ARMS)]), strict=True))
    listed = [{"a1y": "a1x", "a2x": "a2y"}.get(name, name) for name in nap.CHANNELS]
    axes = np.array([np.eye(3)["xyz".index(name[2])] for name in listed])
    h = rigid_body.design(np.array([places[name[1]] for name in listed]) / max(ARMS), axes)
    return int(np.linalg.matrix_rank(h))


def checks() -> list[Published]:
    """Right forms to rounding; the printed forms as far off as METHODS 1.2 says, where it says."""
    found = misprints()
    out = [
        Published(
            SOURCE,
            f"eq {m.equation} as printed, rms relative error of {m.quantity} on random motion, %",
            f"misprint ({MISPRINTS[m.equation][0]:g} %)",
            m.percent,
            *MISPRINTS[m.equation],
            _ROUNDED,
        )
        for m in found
        if m.equation in MISPRINTS
    ]
    listed = "eq 22a, rank of H with a1x and a2y as listed (6 with the right nine)"
    out.append(Published(SOURCE, listed, "6 (nine channels)", float(rank_as_listed()), 5.0, 0.5, "a whole number"))
    out += put_right(m for m in found if _WORDS.get(m.equation) is not _PROFUSE)
    return [*out, *_closed_forms()]


def _closed_forms() -> list[Published]:
    """All nine, as physics/nap.py has them; those of the centre stand in for eqs 29, 31 and 33."""
    motion, out = random_motion(), []
    nine = np.stack([motion.channel[name] for name in nap.CHANNELS], axis=1)
    for name in nap.CHANNELS:
        error = relative(nap.rebuild(name, nine, np.array(ARMS), motion.time), motion.channel[name])
        label = f"closed form of {name}, rms relative error on random motion"
        why = "integration at 5 µs, ends of the record"
        out.append(Published(SOURCE, label, "0 (exact)", error, 0.0, _INTEGRATED, why))
    return out
