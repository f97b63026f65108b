"""Is the unit of all accelerations, or of all rates, another than the rig says? The fit with the other unit answers.

Readings in a wrong unit are off by a factor, the same for all channels of a kind. Where a record contradicts itself and
no longer does with the factor undone, the unit is named: products of ω are squares of rates and do not scale as α does,
and dω/dt of rate sensors is α of accelerometers, so that the factor shows wherever the array is redundant.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.errors import EstimationError
from nineaudit.estimate.calibration import PARAMETERS
from nineaudit.estimate.hypotheses import healthy_fit
from nineaudit.estimate.model import Data
from nineaudit.estimate.quiet import Quiet
from nineaudit.units import FACTORS, UnitNames

_UNITS = {"acceleration": ("m/s^2", "g_0"), "angular_rate": ("rad/s", "deg/s")}
"""Units that recordings are in: mm and feet are not mistaken for them unseen."""
QUIETEST = 1e-2
"""Least noise at rest over what the rig states that counts: below, a record is computed."""


def wrong_unit(case: Case) -> str | None:
    """A sentence that names the unit with which `case` agrees with itself, None where there is none, or no rest
    that shows the noise."""
    if case.healthy.statistic <= case.statistic_limit:
        return None
    if case.rest is None:
        return None
    seen = _seen(case, case.rest)
    for said, factors in _hypotheses(case):
        scaled = _in_unit(case, seen, factors)
        try:
            fitted = healthy_fit(scaled)
        except EstimationError:
            continue
        if fitted.statistic <= case.statistic_limit:
            return said
    return None


def _in_unit(case: Case, seen: FloatArray, factors: FloatArray) -> Data:
    """The readings times `factors` (k,), with the noise that they then have: that of the rest, `seen` (k,) times what
    the rig states. So a record gains nothing by being shrunk into the noise that the rig states."""
    data, larger = case.fit_data, np.maximum(factors, 1.0)
    prior = data.prior_sd.copy()
    prior[:, PARAMETERS.index("zero")] *= larger
    return replace(data, readings=data.readings * factors, weight=data.weight / (seen * factors), prior_sd=prior)


def _seen(case: Case, rest: Quiet) -> FloatArray:
    """(k,) noise at rest over that of the fit, the median of each kind of sensor."""
    ratio, held = np.nanstd(case.readings[rest.samples], axis=0) / case.sigma, case.array.is_accelerometer
    out = np.ones(len(held))
    for kind in (held, ~held):
        if kind.any():
            out[kind] = max(float(np.nanmedian(ratio[kind])), QUIETEST)
    return out


def _hypotheses(case: Case) -> Iterator[tuple[str, FloatArray]]:
    """What would be said, and the factor (k,) that puts the readings right, one kind wrong first, then both."""
    held, units = case.array.is_accelerometer, case.recording.rig.units
    accelerations = list(_other("accelerations", "acceleration", units)) if held.any() else []
    rates = list(_other("rates", "angular_rate", units)) if not held.all() else []
    for said, factor in accelerations:
        yield said, np.where(held, factor, 1.0)
    for said, factor in rates:
        yield said, np.where(held, 1.0, factor)
    for one, by_acceleration in accelerations:
        for other, by_rate in rates:
            yield f"{one}; {other}", np.where(held, by_acceleration, by_rate)


def _other(what: str, quantity: str, units: UnitNames) -> Iterator[tuple[str, float]]:
    known = FACTORS["acceleration" if quantity == "acceleration" else "angular_rate"]
    stated = str(getattr(units, quantity))
    for unit in _UNITS[quantity]:
        if stated in known and unit != stated:
            yield f"all {what} are in {unit}, it seems, not in {stated}", known[unit] / known[stated]
