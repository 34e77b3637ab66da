"""What a residual that no sensor explains adds to an error: nothing without it, and never more than the bound."""

import numpy as np
import pytest
from numpy.typing import NDArray

from wingwatch.estimators.offline.endogeneity import Difference, left_unexplained, may_be_off

Array = NDArray[np.float64]


def difference(value: Array, covariance: Array, bound: Array) -> Difference:
    return Difference(np.asarray(value), np.asarray(covariance), np.asarray(bound))


def test_a_difference_within_chance_adds_its_covariance_alone() -> None:
    covariance = np.array([[0.04, 0.01], [0.01, 0.09]])
    found = may_be_off([difference(np.array([0.1, -0.2]), covariance, 100.0 * np.eye(2))])
    np.testing.assert_allclose(found, covariance)


def test_a_difference_beyond_chance_adds_itself() -> None:
    covariance, value = np.diag([0.04, 0.09]), np.array([2.0, 0.1])
    found = may_be_off([difference(value, covariance, 100.0 * np.eye(2))])
    np.testing.assert_allclose(found, covariance + np.outer(value, value))


def test_no_error_passes_the_bound() -> None:
    """|sum h e| is at most |h| |e|, whatever the instruments say or where there are none."""
    bound = np.diag([0.01, 0.02])
    for d in (
        difference(np.array([2.0, 1.0]), np.diag([0.04, 0.09]), bound),
        difference(np.array([0.0, 0.0]), np.diag([4.0, 9.0]), bound),
        difference(np.array([np.nan, np.nan]), np.zeros((2, 2)), bound),
    ):
        np.testing.assert_allclose(np.diagonal(may_be_off([d])), np.diagonal(bound))


@pytest.mark.parametrize("freedom", [50.0, 5000.0])
def test_a_residual_that_chance_explains_leaves_nothing(freedom: float) -> None:
    rng = np.random.default_rng(3)
    ratios = rng.chisquare(freedom, 2000) / freedom
    called = np.mean([left_unexplained(float(r), 1.0, freedom) > 0.0 for r in ratios])
    assert 0.003 < called < 0.02, "one in a hundred by chance"
    assert left_unexplained(2.0, 1.0, freedom) == 1.0
