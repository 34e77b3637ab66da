"""Linear algebra of small matrices against numpy's."""

import numpy as np
import pytest
from numpy.typing import NDArray

from wingwatch.estimators.kernels import symmetric

Array = NDArray[np.float64]


def some(n: int, seed: int) -> Array:
    """A positive definite matrix."""
    root = np.random.default_rng(seed).standard_normal((n, n))
    return np.asarray(root @ root.T + 0.1 * np.eye(n))


def eigen(matrix: Array) -> tuple[Array, Array]:
    n = len(matrix)
    rows, values = matrix.copy(), np.empty(n)
    symmetric.eigen(rows, values, np.empty(n), np.empty(n))
    return values, rows


@pytest.mark.parametrize("n", [1, 2, 3, 6, 15])
@pytest.mark.parametrize("rank", ["full", "one", "diagonal", "nothing"])
def test_eigenvectors_take_a_matrix_apart(n: int, rank: str) -> None:
    matrix = some(n, n)
    if rank == "one":
        matrix = np.outer(matrix[0], matrix[0])
    elif rank == "diagonal":
        matrix = np.diag(np.diagonal(matrix)[::-1])
    elif rank == "nothing":
        matrix = np.zeros((n, n))
    values, rows = eigen(matrix)
    size = max(np.abs(matrix).max(), 1e-300)
    np.testing.assert_allclose(values, np.linalg.eigvalsh(matrix), rtol=0.0, atol=1e-13 * n * size)
    np.testing.assert_allclose(rows @ rows.T, np.eye(n), rtol=0.0, atol=1e-13)
    np.testing.assert_allclose((rows.T * values) @ rows, matrix, rtol=0.0, atol=1e-13 * n * size)


def test_numbers_that_are_not_finite_raise_nothing() -> None:
    values, _ = eigen(np.full((6, 6), np.nan))
    assert np.isnan(values).any()


@pytest.mark.parametrize("n", [1, 2, 6, 15])
def test_solutions_solve(n: int) -> None:
    matrix, rows = some(n, n), np.random.default_rng(0).standard_normal((n, n + 1))
    root, out, half = np.zeros((n, n)), np.empty((n, n)), np.empty((n, n))
    assert symmetric.cholesky(matrix, 0.0, root)
    np.testing.assert_allclose(root @ root.T, matrix, rtol=1e-12, atol=1e-12)
    solved = rows.copy()
    symmetric.forward(root, solved)
    np.testing.assert_allclose(root @ solved, rows, rtol=1e-10, atol=1e-10)
    symmetric.backward(root, solved)
    np.testing.assert_allclose(matrix @ solved, rows, rtol=1e-9, atol=1e-9)
    symmetric.invert(matrix.copy(), out)
    np.testing.assert_allclose(out @ matrix, np.eye(n), rtol=0.0, atol=1e-9)
    symmetric.congruence(rows[:, :n].copy(), matrix, half, out)
    np.testing.assert_allclose(out, rows[:, :n] @ matrix @ rows[:, :n].T, rtol=1e-10, atol=1e-10)


def test_elimination_exchanges_rows() -> None:
    matrix = np.array([[0.0, 2.0, 1.0], [1e-14, 1.0, 3.0], [4.0, 1.0, 0.0]])
    rows = np.arange(6.0).reshape(3, 2)
    solved = rows.copy()
    symmetric.solve_general(matrix.copy(), solved, 3)
    np.testing.assert_allclose(matrix @ solved, rows, rtol=0.0, atol=1e-12)


def test_a_matrix_that_is_not_positive_is_told() -> None:
    root = np.zeros((2, 2))
    assert not symmetric.cholesky(np.array([[1.0, 2.0], [2.0, 1.0]]), 0.0, root)
