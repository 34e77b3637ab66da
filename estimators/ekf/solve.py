"""What a solution does to the filter: it notes what was learned, and forgets; compiled."""

import numpy as np
from numba import njit

from wingwatch.estimators.ekf.covariance import forget, inverse_of, keep_marginal
from wingwatch.estimators.ekf.inputs import input_noise_information
from wingwatch.estimators.ekf.recursion import WARM_UP
from wingwatch.estimators.ekf.scatter import begin_block, close_block
from wingwatch.estimators.ekf.state import FIRST_READING, NEWEST, READINGS, SQUARES, SUM, TIME, VANE
from wingwatch.estimators.kernels.hot import part, whole_entry
from wingwatch.estimators.kernels.symmetric import invert

__all__ = ["columns_of", "solve_all"]

CHANCE = 4.0
"""Standard deviations by which the readings' variance must exceed that of their noise to be motion: once in 30,000 half
seconds by chance."""

STATES_KEPT = 0.75
"""Part of a state's readings that is kept at a solution: two seconds, for slow modes hardly move in half a second."""

MOVED_S = 1.75
"""Time that a motion is given to die out."""

NOISE_FRACTION = 0.5
"""Fraction of all that is known of an input's derivatives beyond which a half second of its noise is not corrected
for."""


@njit(cache=True, error_model="numpy")
def _resting(moments, moved_s, variance, now_s):  # type: ignore[no-untyped-def]
    """Which of some readings have not moved beyond their own noise for ``MOVED_S``; none of those that have no noise.

    The variance of so many readings has a chi-square distribution (Wilson and Hilferty 1931).
    """
    resting = np.zeros(variance.size, dtype=np.bool_)
    for j in range(variance.size):
        freedom = moments[j, READINGS] - 1.0
        if freedom > 0.0:
            spread = (
                moments[j, SQUARES] - moments[j, SUM] * moments[j, SUM] / moments[j, READINGS]
            ) / freedom
            part = 2.0 / (9.0 * freedom)
            if spread > variance[j] * (1.0 - part + CHANCE * np.sqrt(part)) ** 3:
                moved_s[j] = now_s
        resting[j] = variance[j] > 0.0 and not now_s - moved_s[j] < MOVED_S
    return resting


@njit(cache=True, error_model="numpy")
def columns_of(resting, ns):  # type: ignore[no-untyped-def]
    """Indices of the derivatives by resting states and inputs, ``resting`` (ns + nu,)."""
    nd = resting.size
    chosen = np.zeros(ns * nd, dtype=np.bool_)
    for a in range(ns):
        for j in range(nd):
            chosen[a * nd + j] = resting[j]
    return np.flatnonzero(chosen)


@part
def _without_noise(model, state, i, noise_information):  # type: ignore[no-untyped-def]
    """Takes back what resting states and inputs taught; the information that came of the noise of the other inputs goes
    into ``noise_information`` (k, k). Returns what is taken to rest.

    An input whose noise gives half as much as is known altogether, when what others taught is taken back and what comes
    of their noise is counted, is treated as one at rest: surfaces that move together are known by their sum alone.
    """
    ns, nu, first = model.sizes.states, model.sizes.inputs, model.sizes.dynamic
    z, cov, moments = state.z[i], state.cov[i], state.moments[i]
    information, vector = state.information[i], state.vector[i]
    variance, largest = state.noise.inputs[i], np.empty(ns + nu)
    largest[:ns], largest[ns:] = state.noise.reading[i, :ns], state.noise.largest_inputs[i]
    if state.rows[i, NEWEST, model.sizes.kinematic + VANE] != 1.0:
        largest[0] = 0.0  # a reconstructed velocity's noise is not white
    resting = _resting(moments, state.moved_s[i], largest, state.rows[i, NEWEST, TIME])
    k = vector.size
    before, mean = np.empty((k, k)), np.zeros(k)
    more = True
    while more:
        if resting.any():
            invert(information.copy(), before)
            mean[:] = 0.0
            for a in range(k):
                for b in range(k):
                    mean[a] += before[a, b] * vector[b]
            keep_marginal(z, cov, mean, before, columns_of(resting, ns), first)
        input_noise_information(
            state.input_errors.information[i], moments, variance, resting, noise_information
        )
        more = False
        fraction = 0.0
        for j in range(nu):
            for a in range(ns):
                for b in range(ns):
                    c, d = a * (ns + nu) + ns + j, b * (ns + nu) + ns + j
                    fraction += noise_information[c, d] * cov[first + c, first + d]
            if fraction > NOISE_FRACTION and not resting[ns + j]:
                resting[ns + j] = more = True
                break
    moments[:ns, :FIRST_READING] *= STATES_KEPT
    moments[ns:] = 0.0
    return resting


