"""Diagnosis of a large array with rate sensors: each channel against what all the others predict of it.

With this many channels the motion is known almost without any one of them: a channel is left out, the record fitted
with Student errors and with what happens between coarse samples (estimate/student.py, between_samples.py), and its
readings compared with every kind of fault (estimate/claims.py). Evidence is the logarithm of how much better a fault
explains a channel than its stated calibration errors, all others taken at their word. Samples that a trace shows to be
wrong by itself are left out from the start, and their channels named.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from nineaudit.by_search import LARGEST_GROUP, ODDS_NATS, fault_word
from nineaudit.case import Case
from nineaudit.diagnosis import Candidate, Diagnosis, Status
from nineaudit.estimate.separation import DETECTION_NATS
from nineaudit.estimate.student import StudentFit
from nineaudit.estimate.suspects import Suspect, still_suspect


def by_others(case: Case, evidence: Mapping[str, str]) -> Diagnosis:
    """Diagnosis of an array with rates on three axes and spare channels. EstimationError where no motion is fitted.

    `evidence`: channel -> fault word that its own trace shows.
    """
    whole, shown = case.student, tuple(evidence)
    limit = case.student_limit
    base = Diagnosis(Status.HEALTHY, (), (), "", healthy_statistic=whole.statistic, limit=limit)
    found = [x for x in case.suspects if x.claim.evidence >= DETECTION_NATS]
    own = tuple(Candidate((c,), word, 1.0, whole.statistic) for c, word in evidence.items())
    if not found:
        return _nothing_found(whole, base, own)
    best, candidates = found[0], (*_candidates(case, found), *own)
    at = f"{best.without.statistic:.2f} per degree of freedom, {whole.statistic:.3g} with it at its word"
    if best.without.statistic > limit or not best.without.converged:
        why = "" if best.without.converged else " (and that fit did not converge)"
        reason = f"something is wrong, but no fault of one channel or of a swapped pair explains it: at best {at}{why}"
        return replace(base, status=Status.UNDIAGNOSED, candidates=candidates, reason=reason)
    near = [x for x in found if best.claim.evidence - x.claim.evidence < ODDS_NATS]
    names = tuple(dict.fromkeys(case.array.channels[c] for x in near for c in x.channels))
    if len(near) == 1 and (others := still_suspect(case.student_data, best, found[1:], case.raw_zero)):
        left = ", ".join(case.array.channels[k] for k in others)
        reason = f"something is wrong, but not in {' and '.join(names)} alone: without it {left} still cannot be right"
        return replace(base, status=Status.UNDIAGNOSED, candidates=candidates, reason=reason)
    if len(near) == 1:
        fault = candidates[0].fault.replace("_", " ")
        besides = f"; besides, the traces of {', '.join(shown)} are wrong by themselves" if shown else ""
        reason = f"{' and '.join(names)}: {fault}; without it the record is whole: {at}{besides}"
        named = tuple(dict.fromkeys((*names, *shown)))
        return replace(base, status=Status.ISOLATED, channels=named, candidates=candidates, reason=reason)
    if len(names) > LARGEST_GROUP:
        reason = f"something is wrong, but {len(names)} channels explain it about as well: {', '.join(names)}"
        return replace(base, status=Status.UNDIAGNOSED, candidates=candidates, reason=reason)
    reason = f"one of {', '.join(names)}: this motion cannot tell them apart; at best {at}"
    return replace(base, status=Status.AMBIGUOUS, channels=names, candidates=candidates, reason=reason)


def _nothing_found(whole: StudentFit, base: Diagnosis, own: tuple[Candidate, ...]) -> Diagnosis:
    limit = base.limit or np.inf
    cost = f"{whole.statistic:.2f} per degree of freedom of a typical sample, limit {limit:.2f}"
    if not whole.converged:
        return replace(base, status=Status.UNDIAGNOSED, candidates=own, reason=f"the fit did not converge; {cost}")
    if whole.statistic > limit:
        reason = f"noise and stated calibration errors do not explain the record ({cost}), and no channel stands out"
        return replace(base, status=Status.UNDIAGNOSED, candidates=own, reason=reason)
    if own:
        names = tuple(x.channels[0] for x in own)
        reason = (
            f"without the samples that their own trace shows wrong ({', '.join(names)}) the record is whole: {cost}"
        )
        return replace(base, status=Status.ISOLATED, channels=names, candidates=own, reason=reason)
    return replace(base, reason=f"the record is that of one rigid body within the budget: {cost}")


def _candidates(case: Case, found: Sequence[Suspect]) -> tuple[Candidate, ...]:
    weight = [float(np.exp(max(x.claim.evidence - found[0].claim.evidence, -700.0))) for x in found]
    return tuple(
        Candidate(
            tuple(case.array.channels[c] for c in x.channels),
            fault_word(x.claim.word, x.claim.parameters),
            w / sum(weight),
            x.without.statistic,
            dict(x.claim.parameters),
        )
        for x, w in zip(found, weight, strict=True)
    )
