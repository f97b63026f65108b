"""RB: do the channels fit one rigid body, within the error budget?

A violated constraint says that *a* channel is wrong, not which: these measures name no channel. The diagnosis does.
"""

from __future__ import annotations

import numpy as np

from nineaudit.array import BoolArray
from nineaudit.case import Case
from nineaudit.errors import EstimationError
from nineaudit.estimate import closed_form, parity
from nineaudit.estimate.motion import has_rates, product_free
from nineaudit.estimate.quiet import noise_level
from nineaudit.estimate.search import FEW_CHANNELS
from nineaudit.estimate.separation import DETECTION_NATS
from nineaudit.finding import COVERAGE_FACTOR, Measure, NotApplicable
from nineaudit.physics import nap
from nineaudit.units import counted

COARSE = 5.0
"""Second differences over the noise above which knocks pass between the samples: no single one proves a fault."""
MOST = 0.5
"""Part of the event in which something must be tested, where samples made of other channels are left out."""
AXES = ("ωyωz", "ωzωx", "ωxωy")


def constraint_equations(case: Case, *, false_alarm: float) -> tuple[Measure, ...] | NotApplicable:
    """RB301: the three constraint equations of the 3-2-2-2 array [Takhounts09 eq 14], one measure each.

    r_x = (a2z − a0z)/2ry + (a3y − a0y)/2rz − ωyωz and so on. Each residual is put as an acceleration by twice the
    geometric mean of its two arms, so that the number compares with the channels.
    """
    problem = case.nap_problem
    if problem is None:
        return NotApplicable("the array holds no ideal 3-2-2-2 layout; RB302 tests its general parity")
    residual, noise, budget = closed_form.constraint_budget(problem)
    measured = _measured_constraints(case, problem)
    axes = [axis for axis in range(3) if _enough(case, measured[:, axis])]
    if not axes:
        raise EstimationError(f"no constraint has only measured channels in most of the event: {_made(case)}")
    factor = parity.budget_factor(false_alarm, int(measured[:, axes].sum()))
    found = []
    for axis in axes:
        scale = 2.0 * np.sqrt(np.abs(np.prod(np.delete(problem.arms, axis))))
        worst = int(np.argmax(np.where(measured[:, axis], np.abs(residual[:, axis]) / budget[:, axis], -1.0)))
        found.append(
            Measure(
                value=float(scale * abs(residual[worst, axis])),
                limit=float(scale * (factor * budget[worst, axis] + COVERAGE_FACTOR * noise[axis])),
                unit="m/s^2",
                u=float(scale * noise[axis]),
                interval=(float(problem.time[worst]), float(problem.time[worst])),
                detail=f"constraint {AXES[axis]}",
            )
        )
    return tuple(found)


def _measured_constraints(case: Case, problem: closed_form.Problem) -> BoolArray:
    """(n,3) where no channel of a constraint was made of the others: such a channel fulfils it by construction."""
    assert case.nap_layout is not None
    made = case.made_blocks[:, list(case.nap_layout[0])]
    return np.asarray(~(made @ (nap.product_rows(problem.arms) != 0).T))


def _enough(case: Case, tested: BoolArray) -> bool:
    """Whether what is tested, (n,) blocks, is most of the event: rest alone shows no fault."""
    return not case.made_blocks.any() or bool(tested[case.onset :].mean() > MOST)


def _made(case: Case) -> str:
    """Which channels are no measurement."""
    names = tuple(dict.fromkeys(made.channel for made in case.recording.remade if made.from_others))
    return f"{', '.join(names)} {'was' if len(names) == 1 else 'were'} made of the other channels"


def array_parity(case: Case, *, false_alarm: float) -> Measure | NotApplicable:
    """RB302: every channel against the least-squares fit of the whole array, (I − HH⁺)(y − q(ω)) [METHODS 2]."""
    if by_student(case) and _unresolved(case) > COARSE:
        left = f"{_unresolved(case):.0f} times the noise is left between neighbours"
        return NotApplicable(f"the samples do not resolve the motion ({left}); RB303 tests the whole record")
    if sum(parity.redundancy(case.array)) == 0:
        return NotApplicable(_nothing_to_spare(case))
    if not (has_rates(case.array) or product_free(case.array)):
        return NotApplicable("without rate sensors α of this layout is not free of ω; RB303 tests the whole record")
    if not _enough(case, np.asarray(np.isfinite(case.parity.value).any(axis=1))):
        raise EstimationError(f"too few channels are left to hold against each other in the event: {_made(case)}")
    worst = parity.worst(case.parity, false_alarm)
    sensor = case.array.sensors[worst.column]
    time = float(case.condensed.time[worst.row])
    return Measure(
        value=worst.value,
        limit=worst.limit + COVERAGE_FACTOR * worst.noise,
        unit="m/s^2" if sensor.kind == "accelerometer" else "rad/s",
        u=worst.noise,
        interval=(time, time),
        detail=f"largest against its budget at {sensor.channel}, which need not be the culprit",
    )


def whole_record(case: Case, *, false_alarm: float) -> Measure | tuple[Measure, ...] | NotApplicable:
    """RB303: cost per degree of freedom of the whole record, calibration errors fitted within their priors [METHODS 2],
    and the evidence of the best fault hypothesis: small faults that no single sample shows add up here.
    """
    if not parity.redundant(case.array):
        return NotApplicable(_nothing_to_spare(case))
    if by_student(case):
        limit = closed_form.limit_per_dof(case.student_data.dof, false_alarm)
        return _by_student(case, limit)
    if len(case.array) > FEW_CHANNELS:
        return NotApplicable(f"more than {FEW_CHANNELS} channels without rates on three axes; RB302 tests their parity")
    limit = closed_form.limit_per_dof(case.fit_data.dof, false_alarm)
    cost = Measure(case.statistic, limit, "1", detail="cost per degree of freedom")
    return cost, _evidence(max((x.evidence for x in case.search.found), default=0.0))


def _evidence(nats: float) -> Measure:
    return Measure(max(nats, 0.0), DETECTION_NATS, "1", detail="evidence in nats of a fault in one channel")


def _by_student(case: Case, limit: float) -> tuple[Measure, ...]:
    """A typical sample of a large array, and the channel of which a fault explains most."""
    found = [Measure(case.student.statistic, limit, "1", detail="cost per degree of freedom of a typical sample")]
    if case.suspects:
        found.append(_evidence(case.suspects[0].claim.evidence))
    return tuple(found)


def by_student(case: Case) -> bool:
    """Whether the array is large and has rates on three axes: a fit bears knocks between coarse samples."""
    return len(case.array) > FEW_CHANNELS and has_rates(case.array)


def _unresolved(case: Case) -> float:
    """What neighbouring samples leave of each other, over the noise: near 1 where they resolve the motion."""
    blocks = case.condensed
    return float(np.median(noise_level(blocks.readings, None) / blocks.sigma))


def _nothing_to_spare(case: Case) -> str:
    return f"no redundancy in {counted(len(case.array), 'channel')}: rigid-body constraints can show no fault in any"


CHECKS = {"RB301": constraint_equations, "RB302": array_parity, "RB303": whole_record}
