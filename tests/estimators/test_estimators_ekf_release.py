"""A change that is reported late: the covariance is reset as of when it changed, not of when it is reported."""

from copy import deepcopy

import numpy as np
import pytest
from convergence import doublets
from convergence import estimators as live_estimators
from numpy.typing import NDArray
from reference_plant import PLANTS, SOLVE_EVERY, noise_std, signals
from tracking import CHANGED, EVERY_S, step_states, stepped_truth

from wingwatch.estimators import EkfEstimator, EkfState
from wingwatch.estimators.ekf.state import arrays_of
from wingwatch.estimators.ekf.window import begin_window
from wingwatch.kernels.by_address import ByAddress

Array = NDArray[np.float64]

FROM, STEP, UNTIL = 1500, 2500, 2650
"""Rows that are flown: 20 s before m_eta loses a fifth, 3 s after it."""

SPREAD = np.eye(6)[CHANGED]
"""It alone has changed, by its natural size."""


@pytest.fixture(scope="module")
def flown() -> tuple[EkfEstimator, EkfState]:
    """The filter at the end, four vehicles at signal-to-noise 30, no change reported yet."""
    rows = flown_rows()
    _, ekf = live_estimators(PLANTS[0])
    state = ekf.init(len(rows))
    for k in range(0, rows.shape[1], SOLVE_EVERY):
        ekf.update(state, rows[:, k : k + SOLVE_EVERY])
        ekf.solve(state)
    return ekf, state


def flown_rows() -> NDArray[np.float64]:
    """Signals of the four, (vehicles, rows, columns)."""
    plant = PLANTS[0]
    surface = doublets(plant, 75.0, 6.0, EVERY_S)
    states = step_states(plant, surface, True)
    noise = np.stack([np.random.default_rng(seed).standard_normal(states.shape) for seed in range(4)])
    return signals(plant, states + noise_std(plant, 30.0) * noise, surface)[:, FROM:UNTIL]


def errors_of(ekf: EkfEstimator, state: EkfState) -> tuple[np.ndarray, np.ndarray]:
    """Error over truth and over its stated standard error, (vehicles, derivatives)."""
    truth = stepped_truth(PLANTS[0])
    found = [ekf.estimate(state, i) for i in range(4)]
    error = np.array([e.value for e in found]) - truth
    return error / truth, error / np.array([e.standard_error for e in found])


def released(
    flown: tuple[EkfEstimator, EkfState], since_s: float, spread: NDArray[np.float64] = SPREAD
) -> EkfState:
    ekf, state = flown[0], deepcopy(flown[1])
    for i in range(4):
        ekf.release(state, spread, i, since_s)
    return state


def test_what_was_flown_since_the_change_teaches_the_new_value(flown: tuple[EkfEstimator, EkfState]) -> None:
    before, _ = errors_of(*flown)
    assert (before[:, CHANGED] > 0.1).all(), "the filter itself has hardly followed"
    state = released(flown, (STEP - 1) / 50.0)
    after, scores = errors_of(flown[0], state)
    assert (np.abs(after[:, CHANGED]) < 0.02).all()
    assert (np.abs(scores) < 4.0).all(), scores


def test_the_account_has_what_was_flown_since_the_change_and_nothing_from_before(
    flown: tuple[EkfEstimator, EkfState],
) -> None:
    ekf, truth = flown[0], stepped_truth(PLANTS[0])
    state = released(flown, (STEP - 1) / 50.0)
    for i in range(4):
        referred = truth - ekf.estimate(state, i).value + state.z[i, ekf._parameters]
        information, vector = ekf.take_gained(state, i, again=True)
        error = 1.0 / np.sqrt(information[CHANGED, CHANGED])
        assert error < 0.05 * abs(truth[CHANGED]), "nothing was learned"
        assert abs((vector - information @ referred)[CHANGED] * error) < 4.0


def account(
    flown: tuple[EkfEstimator, EkfState], derivative: int, information: float, off: float, within: float = 0.0
) -> Array:
    """What ``take_gained`` gives of one derivative, where the account has ``information``, in halves of the prior's
    standard deviation, at a value that is ``off`` by so many of its errors."""
    ekf, state = flown[0], deepcopy(flown[1])
    size = ekf.config.prior_std[derivative] / 2.0 / np.sqrt(information)
    state.gained_matrix[0], state.gained_vector[0] = 0.0, 0.0
    state.gained_matrix[0, derivative, derivative] = size**-2.0
    state.gained_vector[0, derivative] = size**-2.0 * (state.z[0, ekf._parameters][derivative] + off * size)
    matrix, vector = ekf.take_gained(state, within=within)
    assert matrix.any() == vector.any()
    assert not state.gained_matrix[0].any()
    return matrix


def test_an_account_that_contradicts_what_is_known_is_no_evidence(
    flown: tuple[EkfEstimator, EkfState],
) -> None:
    """Of a derivative that it says is five of its errors off; three are chance."""
    assert account(flown, CHANGED, 10.0, 3.0).any()
    assert not account(flown, CHANGED, 10.0, 5.0).any()


