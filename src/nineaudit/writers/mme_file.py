"""ISO-MME (ISO/TS 13499), so that readings go back to a laboratory's database: a ZIP archive, or a .mme file with its
folder Channel beside it. Readings that are not valid are NOVALUE."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from nineaudit.array import FloatArray, Sensor
from nineaudit.recording import Recording
from nineaudit.signals import in_unit
from nineaudit.units import counted
from nineaudit.writers.mme_place import CHANNEL
from nineaudit.writers.outcome import Outcome

_CODE: Final = re.compile(r"[0-9A-Z?]{16}")
_FILTERS: Final = {"CFC1000": "A", "CFC600": "B", "CFC180": "C", "CFC60": "D"}
_UNITS: Final = {"g_0": "g"}
_CLOCK: Final = "1?TIRS000000TI00"
_EXACT: Final = 1e-9
"""s that the times of a regular clock may be off those of the recording."""
_DATE: Final = (1980, 1, 1, 0, 0, 0)

Put = Callable[[str, str], None]
Header = dict[str, str]


def write_mme_zip(recording: Recording, readings: FloatArray, path: Path, _: Sequence[Path]) -> Outcome:
    """The test as an archive; the same recording gives the same bytes."""
    with zipfile.ZipFile(path, "x", zipfile.ZIP_DEFLATED) as archive:

        def put(name: str, text: str) -> None:
            entry = zipfile.ZipInfo(name, _DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, text.encode())

        return _write(recording, readings, _stem(path), put, f"{_stem(path)}.mme")


def write_mme(recording: Recording, readings: FloatArray, path: Path, _: Sequence[Path]) -> Outcome:
    """The test as a .mme file and the folder Channel beside it, neither of which is there yet."""
    (path.parent / CHANNEL).mkdir()

    def put(name: str, text: str) -> None:
        (path.parent / name).write_text(text, encoding="utf-8", newline="\n")

    return _write(recording, readings, path.stem, put, path.name)


def _stem(path: Path) -> str:
    """Name of the test: write_recording gives the name of its partial file, `.NAME.process.zip`."""
    found = re.fullmatch(r"\.(.+)\.\d+", path.stem)
    return found[1] if found else path.stem


def _write(recording: Recording, readings: FloatArray, stem: str, put: Put, header: str) -> Outcome:
    columns = {sensor.signal: i for i, sensor in enumerate(recording.rig.array.sensors)}
    clock = _clock(recording.time)
    channels = [_channel(recording, readings, column, clock) for column in columns.values()]
    if "Reference channel name" in clock:
        channels.append((_time_header(recording), recording.time))
    for i, (keys, values) in enumerate(channels, 1):
        put(f"{CHANNEL}/{stem}.{i:03d}", _text(keys) + "".join(f"{_cell(value)}\n" for value in values.tolist()))
    index = {"Number of channels": str(len(channels))}
    for i, (keys, _) in enumerate(channels, 1):
        index[f"Name of channel {i:03d}"] = f"{keys['Channel code']} / {keys['Name of the channel']}"
    put(f"{CHANNEL}/{stem}.chn", _text(index))
    put(header, _text(_test(recording)))
    made_up = [s.channel for s in recording.rig.array.sensors if not _CODE.fullmatch(s.signal)]
    note = f"channel codes made up, for the rig names none: {', '.join(made_up)}"
    return Outcome(notes=(note,) if made_up else ())


def _channel(recording: Recording, readings: FloatArray, column: int, clock: Header) -> tuple[Header, FloatArray]:
    """Header and numbers, in the rig's unit, of one channel."""
    sensor = recording.rig.array.sensors[column]
    values = in_unit(readings[:, column], sensor.to_si, sensor.offset)
    before = recording.readings[:, column]
    changed = int(np.count_nonzero((readings[:, column] != before) & ~(np.isnan(before) & np.isnan(values))))
    valid = np.isfinite(values)
    keys = {
        "Test object number": "1",
        "Name of the channel": sensor.signal,
        "Laboratory channel code": sensor.channel,
        "Customer channel code": "NOVALUE",
        "Channel code": _code(sensor, column, recording.rig.filter_class),
        "Location": "NOVALUE",
        "Dimension": "AC" if sensor.kind == "accelerometer" else "AV",
        "Direction": _direction(sensor),
        "Channel frequency class": recording.rig.filter_class.removeprefix("CFC").replace("none", "NOVALUE"),
        "Unit": _UNITS.get(sensor.unit, sensor.unit.replace("/s^2", "/(s*s)")),
        "Reference system": "NOVALUE",
        "Transducer id": sensor.serial or "NOVALUE",
        "Bit resolution": "NOVALUE",
        **clock,
        "Number of samples": str(values.size),
        "Data source": _source(recording, changed),
        "Data status": "ok" if valid.any() else "no data",
    }
    if valid.any():
        keys |= _extremes(values, recording.time)
    if changed:
        keys["Comments"] = f"{counted(changed, 'sample')} rebuilt by nineaudit; the original is not altered"
    return keys, values


