"""A recording from arrays, for tests of single channels and of files that no reader is needed for."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.readers.clocks.assemble import assemble
from nineaudit.readers.contents import Contents
from nineaudit.recording import Recording, Source, Trace
from nineaudit.rig import parse_rig


def recording(
    time: FloatArray | Mapping[str, FloatArray],
    columns: Mapping[str, FloatArray],
    *,
    gyros: tuple[str, ...] = (),
    units: str = "",
    noise: Mapping[str, float] | None = None,
    full_scale: Mapping[str, float] | None = None,
    recording_table: str = "",
) -> Recording:
    """Channels of (n,) values in the rig's unit (m/s² and rad/s unless `units` says otherwise), all along x."""
    text = f'[units]\nacceleration = "m/s^2"\n{units}\n[recording]\n{recording_table}\n'
    for name in columns:
        kind = "gyroscope" if name in gyros else "accelerometer"
        text += f'[[sensor]]\nchannel = "{name}"\nkind = "{kind}"\nposition = [0, 0, 0]\naxis = [1, 0, 0]\n'
        text += f"noise = {noise[name]}\n" if noise and name in noise else ""
        text += f"range = {full_scale[name]}\n" if full_scale and name in full_scale else ""
    traces = tuple(
        Trace(name, name, np.asarray(time[name] if isinstance(time, Mapping) else time, float), np.asarray(v, float))
        for name, v in columns.items()
    )
    return assemble(Contents(traces), parse_rig(text), Source(Path("test"), "test", "", 0))
