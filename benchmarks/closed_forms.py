"""What the closed forms of the literature answer, to stand beside the audit.

``closed_form_answer``: leave-one-out by the closed forms of the 3-2-2-2 array with calibration errors in the fit, the
engine of nineaudit 0.1. ``naive_answer``: the same without calibration errors, and the limit of white noise,
1 + 3.09 √(2/dof): the test that suggests itself on reading the papers.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.case import Case
from nineaudit.estimate import closed_form, condense
from nineaudit.estimate.closed_form import Hypothesis, Problem
from nineaudit.estimate.motion import bridge
from nineaudit.physics import kinematics, nap

SEPARATION = 21.7
"""λ at which the wrong one of two channels is preferred once in a hundred (METHODS.md 3)."""

Answer = tuple[str, tuple[str, ...]]
"""Status, and the channels it speaks of."""


def closed_form_answer(case: Case) -> Answer | None:
    """Leave-one-out within the calibration budget; None where the array holds no ideal 3-2-2-2."""
    problem = case.nap_problem
    return None if problem is None else _leave_one_out(problem, closed_form.MODEL_SLACK)


def naive_answer(case: Case) -> Answer | None:
    """Leave-one-out against white noise alone."""
    problem = case.nap_problem
    if problem is None:
        return None
    return _leave_one_out(replace(problem, patterns=np.zeros((9, len(problem.time), 1))), 0.0)


def _leave_one_out(problem: Problem, slack: float) -> Answer:
    healthy = closed_form.fit_hypothesis(problem, None)
    if healthy.statistic <= _limit(healthy, slack):
        return "healthy", ()
    free = [closed_form.fit_hypothesis(problem, k) for k in range(9)]
    holding = [k for k in range(9) if free[k].statistic <= _limit(free[k], slack)]
    if not holding:
        return "undiagnosed", ()
    group = _group(problem, free, holding, slack)
    return "isolated" if len(group) == 1 else "ambiguous", tuple(problem.names[k] for k in group)


def _limit(hypothesis: Hypothesis, slack: float) -> float:
    """χ² per degree of freedom that white noise passes once in a thousand, plus `slack`."""
    return 1.0 + slack + 3.09 * float(np.sqrt(2.0 / hypothesis.dof))


def _group(problem: Problem, free: list[Hypothesis], holding: list[int], slack: float) -> list[int]:
    """The best, and every other that holds and from which the fault that the best one claims is not set apart."""
    best = min(holding, key=lambda k: free[k].excess)
    claimed = _claimed(problem, best)
    needed = SEPARATION + slack * free[best].dof / 3.0

    def apart(k: int) -> bool:
        if free[k].excess - free[best].excess <= needed:
            return False
        return bool(closed_form.separations(problem, free[k], claimed)[best] > SEPARATION)

    return [best, *(k for k in holding if k != best and not apart(k))]


def _claimed(problem: Problem, channel: int) -> FloatArray:
    """(n,) measured less closed form, 0 where under 4 standard deviations."""
    rebuilt = closed_form.replaced(problem, channel, problem.readings)
    row = nap.closed_form(nap.CHANNELS[channel], problem.arms).row
    spread = np.sqrt(row**2 @ problem.sigma**2 + problem.sigma[channel] ** 2)
    fault = problem.readings[:, channel] - rebuilt[:, channel]
    return np.where(np.abs(fault) > 4.0 * spread, fault, 0.0)


def rebuilt(case: Case, channel: str) -> FloatArray:
    """(n,) a channel of the 3-2-2-2 array by its closed form from the other eight, SI, zero taken off."""
    assert case.nap_layout is not None
    index, arms = list(case.nap_layout[0]), case.nap_layout[1]
    readings = bridge(case.readings[:, index], case.time)
    return np.asarray(nap.rebuild(nap.CHANNELS[index.index(case.array.index(channel))], readings, arms, case.time))


def visibility(case: Case, error: FloatArray) -> float:
    """λ = ‖(I − Π) S e‖² of an injected `error` (n,k), for one who knows its waveform (METHODS.md 3): how far it
    stands out of noise and calibration errors. `case` is the healthy recording. NaN for another array.

    Under about 10 not even a filter matched to the fault would find it more often than not at one false alarm in a
    thousand; the mean of the statistic is √λ in standard deviations.
    """
    problem = case.nap_problem
    if problem is None or case.nap_layout is None:
        return float("nan")
    blocks = condense.block_means(error[:, list(case.nap_layout[0])], case.condensed.length)
    patterns = blocks.T[:, :, None]
    turned = kinematics.integrate(blocks, problem.time).T[:, :, None]
    seen = closed_form.response(problem, None, patterns, turned)[:, :, :, 0].sum(axis=0)
    white = seen @ case.nap_healthy.whiten.T
    return float(closed_form.unexplained(case.nap_healthy.design, white.reshape(1, -1))[0])
