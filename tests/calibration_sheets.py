"""Calibration runs of a rig whose sensors are not what it says: the CSV files that `nineaudit calibrate` reads."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.rig import Rig
from nineaudit.units import G0

BODY = {"+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0), "+z": (0, 0, 1), "-z": (0, 0, -1)}
RADIUS_M = 0.4


@dataclass(frozen=True, eq=False)
class Truth:
    """True sensitivity vectors (k,3) and offsets (k,), reading per true value, in the units of the rig's readings."""

    vectors: FloatArray
    offsets: FloatArray


def draw(rig: Rig, seed: int, spread: float = 0.03) -> Truth:
    rng = np.random.default_rng(seed)
    axes = rig.array.axes + spread * rng.standard_normal(rig.array.axes.shape)
    return Truth(axes * rng.uniform(0.9, 1.1, (len(axes), 1)), rng.normal(0.0, 0.5, len(axes)))


def right_angles(directions: list[str] | None = None) -> list[tuple[str, str]]:
    """Every pair (up, out) of body directions at right angles."""
    names = directions or list(BODY)
    return [(u, o) for u in names for o in names if not np.dot(BODY[u], BODY[o])]


def felt(rig: Rig, up: str, out: str, rate: float) -> FloatArray:
    """(k,3) in m/s² or rad/s: what a table at `rate` rad/s, RADIUS_M from its axis, does to each sensor."""
    u, o = np.array(BODY[up], dtype=float), np.array(BODY[out], dtype=float)
    away = RADIUS_M * o + rig.array.positions
    away = away - np.outer(away @ u, u)  # from the axis, not along it
    force = -(rate**2) * away + G0 * u
    return np.where(rig.array.is_accelerometer[:, None], force, rate * u)


def table(
    rig: Rig,
    truth: Truth,
    noise: float,
    seed: int,
    pairs: list[tuple[str, str]] | None = None,
    rpm: tuple[float, ...] = (0, 60, 120, 180),
) -> str:
    """Runs of a rate table as a CSV text; `noise` in the unit of the readings."""
    rng = np.random.default_rng(seed)
    rows = ["# calibration of today", ",".join(["run", "up", "out", "rate_rpm", "radius_mm", *rig.array.channels])]
    for number, (up, out) in enumerate(pairs or right_angles()):
        for speed in rpm:
            read = readings(rig, truth, felt(rig, up, out, speed * np.pi / 30.0)) + noise * rng.standard_normal(
                len(rig.array)
            )
            rows.append(
                ",".join([str(number), up, out, str(speed), str(1e3 * RADIUS_M), *(repr(float(v)) for v in read)])
            )
    return "\n".join(rows) + "\n"


def flips(rig: Rig, truth: Truth, noise: float, seed: int, ups: list[str] | None = None) -> str:
    rng = np.random.default_rng(seed)
    held = [c for c, kind in zip(rig.array.channels, rig.array.is_accelerometer, strict=True) if kind]
    columns = [rig.array.index(c) for c in held]
    rows = [",".join(["up", *held])]
    for up in ups or list(BODY):
        out = next(o for u, o in right_angles() if u == up)
        read = readings(rig, truth, felt(rig, up, out, 0.0)) + noise * rng.standard_normal(len(rig.array))
        rows.append(",".join([up, *(repr(float(read[c])) for c in columns)]))
    return "\n".join(rows) + "\n"


def staircase(rig: Rig, gain: float, offset: float, noise: float, seed: int, levels: FloatArray | None = None) -> str:
    rng = np.random.default_rng(seed)
    rows = [",".join(["level", *rig.array.channels])]
    for level in np.linspace(-450.0, 450.0, 10) if levels is None else levels:
        read = gain * level + offset + noise * rng.standard_normal(len(rig.array))
        rows.append(",".join([repr(float(level)), *(repr(float(v)) for v in read)]))
    return "\n".join(rows) + "\n"


def readings(rig: Rig, truth: Truth, force: FloatArray) -> FloatArray:
    """(k,) v = S·f + V, f in the unit of the readings."""
    unit = rig.array.values("to_si") * rig.array.values("scale")
    return np.einsum("ki,ki->k", truth.vectors, force) / unit + truth.offsets


def write_all(rig: Rig, folder: Path) -> None:
    """table.csv, flips.csv and staircase.csv, as the examples of the help name them."""
    truth = draw(rig, 0)
    (folder / "table.csv").write_text(table(rig, truth, 0.002, 1), encoding="utf-8")
    (folder / "flips.csv").write_text(flips(rig, truth, 0.002, 2), encoding="utf-8")
    (folder / "staircase.csv").write_text(staircase(rig, 0.99, 0.5, 0.05, 3), encoding="utf-8")
