"""Diagnosis by the whole-record search, for any array: the hypotheses of estimate/search.py weighed.

A channel is named when it holds the posterior against every other at 99 to 1, when the record without its fault costs
what a healthy one does, and, where its fault is a mere waveform, when the motion also tells that waveform from a free
one in any other channel. Otherwise those that are left are a group, and no name is given inside it. Nor is one given
where a cause common to many channels (estimate/common.py) explains the record about as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from nineaudit.case import Case
from nineaudit.diagnosis import SEPARATION, Candidate, Diagnosis, Status
from nineaudit.estimate.common import Common, common_causes, mostly_explained
from nineaudit.estimate.hypotheses import Hypothesis, log_evidence, theta_for
from nineaudit.estimate.model import Data
from nineaudit.estimate.search import FAR, Search
from nineaudit.estimate.separation import DETECTION_NATS, claimed, smallest

ODDS_NATS = float(np.log(99.0))
"""A name needs 99 to 1 against every other channel."""
LARGEST_GROUP = 4
"""A group of more channels than this helps nobody."""
UNEXPLAINED = 1.5
"""Cost per degree of freedom, over the best, that even the best hypothesis may leave before it explains nothing."""
UNSAID = 0.01
"""Part of the cost that what no budget says may move from one hypothesis to another: it must not name a twin."""
UNTOLD = 0.002
"""The same as a part of the evidence, between two faults that both leave little unexplained."""
DECISIVE = ("dropout", "stuck", "spikes")
"""Faults that a trace shows beyond doubt."""
WAVEFORMS = ("unknown", "samples")
DEAD = 0.1
"""Gain factor under which a channel measures nothing of the motion."""
FARTHEST = {"position": 25e-3, "cross_axis": 0.3}
"""m, and sensitivity, beyond which these kinds are any waveform: a sensor 50 mm off, at the origin, feels no α."""
UNIT_FACTORS = (9.80665, 57.29578, 1000.0, 100.0, 25.4, 2.54, 0.3048 * 9.80665)


def by_search(case: Case, evidence: Mapping[str, str]) -> Diagnosis:
    """Diagnosis of a redundant array. EstimationError where no motion can be fitted.

    `evidence`: channel -> fault word that its own trace shows, the word of a hypothesis that leaves just those samples
    out.
    """
    search = case.search
    best = _best(search)
    base = Diagnosis(Status.HEALTHY, (), (), "", healthy_statistic=search.healthy.statistic, limit=case.statistic_limit)
    base = _with_sizes(case, search, base)
    if best is None or best.evidence < DETECTION_NATS:
        return _nothing_found(search, base)
    candidates = _candidates(case, search, best, evidence)
    floor = _floor(search)
    if common := _common(case, search, best):
        return _no_channel(case, search, base, common, candidates)
    at = f"{best.statistic:.2f} per degree of freedom, {search.healthy.statistic:.3g} with it at its word"
    if (best.statistic > UNEXPLAINED * floor and best.word not in WAVEFORMS) or floor > UNEXPLAINED:
        reason = f"something is wrong, but no fault of one or two channels explains it: at best {at}"
        return replace(base, status=Status.UNDIAGNOSED, candidates=candidates, reason=reason)
    if search.healthy.data.between is not None and best.word == "noise":
        name = case.array.channels[best.channels[0]]
        reason = f"the samples are too far apart to tell noise of {name} from motion between them; at best {at}"
        return replace(base, status=Status.UNDIAGNOSED, candidates=candidates, reason=reason)
    group = _group(search, best, floor)
    shown = _shown(case, search, evidence)
    group = [best.channels] if shown == [best] else group + [x.channels for x in shown if x.channels not in group]
    names = [tuple(case.array.channels[c] for c in channels) for channels in group]
    if len(group) == 1:
        fault = candidates[0].fault.replace("_", " ")
        reason = f"{' and '.join(names[0])}: {fault}; without it the record is whole: {at}"
        return replace(base, status=Status.ISOLATED, channels=names[0], candidates=candidates, reason=reason)
    members = tuple(dict.fromkeys(name for channels in names for name in channels))
    if len(members) > LARGEST_GROUP:
        reason = f"something is wrong, but {len(members)} channels explain it about as well: {', '.join(members)}"
        return replace(base, status=Status.UNDIAGNOSED, candidates=candidates, reason=reason)
    reason = f"one of {', '.join(members)}: this motion cannot tell them apart; at best {at}"
    return replace(base, status=Status.AMBIGUOUS, channels=members, candidates=candidates, reason=reason)


def _best(search: Search) -> Hypothesis | None:
    """The best hypothesis, or, where that leaves the record unexplained, the best of its channels that does not."""
    if not search.found:
        return None
    top, enough = search.found[0], UNEXPLAINED * _floor(search)
    return next((x for x in search.found if x.channels == top.channels and x.statistic <= enough), top)


def _common(case: Case, search: Search, best: Hypothesis) -> list[Common]:
    """The common causes that explain the record better than any channel does, or so nearly that 99 to 1 is missing."""
    if mostly_explained(search.healthy, best):
        return []
    least = max(search.found[0].evidence - ODDS_NATS * _floor(search), DETECTION_NATS)
    found = common_causes(search.healthy, best, log_evidence(search.healthy), case.recording.messages)
    return [x for x in found if x.found.evidence >= least]


def _no_channel(
    case: Case, search: Search, base: Diagnosis, common: Sequence[Common], channels: Sequence[Candidate]
) -> Diagnosis:
    """No name, and no group, one of which would be the culprit: the common causes beside the channels."""
    top, best = max(common[0].found.evidence, search.found[0].evidence), search.found[0].evidence
    weight = [float(np.exp(max((x.found.evidence - top) / _floor(search), -700.0))) for x in common]
    rest = float(np.exp(max((best - top) / _floor(search), -700.0))) / channels[0].probability
    total = sum(weight) + rest
    shared = [
        Candidate(
            tuple(case.array.channels[c] for c in x.found.channels), x.found.word, w / total, x.found.statistic,
            dict(x.found.parameters),
        )
        for x, w in zip(common, weight, strict=True)
    ]  # fmt: skip
    alone = [replace(c, probability=c.probability * rest / total) for c in channels]
    found = sorted([*shared, *alone], key=lambda c: -c.probability)
    at = f"{common[0].found.statistic:.2f} per degree of freedom, {search.healthy.statistic:.3g} as it stands"
    rivals = [" and ".join(c.channels) for c in alone if c.probability > 0.01]
    said = common[0].cause.said
    if common[0].found.statistic > UNEXPLAINED:
        said = f"something is wrong that no fault of one or two channels explains; nearest: {said}"
    reason = f"{said} ({at})" + (f", unless it is {' or '.join(rivals)} alone" if rivals else "")
    return replace(base, status=Status.UNDIAGNOSED, candidates=tuple(found), reason=reason)


def _shown(case: Case, search: Search, evidence: Mapping[str, str]) -> list[Hypothesis]:
    """Hypotheses of samples that a channel's own trace shows to be what no sensor at work gives, and that explain the
    record: alone and best, it breaks a tie that physics cannot (METHODS.md 3); else its channel stays in the group.
    A flat top may be one of the motion's."""
    enough = UNEXPLAINED * _floor(search)
    telling = [x for x in search.found if x.word == "samples" and x.statistic <= enough and x.evidence > DETECTION_NATS]
    return [x for x in telling if evidence.get(case.array.channels[x.channels[0]]) in DECISIVE]


