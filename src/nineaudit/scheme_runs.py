"""The schemes of the papers by name, as functions of the readings of one case."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from nineaudit.array import FloatArray, SensorArray
from nineaudit.case import Case
from nineaudit.errors import EstimationError
from nineaudit.estimate import parity
from nineaudit.estimate.motion import Motion, estimate_motion, has_rates
from nineaudit.estimate.smoothed_rates import smoothed_rates
from nineaudit.estimate.trajectory import Fit, fit
from nineaudit.schemes import growth, martin, ninacc, rgla, takhounts
from nineaudit.schemes.requirements import require_alpha

Scheme = Callable[[FloatArray], Motion]
"""Readings (m,k) SI of the blocks of a case to the motion; EstimationError where the sensors do not allow it."""


def schemes_of(case: Case) -> dict[str, Scheme]:
    """Schemes by name: readings (m,k) of the blocks to a motion; each refuses with an EstimationError."""
    blocks, array = case.condensed, case.array
    time, sigma = blocks.time, blocks.sigma
    fitted: list[Fit] = []

    def by_map(readings: FloatArray) -> Motion:
        if has_rates(array) and not parity.tells_alpha(array):
            return smoothed_rates(array, time, readings, sigma)
        require_alpha(array)
        data = replace(case.fit_data, readings=readings)
        fitted.append(fit(data, fitted[0].omega, fitted[0].theta) if fitted else case.healthy)
        return fitted[-1].motion

    def by_fit_at_its_word(readings: FloatArray) -> Motion:
        require_alpha(array)
        return takhounts.optimise(replace(case.fit_data, readings=readings)).motion

    def by_padgaonkar(readings: FloatArray) -> Motion:
        held = _accelerometers(array)
        chosen = array.select(held)
        return estimate_motion(chosen, time, readings[:, held], sigma[held], _rest(case))

    def by_rates(readings: FloatArray) -> Motion:
        if not has_rates(array):
            raise EstimationError("no rate sensors on three axes")
        return estimate_motion(array, time, readings, sigma)

    def by_ninacc(readings: FloatArray) -> Motion:
        start = _rest(case)
        found = ninacc.forward(array, time[start:], readings[start:], np.zeros(3), sigma[_accelerometers(array)] ** 2)
        return _from(found, start)

    def by_six_accelerometers(readings: FloatArray) -> Motion:
        start = _rest(case)
        return _from(growth.motion(array, time[start:], readings[start:], np.zeros(3))[0], start)

    return {
        "map": by_map,
        "optimised": by_fit_at_its_word,
        "product-free": by_padgaonkar,
        "ninacc": by_ninacc,
        "six-accelerometers": by_six_accelerometers,
        "rates": by_rates,
        "periphery": lambda y: martin.periphery(array, time, y, sigma),
        "co-planar": lambda y: martin.coplanar(array, time, y, sigma),
        "compact-cube": lambda y: martin.compact_cube(array, time, y, sigma),
        "rgla": lambda y: rgla.motion(array, time, y, sigma),
        "rgla-fourier": lambda y: rgla.motion(array, time, y, sigma, "fourier"),
        "rgla-lanczos": lambda y: rgla.motion(array, time, y, sigma, "lanczos"),
    }


def remarks(case: Case, omega: FloatArray) -> tuple[str, ...]:
    """What this motion tells of the sensors besides, in words: cross-axis sensitivity with its rank, and the bandwidth
    of `omega` (m,3) rad/s on the blocks."""
    return _cross_axis(case), _bandwidth(case, omega)


def _cross_axis(case: Case) -> str:
    """[Takhounts09]: his optimisation cannot undo it; a joint fit can, as far as its rank goes."""
    what = "cross-axis sensitivity, fitted with the motion"
    try:
        found = takhounts.fit_sensitivity(case.fit_data)
    except EstimationError as error:
        return f"{what}: {error}"
    rank = f"rank {found.coupling_rank} of 6 (by channel {found.rank} of {found.unknowns})"
    if not found.determined:
        return f"{what}: {rank}; this motion does not tell it, and optimising α cannot undo it"
    significance = np.abs(found.coupling) / np.where(found.coupling_sd > 0.0, found.coupling_sd, 1.0)
    i, j = divmod(int(np.argmax(significance)), 3)
    size, u = 100.0 * found.coupling[i, j], 200.0 * found.coupling_sd[i, j]
    return f"{what}: {rank}; most significant, {'xyz'[j]} in {'xyz'[i]}: {size:.1f} %, U {u:.1f} % (k = 2)"


def _bandwidth(case: Case, omega: FloatArray) -> str:
    """[Hu77]: how many harmonics carry ω, and whether the blocks follow the last of them."""
    try:
        found = rgla.bandwidth(omega, case.condensed.time)
    except EstimationError as error:
        return f"bandwidth of ω: {error}"
    enough = "enough" if found.suffices else f"too slow: {found.required:.0f} Hz are needed"
    part = f"{100 * rgla.HARMONIC_PART:g} %"
    carried = f"{found.harmonics} harmonics, up to {found.frequency:.0f} Hz, carry {part} of ω"
    return f"bandwidth of ω: {carried}; compared at {found.rate:.0f} Hz, {enough}"


def _accelerometers(array: SensorArray) -> list[int]:
    return [int(i) for i in np.flatnonzero(array.is_accelerometer)]


def _rest(case: Case) -> int:
    """Block at which the rest begins. EstimationError where there is none."""
    return case.required_rest.start // case.condensed.length


def _from(motion: Motion, start: int) -> Motion:
    """The motion with what lies before `start` at rest."""
    if start == 0:
        return motion
    still = np.zeros((start, 3))
    a0 = np.vstack([np.tile(motion.a0[:1], (start, 1)), motion.a0])
    return Motion(np.vstack([still, motion.omega]), np.vstack([still, motion.alpha]), a0, motion.method)
