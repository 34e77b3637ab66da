"""Directional forgetting: what new data replace goes, everything else is kept."""

import numpy as np
import pytest
from estimator_kernels import in_python, left_by
from estimator_plants import PITCH, Array, fourier, noisy_batch, quiet_batch

from wingwatch.estimators import FourierState
from wingwatch.estimators.evidence.forgetting import EXCITED
from wingwatch.estimators.fourier.memory import memory_workspace, replace
from wingwatch.estimators.fourier.state import Memory

DECAY = 0.2


def positive(k: int, rank: int, seed: int) -> Array:
    root = np.random.default_rng(seed).standard_normal((k, rank))
    return np.asarray(root @ root.T)


def left(discounted: Array, known: Array, gained: Array) -> Array:
    q = left_by(discounted, known, gained, DECAY)
    return np.asarray(q @ discounted @ q.T)


def test_nothing_new_leaves_all() -> None:
    reserve, known = positive(6, 6, 1), positive(6, 6, 2)
    np.testing.assert_allclose(left(reserve, known, np.zeros((6, 6))), reserve, rtol=1e-8, atol=1e-9)


def test_where_everything_is_excited_nothing_is_left() -> None:
    reserve, known = positive(6, 6, 3), positive(6, 6, 4)
    np.testing.assert_allclose(left(reserve, known, DECAY * known), 0.0, atol=1e-9)


def test_what_is_hardly_excited_stays() -> None:
    reserve, known = positive(6, 6, 5), positive(6, 6, 6)
    np.testing.assert_allclose(
        left(reserve, known, 0.5 * EXCITED * DECAY * known), reserve, rtol=1e-6, atol=1e-9
    )


def test_the_marginal_of_the_excited_goes_and_the_conditional_of_the_others_stays() -> None:
    """With the excited parameter known from elsewhere, the others are as well known as before; without, not at all."""
    reserve, gained = positive(4, 4, 20), np.diag([5.0, 0.0, 0.0, 0.0])
    after = left(reserve, np.eye(4) + reserve + gained, gained)
    np.testing.assert_allclose(after[1:, 1:], reserve[1:, 1:], rtol=1e-6)
    marginal = after[0, 0] - after[0, 1:] @ np.linalg.solve(after[1:, 1:], after[1:, 0])
    assert abs(marginal) < 1e-6 * reserve[0, 0]


def test_what_is_known_of_other_directions_stays() -> None:
    """Along directions of which the new data say nothing, all as sure as before."""
    known, gained = positive(6, 6, 7), 10.0 * positive(6, 2, 8)
    after = left(known, known + gained, gained)
    untouched = np.linalg.svd(gained)[0][:, 2:]
    np.testing.assert_allclose(untouched.T @ after @ untouched, untouched.T @ known @ untouched, rtol=1e-7)
    assert np.linalg.matrix_rank(after, tol=1e-7) == 4


@pytest.mark.parametrize("seed", range(5))
def test_discounted_information_never_grows_and_stays_information(seed: int) -> None:
    known, gained = positive(5, 5, seed), positive(5, 2, seed + 50)
    total = known + gained
    after = np.linalg.eigvalsh(left(known, total, gained))
    assert after[0] > -1e-9
    assert np.trace(np.linalg.solve(total, left(known, total, gained))) <= np.trace(
        np.linalg.solve(total, known)
    )


def test_units_do_not_matter() -> None:
    reserve, known, gained = positive(4, 4, 9), positive(4, 4, 10), positive(4, 2, 11)
    unit = np.diag([1.0, 1e3, 1e-4, 20.0])
    scaled = left(unit @ reserve @ unit, unit @ known @ unit, unit @ gained @ unit)
    np.testing.assert_allclose(scaled, unit @ left(reserve, known, gained) @ unit, rtol=1e-6, atol=1e-9)


def test_numbers_that_are_not_finite_replace_nothing() -> None:
    broken = np.eye(3)
    broken[0, 0] = np.nan
    np.testing.assert_array_equal(left_by(np.eye(3), np.eye(3), broken, DECAY), np.eye(3))


def test_quiet_flight_leaves_what_is_known_to_the_bit() -> None:
    runner = fourier(PITCH)
    state = runner.run(noisy_batch(PITCH, 40.0, 1))
    assert isinstance(state, FourierState)
    quiet = quiet_batch(PITCH, 140.0)
    quiet[..., 0] += 40.0
    runner.run(quiet[:, :1000], state)
    known = state.sensitivity.copy()
    runner.run(quiet[:, 1000:], state)
    np.testing.assert_array_equal(state.sensitivity, known)


def test_while_all_is_excited_nothing_discounted_is_left() -> None:
    """With a doublet every five seconds the memory is the time constant's, to a few per cent of what is known."""
    runner = fourier(PITCH)
    state = runner.run(noisy_batch(PITCH, 120.0, 2))
    assert isinstance(state, FourierState)
    for i in range(2):
        reserve, known = np.diag(state.discounted_sensitivity[i]), np.diag(state.sensitivity[i])
        assert (reserve < 0.05 * known).all()


@pytest.mark.parametrize("seed", range(8))
def test_what_goes_takes_no_mean_with_it(seed: int) -> None:
    """A block and a memory that agree, known to 1e-4 of each derivative, in part hardly at all: they still agree."""
    rng, k = np.random.default_rng(seed), 15
    spread = np.diag(10.0 ** rng.uniform(-4.0, 4.0, k))

    def known(rank: int, shift: int) -> Array:
        matrix = spread @ positive(k, rank, seed + shift) @ spread
        return np.asarray(0.5 * (matrix + matrix.T))

    reserve = known(9, 0) + 1e-6 * known(15, 300)
    kept, gained = known(12, 100), 1e-2 * known(4, 200)
    theta = 1e4 * np.linalg.solve(spread, rng.standard_normal(k))
    matrices = reserve + kept, reserve.copy()
    memory, discounted = (Memory(a.copy(), a.copy(), a @ theta, np.zeros(k)) for a in matrices)
    near = theta + 3.0 * np.linalg.solve(spread, rng.standard_normal(k))
    prior_std = 1e3 / np.diagonal(spread)
    in_python(replace)(DECAY, gained, near, prior_std, memory, discounted, memory_workspace(k))
    for left_over in (memory, discounted):
        np.testing.assert_array_equal(left_over.sensitivity, left_over.sensitivity.T)
    size = np.sqrt(np.diagonal(reserve))
    unit = discounted.sensitivity / (size[:, None] * size)
    assert np.linalg.eigvalsh(unit)[0] > -1e-6
    # In standard errors of what is known: how far the memory's score is from nothing at the mean that went in.
    off = memory.vector - memory.sensitivity @ theta
    total = memory.sensitivity + gained + np.diag(prior_std**-2)
    assert np.sqrt(off @ np.linalg.solve(total, off)) < 0.05
