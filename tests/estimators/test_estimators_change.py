"""A derivative that changes is followed, what is known of the others stays, and chance inflates few covariances."""

import numpy as np
import pytest
from convergence import Course
from estimator_kernels import (
    change_of,
    changed_derivatives,
    inflate_covariance,
    since_checkpoint,
    spread_of_change,
)
from estimator_plants import (
    PITCH,
    RATE_HZ,
    SOLVE_EVERY,
    Array,
    curved_signals,
    doublets,
    fourier,
    make_signals,
)
from reference_plant import PLANTS
from tracking import CHANGED, follow_step, stepped_truth

from wingwatch.estimators import FourierEstimator, FourierState
from wingwatch.estimators.evidence.change import CHANGE_LOG_THRESHOLD, WITH_ANOTHER
from wingwatch.estimators.fourier.state import Block, Memory

SIZE = np.array([4.0, 25.0, 2.0, 4.0, 6.0, 32.0])


def some_information(rng: np.random.Generator, precision: float) -> Array:
    """A full-rank information matrix about six derivatives of natural size ``SIZE``."""
    root = rng.standard_normal((6, 12)) * precision / SIZE[:, None]
    return np.asarray(root @ root.T)


def window_of(truth: Array, information: Array, rng: np.random.Generator) -> Array:
    """Vector of a window that saw ``truth`` with its own noise."""
    return np.asarray(information @ truth + np.linalg.cholesky(information) @ rng.standard_normal(6))


def test_the_change_and_no_other_is_found() -> None:
    rng = np.random.default_rng(1)
    for k in range(6):
        memory, window = some_information(rng, 60.0), some_information(rng, 30.0)
        truth = rng.standard_normal(6) * SIZE
        mean = truth + np.linalg.cholesky(np.linalg.inv(memory)) @ rng.standard_normal(6)
        moved = truth + 0.4 * SIZE * (np.arange(6) == k)
        matrix, vector = change_of(window, window_of(moved, window, rng), mean, np.linalg.inv(memory))
        changed = np.zeros(6, dtype=np.bool_)
        assert changed_derivatives(matrix, vector, SIZE, CHANGE_LOG_THRESHOLD, changed) > CHANGE_LOG_THRESHOLD
        assert changed.tolist() == [j == k for j in range(6)]


@pytest.mark.parametrize("alone", [True, False])
def test_others_are_doubted_as_far_as_the_window_says_that_they_have_changed_too(alone: bool) -> None:
    """One derivative loses 40 %; the others stay, or change by 5 % each: the probability of even odds, as computed
    from the joint densities."""
    rng = np.random.default_rng(7)
    memory, window = some_information(rng, 300.0), some_information(rng, 30.0)
    mean = np.linalg.cholesky(np.linalg.inv(memory)) @ rng.standard_normal(6)
    moved = SIZE * np.where(np.arange(6) == 2, 0.4, 0.0 if alone else 0.05)
    matrix, vector = change_of(window, window_of(moved, window, rng), mean, np.linalg.inv(memory))
    changed = np.zeros(6, dtype=np.bool_)
    changed_derivatives(matrix, vector, SIZE, CHANGE_LOG_THRESHOLD, changed)  # takes them out of both
    spread = spread_of_change(matrix.copy(), vector.copy(), SIZE, changed)
    evidence = []
    for others in (0.0, WITH_ANOTHER):
        variance = np.diag((SIZE * np.where(changed, 0.0, others)) ** 2)
        grown = np.eye(6) + matrix @ variance
        evidence.append(
            -0.5 * np.linalg.slogdet(grown)[1] + 0.5 * vector @ variance @ np.linalg.solve(grown, vector)
        )
    expected = WITH_ANOTHER * np.sqrt(1.0 / (1.0 + np.exp(evidence[0] - evidence[1])))
    assert changed[2]
    assert not changed.all()
    assert (spread[changed] == 1.0).all()
    np.testing.assert_allclose(spread[~changed], expected, rtol=1e-6)
    assert (
        (spread[~changed] < 0.5 * WITH_ANOTHER).all()
        if alone
        else (spread[~changed] > 0.9 * WITH_ANOTHER).all()
    )


def test_chance_passes_a_threshold_no_more_often_than_its_inverse() -> None:
    """Markov's inequality on the mean Bayes factor, at a threshold of twenty and 4000 windows without a change."""
    rng, passed = np.random.default_rng(2), 0
    changed = np.zeros(6, dtype=np.bool_)
    for _ in range(4000):
        memory, window = some_information(rng, 10.0), some_information(rng, rng.choice([0.1, 1.0, 10.0]))
        mean = np.linalg.cholesky(np.linalg.inv(memory)) @ rng.standard_normal(6)
        matrix, vector = change_of(window, window_of(np.zeros(6), window, rng), mean, np.linalg.inv(memory))
        passed += changed_derivatives(matrix, vector, SIZE, np.log(20.0), changed) > np.log(20.0)
    assert passed <= 4000 / 20


def test_a_window_that_saw_nothing_inflates_nothing() -> None:
    changed = np.ones(6, dtype=np.bool_)
    matrix, vector = change_of(np.zeros((6, 6)), np.zeros(6), SIZE.copy(), np.diag(SIZE**2))
    assert changed_derivatives(matrix, vector, SIZE, CHANGE_LOG_THRESHOLD, changed) == pytest.approx(0.0)
    assert not changed.any()


