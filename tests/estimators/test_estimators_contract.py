"""Every estimator against every promise: one table, whatever the estimator is made of."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest
from estimator_plants import (
    ESTIMATORS,
    LEVEL,
    PITCH,
    PLANTS,
    SOLVE_EVERY,
    Array,
    Maker,
    Plant,
    Runner,
    State,
    arrays,
    doublets,
    make_signals,
    noisy_batch,
    quiet_batch,
)
from scipy.stats import binom, norm

from wingwatch.estimators import EkfEstimator, EkfState, FourierEstimator, Outcome

every_estimator = pytest.mark.parametrize("make", ESTIMATORS.values(), ids=ESTIMATORS)
every_plant = pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
FAST = [ESTIMATORS["fourier"], ESTIMATORS["ekf"]]
"""The compiled ones; filterpy's answers are theirs to 1e-9 (below) at a hundred times the cost."""
compiled = pytest.mark.parametrize("make", FAST, ids=["fourier", "ekf"])


def apart(a: dict[str, Array], b: dict[str, Array]) -> list[str]:
    """Names of the arrays in which two states, or their rows, differ by a bit."""
    return [
        name
        for name, array in a.items()
        if not np.array_equal(array, b[name], equal_nan=array.dtype.kind == "f")
    ]


def row_of(state: State, vehicle: int) -> dict[str, Array]:
    return {name: array[vehicle].copy() for name, array in arrays(state).items()}


def all_finite(state: State, vehicle: int, runner: Runner) -> bool:
    estimate = runner.estimate(state, vehicle)
    return bool(np.isfinite(estimate.value).all() and np.isfinite(estimate.covariance).all())


@every_estimator
@every_plant
def test_clean_plant_is_recovered(make: Maker, plant: Plant) -> None:
    """Within 1 % (issue 2), by the Fourier one, exact between samples to second order in the step, within 0.02 %."""
    runner = make(plant)
    signals = make_signals(plant, doublets(plant, 22.0))
    estimate = runner.estimate(runner.run(signals[None]))
    miss = np.abs(estimate.value - plant.truth)
    within = 2e-4 if isinstance(runner.estimator, FourierEstimator) else 0.01
    assert (miss < within * np.abs(plant.truth)).all(), 100.0 * miss / np.abs(plant.truth)
    assert estimate.outcome is Outcome.CONVERGED


@compiled
@every_plant
def test_short_data_say_nothing(make: Maker, plant: Plant) -> None:
    runner = make(plant)
    quiet = quiet_batch(plant, 1.9)
    for samples in (0, 1, 2, 12, 95):
        state = runner.init(1)
        runner.update(state, quiet[:, :samples])
        runner.solve(state)
        estimate = runner.estimate(state)
        assert estimate.outcome is Outcome.NOT_OBSERVABLE, samples
        assert set(estimate.outcomes) == {Outcome.NOT_OBSERVABLE}
        assert estimate.reason
        assert not np.isinf(estimate.value).any(), "a value is known or NaN"


@compiled
@every_plant
def test_quiet_flight_is_not_observable(make: Maker, plant: Plant) -> None:
    """Sensor noise alone: the mode never converges, at any solution, on any of twenty vehicles."""
    runner = make(plant)
    vehicles, quiet = 20, quiet_batch(plant, 60.0, 20)
    state = runner.init(vehicles)
    for start in range(0, quiet.shape[1], SOLVE_EVERY):
        runner.update(state, quiet[:, start : start + SOLVE_EVERY])
        runner.solve(state)
        for i in range(vehicles):
            estimate = runner.estimate(state, i)
            assert estimate.outcome not in (Outcome.CONVERGED, Outcome.REJECTED), (i, start)
            assert start < 100 or np.isfinite(estimate.value).all()


@every_plant
def test_filterpy_too_does_not_learn_from_noise(plant: Plant) -> None:
    runner = ESTIMATORS["ekf_filterpy"](plant)
    estimate = runner.estimate(runner.run(quiet_batch(plant, 30.0)))
    assert estimate.outcome is Outcome.NOT_OBSERVABLE
    assert "move the" in estimate.reason


