"""What campaign health computes for all unknowns at once, against the equations written out for one at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from health_campaigns import Plan, drawn
from nineaudit.array import FloatArray
from nineaudit.campaign.health.connect import parts
from nineaudit.campaign.health.look import Look, Sight, look, look_again
from nineaudit.campaign.health.model import Change, Part, Solution, solve, with_change
from nineaudit.campaign.health.scan import scan

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


def normal_equations(part: Part, solution: Solution) -> FloatArray:
    """Their matrix, from the designs of each recording with its changes."""
    n, size = len(part.unknowns), len(solution.x)
    out = np.diag(np.append(part.prior**-2.0, np.full(size - n, 1e-10)))
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


def test_z_of_every_shape_is_that_of_the_equations(part: Part) -> None:
    """u, I of each unknown's best shape recording by recording, with two changes in the model."""
    solution = solve(part, TAU, some_changes(part)[:2])
    cov = np.linalg.inv(normal_equations(part, solution))
    found = scan(look(solution), PLAN.tests)
    assert len(found) == len(part.unknowns)
    for one in found:
        score, own, across = 0.0, 0.0, np.zeros(len(solution.x))
        level = np.array([one.amount[one.track.index[one.track.bin == b]].mean() for b in one.track.bin])
        np.testing.assert_allclose(one.amount[one.track.index], level)
        for marginal in solution.marginals:
            for j, place in enumerate(marginal.group.index):
                design = full_design(place, solution, part)
                does = design[:, one.unknown] * one.amount[place]
                score += float(does @ (marginal.eta[j] - marginal.matrix[j] @ design @ solution.x))
                own += float(does @ marginal.matrix[j] @ does)
                across += design.T @ marginal.matrix[j] @ does
        info = own - float(across @ cov @ across)
        np.testing.assert_allclose(one.size, score / info, rtol=1e-6, atol=1e-9)
        assert abs(one.z) <= abs(score) / np.sqrt(info) * (1.0 + 1e-6)


def test_looking_again_sees_what_a_new_look_sees(part: Part) -> None:
    changes = some_changes(part)
    again: Look = look(solve(part, TAU, changes[:1]))
    for change in changes[1:]:
        again = look_again(again, change)
    new = look(solve(part, TAU, changes))
    for one, other in zip(again.sights, new.sights, strict=True):
        assert isinstance(one, Sight)
        np.testing.assert_allclose(one.info, other.info, rtol=1e-8, atol=1e-8)
    pairs = list(zip(scan(again, PLAN.tests), scan(new, PLAN.tests), strict=True))
    assert [a.unknown for a, _ in pairs[:10]] == [b.unknown for _, b in pairs[:10]]
    np.testing.assert_allclose([a.z for a, _ in pairs], [b.z for _, b in pairs], rtol=1e-6, atol=1e-8)
