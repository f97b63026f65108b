"""Which channel? The right method for the array, and its answer (METHODS.md 3).

any redundant array of up to 12 channels            whole-record search (by_search.py)
larger arrays with rate sensors on three axes       each channel against all others (by_others.py)
larger arrays without                               parity, with and without what traces show wrong by themselves
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from nineaudit.by_others import by_others
from nineaudit.by_search import by_search
from nineaudit.case import Case
from nineaudit.diagnosis import Candidate, Diagnosis, Status
from nineaudit.estimate import parity
from nineaudit.estimate.motion import has_rates
from nineaudit.estimate.search import FEW_CHANNELS

__all__ = ["Candidate", "Diagnosis", "Status", "diagnose"]


def diagnose(case: Case, evidence: Mapping[str, str] | None = None) -> Diagnosis:
    """Name the faulty channel, the group, or neither. EstimationError where no motion can be told.

    `evidence`: channel -> fault word that its own trace shows (clipping, dropout, stuck, spikes).
    """
    if not parity.redundant(case.array):
        reason = "the array has no redundancy: rigid-body constraints cannot show a fault in any channel"
        return Diagnosis(Status.UNDIAGNOSED, (), (), reason)
    if len(case.array) <= FEW_CHANNELS:
        return by_search(case, evidence or {})
    if has_rates(case.array):
        return by_others(case, evidence or {})
    return _of_parity(case, evidence or {})


def _of_parity(case: Case, evidence: Mapping[str, str]) -> Diagnosis:
    """An array of another layout. Healthy when every parity residual keeps within its budget; the channels that
    their own trace shows to be wrong are named when the array agrees with itself without those samples."""
    whole = _parity_ratio(case.parity)
    sizes = Diagnosis(Status.UNDIAGNOSED, (), (), "", healthy_statistic=whole, limit=1.0)
    if whole <= 1.0:
        reason = f"every channel agrees with the array: the worst residual is {whole:.2f} of its limit"
        return replace(sizes, status=Status.HEALTHY, reason=reason)
    contradiction = f"the array contradicts itself: the worst residual is {whole:.3g} times its limit"
    if not evidence:
        return replace(sizes, reason=contradiction)
    without = _parity_ratio(case.trusted_parity)
    candidates = tuple(Candidate((c,), word, 1.0, without) for c, word in evidence.items())
    if without > 1.0:
        reason = f"{contradiction}, {without:.3g} times it without the samples that their own trace shows wrong"
        return replace(sizes, candidates=candidates, reason=reason)
    reason = (
        f"{contradiction}; without the samples that their own trace shows wrong ({', '.join(evidence)}) it agrees: "
        f"{without:.2f} of the limit"
    )
    return replace(sizes, status=Status.ISOLATED, channels=tuple(evidence), candidates=candidates, reason=reason)


def _parity_ratio(residual: parity.Residual) -> float:
    worst = parity.worst(residual, 1e-3)
    return worst.value / worst.limit
