"""The filter by itself: what becomes of one that has lost its numbers."""

import numpy as np
from estimator_plants import PLANTS, ekf, noisy_batch

from wingwatch.estimators import EkfState, Outcome


def test_a_filter_that_has_lost_its_numbers_starts_anew_and_the_others_go_on() -> None:
    plant = PLANTS["short_period"]
    runner = ekf(plant)
    rows = noisy_batch(plant, 12.0, 2)
    state, untouched = runner.init(2), runner.init(2)
    half = rows.shape[1] // 2
    for s in (state, untouched):
        runner.update(s, rows[:, :half])
        runner.solve(s)
    assert isinstance(state, EkfState)
    state.z[0, -1] = np.nan
    state.cov[0, 0, 0] = np.inf
    for s in (state, untouched):
        runner.solve(s)
    assert runner.estimate(state, 0).outcome is Outcome.NOT_OBSERVABLE
    for s in (state, untouched):
        runner.update(s, rows[:, half:])
        runner.solve(s)
    assert np.isfinite(runner.estimate(state, 0).standard_error).all()
    np.testing.assert_array_equal(runner.estimate(state, 1).value, runner.estimate(untouched, 1).value)
