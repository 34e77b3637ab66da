"""Evidence as both online estimators use it: what J and h stand for, what is no chance, what goes with the motion."""

import numpy as np
import pytest
from estimator_kernels import in_python
from scipy.stats import chi2, norm

from wingwatch.estimators.evidence import chance, dispersion, information

beyond_chance, chance_of = in_python(chance.beyond_chance), in_python(chance.chance_of)
coherent_dispersion = in_python(dispersion.coherent_dispersion)
believe, times = in_python(information.believe), in_python(information.times)


def test_a_mean_and_covariance_come_back_from_their_evidence() -> None:
    rng = np.random.default_rng(1)
    root, mean = rng.standard_normal((5, 8)), rng.standard_normal(5)
    covariance = root @ root.T
    matrix = np.linalg.inv(covariance)
    found, value = np.empty((5, 5)), np.empty(5)
    assert believe(matrix, matrix @ mean, np.empty((5, 5)), found, value)
    np.testing.assert_allclose(found, covariance, rtol=1e-8)
    np.testing.assert_allclose(value, mean, rtol=1e-8)


def test_evidence_of_independent_data_adds_up() -> None:
    rng = np.random.default_rng(2)
    regressors, noise = rng.standard_normal((40, 3)), rng.standard_normal(40)
    readings = regressors @ [1.0, -2.0, 0.5] + noise
    halves = [(x.T @ x, x.T @ y) for x, y in zip(np.split(regressors, 2), np.split(readings, 2), strict=True)]
    value = np.empty(3)
    matrix, vector = halves[0][0] + halves[1][0], halves[0][1] + halves[1][1]
    believe(matrix, vector, np.empty((3, 3)), np.empty((3, 3)), value)
    np.testing.assert_allclose(value, np.linalg.lstsq(regressors, readings, rcond=None)[0], rtol=1e-10)


@pytest.mark.parametrize("matrix", [np.diag([1.0, -1.0]), np.diag([1.0, 0.0]), np.diag([1.0, np.nan])])
def test_evidence_that_is_no_distribution_is_said_to_be_none(matrix: np.ndarray) -> None:
    assert not believe(matrix, np.ones(2), np.empty((2, 2)), np.empty((2, 2)), np.empty(2))


def test_a_matrix_that_is_not_square_is_multiplied_too() -> None:
    out = np.empty(2)
    times(np.array([[1.0, 2.0, 3.0], [0.0, 1.0, 0.0]]), np.array([1.0, 1.0, 2.0]), out)
    np.testing.assert_array_equal(out, [9.0, 1.0])


@pytest.mark.parametrize("freedom", [3, 10, 100])
def test_what_is_beyond_chance_is_that_once_in_thirty_thousand(freedom: int) -> None:
    """Wilson and Hilferty's normal approximation: the limit is that of chi-square to 5 %, of few squares too."""
    limit = float(chi2.isf(norm.sf(chance.CHANCE), freedom))
    assert chance_of(float(freedom)) == pytest.approx(limit, rel=0.05)
    assert beyond_chance(1.06 * limit, float(freedom))
    assert not beyond_chance(0.94 * limit, float(freedom))


def test_what_goes_with_the_motion_widens_as_far_as_it_is_known_to() -> None:
    assert coherent_dispersion(1.0, 1.0, 10.0, 0.0) == 1.0
    assert coherent_dispersion(0.2, 1.0, 10.0, 0.0) == 1.0  # never less than noise
    few, many = (coherent_dispersion(5.0, 1.0, freedom, 0.0) for freedom in (1.0, 1000.0))
    assert 1.0 < few < many < 5.0
    assert coherent_dispersion(5.0, 1.0, 10.0, 4.0) > coherent_dispersion(
        5.0, 1.0, 10.0, 0.0
    )  # fits have taken some
