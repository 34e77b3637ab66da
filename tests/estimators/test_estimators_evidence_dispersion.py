"""How much more blocks scatter than they say, by equation, and that it widens what is stated and changes no value."""

import numpy as np
import pytest

from wingwatch.estimators.evidence.dispersion import (
    disperse,
    dispersion_of,
    dispersion_workspace,
    gather_scatter,
)

EQUATIONS, COLUMNS = 2, 3
K = EQUATIONS * COLUMNS
WIDE = 100.0
WORK = dispersion_workspace(K)


def scattered(factors: tuple[float, ...], blocks: int, seed: int, seen: int = K) -> np.ndarray:
    """Scatter of blocks whose errors are larger than stated by the roots of ``factors``, nothing forgotten."""
    rng = np.random.default_rng(seed)
    truth, scatter = rng.standard_normal(K), np.zeros((EQUATIONS, 3))
    known, vector = np.eye(K) / WIDE**2, np.zeros(K)
    wider = np.repeat(np.sqrt(factors), COLUMNS)
    for _ in range(blocks):
        half = rng.standard_normal((seen, 4 * K))
        evidence = np.zeros((K, K))
        evidence[:seen, :seen] = half @ half.T
        error = np.zeros(K)
        error[:seen] = np.linalg.cholesky(np.linalg.inv(evidence[:seen, :seen])) @ rng.standard_normal(seen)
        score = evidence @ (truth + wider * error)
        spread = np.linalg.inv(known)
        gather_scatter(evidence, score, spread @ vector, spread, 1.0, scatter, WORK)
        known += evidence
        vector += score
    return scatter


@pytest.mark.parametrize("factor", [1.0, 4.0])
def test_the_scatter_of_many_blocks_gives_the_factor_by_which_they_err_more_than_they_say(
    factor: float,
) -> None:
    scatter = scattered((factor, factor), 300, 1)
    # The first block is held against the wide prior, which the truth (one of a hundred prior errors) fits too well.
    np.testing.assert_allclose(scatter[:, 1], COLUMNS * 300)
    # Chi-square of 900 degrees of freedom: relative error sqrt(2 / 900); four of them.
    np.testing.assert_allclose(scatter[:, 0] / scatter[:, 1], factor, rtol=4.0 * np.sqrt(2.0 / 900.0))


def test_directions_that_a_block_does_not_see_count_for_nothing() -> None:
    scatter = scattered((1.0, 1.0), 50, 2, seen=COLUMNS + 1)
    np.testing.assert_array_equal(scatter[:, 1], [COLUMNS * 50, 50])


def test_without_blocks_nothing_is_widened_and_one_bad_block_does_not_rule() -> None:
    assert dispersion_of(np.zeros(3)) == 1.0
    assert dispersion_of(np.array([1.0, 30.0, 1.0])) == 1.0
    assert dispersion_of(np.array([12.0, 3.0, 1.0])) == pytest.approx(2.5)


def test_what_was_learned_fades_before_the_next_block_is_held_against_the_memory() -> None:
    scatter = np.array([[40.0, 10.0, 1.0]] * EQUATIONS)
    gather_scatter(np.eye(K), np.full(K, 2.0), np.zeros(K), np.eye(K), 0.5, scatter, WORK)
    # of each equation's columns h' (J + J P J)^-1 h = 4 / 2 a column
    np.testing.assert_allclose(scatter[0], [20.0 + 2.0 * COLUMNS, 5.0 + COLUMNS, 43.0 / 13.0])


def test_evidence_keeps_its_values_and_gets_the_wider_errors() -> None:
    rng = np.random.default_rng(3)
    half = rng.standard_normal((K, 2 * K))
    evidence, value, shift = half @ half.T, rng.standard_normal(K), rng.standard_normal(K)
    before = np.linalg.inv(evidence)
    scatter = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 9.0]])
    vector, bias = evidence @ value, evidence @ shift
    disperse(evidence, vector, bias, scatter, WORK)
    wider = before.copy()
    wider[COLUMNS:, COLUMNS:] *= 9.0
    np.testing.assert_allclose(np.linalg.inv(evidence), wider, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(np.linalg.solve(evidence, vector), value, rtol=1e-8)
    np.testing.assert_allclose(np.linalg.solve(evidence, bias), shift, rtol=1e-8)


def test_a_dispersion_of_one_leaves_evidence_as_it_is_to_the_bit() -> None:
    evidence, vector, bias = np.eye(K) * 3.0, np.arange(float(K)), np.ones(K)
    disperse(evidence, vector, bias, np.ones((EQUATIONS, 3)), WORK)
    np.testing.assert_array_equal(evidence, np.eye(K) * 3.0)
    np.testing.assert_array_equal(vector, np.arange(float(K)))
