"""What campaign health computes for all unknowns at once, against the equations written out for one at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from health_campaigns import Plan, drawn
from nineaudit.array import FloatArray
from nineaudit.campaign.health.border import with_change
from nineaudit.campaign.health.connect import parts
from nineaudit.campaign.health.look import Look, Sight, look, look_again, look_without
from nineaudit.campaign.health.model import FREE, Change, Part, Solution, solve
from nineaudit.campaign.health.scan import excess, scan

PLAN = Plan(rigs=2, channels=4, tests=70, swaps=2, tilts=True)
TAU = {("accelerometer", "gain"): 0.1, ("accelerometer", "tilt"): 0.05}


@pytest.fixture(scope="module")
def part() -> Part:
    """Two rigs made one by a sensor that went from the first to the second."""
    records = drawn(PLAN, 4, drift=3.0, culprit="S01").records.records
    went = [replace(r, rows=tuple(replace(row, sensor="S00") if row.sensor == "S05" else row for row in r.rows))
            for r in records]  # fmt: skip
    (one,) = parts(went)
    return one


def some_changes(part: Part) -> tuple[Change, ...]:
    """A step of a sensor's gain, a ramp of a sensor's tilt, a step of a seat's."""
    along = np.linspace(0.0, 1.0, PLAN.tests)
    tilts = [i for i, u in enumerate(part.unknowns) if u.parameter == "tilt_1"]
    seat = next(i for i in tilts if part.unknowns[i].seat)
    sensor = next(i for i in tilts if part.unknowns[i].sensor)
    return Change(0, (along > 0.4).astype(float)), Change(sensor, along), Change(seat, (along > 0.7).astype(float))


def normal_equations(part: Part, solution: Solution, *more: int) -> FloatArray:
    """Their matrix, from the designs of each recording with its changes. The level of an unknown that changes is nearly
    free: it is N(0, P) and a constant N(0, FREE² P); `more` are free too."""
    n, size = len(part.unknowns), len(solution.x)
    variance = np.append(part.prior**2.0, np.full(size - n, 1e10))
    for i in {c.unknown for c in solution.changes}:
        variance[i] += FREE**2 * part.prior[i] ** 2
    for i in more:
        variance[i] += FREE**2 * part.prior[i] ** 2
    out = np.diag(1.0 / variance)
    for one in solution.marginals:
        for j in range(len(one.eta)):
            design = full_design(one.group.index[j], solution, part)
            out += design.T @ one.matrix[j] @ design
    return out


def full_design(place: int, solution: Solution, part: Part) -> FloatArray:
    n = len(part.unknowns)
    (one,) = [m for m in solution.marginals if place in m.group.index]
    design = np.zeros((one.eta.shape[1], len(solution.x)))
    design[:, one.group.at] = one.group.design
    for k, change in enumerate(solution.changes):
        design[:, n + k] = design[:, change.unknown] * change.amount[place]
    return design


def test_the_covariance_is_the_inverse_also_where_tests_tell_very_much(part: Part) -> None:
    """By blocks of rigs 0.8 of the identity had been lost, and equal tests had changes of thousands of deviations."""
    solution = solve(part, TAU, some_changes(part))
    normal = normal_equations(part, solution)
    np.testing.assert_allclose(solution.cov @ normal, np.eye(len(normal)), atol=1e-9)
    sure = Part(
        tuple(replace(g, eta=1e4 * g.eta, matrix=1e4 * g.matrix) for g in part.groups), part.unknowns, part.prior
    )
    solution = solve(sure, TAU)
    normal = normal_equations(sure, solution)
    np.testing.assert_allclose(solution.cov @ normal, np.eye(len(normal)), atol=1e-6)