def _nothing_found(search: Search, base: Diagnosis) -> Diagnosis:
    statistic, limit = search.healthy.statistic, base.limit or np.inf
    cost = f"{statistic:.2f} per degree of freedom, limit {limit:.2f}"
    if not search.healthy.converged:
        return replace(base, status=Status.UNDIAGNOSED, reason=f"the fit did not converge; {cost}")
    if statistic > limit:
        reason = f"noise and stated calibration errors do not explain the record ({cost}), and no channel stands out"
        return replace(base, status=Status.UNDIAGNOSED, reason=reason)
    return replace(base, reason=f"the record is that of one rigid body within the budget: {cost}")


def _floor(search: Search) -> float:
    """Cost per degree of freedom at the best: noise that is not what the rig says scales all evidence."""
    return max(1.0, min(x.statistic for x in search.found))


def _scores(search: Search, chance: bool = False) -> dict[tuple[int, ...], float]:
    """Best evidence of each channel (or pair), in nats of the noise as found; with what `chance` may have cost it."""
    scale = _floor(search)
    out: dict[tuple[int, ...], float] = {}
    for x in search.found:
        score = (x.evidence + chance * x.chance) / scale
        out[x.channels] = max(score, out.get(x.channels, score))
    return out


def _group(search: Search, best: Hypothesis, floor: float) -> list[tuple[int, ...]]:
    """The best channel, and every other that nothing sets apart from it."""
    scores = _scores(search)
    odds = ODDS_NATS if len(best.channels) == 1 or best.word == "swap" else FAR
    whole = {x.channels for x in search.found if x.statistic <= UNEXPLAINED * floor}
    untold, lucky = UNTOLD * scores[best.channels], _scores(search, chance=True)
    near = [c for c, score in lucky.items() if scores[best.channels] - score < odds + untold * (c in whole)]
    if len(best.channels) == 1 and best.channels[0] in search.without and _is_waveform(search, best):
        channel, data = best.channels[0], search.healthy.data
        mine, needed = search.without[channel], _separation(data)
        rivals = {k: f for k, f in search.without.items() if k != channel and (k,) not in near}
        # a fit that has not settled may still fall: it is no evidence against its channel unless far off
        apart = {k: (f.cost - f.data.dof - mine.cost + mine.data.dof) / floor for k, f in rivals.items()}
        tied = [k for k, f in rivals.items() if apart[k] < (needed if f.converged else FAR)]
        seen = claimed(data, mine, channel, [k for k in rivals if k not in tied and apart[k] < FAR])
        near += [(k,) for k in [*tied, *(k for k, told in seen.items() if told < needed)]]
    return sorted(near, key=lambda c: -scores.get(c, -np.inf))