@compiled
@every_plant
def test_ten_minutes_of_quiet_do_not_drift(make: Maker, plant: Plant) -> None:
    """After an excited start the quiet adds nothing: the last values stay within three of their standard errors."""
    runner = make(plant)
    state = runner.run(noisy_batch(plant, 22.0, 1))
    before = runner.estimate(state)
    quiet = quiet_batch(plant, 600.0, seed=5)
    quiet[:, :, 0] += 30.0  # after a gap, so that the states do not jump
    state = runner.run(quiet, state)
    after = runner.estimate(state)
    assert after.outcome is Outcome.NOT_OBSERVABLE
    assert "since" in after.reason
    error = np.hypot(before.standard_error, after.standard_error)
    assert (np.abs(after.value - before.value) < 3.0 * error).all(), (after.value - before.value) / error
    if isinstance(state, EkfState):
        std = quiet[0, :, 1:3].std(axis=0)
        assert (np.abs(state.z[0, :2]) < 6.0 * std).all()


@every_estimator
@every_plant
def test_rows_with_a_hole_are_passed_over(make: Maker, plant: Plant) -> None:
    """The same as if the rows had never been there, whichever channel the hole is in."""
    runner = make(plant)
    whole = noisy_batch(plant, 13.0, 1)
    holed = whole.copy()
    rows = np.array([40, 41, 120, 333, 500])
    holed[0, rows, np.array([1, 2, 3, 4, 5])] = np.nan
    without = np.delete(whole, rows, axis=1)
    a, b = runner.init(1), runner.init(1)
    runner.update(a, holed)
    runner.update(b, without)
    runner.solve(a)
    runner.solve(b)
    assert apart(arrays(a), arrays(b)) == []


@every_estimator
@pytest.mark.parametrize("jump_s", [3.0, -100.0], ids=["gap", "time going back"])
@every_plant
def test_nothing_is_bridged_over_a_gap(make: Maker, plant: Plant, jump_s: float) -> None:
    """The record goes on amid a doublet: the jump of the states would be an impulse if the gap were bridged."""
    runner = make(plant)
    first = make_signals(plant, doublets(plant, 12.0))
    second = make_signals(plant, doublets(plant, 12.0))[58:]
    second[:, 0] += first[-1, 0] + jump_s
    state = runner.run(np.concatenate([first, second])[None])
    estimate = runner.estimate(state)
    strong = np.array([d not in ("z_eta", "y_zeta") for d in plant.structure.derivatives])
    miss = np.abs(estimate.value / plant.truth - 1.0)
    assert (miss[strong] < 0.02).all(), 100.0 * miss
    assert estimate.time_s == second[-1, 0]


@compiled
@every_plant
def test_the_stated_interval_holds_the_truth(make: Maker, plant: Plant) -> None:
    """95 % intervals of 100 seeds at signal-to-noise 5, and no bias; each bound is passed by chance once in 10 000
    derivatives."""
    runner, seeds = make(plant), 100
    state = runner.run(noisy_batch(plant, 22.0, seeds))
    estimates = [runner.estimate(state, i) for i in range(seeds)]
    error = np.array([e.standard_error for e in estimates])
    miss = np.array([e.value for e in estimates]) - plant.truth
    inside = (np.abs(miss) < 1.96 * error).sum(axis=0)
    assert (inside >= binom.ppf(1e-4, seeds, 0.95)).all(), inside
    scatter = miss.std(axis=0)
    assert (error.mean(axis=0) < 4.0 * scatter).all(), "an interval that is four times too wide says nothing"
    bias = miss.mean(axis=0) * np.sqrt(seeds) / scatter
    assert (np.abs(bias) < norm.isf(0.5e-4)).all(), bias