def test_a_change_more_is_the_solution_with_it(part: Part) -> None:
    changes = some_changes(part)
    whole, grown = solve(part, TAU, changes), solve(part, TAU)
    for change in changes:
        grown = with_change(grown, change)
    np.testing.assert_allclose(grown.x, whole.x, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(grown.cov, whole.cov, rtol=1e-8, atol=1e-10)


def right_hand_side(part: Part, solution: Solution) -> FloatArray:
    out = np.zeros(len(solution.x))
    for one in solution.marginals:
        for j in range(len(one.eta)):
            out += full_design(one.group.index[j], solution, part).T @ one.eta[j]
    return out


def test_z_of_every_shape_is_that_of_the_equations(part: Part) -> None:
    """u, I of each unknown's best shape recording by recording, with two changes in the model and its level free."""
    solution = solve(part, TAU, some_changes(part)[:2])
    right = right_hand_side(part, solution)
    found = scan(look(solution), PLAN.tests)
    assert len(found) == len(part.unknowns)
    for one in found:
        cov = np.linalg.inv(normal_equations(part, solution, one.unknown))
        x = cov @ right
        score, own, across = 0.0, 0.0, np.zeros(len(solution.x))
        level = np.array([one.amount[one.track.index[one.track.bin == b]].mean() for b in one.track.bin])
        np.testing.assert_allclose(one.amount[one.track.index], level)
        for marginal in solution.marginals:
            for j, place in enumerate(marginal.group.index):
                design = full_design(place, solution, part)
                does = design[:, one.unknown] * one.amount[place]
                score += float(does @ (marginal.eta[j] - marginal.matrix[j] @ design @ x))
                own += float(does @ marginal.matrix[j] @ does)
                across += design.T @ marginal.matrix[j] @ does
        info = own - float(across @ cov @ across)
        np.testing.assert_allclose(one.size, score / info, rtol=1e-5, atol=1e-8)
        assert abs(one.z) <= abs(score) / np.sqrt(info) * (1.0 + 1e-5)


def test_z_is_what_the_change_is_in_the_solution_that_has_it(part: Part) -> None:
    """Size over standard uncertainty, also where the level is far beyond the rig's stated u: it is free in both."""
    far = 30.0 * np.eye(len(part.unknowns))[3]
    moved = [replace(g, eta=g.eta + g.matrix @ (g.design @ far[g.at])) for g in part.groups]
    seen = look(solve(Part(tuple(moved), part.unknowns, part.prior), TAU))
    for one in [f for f in scan(seen, PLAN.tests) if f.unknown < 6]:
        grown = with_change(seen.solution, Change(one.unknown, one.amount))
        np.testing.assert_allclose(grown.x[-1], one.size, rtol=1e-5, atol=1e-7)
        spread = np.sqrt(grown.cov[-1, -1]) * excess(one.track)
        np.testing.assert_allclose(grown.x[-1] / spread, one.z, rtol=1e-5, atol=1e-7)


def test_looking_again_sees_what_a_new_look_sees(part: Part) -> None:
    changes = some_changes(part)
    again: Look = look(solve(part, TAU, changes[:1]))
    for change in changes[1:]:
        again = look_again(again, change)
    assert_equal_looks(again, look(solve(part, TAU, changes)))


def assert_equal_looks(again: Look, new: Look) -> None:
    for one, other in zip(again.sights, new.sights, strict=True):
        assert isinstance(one, Sight)
        for name in ("info", "shared", "level"):
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(again.solution.cov, new.solution.cov, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(again.solution.x, new.solution.x, rtol=1e-6, atol=1e-8)
    pairs = list(zip(scan(again, PLAN.tests), scan(new, PLAN.tests), strict=True))
    assert [a.unknown for a, _ in pairs[:10]] == [b.unknown for _, b in pairs[:10]]
    np.testing.assert_allclose([a.z for a, _ in pairs], [b.z for _, b in pairs], rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("number", [0, 1, 2, 3])
def test_looking_without_a_change_sees_what_a_look_that_never_had_it_sees(part: Part, number: int) -> None:
    """Also one of two changes of an unknown (the first and the last): its level stays free until the other goes too."""
    changes = (*some_changes(part), Change(0, np.linspace(0.0, 1.0, PLAN.tests)))
    rest = [c for k, c in enumerate(changes) if k != number]
    again = look_without(look(solve(part, TAU, changes)), number)
    assert_equal_looks(again, look(solve(part, TAU, rest)))
    new = [k for k, c in enumerate(rest) if c.unknown == 0][-1]
    assert_equal_looks(look_without(again, new), look(solve(part, TAU, [c for k, c in enumerate(rest) if k != new])))


def test_of_a_change_that_the_model_has_nothing_is_left_to_be_seen(part: Part) -> None:
    """Else it could be taken again and again, now that an unknown may change more than once."""
    (best, *_) = scan(look(solve(part, TAU)), PLAN.tests)
    again = scan(look(solve(part, TAU, [Change(best.unknown, best.amount)])), PLAN.tests)
    (other,) = [f for f in again if f.unknown == best.unknown]
    assert not np.array_equal(other.amount, best.amount)
    assert abs(other.z) < abs(best.z)