def _is_waveform(search: Search, best: Hypothesis) -> bool:
    """Whether a hypothesis says no more than that its channel has another waveform: it is free, it is dead (a gain near
    0, a place far off), or its kind of fault leaves more than the free waveform, by more than chance (3 σ of χ²)."""
    if best.word in WAVEFORMS or abs(best.parameters.get("factor", 1.0)) < DEAD:
        return True
    if best.parameters.get("size", 0.0) > FARTHEST.get(best.word, np.inf):
        return True
    dof, free = search.healthy.data.dof, search.without[best.channels[0]]
    count = int((search.healthy.data.weight[:, best.channels[0]] > 0).sum())
    return (best.statistic - 1.0) * dof - (free.cost - free.data.dof) > 3.0 * float(np.sqrt(2.0 * count))


def _separation(data: Data) -> float:
    """λ that sets two free waveforms apart, in a record whose budget leaves a little unsaid."""
    return SEPARATION + UNSAID * data.dof


def _candidates(case: Case, search: Search, top: Hypothesis, evidence: Mapping[str, str]) -> tuple[Candidate, ...]:
    """The best hypothesis of each channel or pair (`top` of its own) with its probability, most probable first."""
    scores = _scores(search)
    most = max(scores.values())
    weight = {c: float(np.exp(max(s - most, -700.0))) for c, s in scores.items()}
    total = sum(weight.values())
    out = []
    for channels in sorted(scores, key=lambda c: -scores[c]):
        best = top if top.channels == channels else next(x for x in search.found if x.channels == channels)
        names = tuple(case.array.channels[c] for c in channels)
        shown = evidence.get(names[0], "unknown") if best.word in WAVEFORMS else best.word
        word = fault_word(shown, best.parameters)
        out.append(Candidate(names, word, weight[channels] / total, best.statistic, dict(best.parameters)))
    return tuple(out)


def fault_word(word: str, parameters: Mapping[str, float]) -> str:
    """The fault word of INTERFACE.md: a gain near −1 is a polarity, one near a ratio of units is a unit."""
    if word != "gain":
        return word
    factor = parameters.get("factor", 1.0 + parameters.get("size", 0.0))
    if abs(factor + 1.0) < 0.1:
        return "polarity"
    size = max(abs(factor), 1.0 / max(abs(factor), 1e-9))
    return "unit" if any(abs(size / u - 1.0) < 0.1 for u in UNIT_FACTORS) else "gain"


def _with_sizes(case: Case, search: Search, base: Diagnosis) -> Diagnosis:
    """What would have shown and been pinned, about the fit without the best channel, in a record as noisy as this."""
    at = whole = search.healthy
    if search.found and search.found[0].evidence > DETECTION_NATS:
        at = search.without.get(search.found[0].channels[0], whole)
    at = replace(at, data=whole.data, theta=theta_for(whole.data, at))
    detectable, isolable = smallest(at, case.onset, _separation(whole.data))
    names = case.array.channels
    return replace(
        base,
        smallest_detectable=dict(zip(names, detectable.tolist(), strict=True)),
        smallest_isolable=dict(zip(names, isolable.tolist(), strict=True)),
    )