@every_plant
def test_filterpy_covers_as_the_compiled_filter_does(plant: Plant) -> None:
    """A few seeds are enough: the two agree on each record."""
    batch = noisy_batch(plant, 12.0, 3)
    one, other = ESTIMATORS["ekf"](plant), ESTIMATORS["ekf_filterpy"](plant)
    a, b = one.run(batch), other.run(batch)
    for i in range(3):
        mine, reference = one.estimate(a, i), other.estimate(b, i)
        np.testing.assert_allclose(mine.value, reference.value, rtol=1e-9)
        np.testing.assert_allclose(mine.standard_error, reference.standard_error, rtol=1e-9)
        scale = np.outer(reference.standard_error, reference.standard_error)
        np.testing.assert_allclose(mine.covariance / scale, reference.covariance / scale, rtol=0.0, atol=1e-9)
        assert mine.outcomes == reference.outcomes


@compiled
def test_units_of_angle_do_not_matter(make: Maker) -> None:
    """The elevator in hundredths of a radian: its derivatives are a hundred times smaller, all else is as before."""
    batch = noisy_batch(PITCH, 13.0, 2)
    other = batch.copy()
    other[:, :, 4] *= 100.0
    one = make(PITCH)
    two = with_prior_scaled(one, np.array([1, 1, 0.01, 1, 1, 0.01]))
    a, b = one.run(batch), two.run(other)
    back = np.array([1, 1, 100.0, 1, 1, 100.0])
    for i in range(2):
        mine, theirs = one.estimate(a, i), two.estimate(b, i)
        miss = (theirs.value * back - mine.value) / mine.standard_error
        assert (np.abs(miss) < 1e-6).all(), miss
        np.testing.assert_allclose(theirs.standard_error * back, mine.standard_error, rtol=1e-6)
        assert theirs.outcomes == mine.outcomes


def with_prior_scaled(original: Runner, factor: Array) -> Runner:
    """The same estimator with its prior in another unit."""
    estimator = original.estimator
    value, std = estimator.config.prior_value * factor, estimator.config.prior_std * factor
    if isinstance(estimator, FourierEstimator):
        return Runner(FourierEstimator(replace(estimator.config, prior_value=value, prior_std=std)))
    return Runner(EkfEstimator(replace(estimator.config, prior_value=value, prior_std=std)))


@every_estimator
@every_plant
def test_vehicles_do_not_see_one_another(make: Maker, plant: Plant) -> None:
    """Alone, in company and in any order: the same to the last bit."""
    runner = make(plant)
    batch = np.concatenate([noisy_batch(plant, 11.0, 2), quiet_batch(plant, 11.0)])
    together = runner.run(batch)
    order = [2, 0, 1]
    permuted = runner.run(batch[order])
    for place, vehicle in enumerate(order):
        alone = row_of(runner.run(batch[vehicle : vehicle + 1]), 0)
        assert apart(row_of(together, vehicle), alone) == []
        assert apart(row_of(together, vehicle), row_of(permuted, place)) == []


@every_estimator
@every_plant
def test_a_reset_forgets_one_vehicle_and_touches_no_other(make: Maker, plant: Plant) -> None:
    """After it every derivative is another one, which is learned with errors that hold."""
    runner, other = make(plant), replace(plant, truth=0.7 * plant.aerodynamic + plant.forward)
    state = runner.run(noisy_batch(plant, 11.0, 2))
    beside, before = row_of(state, 1), runner.estimate(state, 0)
    runner.reset(state, 0)
    assert apart(row_of(state, 1), beside) == []
    after_a_gap = noisy_batch(other, 13.0, 2, first_seed=7)
    after_a_gap[:, :, 0] += 30.0
    estimate = runner.estimate(runner.run(after_a_gap, state), 0)
    assert (np.abs(estimate.value - other.truth) < 4.0 * estimate.standard_error).all()
    assert (
        np.abs(before.value - other.truth) > 4.0 * np.hypot(before.standard_error, estimate.standard_error)
    ).any()


@every_estimator
@every_plant
def test_pieces_are_the_whole(make: Maker, plant: Plant) -> None:
    runner = make(plant)
    batch = noisy_batch(plant, 11.0, 1)
    whole = arrays(runner.run(batch))
    assert apart(whole, arrays(runner.run(batch, chunks=(1,)))) == []
    assert apart(whole, arrays(runner.run(batch, chunks=(7, 1, 3)))) == []