def _source(recording: Recording, changed: int) -> str:
    if recording.source.format == "simulation":
        return "simulation"
    return "calculation" if changed else "transducer"


def _extremes(values: FloatArray, time: FloatArray) -> Header:
    high, low = int(np.nanargmax(values)), int(np.nanargmin(values))
    return {
        "First global maximum value": repr(float(values[high])),
        "Time of maximum value": repr(float(time[high])),
        "First global minimum value": repr(float(values[low])),
        "Time of minimum value": repr(float(time[low])),
    }


def _code(sensor: Sensor, column: int, filter_class: str) -> str:
    """The signal where it is a channel code, else one with the place unknown (?) and the column as fine location 1."""
    if _CODE.fullmatch(sensor.signal):
        return sensor.signal
    dimension = "AC" if sensor.kind == "accelerometer" else "AV"
    return f"1?????{column % 100:02d}0000{dimension}{_direction(sensor)}{_FILTERS.get(filter_class, '0')}"


def _direction(sensor: Sensor) -> str:
    """X, Y, Z along an axis of the body, 1, 2, 3 against it; 0 for any other."""
    axis = int(np.argmax(np.abs(sensor.axis)))
    if abs(sensor.axis[axis]) < 1 - 1e-6:
        return "0"
    return ("XYZ" if sensor.axis[axis] > 0 else "123")[axis]


def _clock(time: FloatArray) -> Header:
    """An implicit clock where the samples are regular, else the name of the channel that has the times."""
    step = float(time[-1] - time[0]) / (time.size - 1) if time.size > 1 else 1.0
    if np.abs(time[0] + step * np.arange(time.size) - time).max() <= _EXACT:
        return {
            "Reference channel": "implicit",
            "Sampling interval": repr(_round(step, time)),
            "Time of first sample": repr(float(time[0])),
        }
    return {"Reference channel": "explicit", "Reference channel name": _CLOCK}


def _round(step: float, time: FloatArray) -> float:
    """The interval with few digits where that is as good."""
    short = float(f"{step:.9g}")
    fits = np.abs(time[0] + short * np.arange(time.size) - time).max() <= _EXACT / 100
    return short if fits else step


def _time_header(recording: Recording) -> Header:
    return {
        "Test object number": "1",
        "Name of the channel": "Time reference channel",
        "Channel code": _CLOCK,
        "Dimension": "TI",
        "Unit": "s",
        "Number of samples": str(recording.time.size),
        "Data source": "calculation",
        "Data status": "ok",
    }


def _test(recording: Recording) -> Header:
    """The header of the test: what is known of it, and where the readings come from."""
    source, test = recording.source, recording.test
    return {
        "Data format edition number": "1.6",
        "Laboratory name": test.laboratory or "NOVALUE",
        "Customer name": test.customer or "NOVALUE",
        "Customer test ref. number": "NOVALUE",
        "Title": test.title or "NOVALUE",
        "Medium No. / number of media": "1 / 1",
        "Type of the test": "NOVALUE",
        "Laboratory test ref. number": test.number or "NOVALUE",
        "Date of the test": test.date or "NOVALUE",
        "Number of test objects": "1",
        "Name of test object 1": test.item or "NOVALUE",
        "Ref. number of test object 1": test.item_serial or "NOVALUE",
        "Comments": f"written by nineaudit from {source.path.name} (SHA-256 {source.sha256}), which is not altered",
    }


def _text(keys: Header) -> str:
    return "".join(f"{key:<28}:{value}\n" for key, value in keys.items())


def _cell(value: float) -> str:
    return "NOVALUE" if value != value else repr(value)
