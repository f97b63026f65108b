"""What a calibration changes in a rig file: the keys of a channel's [[sensor]] table, in the file's own units."""

from __future__ import annotations

import math

from nineaudit.array import FloatArray, Sensor
from nineaudit.calibrating.fit import Calibration
from nineaudit.calibrating.path import PathGain

Keys = dict[str, float | list[float]]
_DIGITS = 9
"""Of numbers in the rig file: a thousand times finer than any calibration."""
_DIGITS_U = 4
"""Of uncertainties."""


def of_sensor(done: Calibration, reference_u: float = 0.0) -> Keys:
    """scale, offset, axis and their uncertainties of a sensor that was calibrated with its path.

    `reference_u`: relative standard uncertainty of the known input, common to all runs and so not in the fit's own;
    it is added to that of the gain in squares.
    """
    keys: Keys = {
        "scale": _short(done.scale),
        "offset": _short(done.offset),
        "gain": _short(math.hypot(done.u_scale / done.scale, reference_u), _DIGITS_U),
        "zero": _short(done.u_offset, _DIGITS_U),
    }
    if done.u_tilt is not None:
        keys |= {"axis": _vector(done.axis), "alignment_deg": _short(math.degrees(done.u_tilt), _DIGITS_U)}
    elif done.tilt:
        keys["axis"] = _vector(done.axis)
    return keys


def of_path(done: PathGain, sensor: Sensor, reference_u: float = 0.0) -> Keys:
    """scale and offset of sensor and path together, and their uncertainties, squares added."""
    before = sensor.offset / sensor.to_si
    relative = math.sqrt(sensor.u_gain**2 + (done.u_gain / done.gain) ** 2 + reference_u**2)
    return {
        "scale": _short(done.gain * sensor.scale),
        "offset": _short(done.gain * before + done.offset),
        "gain": _short(relative, _DIGITS_U),
        "zero": _short(math.hypot(done.gain * sensor.u_zero / sensor.to_si, done.u_offset), _DIGITS_U),
    }


def _short(value: float, digits: int = _DIGITS) -> float:
    return float(f"{value:.{digits}g}")


def _vector(values: FloatArray) -> list[float]:
    return [round(float(v), _DIGITS) + 0.0 for v in values]
