"""The array in space: an oblique view of the sensors and their axes, as the body lies at a few instants."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.report.figures import Figure
from nineaudit.report.numbers import digits, printable, seconds

if TYPE_CHECKING:
    from nineaudit.auditing import Audit

SIZE, MARGIN = 210, 30
"""Side of a view and the room around the body in it, pixels."""
ARROW = 0.28
"""Length of a sensitive axis, in reaches of the array."""
_VIEW = np.array([[0.866, -0.866, 0.0], [0.4, 0.4, -0.9]])
"""Rows: right and down on the screen, of x, y, z."""


def views(audit: Audit) -> list[Figure]:
    """The array at rest with its channels named, then as it had turned at the peaks of α and ω and at the end."""
    array = audit.recording.rig.array
    centre = np.nanmean(array.positions, axis=0)
    placed = array.positions - centre
    reach = float(np.nanmax(np.linalg.norm(placed, axis=1))) or 1.0
    at = [(0, "at first", True)]
    if audit.motion is not None and audit.attitude is not None:
        alpha, omega = (np.linalg.norm(v, axis=1) for v in (audit.motion.alpha, audit.motion.omega))
        at += [(int(np.nanargmax(alpha)), "peak of α", False), (int(np.nanargmax(omega)), "peak of ω", False)]
        at += [(len(alpha) - 1, "at the end", False)]
    return [_view(audit, k, sample, name, placed / reach, named) for k, (sample, name, named) in enumerate(at)]


def _view(audit: Audit, k: int, sample: int, name: str, placed: FloatArray, named: bool) -> Figure:
    turned = np.eye(3) if audit.attitude is None else audit.attitude[sample]
    angle = np.degrees(np.arccos(np.clip(0.5 * (np.trace(turned) - 1.0), -1.0, 1.0)))
    when = seconds(float(audit.recording.time[sample]))
    told = f"{name}, {when}" + ("" if named else f": turned by {digits(float(angle), 2)}°")
    body = _Body(audit, placed @ turned.T, audit.recording.rig.array.axes @ turned.T, turned)
    parts = [
        f'<svg class="view" role="img" aria-labelledby="view-{k}-t" viewBox="0 0 {SIZE} {SIZE}" width="{SIZE}" '
        f'height="{SIZE}">',
        f'<title id="view-{k}-t">The array {escape(printable(told))}</title>',
        *body.frame(),
        *body.sensors(),
        *(body.names() if named else []),
        "</svg>",
    ]
    return Figure("".join(parts), told)


class _Body:
    """The array turned into the laboratory: places (k,3) in reaches of the array, axes (k,3), attitude (3,3)."""

    def __init__(self, audit: Audit, places: FloatArray, axes: FloatArray, turned: FloatArray) -> None:
        self.array, self.culprits = audit.recording.rig.array, set(audit.diagnosis.channels)
        self.places, self.axes, self.turned = np.nan_to_num(places), np.nan_to_num(axes), turned

    def at(self, point: FloatArray) -> tuple[float, float]:
        """Pixels of a point (3,)."""
        x, y = _VIEW @ point * (0.5 * SIZE - MARGIN) + 0.5 * SIZE
        return round(float(x), 1), round(float(y), 1)

    def line(self, start: FloatArray, end: FloatArray, style: str) -> str:
        (x1, y1), (x2, y2) = self.at(start), self.at(end)
        return f'<line class="{style}" x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}"/>'

    def frame(self) -> list[str]:
        """The body's axes, and the arms that hold the sensors."""
        middle = np.zeros(3)
        arms = [self.line(middle, p, "arm") for p in np.unique(self.places.round(6), axis=0)]
        for axis, name in zip(self.turned.T, "xyz", strict=True):
            x, y = self.at(0.72 * axis)
            arms.append(self.line(middle, 0.6 * axis, f"line axis-{name}"))
            arms.append(f'<text class="name axis-{name}" x="{x}" y="{y + 4}" text-anchor="middle">{name}</text>')
        return arms

    def sensors(self) -> list[str]:
        """A dot a place, a stroke along each sensitive axis; rate sensors dashed, the culprit marked."""
        parts = []
        for sensor, place, axis in zip(self.array.sensors, self.places, self.axes, strict=True):
            kind = "sensor" if sensor.kind == "accelerometer" else "sensor rate"
            style = f"{kind} culprit" if sensor.channel in self.culprits else kind
            x, y = self.at(place)
            parts.append(self.line(place, place + ARROW * axis, style))
            parts.append(f'<circle class="place" cx="{x}" cy="{y}" r="2.5"/>')
        return parts

    def names(self) -> list[str]:
        """The channels at each place."""
        gathered: dict[tuple[float, float], list[str]] = {}
        for sensor, place in zip(self.array.sensors, self.places, strict=True):
            gathered.setdefault(self.at(place), []).append(printable(sensor.channel))
        if len(gathered) > 12:
            return []
        return [
            f'<text class="tick" x="{x}" y="{y + 16}" text-anchor="middle">{escape(" ".join(names)[:40])}</text>'
            for (x, y), names in gathered.items()
        ]
