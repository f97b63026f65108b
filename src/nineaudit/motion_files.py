"""A motion as a file: a table (CSV, Parquet) with SI units in the names of its columns, MCAP with poses, or a CAN log
(motion_can.py) with its database beside it.

An MCAP file has, for Foxglove, the topics /tf (foxglove.FrameTransform, laboratory to body) and /pose/NAME
(foxglove.PoseInFrame) for every point, and with all numbers /motion and /point/NAME. Log times cannot be negative: a
motion that starts before 0 is shifted, and the metadata record "nineaudit" says by how much.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from nineaudit import motion_can
from nineaudit.array import FloatArray
from nineaudit.errors import ConfigurationError
from nineaudit.files import partial_name
from nineaudit.motion import Kinematics
from nineaudit.presets import nearest
from nineaudit.signals import MCAP_ORIGIN

Writer = Callable[[Kinematics, Path], tuple[str, ...]]
"""Writes a motion to a file and returns notes on what its format changed."""
LABORATORY, BODY = "laboratory", "body"
_U = {"omega": "u_omega_{}_rad_s", "alpha": "u_alpha_{}_rad_s2", "attitude": "u_attitude_{}_rad"}
_POINT = {
    "a_body": ("acceleration_body", "m_s2"), "a": ("acceleration_lab", "m_s2"), "v_body": ("velocity_body", "m_s"),
    "v": ("velocity_lab", "m_s"), "x_body": ("position_body", "m"), "x": ("position_lab", "m"),
}  # fmt: skip
_POINT_U = {"a": "u_acceleration_body_{}_m_s2", "v": "u_velocity_lab_{}_m_s", "x": "u_position_lab_{}_m"}


def columns(found: Kinematics) -> dict[str, FloatArray]:
    """Every curve (n,) by the name of its column, SI."""
    out = {"time_s": found.time}
    out |= _split("omega_{}_rad_s", found.omega) | _split("alpha_{}_rad_s2", found.alpha)
    out |= {f"{name}_rad": found.euler[:, i] for i, name in enumerate(("yaw", "pitch", "roll"))}
    out |= _split("quaternion_{}", found.quaternion, "xyzw")
    for name, path in found.paths.items():
        for attribute, (quantity, unit) in _POINT.items():
            out |= _split(f"{name}_{quantity}_{{}}_{unit}", getattr(path, attribute))
    for name, u in found.u.items():
        point, _, quantity = name.rpartition(" ")
        out |= _split(f"{point}_{_POINT_U[quantity]}" if point else _U[name], u)
    return out


def _split(pattern: str, values: FloatArray, letters: str = "xyz") -> dict[str, FloatArray]:
    return {pattern.format(letter): values[:, i] for i, letter in enumerate(letters)}


def files_of(path: Path) -> tuple[Path, ...]:
    """What a motion is written to: the file, and of a CAN log the database that describes it, beside it."""
    return (path, path.with_suffix(".dbc")) if path.suffix.lower() in motion_can.SUFFIXES else (path,)


def write_motion(found: Kinematics, path: Path, force: bool = False) -> tuple[str, ...]:
    """Write the motion in the format of the path's suffix, to `files_of` it, each whole or not at all; returns notes on
    what the format changed. ConfigurationError: unknown suffix, a file exists (unless `force`), or cannot be written.
    """
    writer, places = writer_of(path), files_of(path)
    for place in places:
        if place.exists() and not force:
            raise ConfigurationError(
                "the file exists", file=place, advice="choose another name, or overwrite it with --force"
            )
    partial = [partial_name(place) for place in places]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        notes = writer(found, partial[0])
        for part, place in zip(partial, places, strict=True):
            os.replace(part, place)
    except OSError as error:
        raise ConfigurationError(f"cannot be written: {error.strerror or error}", file=path) from error
    finally:
        for part in partial:
            part.unlink(missing_ok=True)
    return notes


def writer_of(path: Path) -> Writer:
    """The writer for the path's suffix; ConfigurationError names those there are."""
    suffix = path.suffix.lower()
    if suffix not in WRITERS:
        close = nearest(suffix, list(WRITERS)) if suffix else None
        raise ConfigurationError(
            "no format to write a motion in",
            file=path,
            found=path.suffix or "no suffix",
            expected="one of " + " ".join(WRITERS),
            advice=f"did you mean {close!r}?" if close else None,
        )
    return WRITERS[suffix]


def _write_can(found: Kinematics, path: Path) -> tuple[str, ...]:
    """A CAN log, and its database by the name that `files_of` gives."""
    error = motion_can.write_log(found, path, path.with_suffix(".dbc")).error
    worst = max(error, key=lambda signal: error[signal])
    return (f"its bits round off up to {error[worst]:.2g} (SI), most in {worst}",)


def _write_csv(found: Kinematics, path: Path) -> tuple[str, ...]:
    import csv

    table = columns(found)
    cells = [[repr(value) for value in column.tolist()] for column in table.values()]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(zip(*cells, strict=True))
    return ()


