"""A motion as a CAN log, and the database that describes it: one message a vector, its components as signals.

The curves go through the writers of recordings (writers/), as channels of an array that has no place on a body: 21 bits
for each component of three, 32 for each of two. A bit of a signal is 1.25·2/2^bits of the largest value of its vector.
Times are those of the motion; a log that cannot start before 0 notes by how much it is shifted (signals.CAN_ORIGIN).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, Sensor, SensorArray
from nineaudit.motion import Kinematics
from nineaudit.recording import Clock, Recording, Source, Trace
from nineaudit.rig import Rig
from nineaudit.writers import WRITERS, make_dbc
from nineaudit.writers.outcome import Outcome

SUFFIXES: Final = (".blf", ".asc")
_LONGEST = 12
"""Letters of a point's name, so that no name of the database is longer than the 32 that tools allow."""
_OF_MOTION = {"omega": "rad/s", "alpha": "rad/s^2", "attitude": "rad"}
_OF_POINT = {
    "acceleration_body": ("a_body", "m/s^2"), "acceleration_lab": ("a", "m/s^2"), "velocity_body": ("v_body", "m/s"),
    "velocity_lab": ("v", "m/s"), "position_body": ("x_body", "m"), "position_lab": ("x", "m"),
}  # fmt: skip
_U_OF_POINT = {"a": "u_acceleration_body", "v": "u_velocity_lab", "x": "u_position_lab"}
Vector = tuple[str, str, dict[str, FloatArray]]
"""Message, unit, and (n,) values by signal."""


def write_log(found: Kinematics, path: Path, database: Path) -> Outcome:
    """Write the log to `path` and its DBC to `database`; what the bits round off. ConfigurationError: values that are
    not finite."""
    recording = as_recording(found)
    database.write_text(make_dbc(recording.rig), encoding="utf-8", newline="\n")
    return WRITERS[path.suffix.lower()](recording, recording.readings, path, [database])


def as_recording(found: Kinematics) -> Recording:
    """The curves as a recording, SI, of a rig whose signals are Message.Signal: what the log reads back as."""
    vectors = list(_vectors(found))
    sensors = [_channel(message, unit, curves, name) for message, unit, curves in vectors for name in curves]
    readings = np.column_stack([values for _, _, curves in vectors for values in curves.values()])
    steps = np.diff(found.time)
    clock = Clock(1.0 / float(steps.mean()), float(steps.std()))
    return Recording(
        time=found.time,
        readings=readings,
        valid=np.isfinite(readings),
        rig=Rig("motion", SensorArray(tuple(sensors)), time_unit="s"),
        source=Source(Path("motion"), "motion", "", 0),
        native=tuple(Trace(s.channel, s.signal, found.time, y) for s, y in zip(sensors, readings.T, strict=True)),
        clocks=(clock,) * len(sensors),
    )


def _channel(message: str, unit: str, curves: dict[str, FloatArray], name: str) -> Sensor:
    """A component as a channel; its range is that of its vector, 1 where that is nothing but 0."""
    largest = max(float(np.abs(values).max()) for values in curves.values())
    signal = f"{message}.{name}"
    return Sensor(signal, "accelerometer", np.zeros(3), np.eye(3)[0], signal, unit, full_scale=largest or 1.0)


def _vectors(found: Kinematics) -> Iterator[Vector]:
    yield _three("omega", "rad/s", found.omega)
    yield _three("alpha", "rad/s^2", found.alpha)
    yield "euler", "rad", dict(zip(("yaw", "pitch", "roll"), found.euler.T, strict=True))
    for pair in ((0, "xy"), (2, "zw")):
        turned = found.quaternion[:, pair[0] : pair[0] + 2].T
        yield f"quaternion_{pair[1]}", "", {f"quaternion_{c}": v for c, v in zip(pair[1], turned, strict=True)}
    names = _names(found.paths)
    for point, path in found.paths.items():
        for quantity, (attribute, unit) in _OF_POINT.items():
            yield _three(quantity, unit, getattr(path, attribute), names[point])
    for name, u in found.u.items():
        point, _, quantity = name.rpartition(" ")
        if point:
            unit = {"a": "m/s^2", "v": "m/s", "x": "m"}[quantity]
            yield _three(_U_OF_POINT[quantity], unit, u, names[point])
        else:
            yield _three(f"u_{name}", _OF_MOTION[name], u)


def _three(quantity: str, unit: str, values: FloatArray, point: str = "") -> Vector:
    message = f"{point}_{quantity}" if point else quantity
    return message, unit, {f"{quantity}_{axis}": values[:, i] for i, axis in enumerate("xyz")}


def _names(points: Iterable[str]) -> dict[str, str]:
    """By point, a name that a database allows; numbered where two would have one."""
    safe = {point: re.sub(r"^(?=\d)", "P", re.sub(r"\W+", "_", point, flags=re.ASCII))[:_LONGEST] for point in points}
    if len({name.lower() for name in safe.values()}) == len(safe):
        return safe
    return {point: f"{name[: _LONGEST - 4]}_{i}" for i, (point, name) in enumerate(safe.items(), 1)}
