"""Rows of numbers that a kernel adds in one go, against numpy."""

import numpy as np
import pytest
from numba import njit

from wingwatch.kernels.rows import ROW, add_row, add_rows


@njit
def _add_row(into, i, weight, of, j):  # type: ignore[no-untyped-def]
    add_row(into, i, weight, of, j)


@njit
def _add_rows(into, i, weights, columns, first, end, of):  # type: ignore[no-untyped-def]
    add_rows(into, i, weights, columns, first, end, of)


def test_rows_are_added_as_numpy_adds_them_and_no_other_row_is_touched() -> None:
    random = np.random.default_rng(1)
    into, of = random.normal(size=(5, ROW)), random.normal(size=(7, ROW))
    said = into.copy()
    _add_row(said, 3, -0.7, of, 6)
    np.testing.assert_allclose(said[3], into[3] - 0.7 * of[6], rtol=1e-15, atol=1e-15)
    weights, columns = random.normal(size=9), np.array([6, 0, 3, 3, 1, 5, 2, 4, 6])
    _add_rows(said, 0, weights, columns, 2, 8, of)
    np.testing.assert_allclose(said[0], into[0] + weights[2:8] @ of[columns[2:8]], rtol=1e-14, atol=1e-14)
    assert np.array_equal(said[[1, 2, 4]], into[[1, 2, 4]])


def test_none_of_many_rows_is_nothing() -> None:
    into = np.ones((1, ROW))
    _add_rows(into, 0, np.ones(3), np.arange(3), 1, 1, np.full((3, ROW), np.nan))
    assert (into == 1.0).all()


def test_a_row_may_be_added_to_itself() -> None:
    rows = np.arange(2.0 * ROW).reshape(2, ROW)
    _add_row(rows, 1, 2.0, rows, 1)
    assert np.array_equal(rows, np.stack([np.arange(ROW), 3.0 * np.arange(ROW, 2.0 * ROW)]))


@pytest.mark.parametrize("wrong", [np.ones((2, 2 * ROW))[:, ::2], np.ones((2, ROW), dtype=np.float32)])
def test_what_is_no_contiguous_array_of_float64_is_refused(wrong: object) -> None:
    with pytest.raises(TypeError, match="contiguous arrays of float64"):
        _add_row(np.ones((2, ROW)), 0, 1.0, wrong, 0)
