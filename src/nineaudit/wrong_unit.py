"""Is the unit of all accelerations, or of all rates, another than the rig says? What the common causes say of it.

Readings in a wrong unit are off by a factor, the same for all channels of a kind: one of the causes that many channels
share (estimate/causes.py), found as the diagnosis finds them (estimate/common.py). It is named where the record
contradicts itself, and with the factor undone no longer does, in the noise that the channels show at rest.
"""

from __future__ import annotations

import numpy as np

from nineaudit.case import Case
from nineaudit.estimate.causes import ACCELERATIONS, NEAR_UNIT, RATES, Cause, unit_pairs
from nineaudit.estimate.common import as_noisy_as_at_rest, common_causes
from nineaudit.estimate.hypotheses import healthy_fit, log_evidence
from nineaudit.units import FACTORS, Quantity, UnitNames

_SAID: dict[Quantity, str] = {"acceleration": "accelerations", "angular_rate": "rates"}


def wrong_unit(case: Case) -> str | None:
    """A sentence that names the unit with which `case` agrees with itself, None where there is none, or no rest
    that shows the noise."""
    if case.healthy.statistic <= case.statistic_limit or case.rest is None:
        return None
    healthy = healthy_fit(as_noisy_as_at_rest(case.fit_data))
    if healthy.statistic <= case.statistic_limit:
        return None
    units = case.recording.rig.units
    for found in common_causes(healthy, None, log_evidence(healthy)):
        if found.found.statistic <= case.statistic_limit and _of_units(found.cause):
            return _sentence(found.cause, units)
    return None


def _of_units(cause: Cause) -> bool:
    """Whether a cause is a factor, and a ratio of units: a free factor may be an error of one channel."""
    known = {"acceleration": ACCELERATIONS, "angular_rate": RATES}
    return bool(cause.factors) and all(unit_pairs(f, known[quantity]) for quantity, f in cause.factors.items())


def _sentence(cause: Cause, units: UnitNames) -> str:
    """The unit by its name beside that of the rig; where none has it (twice converted), as the cause says it."""
    said = [_other(quantity, cause.factors[quantity], units) for quantity in _SAID if quantity in cause.factors]
    return "; ".join(said) if all(said) else cause.said


def _other(quantity: Quantity, factor: float, units: UnitNames) -> str:
    known, stated = FACTORS[quantity], str(getattr(units, quantity))
    for unit, size in known.items():
        if unit != stated and stated in known and abs(np.log(factor * known[stated] / size)) < NEAR_UNIT:
            return f"all {_SAID[quantity]} are in {unit}, it seems, not in {stated}"
    return ""