def test_inflated_memory_has_the_covariance_of_one_that_may_have_changed() -> None:
    rng = np.random.default_rng(3)
    sensitivity, information = some_information(rng, 10.0), some_information(rng, 10.0)
    vector, bias = rng.standard_normal(6), rng.standard_normal(6)
    inverse = np.linalg.inv(sensitivity)
    before, mean = inverse @ information @ inverse, inverse @ vector
    changed = np.array([False, True, False, False, False, True])
    inflate_covariance(Memory(sensitivity, information, vector, bias), SIZE * changed)
    after = np.linalg.inv(sensitivity)
    np.testing.assert_allclose(
        after @ information @ after, before + np.diag(SIZE**2 * changed), rtol=1e-8, atol=1e-9
    )
    np.testing.assert_allclose(after @ vector, mean, rtol=1e-8)


def block_of(state: FourierState) -> Block:
    """The running block of the first vehicle."""
    return Block(state.bank[0], state.rows[0], state.sums[0], state.roughness[0])


def test_a_block_cut_at_a_checkpoint_is_one_that_began_there() -> None:
    runner = fourier(PITCH)
    rows = make_signals(PITCH, doublets(PITCH, 9.0))[None]
    state, later = runner.init(1), runner.init(1)
    assert isinstance(state, FourierState)
    assert isinstance(later, FourierState)
    runner.update(state, rows[:, :201])
    checkpoint = Block(*(array.copy() for array in block_of(state)))
    runner.update(state, rows[:, 201:400])
    omega = runner.estimator.config.omega_rad_s  # type: ignore[union-attr]
    part, ends, *_ = since_checkpoint(omega, block_of(state), checkpoint)
    runner.update(later, rows[:, 200:400])
    np.testing.assert_allclose(part, later.bank[0], rtol=0.0, atol=1e-9 * np.abs(later.bank).max())
    np.testing.assert_array_equal(ends[:2], later.rows[0, :2])


@pytest.fixture(scope="module", params=[0, 1], ids=["short_period", "dutch_roll"])
def courses(request: pytest.FixtureRequest) -> tuple[int, dict[str, Course]]:
    return request.param, follow_step(PLANTS[request.param], 2, stepped=True)


def test_a_step_is_followed_within_three_seconds(courses: tuple[int, dict[str, Course]]) -> None:
    """20 % of the surface's moment at signal-to-noise 5; the others stay within four of their stated errors."""
    number, found = courses
    course, truth = found["fourier"], stepped_truth(PLANTS[number])
    late = course.since_s >= 3.0
    error = course.value[late] - truth
    assert (np.abs(error[..., CHANGED] / truth[CHANGED]) <= 0.05).all()
    others = np.arange(6) != CHANGED
    scores = np.abs(course.value - truth) / course.standard_error
    assert (scores[..., others] < 4.0).all(), scores.max(axis=(0, 1))


def test_the_filter_that_learns_of_it_follows_too(courses: tuple[int, dict[str, Course]]) -> None:
    """It inflates the covariance as of the change and filters again what came since: no later than the first."""
    number, found = courses
    course, truth = (
        next(c for name, c in found.items() if name.startswith("ekf, reset")),
        stepped_truth(PLANTS[number]),
    )
    late = course.since_s >= 3.0
    error = course.value[late] - truth
    assert (np.abs(error[..., CHANGED] / truth[CHANGED]) <= 0.05).all()
    assert (np.abs(error / course.standard_error[late]) < 4.0).all()


def test_a_change_is_found_the_same_however_the_record_is_cut() -> None:
    rows = make_signals(PITCH, doublets(PITCH, 26.0, 2.0))
    weaker = make_signals(PITCH, 0.6 * doublets(PITCH, 26.0, 2.0))
    rows[800:, 1:4] = weaker[800:, 1:4]
    rows[800:, 5] = weaker[800:, 5]
    runner = fourier(PITCH)
    whole, pieces = runner.run(rows[None]), runner.run(rows[None], chunks=(7, 1, 3))
    np.testing.assert_array_equal(runner.estimate(whole).value, runner.estimate(pieces).value)
    assert abs(runner.estimate(whole).value[5] / (0.6 * PITCH.truth[5]) - 1.0) < 0.05


def changes_found(rows: Array) -> list[tuple[float, list[int]]]:
    """When a record's last solution found a change, and of which derivatives."""
    runner, found = fourier(PITCH), []
    estimator, state = runner.estimator, runner.init(1)
    assert isinstance(estimator, FourierEstimator)
    assert isinstance(state, FourierState)
    for start in range(0, len(rows), SOLVE_EVERY):
        part = rows[start : start + SOLVE_EVERY]
        runner.run(part[None], state)
        changed = np.flatnonzero(estimator.changed(state, np.arange(1))[0] >= 1.0).tolist()
        if changed:
            found.append((float(part[-1, 0]), changed))
    return found


@pytest.mark.parametrize("bent", [0.02, 0.05, 0.1])
def test_what_no_linear_model_describes_is_no_change_but_a_lost_elevator_is(bent: float) -> None:
    """Without noise, doublets of different size and side: to the linear model each is of another aircraft."""
    size = np.repeat([1.0, -2.0, 3.0, -1.0, 2.0, -3.0, 2.0, 1.0, -2.0, 3.0, 1.0, -2.0], 5 * int(RATE_HZ))
    inputs = size * doublets(PITCH, 60.0)
    assert changes_found(curved_signals(inputs, bent, bent)) == []
    found = changes_found(curved_signals(inputs, bent, bent, lost_s=40.5))
    assert 40.5 < found[0][0] <= 43.5
    assert 5 in found[0][1]
