"""The `sensors` block of the result: what a campaign combines by serial number (campaign/health).

Calibration and shock in SI, peaks in the rig's unit. The likelihood of the calibration is packed: float32,
little-endian, base64.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from nineaudit.estimate.calibration import PARAMETERS
from nineaudit.report.numbers import plain, sensor_edge
from nineaudit.units import G0, factor

if TYPE_CHECKING:
    from nineaudit.array import FloatArray, Sensor
    from nineaudit.estimate.calibrated import Calibrated
    from nineaudit.estimate.information import Information
    from nineaudit.rig import Rig
    from nineaudit.sensed import Sensed


def sensors_document(told: Sensed, rig: Rig) -> dict[str, Any]:
    """Channels with peak, shock and calibration, and what the data alone say of all of them together."""
    shock = np.array([p for s, p in zip(rig.array.sensors, told.peaks, strict=True) if s.kind == "accelerometer"])
    hardest = float(np.nanmax(shock)) if np.isfinite(shock).any() else None
    return {
        "channels": [_channel(i, told, rig, hardest) for i in range(len(rig.array))],
        "parameters": list(PARAMETERS),
        "fit": told.fit,
        "statistic": plain(told.statistic),
        "information": None if told.information is None else _packed(told.information, rig),
    }


def unpacked(block: Mapping[str, Any]) -> tuple[FloatArray, FloatArray]:
    """(p,) η and (p,p) Λ of an `information` block, in prior standard deviations."""
    eta = _floats(block["eta"])
    matrix = np.zeros((len(eta), len(eta)))
    matrix[np.triu_indices(len(eta))] = _floats(block["matrix"])
    return eta, matrix + np.triu(matrix, 1).T


def _packed(told: Information, rig: Rig) -> dict[str, Any]:
    names, upper = rig.array.channels, np.triu_indices(len(told.eta))
    size = np.sqrt(np.maximum(np.diag(told.matrix), 1e-12))
    return {
        "parameters": [[names[c], PARAMETERS[p]] for c, p in zip(told.channel, told.parameter, strict=True)],
        "prior": plain(told.prior),
        "eta": _text(_cut(told.eta, size)),
        "matrix": _text(_cut(told.matrix, np.outer(size, size))[upper]),
    }


def _cut(values: FloatArray, size: FloatArray) -> FloatArray:
    """To a millionth of `size`, a power of two: what rounding makes of the last digits is another on each machine."""
    step = 2.0 ** (np.floor(np.log2(size)) - 20.0)
    return np.asarray(np.round(values / step) * step)


def _text(values: FloatArray) -> str:
    return base64.b64encode(values.astype("<f4").tobytes()).decode("ascii")


def _floats(text: str) -> FloatArray:
    return np.frombuffer(base64.b64decode(text), dtype="<f4").astype(np.float64)


def _channel(index: int, told: Sensed, rig: Rig, hardest: float | None) -> dict[str, Any]:
    """One channel; `shock` of a rate sensor is that of the hardest hit accelerometer."""
    sensor, peak = rig.array.sensors[index], float(told.peaks[index])
    unit, one = sensor_edge(sensor, rig)
    return {
        "channel": sensor.channel,
        "serial": sensor.serial,
        "kind": sensor.kind,
        "unit": unit,
        "peak": plain(peak / one),
        "shock": plain(peak if sensor.kind == "accelerometer" else hardest),
        "scale": plain(stated_scale(sensor)),
        "position": plain(sensor.position),
        "axis": plain(sensor.axis),
        "calibration": None if told.calibration is None else _errors(told.calibration, index),
    }


def stated_scale(sensor: Sensor) -> float:
    """Units of the recording per unit of the quantity, as the rig states the sensor: its scale; in mV its sensitivity,
    per g_0 or °/s."""
    rate = sensor.kind == "gyroscope"
    if sensor.unit == "mV":
        return float((np.pi / 180.0 if rate else G0) / sensor.to_si)
    return factor(sensor.unit, "angular_rate" if rate else "acceleration") / sensor.to_si


def _errors(values: Calibrated, index: int) -> dict[str, Any]:
    """Value, standard uncertainty and the rig's, in the order of PARAMETERS; null where nothing is open."""
    return {name: [_short(v) for v in getattr(values, name)[index]] for name in ("value", "u", "prior")}


def _short(value: float) -> float | None:
    """Four digits: finer than any of these is known."""
    return float(f"{value:.3e}") + 0.0 if np.isfinite(value) else None