def _write_parquet(found: Kinematics, path: Path) -> tuple[str, ...]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = columns(found)
    arrays = [pa.Array.from_buffers(pa.float64(), c.size, [None, pa.py_buffer(c.tobytes())]) for c in table.values()]
    pq.write_table(pa.table(arrays, names=list(table)), path)
    return ()


def _write_mcap(found: Kinematics, path: Path) -> tuple[str, ...]:
    from mcap.writer import Writer

    stamps = np.rint(found.time * 1e9).astype(np.int64)
    origin = min(int(stamps[0]), 0)
    topics = _topics(found)
    with path.open("wb") as file:
        writer = Writer(file, enable_data_crcs=True)
        writer.start()
        writer.add_metadata("nineaudit", {MCAP_ORIGIN: str(origin), "method": found.method})
        channels = {topic: _register(writer, topic, schema) for topic, (schema, _) in topics.items()}
        for i, stamp in enumerate((stamps - origin).tolist()):
            head = {"timestamp": {"sec": stamp // 10**9, "nsec": stamp % 10**9}}
            for topic, (_, message) in topics.items():
                data = json.dumps(head | message(i)).encode()
                writer.add_message(channels[topic], log_time=stamp, data=data, publish_time=stamp, sequence=i)
        writer.finish()  # type: ignore[no-untyped-call]
    return ()


Message = Callable[[int], dict[str, Any]]


def _register(writer: Any, topic: str, schema: dict[str, Any]) -> int:
    number = writer.register_schema(schema["title"], "jsonschema", json.dumps(schema).encode())
    return int(writer.register_channel(topic, "json", number))


def _topics(found: Kinematics) -> dict[str, tuple[dict[str, Any], Message]]:
    """Schema and message of sample i, without its time stamp, of every topic."""
    turned, origin = _named(found.quaternion), _origin(found)
    frames = {"parent_frame_id": LABORATORY, "child_frame_id": BODY}
    whole = {"omega": _named(found.omega), "alpha": _named(found.alpha)}
    out: dict[str, tuple[dict[str, Any], Message]] = {
        "/tf": (FRAME_TRANSFORM, _message(**frames, translation=origin, rotation=turned)),
        "/motion": (_plain("nineaudit.Motion"), _message(**whole, euler=_named(found.euler, ("yaw", "pitch", "roll")))),
    }
    for name, path in found.paths.items():
        pose = {"position": _named(path.x), "orientation": turned}
        curves = {quantity: _named(getattr(path, attribute)) for attribute, (quantity, _) in _POINT.items()}
        safe = re.sub(r"\W+", "_", name)
        out[f"/pose/{safe}"] = (POSE_IN_FRAME, _message(frame_id=LABORATORY, pose=pose))
        out[f"/point/{safe}"] = (_plain("nineaudit.Point"), _message(**curves))
    return out


def _origin(found: Kinematics) -> list[dict[str, float]]:
    """The position of the body's origin in the laboratory, from any of its points: x − C r."""
    path = next(iter(found.paths.values()))
    return _named(path.x - np.einsum("nij,j->ni", found.attitude, found.points[next(iter(found.paths))]))


def _named(values: FloatArray, names: Sequence[str] = "xyzw") -> list[dict[str, float]]:
    return [dict(zip(names, row, strict=False)) for row in values.tolist()]


def _message(**fields: Any) -> Message:
    def at(value: Any, i: int) -> Any:
        if isinstance(value, list):
            return value[i]
        return {key: at(inner, i) for key, inner in value.items()} if isinstance(value, dict) else value

    return lambda i: {name: at(value, i) for name, value in fields.items()}


def _object(title: str, **properties: Any) -> dict[str, Any]:
    return {"title": title, "type": "object", "properties": properties}


def _plain(title: str) -> dict[str, Any]:
    return {"title": title, "type": "object"}


_NUMBER: Final = {"type": "number"}
_TEXT: Final = {"type": "string"}
_TIME: Final = _object("time", sec={"type": "integer", "minimum": 0}, nsec={"type": "integer", "minimum": 0})
_VECTOR: Final = _object("foxglove.Vector3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION: Final = _object("foxglove.Quaternion", x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
POSE_IN_FRAME: Final = _object(
    "foxglove.PoseInFrame",
    timestamp=_TIME,
    frame_id=_TEXT,
    pose=_object("foxglove.Pose", position=_VECTOR, orientation=_QUATERNION),
)
FRAME_TRANSFORM: Final = _object(
    "foxglove.FrameTransform",
    timestamp=_TIME,
    parent_frame_id=_TEXT,
    child_frame_id=_TEXT,
    translation=_VECTOR,
    rotation=_QUATERNION,
)
"""Well-known schemas of Foxglove, by their JSON names."""

WRITERS: Final[Mapping[str, Writer]] = {
    ".csv": _write_csv,
    ".parquet": _write_parquet,
    ".mcap": _write_mcap,
    ".blf": _write_can,
    ".asc": _write_can,
}
"""Writer of each suffix (lower case)."""