@part
def _account(state, i, first, noise_information, fresh):  # type: ignore[no-untyped-def]
    """Adds to what was gained; returns the fraction of all that is known which the last half second gave.

    ``fresh``: inverse of the derivatives' covariance.
    """
    z, cov, information, vector = state.z[i], state.cov[i], state.information[i], state.vector[i]
    gained_matrix, gained_vector = state.gained_matrix[i], state.gained_vector[i]
    block_matrix, block_vector = state.scatter.matrix[i], state.scatter.vector[i]
    k, fraction = vector.size, 0.0
    for a in range(k):
        gained = -vector[a]
        for b in range(k):
            gained += fresh[a, b] * z[first + b]
            more = fresh[a, b] - noise_information[a, b] - information[a, b]
            gained_matrix[a, b] += more
            block_matrix[a, b] += more
            fraction += more * cov[first + a, first + b]
        gained_vector[a] += gained
        block_vector[a] += gained
        if cov[first + a, first + a] < 0.98 * state.variance[i, a]:
            state.informed_s[i, a] = state.rows[i, NEWEST, TIME]
    return max(fraction / k, 0.0)


@whole_entry
def solve_all(model, state, places, solved, dispersing):  # type: ignore[no-untyped-def]
    """Note what the last half second taught, then forget; after ``stale_s`` of quiet, nothing is forgotten.

    ``places``: vehicles of the state, (m,). What was done is left in ``solved``. ``dispersing``: a
    ``DispersionWorkspace``.
    """
    k, first = state.vector.shape[1], model.sizes.dynamic
    prior_information = 1.0 / (model.prior_std * model.prior_std)
    noise_information, chosen = np.zeros((k, k)), np.arange(first, first + k)
    for m in range(places.size):
        i = places[m]
        now_s, z, cov = state.rows[i, NEWEST, TIME], state.z[i], state.cov[i]
        if state.samples[i] <= WARM_UP:
            state.moments[i] = 0.0
            solved.keep[m] = np.nan
            continue
        solved.resting[m] = _without_noise(model, state, i, noise_information)
        fresh = inverse_of(cov, chosen)
        solved.gained[m] = _account(state, i, first, noise_information, fresh)
        close_block(state.scatter, i, now_s, model.memory_s, dispersing)
        elapsed_s = now_s - state.solved_s[i]
        state.solved_s[i] = now_s
        forgets = 0.0 < elapsed_s < model.stale_s and now_s - np.max(state.informed_s[i]) < model.stale_s
        keep = np.exp(-elapsed_s / model.memory_s) if forgets else 1.0
        solved.keep[m] = keep
        if forgets or noise_information.any():
            forget(z, cov, model.prior_value, prior_information, keep, noise_information, first)
            fresh = inverse_of(cov, chosen)
        information, vector, variance = state.information[i], state.vector[i], state.variance[i]
        for a in range(k):
            variance[a], vector[a] = cov[first + a, first + a], 0.0
            for b in range(k):
                information[a, b] = fresh[a, b]
                vector[a] += fresh[a, b] * z[first + b]
        if state.scatter.solutions[i] == 0:
            begin_block(state.scatter, i, now_s, information, vector)
        state.scatter.solutions[i] += 1
        state.solutions[i] += 1
