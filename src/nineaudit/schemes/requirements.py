"""What a scheme asks of array and readings, refused in one sentence that names the quantity and what to change."""

from __future__ import annotations

from typing import Final

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.errors import EstimationError
from nineaudit.estimate import parity
from nineaudit.estimate.motion import has_rates
from nineaudit.physics import rigid_body
from nineaudit.units import counted

LARGEST: Final = 1e9
"""SI: a hundred million g, beyond what any sensor reads, and far from where squares overflow."""


def require_alpha(array: SensorArray) -> None:
    """EstimationError, with rank and condition number of H (lengths in units of the array's size), where the
    accelerometers do not tell α: a fit would leave it to differences of ω."""
    if parity.tells_alpha(array):
        return
    held = array.is_accelerometer
    positions, axes = array.positions[held], array.axes[held]
    rank, condition = 0, "infinite"
    if len(axes):
        rank = int(np.linalg.matrix_rank(rigid_body.design(positions, axes), tol=1e-6))
        size = float(np.ptp(positions, axis=0).max()) or 1.0
        scaled = rigid_body.design((positions - positions.mean(axis=0)) / size, axes)
        singular = np.linalg.svd(scaled, compute_uv=False)
        if len(singular) == 6 and singular[5] > 1e-12 * singular[0]:
            condition = f"{singular[0] / singular[5]:.2g}"
    more = "six accelerometers or more, not all along one axis nor at points on one line, tell α"
    raise EstimationError(
        "the accelerometers do not tell α, and the fit leaves it to differences of ω",
        found=f"{counted(len(axes), 'accelerometer')}, H of rank {rank}, condition number {condition}",
        expected="rank 6",
        advice=f"use --method rates; {more}" if has_rates(array) else f"{more}: add some, or move one",
    )


def require_acceleration(array: SensorArray) -> None:
    """EstimationError where the accelerometers do not tell the acceleration of the origin, ω and α being known."""
    axes = array.axes[array.is_accelerometer]
    rank = int(np.linalg.matrix_rank(axes, tol=1e-3)) if len(axes) else 0
    if rank < 3:
        raise EstimationError(
            "no accelerometers on three axes: accelerations, velocities and paths are not known",
            found=f"{counted(len(axes), 'accelerometer')}, axes of rank {rank}",
            expected="rank 3",
            advice="add accelerometers along the axes that have none",
        )


def require_readings(array: SensorArray, readings: FloatArray, *, each: bool = False) -> None:
    """EstimationError unless `readings` (n,k) SI have a valid sample, of `each` channel if so asked, and are of a size
    that sensors have."""
    dead = [array.channels[k] for k in np.flatnonzero(~np.isfinite(readings).any(axis=0))]
    if dead and (each or len(dead) == len(array)):
        raise EstimationError(
            f"{'channels' if len(dead) > 1 else 'channel'} {', '.join(dead)} without a valid sample",
            expected="readings",
            advice="take it out of the rig file" if len(dead) < len(array) else "are signal names and units right?",
        )
    size = np.nanmax(np.abs(readings), axis=0, initial=0.0)
    if size.max() > LARGEST:
        worst = int(np.argmax(size))
        raise EstimationError(
            "a reading that no sensor gives",
            place=f"channel {array.channels[worst]}",
            found=f"{size[worst]:.3g} {'m/s²' if array.is_accelerometer[worst] else 'rad/s'}",
            expected=f"at most {LARGEST:g}",
            advice="is its unit right, in the recording and in the rig file?",
        )
