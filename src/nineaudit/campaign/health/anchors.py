"""What the rig files said first of each seat and of each sensor's scale: the anchors that later statements are against.

A seat is a channel of a rig at a place and in a direction. A restated direction n moves the tilts by P (n − n_first) to
first order: more than SAME_AXIS or SAME_PLACE away, it is another seat.

A scale is that of a sensor with its recording path, so of a sensor in a seat. Stated anew there, it is the same gain
against another number: θ + ln(stated/first). In another seat the path is another. Where the same number is stated there
the gain is taken for the same; where another is, nothing tells what of it is the path and what a recalibration: it is
another gain, of another `setting`, and so it is over SAME_SCALE (other units, another range).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf, log
from typing import Final

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.estimate.calibration import perpendicular

SAME_SCALE, SAME_PLACE, SAME_AXIS = 0.2, 5e-3, 0.1
"""Restated by more (relative, m, rad), it is another setting of the sensor, another seat."""
SAME_NUMBER: Final = 1e-6
"""Relative: scales within it are one number."""

Seat = tuple[str, str]
"""Name of the rig, and channel."""


@dataclass(frozen=True, eq=False)
class Place:
    """A seat, where it was first stated to be: `position` (3,) m, `axis` (3,)."""

    seat: Seat
    position: FloatArray
    axis: FloatArray

    def turned(self, axis: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(2,2) Q and (2,) c: tilts against `axis` are Q τ + c against the first."""
        if np.array_equal(axis, self.axis):
            return np.eye(2), np.zeros(2)
        common = perpendicular(self.axis)
        return common @ perpendicular(axis).T, common @ (axis - self.axis)


@dataclass(frozen=True)
class Scale:
    """The scale that gains of one `setting` of a sensor are against."""

    first: float
    setting: int

    def restated(self, scale: float) -> float:
        """What is added to a gain against `scale`; of the other sign, nothing is the same."""
        ratio = scale / self.first
        return log(ratio) if ratio > 0.0 else inf


@dataclass(eq=False)
class Anchors:
    """By rig and channel its seats, by sensor and seat its scales, of each sensor how many settings it had, and what
    was stated last."""

    places: dict[Seat, list[Place]] = field(default_factory=dict)
    scales: dict[tuple[str, Seat], list[Scale]] = field(default_factory=dict)
    settings: dict[str, int] = field(default_factory=dict)
    last: dict[str, tuple[float, Scale]] = field(default_factory=dict)

    def known_place(self, rig: str, channel: str, position: Sequence[float], axis: Sequence[float]) -> Place | None:
        """The seat that a channel is in by this statement; None where no recording was of it."""
        where, along = np.array(position, dtype=np.float64), np.array(axis, dtype=np.float64)
        for place in self.places.get((rig, channel), ()):
            near = float(np.abs(where - place.position).max()) <= SAME_PLACE
            if near and float(np.linalg.norm(along - place.axis)) <= SAME_AXIS:
                return place
        return None

    def place(self, rig: str, channel: str, position: Sequence[float], axis: Sequence[float]) -> Place:
        """The same; a new seat where none is known."""
        known = self.known_place(rig, channel, position, axis)
        if known is not None:
            return known
        seats = self.places.setdefault((rig, channel), [])
        name = f"{channel} (place {len(seats) + 1})" if seats else channel
        made = Place((rig, name), np.array(position, dtype=np.float64), np.array(axis, dtype=np.float64))
        seats.append(made)
        return made

    def known_scale(self, sensor: str, seat: Seat | None, scale: float) -> Scale | None:
        """What the gain of a sensor is against that is stated so in a seat; None where it is a gain that no recording
        shows."""
        told = [] if seat is None else self.scales.get((sensor, seat), [])
        near = [one for one in told if abs(one.restated(scale)) <= SAME_SCALE]
        if near:
            return near[0]
        number, one = self.last.get(sensor, (0.0, None))
        return one if one is not None and abs(number / scale - 1.0) <= SAME_NUMBER else None

    def scale(self, sensor: str, seat: Seat, scale: float) -> Scale:
        """The same; a new setting where none is known. It is what was stated last from then on."""
        known = self.known_scale(sensor, seat, scale)
        if known is None:
            known = Scale(scale, self.settings.get(sensor, 0))
            self.settings[sensor] = known.setting + 1
        told = self.scales.setdefault((sensor, seat), [])
        if known not in told:
            told.append(known)
        self.last[sensor] = (scale, known)
        return known
