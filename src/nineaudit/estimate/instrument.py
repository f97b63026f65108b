"""The array as calibration errors have it: axes and positions as they are, not as the rig says.

    axis (1 + g)(n + τ_1 u_1 + τ_2 u_2),  position r + e                                   (METHODS.md 1)

Sensor by sensor along rows, time along columns, so that whole records are a few matrix products.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nineaudit.array import BoolArray, FloatArray
from nineaudit.estimate import calibration


@dataclass(frozen=True, eq=False)
class Instrument:
    """`axes` (k,3) with their gain, `positions` (k,3) m, `held` (k,) the accelerometers, `across` (k,2,3) directions of
    the tilts, `gain` (k,) 1 + g that the axes have."""

    axes: FloatArray
    positions: FloatArray
    held: BoolArray
    across: FloatArray
    gain: FloatArray

    @cached_property
    def lever(self) -> FloatArray:
        """(k,3) r × n, what α is felt with; zero for rate sensors."""
        return np.where(self.held[:, None], np.cross(self.positions, self.axes), 0.0)

    @cached_property
    def axes_a(self) -> FloatArray:
        """(k,3) axes of the accelerometers, zero for rate sensors."""
        return np.where(self.held[:, None], self.axes, 0.0)

    def predict(self, features: FloatArray) -> FloatArray:
        """(k,n) readings in a motion, from calibration.features()."""
        return np.asarray(calibration.sensing(self.axes, self.positions, self.held) @ features)

    def sensitivities(self) -> FloatArray:
        """(k,6,15) change of the readings per unit of gain, tilts and position, from calibration.features()."""
        out = calibration.sensitivities(self.axes, self.positions, self.held, self.across)
        out[:, 0] /= self.gain[:, None]  # of the reading without its gain
        out[:, 1:3] *= self.gain[:, None, None]
        return out

    def by_omega(self, omega: FloatArray) -> FloatArray:
        """(k,3,n) derivative of the readings by ω (3,n) with α held: (r·ω)n + (n·ω)r − 2(n·r)ω, or n."""
        n, r = self.axes, self.positions
        outer = n[:, :, None] * r[:, None, :]
        along = np.einsum("kii->k", outer)[:, None, None] * np.eye(3)
        turning = np.where(self.held[:, None, None], outer + outer.transpose(0, 2, 1) - 2.0 * along, 0.0)
        constant = np.where(self.held[:, None], 0.0, n)
        return np.asarray((turning.reshape(-1, 3) @ omega).reshape(len(n), 3, -1) + constant[:, :, None])


def instrument(
    axes: FloatArray, positions: FloatArray, held: BoolArray, across: FloatArray, error: FloatArray
) -> Instrument:
    """The instrument with the errors (k,8) of calibration.PARAMETERS, SI."""
    gain = 1.0 + error[:, 0]
    turned = axes + np.einsum("kj,kji->ki", error[:, 2:4], across)
    return Instrument(gain[:, None] * turned, positions + error[:, 4:7], held, across, gain)
