"""A triax more than the motion needs: what the others predict for it, judged by HIC and GSI [Alem77, sled test].

The paper's sled gave HIC 694 predicted against 696 measured (−0.29 %) and GSI 873 against 880 (−0.80 %).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.errors import ConfigurationError
from nineaudit.estimate.motion import Motion, bridge
from nineaudit.physics import injury, kinematics, rigid_body

HIC_TOLERANCE, GSI_TOLERANCE = 0.0029, 0.0080
"""Relative deviations of the paper's sled, taken as tolerances (METHODS 7.2)."""
WINDOW: Final = 0.036
"""Longest HIC window, s."""
APART: Final = 0.005
"""Farthest that the three seismic masses of one triax may lie from their middle, m."""


class Prediction(NamedTuple):
    """HIC36 and GSI (g^2.5 s) of the triax as `measured` and as `predicted`, and their largest difference in
    acceleration over the measured peak, `worst`."""

    hic_measured: float
    hic_predicted: float
    gsi_measured: float
    gsi_predicted: float
    worst: float

    @property
    def hic_deviation(self) -> float:
        """Predicted over measured HIC, less 1."""
        return self.hic_predicted / self.hic_measured - 1.0

    @property
    def gsi_deviation(self) -> float:
        """Predicted over measured GSI, less 1."""
        return self.gsi_predicted / self.gsi_measured - 1.0

    @property
    def passed(self) -> bool:
        """Whether both are within the deviations of the paper."""
        return abs(self.hic_deviation) <= HIC_TOLERANCE and abs(self.gsi_deviation) <= GSI_TOLERANCE


def triax_columns(array: SensorArray, prefix: str) -> list[int]:
    """Columns of the three accelerometers whose names begin with `prefix`, one triax.

    ConfigurationError, naming what was found, unless they are three, in one place, along three independent axes.
    """
    columns = [i for i, s in enumerate(array.sensors) if s.channel.startswith(prefix) and s.kind == "accelerometer"]
    named = ", ".join(array.channels[c] for c in columns) or "none"
    if len(columns) != 3:
        raise ConfigurationError(
            "no triax by that name",
            place="--check-triax",
            found=f"{prefix}: {named}",
            expected="a beginning that three accelerometers share",
            advice="the rig has " + ", ".join(array.channels),
        )
    places, axes = array.positions[columns], array.axes[columns]
    spread = float(np.linalg.norm(places - places.mean(axis=0), axis=1).max())
    rank = int(np.linalg.matrix_rank(axes, tol=1e-2))
    if spread > APART or rank < 3:
        raise ConfigurationError(
            f"{named} are no triax",
            place="--check-triax",
            found=f"{1e3 * spread:.3g} mm from their middle, axes of rank {rank}",
            expected=f"at most {1e3 * APART:g} mm, rank 3",
        )
    return columns


def check(
    array: SensorArray, columns: Sequence[int], time: FloatArray, readings: FloatArray, motion: Motion
) -> Prediction:
    """The triax in `columns` of `readings` (n,k) SI against what `motion`, made without it, predicts there."""
    held = list(columns)
    positions, axes = array.positions[held], array.axes[held]
    predicted = rigid_body.predict(positions, axes, np.ones(3, dtype=np.bool_), motion.a0, motion.alpha, motion.omega)
    solve = np.linalg.inv(axes).T
    seen, told = bridge(readings[:, held], time) @ solve, predicted @ solve
    sizes = [kinematics.resultant(a) for a in (seen, told)]
    hics = [injury.hic(size, time, WINDOW).value for size in sizes]
    gsis = [injury.gsi(size, time) for size in sizes]
    worst = float(kinematics.resultant(told - seen).max() / sizes[0].max())
    return Prediction(hics[0], hics[1], gsis[0], gsis[1], worst)
