"""The instrument: sensors on one rigid body. Positions and axes in the body frame, SI units."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

_Array = TypeVar("_Array", bound=NDArray[Any])

Kind = Literal["accelerometer", "gyroscope"]


def frozen(values: object) -> FloatArray:
    """A read-only float64 copy, so that a value that holds it cannot change."""
    return read_only(np.array(values, dtype=np.float64))


def read_only(array: _Array) -> _Array:
    """The array itself, which nobody writes to any more: for one that was made here and is held by nobody else."""
    array.setflags(write=False)
    return array


@dataclass(frozen=True, eq=False)
class Sensor:
    """One channel: where it sits, what it senses, and how well that is known.

    `position` (3,) m and unit vector `axis` (3,) in the body frame; the position of a rate sensor has no
    effect. `full_scale` (the rig file's ``range``) in m/s² or rad/s. Standard uncertainties: `u_gain`
    relative, `u_zero` and `noise` in m/s² or rad/s, `u_alignment` rad (each of two tilts), `u_position`
    m (each coordinate), `u_timing` s. `noise` None: to be estimated from the quiet interval. `resolution` in m/s² or
    rad/s, None: as the recording shows it.
    `to_si` converts a value in the rig's unit (`unit`) to SI, calibrated: the unit over `scale`. A value read is
    value·to_si − `offset`, `offset` in m/s² or rad/s.
    """

    channel: str
    kind: Kind
    position: FloatArray
    axis: FloatArray
    signal: str
    unit: str = "m/s^2"
    to_si: float = 1.0
    scale: float = 1.0
    offset: float = 0.0
    full_scale: float | None = None
    serial: str | None = None
    u_gain: float = 0.0
    u_zero: float = 0.0
    u_alignment: float = 0.0
    u_position: float = 0.0
    u_timing: float = 0.0
    noise: float | None = None
    resolution: float | None = None


@dataclass(frozen=True, eq=False)
class SensorArray:
    """All channels of a rig, in the order of the rig file; (k,) arrays follow that order."""

    sensors: tuple[Sensor, ...]

    def __len__(self) -> int:
        return len(self.sensors)

    @cached_property
    def channels(self) -> tuple[str, ...]:
        return tuple(s.channel for s in self.sensors)

    @cached_property
    def positions(self) -> FloatArray:
        """(k,3) m."""
        return frozen(np.reshape([s.position for s in self.sensors], (-1, 3)))

    @cached_property
    def axes(self) -> FloatArray:
        """(k,3) unit vectors."""
        return frozen(np.reshape([s.axis for s in self.sensors], (-1, 3)))

    @cached_property
    def is_accelerometer(self) -> BoolArray:
        """(k,)"""
        return np.array([s.kind == "accelerometer" for s in self.sensors], dtype=np.bool_)

    def index(self, channel: str) -> int:
        """Column of a channel; KeyError names it when the array has none such."""
        try:
            return self.channels.index(channel)
        except ValueError:
            raise KeyError(channel) from None

    def __getitem__(self, channel: str) -> Sensor:
        return self.sensors[self.index(channel)]

    def values(self, name: str) -> FloatArray:
        """(k,) of one numeric attribute of the sensors, NaN where it is None."""
        return frozen([np.nan if (v := getattr(s, name)) is None else v for s in self.sensors])

    def select(self, columns: Iterable[int]) -> SensorArray:
        """The sensors of these columns, in the order given."""
        return SensorArray(tuple(self.sensors[c] for c in columns))

    def subset(self, channels: Iterable[str]) -> SensorArray:
        """The same sensors less those not named, in this array's order."""
        wanted = set(channels)
        return SensorArray(tuple(s for s in self.sensors if s.channel in wanted))
