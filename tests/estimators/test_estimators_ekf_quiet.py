"""A filter that knows what the data carried: noise leaves no trace in what it knows, signal stays."""

import numpy as np
import pytest
from estimator_plants import PITCH, SOLVE_EVERY, YAW, Array, Plant, Runner, ekf, noisy_batch, quiet_batch

from wingwatch.estimators import EkfEstimator, EkfState
from wingwatch.estimators.ekf.accepted import NOISE, SIGNAL, UNDECIDED

plants = pytest.mark.parametrize("plant", [PITCH, YAW], ids=["short_period", "dutch_roll"])


def filter_of(runner: Runner) -> EkfEstimator:
    assert isinstance(runner.estimator, EkfEstimator)
    return runner.estimator


def known(estimator: EkfEstimator, state: EkfState, vehicle: int = 0) -> tuple[Array, Array]:
    estimate = estimator.estimate(state, vehicle)
    return estimate.value, estimate.covariance


def feed(estimator: EkfEstimator, state: EkfState, batch: Array, seen: int | None) -> None:
    """Solved every half second with the same decision, or with none."""
    for start in range(0, batch.shape[1], SOLVE_EVERY):
        estimator.update(state, batch[:, start : start + SOLVE_EVERY])
        estimator.solve(state, None if seen is None else np.full(len(batch), seen))


@plants
def test_noise_teaches_nothing(plant: Plant) -> None:
    estimator = filter_of(ekf(plant))
    batch = quiet_batch(plant, 30.0)
    decided, undecided = estimator.init(1), estimator.init(1)
    feed(estimator, decided, batch, NOISE)
    feed(estimator, undecided, batch, None)
    prior = estimator.config
    value = np.linalg.solve(decided.information[0], decided.vector[0])
    np.testing.assert_allclose(value, prior.prior_value, rtol=1e-6)
    np.testing.assert_allclose(decided.variance[0], prior.prior_std**2, rtol=1e-6)
    np.testing.assert_allclose(
        decided.gained_matrix[0] * np.outer(prior.prior_std, prior.prior_std), 0.0, atol=1e-6
    )
    alone = np.sqrt(np.diagonal(known(estimator, undecided)[1]))
    np.testing.assert_allclose(alone, np.sqrt(np.diagonal(known(estimator, decided)[1])), rtol=0.1)


@plants
def test_what_was_undecided_goes_with_the_next_decision(plant: Plant) -> None:
    estimator = filter_of(ekf(plant))
    batch = noisy_batch(plant, 14.0, 1)
    always, late, never = (estimator.init(1) for _ in range(3))
    half = SOLVE_EVERY * 16
    feed(estimator, always, batch, SIGNAL)
    feed(estimator, late, batch[:, :half], UNDECIDED)
    feed(estimator, late, batch[:, half:], SIGNAL)
    feed(estimator, never, batch[:, :half], UNDECIDED)
    before = known(estimator, never)
    feed(estimator, never, batch[:, half : half + SOLVE_EVERY], NOISE)
    for one, other in zip(known(estimator, always), known(estimator, late), strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_allclose(never.variance[0], estimator.config.prior_std**2, rtol=1e-6)
    assert (np.diagonal(before[1]) < 0.5 * np.diagonal(known(estimator, never)[1])).all()


@plants
def test_a_filter_that_knows_of_nothing_but_signal_is_the_filter(plant: Plant) -> None:
    estimator = filter_of(ekf(plant))
    batch = noisy_batch(plant, 12.0, 3)
    decided, undecided = estimator.init(3), estimator.init(3)
    feed(estimator, decided, batch, SIGNAL)
    feed(estimator, undecided, batch, None)
    np.testing.assert_array_equal(decided.z, undecided.z)
    np.testing.assert_array_equal(decided.cov, undecided.cov)
    np.testing.assert_array_equal(decided.gained_matrix, undecided.gained_matrix)


@plants
def test_quiet_after_a_flight_moves_nothing(plant: Plant) -> None:
    """Nor does it forget, once the time is over in which it forgets unexcited flight at all."""
    estimator = filter_of(ekf(plant))
    state = estimator.init(1)
    feed(estimator, state, noisy_batch(plant, 14.0, 1), SIGNAL)
    quiet = quiet_batch(plant, 120.0)
    quiet[:, :, 0] += 14.0
    feed(estimator, state, quiet[:, : 40 * 50], NOISE)
    value, covariance = known(estimator, state)
    feed(estimator, state, quiet[:, 40 * 50 :], NOISE)
    after, covariance_after = known(estimator, state)
    np.testing.assert_allclose(after, value, rtol=1e-6)
    np.testing.assert_allclose(covariance_after, covariance, rtol=1e-6, atol=1e-9 * covariance.max())
