"""Diagnosis of a 3-2-2-2 array by its closed forms.

Each channel in turn is replaced by its closed form from the other eight. The culprit is the one whose replacement
makes the *remaining* constraints hold within the budget. With one bad channel every reconstruction disagrees with its
trace, so disagreement accuses nobody. Channels whose replacement serves equally well are a group.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.diagnosis import SEPARATION, Candidate, Diagnosis, Status
from nineaudit.estimate import closed_form
from nineaudit.physics import nap


@dataclass(frozen=True, eq=False)
class ClosedFormFit:
    """The ten hypotheses of a 3-2-2-2 array: `healthy`, and each channel `free`."""

    problem: closed_form.Problem
    healthy: closed_form.Hypothesis
    free: tuple[closed_form.Hypothesis, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return self.problem.names


def by_closed_form(case: Case, evidence: Mapping[str, str]) -> Diagnosis:
    """Diagnosis of a 3-2-2-2 array. `evidence`: channel -> fault word that its own trace shows; it weighs in the
    probabilities and gives the fault its word; it does not name a channel inside a group."""
    problem = case.required_nap_problem
    free = tuple(closed_form.fit_hypothesis(problem, k) for k in range(9))
    fit = ClosedFormFit(problem, case.nap_healthy, free)
    healthy = fit.healthy.statistic
    limit = closed_form.limit_per_dof(fit.healthy.dof)
    detectable, isolable = _smallest(fit)
    sizes = Diagnosis(Status.HEALTHY, (), (), "", detectable, isolable, healthy, limit)
    if healthy <= limit:
        reason = f"the constraints hold within the budget: {healthy:.2f} per degree of freedom, limit {limit:.2f}"
        return replace(sizes, reason=reason)
    candidates = _candidates(fit, evidence)
    holding = [k for k in range(9) if fit.free[k].statistic <= closed_form.limit_per_dof(fit.free[k].dof)]
    if not holding:
        best = candidates[0]
        reason = (
            f"the constraints fail ({healthy:.3g} per degree of freedom, limit {limit:.2f}) and no single channel "
            f"mends them: at best {best.statistic:.3g} without {best.channels[0]}"
        )
        return replace(sizes, status=Status.UNDIAGNOSED, candidates=candidates, reason=reason)
    group = _group(fit, holding)
    names = tuple(fit.names[k] for k in group)
    named = replace(sizes, channels=names, candidates=candidates, interval=_where(fit, group[0]))
    without = f"{fit.free[group[0]].statistic:.2f} without, {healthy:.3g} with it (limit {limit:.2f})"
    if len(group) == 1:
        reason = f"only without {names[0]} do the constraints hold: {without} per degree of freedom"
        return replace(named, status=Status.ISOLATED, reason=reason)
    reason = f"the constraints hold without any one of {', '.join(names)}; this motion cannot tell them apart"
    return replace(named, status=Status.AMBIGUOUS, reason=reason)


def _group(fit: ClosedFormFit, holding: list[int]) -> list[int]:
    """The best hypothesis, and every other that holds and that nothing sets apart from it.

    A better cost alone does not name a channel: the fault that the best one claims must also stay visible, in
    this motion, when the other one is left free (λ > SEPARATION).
    """
    best = min(holding, key=lambda k: fit.free[k].excess)
    claimed = _claimed(fit, best)
    slack = SEPARATION + closed_form.MODEL_SLACK * fit.free[best].dof / 3.0

    def apart(k: int) -> bool:
        costs = fit.free[k].excess - fit.free[best].excess
        return costs > slack and closed_form.separations(fit.problem, fit.free[k], claimed)[best] > SEPARATION

    near = [k for k in holding if k != best and not apart(k)]
    return [best, *sorted(near, key=lambda k: fit.free[k].excess)]


def _smallest(fit: ClosedFormFit) -> tuple[dict[str, float], dict[str, float]]:
    """Per channel the smallest step at the event that shows, and the smallest that is pinned to its channel.

    λ grows with the square of the size. Detection: the cost must pass its limit; isolation: λ under every
    other hypothesis must reach SEPARATION beyond the slack of that hypothesis. No entry where none would do.
    """
    problem = fit.problem
    moving = np.linalg.norm(problem.readings / problem.sigma, axis=1) > 9.0
    step = (np.cumsum(moving) > 0).astype(float)
    needed = closed_form.limit_per_dof(fit.healthy.dof) * fit.healthy.dof - fit.healthy.dof
    seen = closed_form.separations(problem, fit.healthy, step)
    rivals = np.stack([closed_form.separations(problem, h, step) for h in fit.free])
    np.fill_diagonal(rivals, np.inf)
    slack = SEPARATION + closed_form.MODEL_SLACK * fit.free[0].dof / 3.0
    with np.errstate(divide="ignore"):
        detectable = np.sqrt(needed / seen)
        isolable = np.maximum(np.sqrt(slack / rivals.min(axis=0)), detectable)
    names = fit.names
    return dict(zip(names, detectable.tolist(), strict=True)), dict(zip(names, isolable.tolist(), strict=True))


def _candidates(fit: ClosedFormFit, evidence: Mapping[str, str]) -> tuple[Candidate, ...]:
    """All nine, most probable first: exp(−cost/2) scaled by the best cost per degree of freedom, times 50 where
    the channel's own trace shows a fault."""
    scale = max(1.0, min(h.statistic for h in fit.free))
    score = np.array([-0.5 * h.excess / scale for h in fit.free])
    score += [np.log(50.0) if name in evidence else 0.0 for name in fit.names]
    weight = np.exp(score - score.max())
    weight /= weight.sum()
    order = np.argsort(-score, kind="stable")
    return tuple(
        Candidate((fit.names[k],), evidence.get(fit.names[k], "unknown"), float(weight[k]), fit.free[k].statistic)
        for k in order
    )


def _claimed(fit: ClosedFormFit, channel: int) -> FloatArray:
    """(n,) the fault that a hypothesis claims, measured less closed form, 0 where under 4 standard deviations."""
    problem = fit.problem
    rebuilt = closed_form.replaced(problem, channel, problem.readings)
    row = nap.closed_form(nap.CHANNELS[channel], problem.arms).row
    spread = np.sqrt(row**2 @ problem.sigma**2 + problem.sigma[channel] ** 2)
    fault = problem.readings[:, channel] - rebuilt[:, channel]
    return np.where(np.abs(fault) > 4.0 * spread, fault, 0.0)


def _where(fit: ClosedFormFit, channel: int) -> tuple[float, float]:
    """From the first to the last block whose claimed fault stands out of its noise."""
    out, time = np.flatnonzero(_claimed(fit, channel)), fit.problem.time
    return (float(time[out[0]]), float(time[out[-1]])) if len(out) else (float(time[0]), float(time[-1]))
