"""Results of a calibration as lines of text, with confidence limits."""

from __future__ import annotations

import math
from collections.abc import Sequence

from nineaudit.calibrating.fit import Calibration, student
from nineaudit.calibrating.path import BECKER_LEVELS, PathGain
from nineaudit.units import counted


def sensors(found: Sequence[Calibration], confidence: float) -> list[str]:
    """A header and one line a sensor; limits are ± Student's t times the standard uncertainty of the fit."""
    out = [f"limits: {100 * confidence:g} % confidence, of the fit alone; the axis has a limit across itself"]
    head = ("channel", "scale", "±", "offset", "±", "unit", "sensitivity vector", "tilt °", "± °", "cross %")
    rows = [_sensor(c, student(c.dof, confidence)) for c in found]
    return [*out, *_aligned([(*head, "rms", "max", "runs"), *rows])]


def _sensor(c: Calibration, t: float) -> tuple[str, ...]:
    vector = " ".join(f"{x:+.5f}" for x in c.vector)
    limit = "rig's" if c.u_tilt is None else f"{math.degrees(t * c.u_tilt):.3g}"
    cross = "" if c.u_tilt is None else f"{100 * math.sin(c.tilt):.2f}"
    tilt = f"{math.degrees(c.tilt):.2f}"
    sizes = (f"{c.scale:.6g}", f"{t * c.u_scale:.2g}", f"{c.offset:.4g}", f"{t * c.u_offset:.2g}", c.unit)
    return (c.channel, *sizes, vector, tilt, limit, cross, f"{c.rms:.3g}", f"{c.largest:.3g}", str(c.runs))


def paths(found: Sequence[PathGain], confidence: float) -> list[str]:
    """A header and one line a path; limits are ± Student's t times the standard uncertainty of the fit."""
    head = ("channel", "gain", "±", "offset", "±", "unit", "rms", "max", "linearity %", "levels", "runs")
    rows = [_path(p, student(p.dof, confidence)) for p in found]
    fewest = min(p.levels for p in found)
    few = (
        [f"{counted(fewest, 'level')}: Becker and Willems 1975 take {BECKER_LEVELS}"] if fewest < BECKER_LEVELS else []
    )
    return [f"limits: {100 * confidence:g} % confidence, of the fit alone", *_aligned([head, *rows]), *few]


def _path(p: PathGain, t: float) -> tuple[str, ...]:
    line = (f"{p.gain:.6g}", f"{t * p.u_gain:.2g}", f"{p.offset:.4g}", f"{t * p.u_offset:.2g}", p.unit)
    errors = (f"{p.rms:.3g}", f"{p.largest:.3g}", f"{100 * p.linearity:.3g}")
    return (p.channel, *line, *errors, str(p.levels), str(p.runs))


def _aligned(rows: Sequence[tuple[str, ...]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)) for row in rows]
