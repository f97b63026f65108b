"""UB: is the result worth reporting, given the stated uncertainties?"""

from __future__ import annotations

from nineaudit.case import Case
from nineaudit.estimate.at_their_word import spans
from nineaudit.estimate.motion import has_rates
from nineaudit.finding import Measure, NotApplicable
from nineaudit.units import counted


def alpha_uncertainty(case: Case, *, part_of_peak: float) -> Measure | NotApplicable:
    """UB401: expanded uncertainty (k = 2) of the peak of α, as a part of it, as `nineaudit budget` has it."""
    if not (has_rates(case.array) or spans(case.array)):
        count = int(case.array.is_accelerometer.sum())
        return NotApplicable(
            f"α is not spanned by {counted(count, 'accelerometer')}, and no rate sensors on three axes give it"
        )
    found = case.alpha_budget
    largest = max(found.rows, key=lambda source: found.rows[source])
    time = float(case.condensed.time[found.row])
    return Measure(
        value=2.0 * found.total / found.peak,
        limit=part_of_peak,
        unit="1",
        interval=(time, time),
        detail=f"peak α {found.peak:.4g} rad/s², U {2.0 * found.total:.3g} rad/s², most of it {largest}",
    )


CHECKS = {"UB401": alpha_uncertainty}
