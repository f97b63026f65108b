"""Laws of the block-tridiagonal solver: what it gives is what dense linear algebra gives, for any number of nodes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nineaudit.array import FloatArray
from nineaudit.errors import EstimationError
from nineaudit.estimate import block_tridiagonal

Blocks = tuple[FloatArray, FloatArray]
MATRICES = {
    "nodes": st.integers(1, 20),
    "seed": st.integers(0, 2**32 - 1),
    "spread": st.sampled_from([0.0, 1.0, 3.0]),
}


def positive_definite(nodes: int, seed: int, spread: float) -> Blocks:
    """A = LLᵀ + 1 of a block-bidiagonal L, its unknowns then scaled by 10^(±spread)."""
    rng = np.random.default_rng(seed)
    low, across = rng.standard_normal((nodes, 3, 3)), rng.standard_normal((nodes, 3, 3))
    diagonal = low @ low.transpose(0, 2, 1) + np.eye(3)
    diagonal[1:] += across[1:] @ across[1:].transpose(0, 2, 1)
    upper = low[:-1] @ across[1:].transpose(0, 2, 1)
    scale = 10.0 ** rng.uniform(-spread, spread, (nodes, 3))
    diagonal *= scale[:, :, None] * scale[:, None, :]
    upper *= scale[:-1, :, None] * scale[1:, None, :]
    return diagonal, upper


def dense(diagonal: FloatArray, upper: FloatArray) -> FloatArray:
    nodes = len(diagonal)
    out = np.zeros((3 * nodes, 3 * nodes))
    for t in range(nodes):
        out[3 * t : 3 * t + 3, 3 * t : 3 * t + 3] = diagonal[t]
    for t in range(nodes - 1):
        out[3 * t : 3 * t + 3, 3 * t + 3 : 3 * t + 6] = upper[t]
        out[3 * t + 3 : 3 * t + 6, 3 * t : 3 * t + 3] = upper[t].T
    return out


def block(matrix: FloatArray, row: int, column: int) -> FloatArray:
    return matrix[3 * row : 3 * row + 3, 3 * column : 3 * column + 3]


@given(**MATRICES, right=st.integers(1, 4))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_solution_satisfies_the_system(nodes: int, seed: int, spread: float, right: int) -> None:
    diagonal, upper = positive_definite(nodes, seed, spread)
    matrix, wanted = dense(diagonal, upper), np.random.default_rng(seed).standard_normal((3 * nodes, right))
    found = block_tridiagonal.factor(diagonal, upper).solve(wanted)
    assert found.shape == wanted.shape
    # backward error of a Cholesky solution: rounding of the matrix times the solution, row by row
    assert (np.abs(matrix @ found - wanted) <= 1e-12 * (np.abs(matrix) @ np.abs(found) + np.abs(wanted))).all()


@given(**MATRICES)
@settings(max_examples=100, deadline=None, derandomize=True)
def test_determinant_is_the_dense_one(nodes: int, seed: int, spread: float) -> None:
    diagonal, upper = positive_definite(nodes, seed, spread)
    sign, expected = np.linalg.slogdet(dense(diagonal, upper))
    assert sign == 1.0
    assert block_tridiagonal.factor(diagonal, upper).log_determinant() == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(**MATRICES)
@settings(max_examples=100, deadline=None, derandomize=True)
def test_blocks_of_the_inverse_are_the_dense_ones(nodes: int, seed: int, spread: float) -> None:
    diagonal, upper = positive_definite(nodes, seed, spread)
    # inverted in unknowns of like size, where dense inversion is accurate, then scaled back
    size = np.sqrt(np.diagonal(diagonal, axis1=1, axis2=2).ravel())
    inverse = np.linalg.inv(dense(diagonal, upper) / np.outer(size, size)) / np.outer(size, size)
    sd = np.sqrt(np.diag(inverse))
    found, beside = block_tridiagonal.inverse_blocks(diagonal, upper)
    assert found.shape == (nodes, 3, 3)
    assert beside.shape == (nodes - 1, 3, 3)
    unit = np.outer(sd, sd)
    for t in range(nodes):
        assert (np.abs(found[t] - block(inverse, t, t)) <= 1e-9 * block(unit, t, t)).all()
    for t in range(nodes - 1):
        assert (np.abs(beside[t] - block(inverse, t, t + 1)) <= 1e-9 * block(unit, t, t + 1)).all()


@given(nodes=st.integers(1, 20), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_reversed_order_of_nodes_reverses_the_answer(nodes: int, seed: int) -> None:
    diagonal, upper = positive_definite(nodes, seed, 0.0)
    found, beside = block_tridiagonal.inverse_blocks(diagonal, upper)
    turned, turned_beside = block_tridiagonal.inverse_blocks(diagonal[::-1], upper[::-1].transpose(0, 2, 1))
    assert np.allclose(turned[::-1], found, rtol=1e-9, atol=1e-12)
    assert np.allclose(turned_beside[::-1].transpose(0, 2, 1), beside, rtol=1e-9, atol=1e-12)


def test_random_walk_has_its_textbook_covariance() -> None:
    """ω(t+1) = ω(t) + unit noise from ω(−1) = 0: covariance min(s, t) + 1, whatever the length."""
    nodes = 1000
    diagonal = np.repeat(2.0 * np.eye(3)[None], nodes, axis=0)
    diagonal[-1] = np.eye(3)
    upper = np.repeat(-np.eye(3)[None], nodes - 1, axis=0)
    found, beside = block_tridiagonal.inverse_blocks(diagonal, upper)
    steps = np.arange(1.0, nodes + 1.0)
    assert np.allclose(found, steps[:, None, None] * np.eye(3), rtol=1e-9, atol=1e-6)
    assert np.allclose(beside, steps[:-1, None, None] * np.eye(3), rtol=1e-9, atol=1e-6)
    assert block_tridiagonal.factor(diagonal, upper).log_determinant() == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("nodes", [1, 2, 5, 20])
@pytest.mark.parametrize("which", [0, -1])
def test_a_matrix_that_is_not_positive_definite_is_refused_at_its_node(nodes: int, which: int) -> None:
    diagonal, upper = positive_definite(nodes, 3, 0.0)
    diagonal[which, 1, 1] = -1.0
    with pytest.raises(EstimationError, match=f"node {which % nodes} of {nodes}"):
        block_tridiagonal.factor(diagonal, upper)


def test_input_is_left_as_it_was() -> None:
    diagonal, upper = positive_definite(7, 4, 0.0)
    before = diagonal.copy(), upper.copy()
    block_tridiagonal.factor(diagonal, upper).solve(np.ones((21, 1)))
    block_tridiagonal.inverse_blocks(diagonal, upper)
    assert np.array_equal(diagonal, before[0])
    assert np.array_equal(upper, before[1])
