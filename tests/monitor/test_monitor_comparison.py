"""The comparison's algebra against direct formulas that invert what may be inverted."""

from dataclasses import fields
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import multivariate_normal

from wingwatch.aircraft import SHORT_PERIOD, FlightCondition, load_aircraft
from wingwatch.monitor.detection.comparison import (
    Change,
    Coordinates,
    along,
    bias_of,
    blurred,
    change_since,
    log_bayes_any,
    log_bayes_direction,
)

CONDITION = FlightCondition(25.0, 1000.0, angle_of_attack_rad=0.05)


def _spd(rng: np.random.Generator, k: int) -> np.ndarray:
    root = rng.normal(size=(k, k))
    return np.asarray(root @ root.T + np.eye(k))


def _change(rng: np.random.Generator, k: int = 4) -> Change:
    information = _spd(rng, k)
    return change_since(
        rng.normal(size=k),
        np.linalg.inv(_spd(rng, k)),
        information,
        rng.normal(size=k),
        0.1 * _spd(rng, k),
        np.ones(k),
    )


@given(seed=st.integers(0, 10_000))
def test_change_equals_the_formula_with_inverses(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mean, covariance, information = rng.normal(size=4), _spd(rng, 4), _spd(rng, 4)
    vector, extra = rng.normal(size=4), 0.1 * _spd(rng, 4)
    found = change_since(mean, covariance, information, vector, extra, np.ones(4))
    precision = np.linalg.inv(np.linalg.inv(information) + covariance + extra)
    difference = np.linalg.solve(information, vector) - mean
    np.testing.assert_allclose(found.precision, precision, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(found.score, precision @ difference, rtol=1e-6, atol=1e-8)


def test_a_block_that_saw_nothing_says_nothing() -> None:
    nothing = np.zeros((3, 3))
    found = change_since(np.ones(3), np.eye(3), nothing, np.zeros(3), np.eye(3), np.ones(3))
    assert np.all(found.precision == 0.0)
    assert np.all(found.score == 0.0)
    assert log_bayes_any(found, np.ones(3)) == 0.0
    exact = along(found, np.ones((1, 3)), np.zeros((1, 3)))
    factor, size, _ = log_bayes_direction(exact.score, exact.precision, 0.3)
    assert factor == pytest.approx(0.0, abs=1e-12)
    assert size == 0.0


@given(score=st.floats(-30.0, 30.0), precision=st.floats(0.01, 500.0), std=st.floats(0.05, 1.0))
def test_directed_factor_is_the_integral_over_the_half_normal_prior(
    score: float, precision: float, std: float
) -> None:
    # a normal density times a constant: taken out of the exponent at its peak, integrated piecewise around it
    width = (precision + std**-2) ** -0.5
    peak = max(score * width**2, 0.0)
    highest = peak * score - 0.5 * (peak / width) ** 2

    def integrand(size: float) -> float:
        return float(np.exp(size * score - 0.5 * (size / width) ** 2 - highest))

    edges = np.unique(np.maximum(peak + width * np.arange(-9.0, 10.0, 1.5), 0.0))
    integral = sum(quad(integrand, a, b)[0] for a, b in pairwise(edges.tolist()))
    expected = highest + np.log(integral) + np.log(2.0 / (std * np.sqrt(2.0 * np.pi)))
    assert log_bayes_direction(score, precision, std)[0] == pytest.approx(expected, rel=1e-7, abs=1e-7)


@given(seed=st.integers(0, 10_000))
def test_undirected_factor_is_a_ratio_of_normal_densities(seed: int) -> None:
    rng = np.random.default_rng(seed)
    change = _change(rng)
    spread = rng.uniform(0.1, 2.0, size=4)
    covariance = np.linalg.inv(change.precision)
    difference = covariance @ change.score
    changed = multivariate_normal(np.zeros(4), covariance + np.diag(spread**2)).logpdf(difference)
    same = multivariate_normal(np.zeros(4), covariance).logpdf(difference)
    assert log_bayes_any(change, spread) == pytest.approx(changed - same, rel=1e-6, abs=1e-8)


def test_a_bayes_factor_has_expectation_one_when_nothing_changed() -> None:
    rng = np.random.default_rng(5)
    n, precision, std = 200_000, 4.0, 0.5
    scores = rng.normal(size=n) * np.sqrt(precision)
    factors = np.array([np.exp(log_bayes_direction(float(p), precision, std)[0]) for p in scores[:20_000]])
    # the factor's own variance under the null is finite here: precision * std^2 = 1 < 3
    assert abs(factors.mean() - 1.0) < 4.0 * factors.std() / np.sqrt(factors.size)


@given(seed=st.integers(0, 10_000))
def test_a_spread_of_the_derivatives_adds_variance_to_what_is_seen_along_a_direction(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, second = _change(rng), _change(rng)
    both = Change(*(np.stack([getattr(c, f.name) for c in (first, second)]) for f in fields(Change)))
    directions = rng.normal(size=(3, 2, 4))
    spread = rng.uniform(0.0, 2.0, size=(3, 2, 4))
    spread[1] = 0.0
    found = along(both, directions, spread)
    for m, change in enumerate((first, second)):
        covariance = np.linalg.inv(change.precision)
        for n, (a, s) in enumerate(zip(directions[:, m], spread[:, m], strict=True)):
            precision = np.linalg.inv(covariance + np.diag(s**2))
            assert found.precision[n, m] == pytest.approx(a @ precision @ a, rel=1e-6)
            assert found.score[n, m] == pytest.approx(
                a @ precision @ covariance @ change.score, rel=1e-6, abs=1e-8
            )
            assert found.log_factor[n, m] == pytest.approx(log_bayes_any(change, s), rel=1e-9, abs=1e-12)


@given(seed=st.integers(0, 10_000), seen=st.integers(1, 5))
def test_a_bias_is_found_as_far_as_the_information_sees_it(seed: int, seen: int) -> None:
    """Derivatives of different units; directions that no block saw."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(5, seen)) * 10.0 ** rng.uniform(-3.0, 3.0, size=(5, 1))
    information = np.stack([root @ root.T, np.zeros((5, 5))])
    bias = rng.normal(size=5) / np.abs(root).max(axis=1)
    pushed = np.stack([information[0] @ bias, np.zeros(5)])
    found = bias_of(information, pushed)
    scale = np.sqrt(np.diagonal(information[0]))
    np.testing.assert_allclose(information[0] @ found[0] / scale, pushed[0] / scale, rtol=1e-6, atol=1e-6)
    assert found[0] @ pushed[0] == pytest.approx(bias @ pushed[0], rel=1e-6, abs=1e-9)
    assert not found[1].any()
    assert np.isfinite(bias_of(1e-300 * information, 1e-300 * pushed)).all()


@given(seed=st.integers(0, 10_000))
def test_blurring_keeps_the_estimate_and_widens_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    information, vector, bias = _spd(rng, 4), rng.normal(size=4), rng.normal(size=4)
    variance = rng.uniform(0.0, 1.0, size=4)
    j, h, b = blurred(information, vector, bias, variance)
    np.testing.assert_allclose(j, np.linalg.inv(np.linalg.inv(information) + np.diag(variance)), rtol=1e-6)
    np.testing.assert_allclose(np.linalg.solve(j, h), np.linalg.solve(information, vector), rtol=1e-6)
    np.testing.assert_allclose(np.linalg.solve(j, b), np.linalg.solve(information, bias), rtol=1e-6)


@pytest.mark.parametrize("name", ["aerosonde", "jetstream31"])
def test_coordinates_round_trip_and_carry_evidence(name: str) -> None:
    aircraft = load_aircraft(name)
    coordinates = Coordinates(SHORT_PERIOD, aircraft, (25.0, 1.1116))
    rng = np.random.default_rng(3)
    value, covariance = rng.normal(size=6) * 10.0, _spd(rng, 6)
    at = coordinates.at(CONDITION)
    scale, offset = at.scale, at.offset
    inside, spread = at.from_concise(value, covariance)
    np.testing.assert_allclose(scale * inside + offset, value, rtol=1e-12)
    np.testing.assert_allclose(spread * np.outer(scale, scale), covariance, rtol=1e-12)
    # evidence about referred derivatives gives the same estimate as converting that estimate
    information = _spd(rng, 6)
    referred = rng.normal(size=6)
    j, h = at.of_evidence(information, information @ referred)
    slope = at.slope
    assert np.allclose(j, information * np.outer(slope, slope))
    shifted = np.linalg.solve(j, h)
    zero = np.linalg.solve(j, at.of_evidence(information, np.zeros(6))[1])
    np.testing.assert_allclose(shifted - zero, referred / slope, rtol=1e-8)