@every_estimator
@every_plant
def test_saved_and_restored_is_uninterrupted(make: Maker, plant: Plant) -> None:
    """Cut inside a block, after solutions and block ends have left their traces; copied, and pickled."""
    runner = make(plant)
    batch = noisy_batch(plant, 23.0, 1)
    cut = 26 * SOLVE_EVERY
    whole = runner.run(batch)
    half = runner.run(batch[:, :cut])
    for kept in (copy.deepcopy(half), pickle.loads(pickle.dumps(half))):
        assert apart(arrays(whole), arrays(make(plant).run(batch[:, cut:], kept))) == []
    runner.run(batch[:, cut:], half)
    assert apart(arrays(whole), arrays(half)) == []


@every_plant
def test_trim_changes_nothing_for_fourier(plant: Plant) -> None:
    """Constants are in the span of a regressor: rounding is left, grown by the nuisance columns' ridge of 1e-10."""
    runner = ESTIMATORS["fourier"](plant)
    still = make_signals(plant, doublets(plant, 22.0))
    trimmed = make_signals(plant, doublets(plant, 22.0), offsets=(1.3, 0.05, 0.05))
    std = still[:, 1:4].std(axis=0) / 5.0
    noise = std * np.random.default_rng(3).standard_normal((len(still), 3))
    for table in (still, trimmed):
        table[:, 1:4] += noise
    a, b = (runner.estimate(runner.run(t[None])) for t in (still, trimmed))
    assert (np.abs(a.value - b.value) < 1e-6 * a.standard_error).all(), (a.value - b.value) / a.standard_error


@pytest.mark.parametrize("make", [ESTIMATORS["ekf"], ESTIMATORS["ekf_filterpy"]], ids=["ekf", "ekf_filterpy"])
@every_plant
def test_trim_hardly_matters_to_the_filter(make: Maker, plant: Plant) -> None:
    """Its constants have to be learned, from a prior about zero; that costs less than one standard error."""
    runner = make(plant)
    a, b = (
        runner.estimate(runner.run(make_noisy(plant, offsets)[None]))
        for offsets in ((0.0, 0.0, 0.0), (1.3, 0.05, 0.05))
    )
    assert (np.abs(a.value - b.value) < a.standard_error).all(), (a.value - b.value) / a.standard_error


def make_noisy(plant: Plant, offsets: tuple[float, float, float]) -> Array:
    table = make_signals(plant, doublets(plant, 22.0), offsets)
    std = table[:, 1:4].std(axis=0) / 5.0
    noise = std * np.random.default_rng(3).standard_normal((len(table), 3))
    table[:, 1:4] += noise
    table[:, 5] += LEVEL.airspeed_true_m_s * noise[:, 1] * (1.0 if plant is PITCH else -1.0)
    return table


@every_estimator
@every_plant
def test_covariance_is_one(make: Maker, plant: Plant) -> None:
    """Symmetric and positive semi-definite at every solution, to rounding of its own scale."""
    runner = make(plant)
    batch = noisy_batch(plant, 12.0, 1)
    state = runner.init(1)
    for start in range(0, batch.shape[1], SOLVE_EVERY):
        runner.update(state, batch[:, start : start + SOLVE_EVERY])
        runner.solve(state)
        if start < 100:
            continue  # the first solution comes after two seconds
        estimate = runner.estimate(state)
        scale = np.outer(estimate.standard_error, estimate.standard_error)
        correlation = estimate.covariance / scale
        np.testing.assert_allclose(correlation, correlation.T, rtol=0.0, atol=1e-9)
        assert np.linalg.eigvalsh(0.5 * (correlation + correlation.T)).min() > -1e-9
        assert all_finite(state, 0, runner)


@every_estimator
@every_plant
def test_signals_of_another_structure_are_refused(make: Maker, plant: Plant) -> None:
    """Compiled code does not look where a row ends."""
    runner = make(plant)
    quiet = quiet_batch(plant, 1.0)
    for wrong in (quiet[:, :, :-1], quiet[0]):
        with pytest.raises(ValueError, match=r"signals have shape .* need \(vehicles"):
            runner.update(runner.init(1), wrong)
