"""Entries of a lake without recordings: what six channels of a rig tell of errors that are given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date, timedelta
from typing import Any

import numpy as np

from nineaudit.report.sensors import _text

Entry = dict[str, Any]
AXES = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1))
POSITIONS = ((0, 0, 0), (0, 0, 0), (0, 0, 0), (0.05, 0, 0), (0.05, 0, 0), (0, 0.05, 0))
PRIOR = {"gain": 0.005, "tilt_1": 0.01, "tilt_2": 0.01} | {f"position_{c}": 5e-4 for c in "xyz"}
SERIALS = tuple(f"S{c}" for c in range(6))


def entry(
    number: int,
    theta: Mapping[tuple[int, str], float],
    *,
    serials: Sequence[str | None] = SERIALS,
    rig: str = "head",
    kinds: Sequence[str] = ("accelerometer",) * 6,
    parameters: Sequence[str] = ("gain",),
    tell: float = 20.0,
    scale: Sequence[float] = (1.0,) * 6,
    positions: Sequence[Sequence[float]] = POSITIONS,
    axes: Sequence[Sequence[float]] = AXES,
    **changes: Any,
) -> Entry:
    """Test `number`, a day later than the one before, with errors `theta` (SI) by channel number and parameter, told to
    prior/√tell, and scattering by 0.2 prior; what all have in common is hardly seen. `changes`: uri, test, recording,
    rig_sha256."""
    rng = np.random.default_rng(number)
    names = [(c, p) for c in range(6) for p in parameters]
    matrix = tell * (np.eye(len(names)) - 0.98 * np.ones((len(names),) * 2) / len(names))
    errors = np.array([theta.get(name, 0.0) / PRIOR[name[1]] for name in names]) + 0.2 * rng.standard_normal(len(names))
    eta = matrix @ errors + np.linalg.cholesky(matrix) @ rng.standard_normal(len(names))
    told = {
        "parameters": [[f"a{c}", p] for c, p in names],
        "prior": [PRIOR[p] for _, p in names],
        "eta": _text(eta),
        "matrix": _text(matrix[np.triu_indices(len(names))]),
    }
    stated = [{"scale": scale[c], "position": list(positions[c]), "axis": list(axes[c])} for c in range(6)]
    channels = [_channel(c, serials[c], kinds[c]) | stated[c] for c in range(6)]
    uri = changes.get("uri", f"T{number:03d}.csv")
    day = (date(2026, 1, 1) + timedelta(number)).isoformat()
    result = {
        "rig": {"name": rig, "sha256": changes.get("rig_sha256", "0" * 64)},
        "recording": {"path": uri, "sha256": f"{number:064x}"} | changes.get("recording", {}),
        "sensors": {"channels": channels, "information": told, "fit": "all channels"},
    }
    return {"uri": uri, "test": {"date": day} | changes.get("test", {}), "result": result}


def _channel(number: int, serial: str | None, kind: str) -> dict[str, Any]:
    return {"channel": f"a{number}", "serial": serial, "kind": kind, "shock": 1000.0 + 100.0 * number}
