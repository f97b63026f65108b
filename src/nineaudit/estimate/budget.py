"""Error-propagation budget of α (METHODS.md 5; root sum of squares, GUM 5.1.2; Martin98 eq 22).

α = L y with L product-free where the array has such a combination, else K of the least squares, so each source
of channel i contributes L_i δy_i(t), with δy_i the calibration columns of one standard deviation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.errors import EstimationError
from nineaudit.estimate import calibration
from nineaudit.estimate.motion import OFF_IDEAL, Motion, bridge, has_rates
from nineaudit.physics import rigid_body


@dataclass(frozen=True, eq=False)
class AlphaBudget:
    """Standard uncertainty of α at its peak, rad/s²: `peak` |α|, its sample `row`, and `rows` by source, the
    root of the summed squares of the three components; `total` of them all."""

    peak: float
    row: int
    rows: dict[str, float]
    total: float


def alpha_combination(array: SensorArray) -> FloatArray:
    """(3,a) rows that give α from the accelerometers: product-free if there is one, else least squares.

    EstimationError where the accelerometers do not span α.
    """
    held = array.is_accelerometer
    positions, axes = array.positions[held], array.axes[held]
    design = rigid_body.design(positions, axes)
    if has_rates(array) and len(design) and np.linalg.matrix_rank(design, tol=1e-6) == 6:
        return np.asarray(np.linalg.pinv(design)[3:])
    return rigid_body.product_free_alpha(positions, axes, leak=OFF_IDEAL)


def alpha_budget(
    array: SensorArray, time: FloatArray, readings: FloatArray, sigma: FloatArray, motion: Motion
) -> AlphaBudget:
    """Budget of α where |α| peaks. `readings` (n,k) SI zeroed, `sigma` (k,) their noise."""
    combination = alpha_combination(array)
    size = np.linalg.norm(motion.alpha, axis=1)
    row = int(np.argmax(size))
    patterns = calibration.all_columns(array, bridge(readings, time), time, motion)[array.is_accelerometer, row]
    reach = (combination**2).sum(axis=0)
    parts = {
        source: float(np.sqrt(sum(reach @ patterns[:, calibration.PARAMETERS.index(m)] ** 2 for m in members)))
        for source, members in calibration.SOURCES.items()
    }
    parts["noise"] = float(np.sqrt(reach @ sigma[array.is_accelerometer] ** 2))
    total = float(np.sqrt(sum(v**2 for v in parts.values())))
    if not np.isfinite(total):
        raise EstimationError("the budget of α is not finite; a position, axis or reading is missing")
    return AlphaBudget(float(size[row]), row, parts, total)