def test_an_account_contradicts_by_more_than_it_may_differ(flown: tuple[EkfEstimator, EkfState]) -> None:
    """Its error is 0.16 natural sizes; 0.8 off is 2.3 standard errors where it may differ by 0.3, 4.8 by 0.05."""
    assert account(flown, CHANGED, 10.0, 5.0, 0.3).any()
    assert not account(flown, CHANGED, 10.0, 5.0, 0.05).any()


def test_the_first_account_of_a_derivative_is_no_evidence(flown: tuple[EkfEstimator, EkfState]) -> None:
    """All that is known of it is in the account; a quarter of that may be."""
    ekf, state = flown
    variance = np.linalg.inv(state.information[0])[CHANGED, CHANGED]
    known = (ekf.config.prior_std[CHANGED] / 2.0) ** 2 / variance
    assert known > 100.0
    assert account(flown, CHANGED, 0.25 * known, 0.0).any()
    assert not account(flown, CHANGED, known - 0.5, 0.0).any()


@pytest.mark.parametrize("since_s", [UNTIL / 50.0 + 1.0, np.inf, np.nan])
def test_a_time_that_is_not_kept_resets_the_derivative_now(
    flown: tuple[EkfEstimator, EkfState], since_s: float
) -> None:
    state = released(flown, since_s)
    np.testing.assert_array_equal(state.z, flown[1].z)
    assert (state.window.filled == 0).all()
    assert not state.gained_matrix.any()
    assert not state.gained_vector.any()
    wide = flown[0].estimate(state, 0).standard_error[CHANGED]
    assert wide > 0.9 * abs(PLANTS[0].truth[CHANGED])


def test_a_window_that_begins_after_the_change_is_run_again_from_its_beginning(
    flown: tuple[EkfEstimator, EkfState],
) -> None:
    ekf, rows = flown[0], flown_rows()
    state, begun = ekf.init(len(rows)), STEP - FROM + SOLVE_EVERY
    for k in range(0, rows.shape[1], SOLVE_EVERY):
        ekf.update(state, rows[:, k : k + SOLVE_EVERY])
        ekf.solve(state)
        if k + SOLVE_EVERY == begun:
            for i in range(len(rows)):
                begin_window(ekf.model, ByAddress(state), i)
    before, _ = errors_of(ekf, state)
    assert (before[:, CHANGED] > 0.1).all()
    for i in range(len(rows)):
        ekf.release(state, SPREAD, i, (STEP - 1) / 50.0)
    assert (state.window.filled == rows.shape[1] - begun).all()
    after, scores = errors_of(ekf, state)
    assert (np.abs(after[:, CHANGED]) < 0.03).all(), after[:, CHANGED]
    assert (np.abs(scores) < 4.0).all(), scores


def test_others_that_may_have_changed_by_less_are_less_well_known(
    flown: tuple[EkfEstimator, EkfState],
) -> None:
    at_s = (STEP - 1) / 50.0
    alone, together = released(flown, at_s), released(flown, at_s, np.where(SPREAD == 1.0, 1.0, 0.1))
    others = np.arange(6) != CHANGED
    for i in range(4):
        ekf, known = flown[0], flown[0].estimate(alone, i).standard_error
        found = ekf.estimate(together, i).standard_error
        assert (found[others] > known[others]).all()
        reset = np.hypot(known, ekf.config.prior_std)
        assert (found[others] < 0.8 * reset[others]).all(), "as if they had been reset"
    _, scores = errors_of(ekf, together)
    assert (np.abs(scores) < 4.0).all(), scores


def test_levels_of_noise_that_the_change_has_raised_are_those_of_before(
    flown: tuple[EkfEstimator, EkfState],
) -> None:
    """A checkpoint remembers them; one that is lower by now stays so."""
    ekf, state = flown[0], deepcopy(flown[1])
    before = state.noise.unmeasured.copy()
    state.noise.reading[:, -1] *= 100.0
    state.noise.unmeasured[:2] *= 100.0
    state.noise.unmeasured[2:] *= 0.01
    for i in range(4):
        ekf.release(state, SPREAD, i, (STEP - 1) / 50.0)
    np.testing.assert_array_equal(state.noise.reading[:, -1], flown[1].noise.reading[:, -1])
    np.testing.assert_array_equal(state.noise.unmeasured[:2], before[:2])
    np.testing.assert_array_equal(state.noise.unmeasured[2:], 0.01 * before[2:])


def test_where_nothing_changed_nothing_is_done(flown: tuple[EkfEstimator, EkfState]) -> None:
    state = deepcopy(flown[1])
    flown[0].release(state, np.zeros(6), 0, STEP / 50.0)
    for (_, array), (name, before) in zip(arrays_of(state), arrays_of(flown[1]), strict=True):
        np.testing.assert_array_equal(array, before, err_msg=name)


def test_the_others_are_as_they_were(flown: tuple[EkfEstimator, EkfState]) -> None:
    state = deepcopy(flown[1])
    flown[0].release(state, SPREAD, 0, (STEP - 1) / 50.0)
    for (_, array), (name, before) in zip(arrays_of(state), arrays_of(flown[1]), strict=True):
        np.testing.assert_array_equal(array[1:], before[1:], err_msg=name)
