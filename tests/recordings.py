"""One motion in every format, for the tests of readers and writers."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

from mcap_logs import Messages, in_encoding
from nineaudit.recording import Recording
from nineaudit.rig import Rig, parse_rig
from nineaudit.simulate import simulate
from nineaudit.writers import make_dbc, write_recording

SENSORS = {
    "a0x": ("accelerometer", (0, 0, 0), (1, 0, 0), "NAAP_A.A0X"),
    "a0y": ("accelerometer", (0, 0, 0), (0, 1, 0), "NAAP_A.A0Y"),
    "a0z": ("accelerometer", (0, 0, 0), (0, 0, 1), "NAAP_A.A0Z"),
    "a1y": ("accelerometer", (50, 0, 0), (0, 1, 0), "NAAP_B.A1Y"),
    "a1z": ("accelerometer", (50, 0, 0), (0, 0, 1), "NAAP_B.A1Z"),
    "wx": ("gyroscope", (0, 0, 0), (1, 0, 0), "NAAP_B.WX"),
}
CAN_FORMATS = (".blf", ".asc", ".log", ".trc", ".can.csv", ".mf4", ".db")
MCAP_FORMATS = (".ros2.mcap", ".ros1.mcap", ".protobuf.mcap")
TABLE_FORMATS = (".csv", ".tsv", ".txt", ".parquet", ".mcap", ".mme", ".zip")


def rig_text(extra: str = "", recording: str = 'time = "time_s"') -> str:
    """A small rig with accelerations in g_0, rates in deg/s and signals named Message.Signal."""
    text = f'[rig]\nname = "test"\n[units]\nangular_rate = "deg/s"\n[recording]\n{recording}\n{extra}\n'
    for channel, (kind, position, axis, signal) in SENSORS.items():
        text += (
            f'[[sensor]]\nchannel = "{channel}"\nkind = "{kind}"\nposition = {list(map(float, position))}\n'
            f'axis = {list(map(float, axis))}\nsignal = "{signal}"\n'
            f"range = {2000.0 if kind == 'gyroscope' else 500.0}\n"
        )
    return text


def array_rig(recording: str = 'time = "time_s"') -> Rig:
    return parse_rig(rig_text(recording=recording))


def motion(rig: Rig, *, duration_s: float = 0.05) -> Recording:
    """A general motion, 10 kHz, from before 0."""
    return simulate(rig, "general", seed=3, duration_s=duration_s).recording


def database(rig: Rig, folder: Path) -> Path:
    path = folder / "rig.dbc"
    path.write_text(make_dbc(rig), encoding="utf-8")
    return path


def write_any(recording: Recording, folder: Path, suffix: str) -> Path:
    """Write in one of the formats above; those that only python-can writes go through its own writers."""
    path = folder / f"recording{suffix}"
    if suffix in (".log", ".trc", ".can.csv", ".mf4", ".db"):
        return _by_python_can(recording, folder, path, suffix)
    if suffix in MCAP_FORMATS:
        return by_mcap(recording, path, suffix.split(".")[1])
    write_recording(recording, path, dbc=database(recording.rig, folder))
    return path


def _by_python_can(recording: Recording, folder: Path, path: Path, suffix: str) -> Path:
    import can

    shifted = replace(recording, time=recording.time - recording.time[0])
    source = folder / "source.blf"
    write_recording(shifted, source, dbc=database(recording.rig, folder), force=True)
    writers = {".log": can.CanutilsLogWriter, ".trc": can.TRCWriter, ".can.csv": can.CSVWriter}
    writers |= {".mf4": can.MF4Writer, ".db": can.SqliteWriter}
    with can.BLFReader(source) as frames, writers[suffix](path) as out:
        for frame in frames:
            frame.timestamp += 1_700_000_000.0
            out.on_message_received(frame)
        while suffix == ".db" and not out.buffer.empty():  # what waits when it is stopped, python-can loses
            time.sleep(0.01)
    return path


def by_mcap(recording: Recording, path: Path, encoding: str) -> Path:
    """Through the mcap library, as a message of messages: the rig's signals are their fields."""
    sensors = recording.rig.array.sensors
    messages: Messages = {}
    for k, sensor in enumerate(sensors):
        name, _, field = sensor.signal.partition(".")
        messages.setdefault(name, {})[field] = (recording.readings[:, k] / sensor.to_si).tolist()
    in_encoding(path, encoding, recording.time.tolist(), messages)
    return path
