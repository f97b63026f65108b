"""UB: is the result worth reporting, given the stated uncertainties?"""

from __future__ import annotations

from nineaudit.case import Case
from nineaudit.errors import EstimationError
from nineaudit.estimate import budget
from nineaudit.finding import Measure, NotApplicable


def alpha_uncertainty(case: Case, *, part_of_peak: float) -> Measure | NotApplicable:
    """UB401: expanded uncertainty (k = 2) of α at its peak, as a part of the peak [METHODS.md 5]."""
    try:
        budget.alpha_combination(case.array)
    except EstimationError as reason:
        return NotApplicable(f"the accelerometers do not give α: {reason}")
    blocks = case.condensed
    found = case.alpha_budget
    largest = max(found.rows, key=lambda source: found.rows[source])
    time = float(blocks.time[found.row])
    return Measure(
        value=2.0 * found.total / found.peak,
        limit=part_of_peak,
        unit="1",
        interval=(time, time),
        detail=f"peak α {found.peak:.4g} rad/s², U {2.0 * found.total:.3g} rad/s², most of it {largest}",
    )


CHECKS = {"UB401": alpha_uncertainty}
