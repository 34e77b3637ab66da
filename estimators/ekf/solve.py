"""What a solution does to the filter: it notes what was learned, and forgets; compiled."""

import numpy as np

from wingwatch.estimators.ekf.coherence import coherent_dispersions
from wingwatch.estimators.ekf.covariance import forget, inverse_of, leave_out, of_derivatives, reseat
from wingwatch.estimators.ekf.inputs import input_noise_information
from wingwatch.estimators.ekf.recursion import WARM_UP
from wingwatch.estimators.ekf.rerun import INFORMED
from wingwatch.estimators.ekf.scatter import begin_block, close_block
from wingwatch.estimators.ekf.state import FIRST_READING, NEWEST, READINGS, SQUARES, SUM, TIME, VANE
from wingwatch.estimators.evidence.chance import chance_of
from wingwatch.estimators.evidence.information import believe, times
from wingwatch.kernels.copying import copy_into
from wingwatch.kernels.decorators import helper, part, whole_entry

__all__ = ["solve_all"]

ALMOST_HALF_S = 0.45
"""Solutions join their readings until they are those of half a second."""

MOVED_S = 1.75
"""Time that a motion is given to die out."""

NOISE_FRACTION = 0.5
"""Fraction of all that is known of an input's derivatives beyond which a half second of its noise is not corrected
for."""


@helper
def _join(moments, half):  # type: ignore[no-untyped-def]
    """The readings since the last solution, of ``moments`` (4,), join those of ``half`` (3,): number, mean and sum of
    squares from it."""
    count = moments[READINGS]
    if count > 0.0:
        mean = moments[FIRST_READING] + moments[SUM] / count
        off, total = mean - half[1], half[0] + count
        half[2] += (
            moments[SQUARES] - moments[SUM] * moments[SUM] / count + off * off * half[0] * count / total
        )
        half[0], half[1] = total, half[1] + off * count / total


@helper
def _moves(halves, variance):  # type: ignore[no-untyped-def]
    """Whether the readings of some half seconds, (h, 3), vary by more than noise of ``variance`` does by chance."""
    count = mean = squares = 0.0
    for h in range(halves.shape[0]):
        count += halves[h, 0]
        mean += halves[h, 0] * halves[h, 1]
    if count < 2.0:
        return False
    mean /= count
    for h in range(halves.shape[0]):
        squares += halves[h, 2] + halves[h, 0] * (halves[h, 1] - mean) ** 2
    return squares > variance * chance_of(count - 1.0)


@helper
def _begin_half_second(halves):  # type: ignore[no-untyped-def]
    """The oldest of some half seconds, (readings, halves, 3), makes room for a new one."""
    last = halves.shape[1] - 1
    for j in range(halves.shape[0]):
        for c in range(halves.shape[2]):
            for h in range(last):
                halves[j, h, c] = halves[j, h + 1, c]
            halves[j, last, c] = 0.0


@helper
def _resting(state, i, variance, ns):  # type: ignore[no-untyped-def]
    """Which states and inputs of vehicle i rest, (ns + nu,): an input that has not moved beyond its noise for
    ``MOVED_S``; all states where none of them has in two seconds, for slow modes hardly move in half a second.

    ``variance`` of the readings at most, (ns + nu,); 0 of readings that are not asked. Moments begin anew.
    """
    moments, halves, moved_s = state.moments[i], state.halves[i], state.moved_s[i]
    now_s, solved_s = state.rows[i, NEWEST, TIME], state.solved_s[i]
    resting, asked, mode = np.zeros(variance.size, dtype=np.bool_), False, True
    if not solved_s - state.half_s[i] < ALMOST_HALF_S:
        state.half_s[i] = solved_s
        _begin_half_second(halves)
    for j in range(variance.size):
        _join(moments[j], halves[j, -1])
        moments[j] = 0.0
        if not variance[j] > 0.0:
            continue
        if _moves(halves[j] if j < ns else halves[j, -1:], variance[j]):
            moved_s[j] = now_s
        if j < ns:
            asked = True
            mode = mode and now_s > moved_s[j]
        else:
            resting[j] = not now_s - moved_s[j] < MOVED_S
    resting[:ns] = asked and mode
    return resting


@part
def _without_noise(model, state, i, noise_information):  # type: ignore[no-untyped-def]
    """Leaves out what resting states and inputs taught; the information that came of the noise of the other inputs goes
    into ``noise_information`` (k, k). Returns what is taken to rest.

    An input whose noise gives half as much as is known altogether, when what others taught is left out and what comes
    of their noise is counted, is treated as one at rest: surfaces that move together are known by their sum alone.
    """
    ns, nu, first = model.sizes.states, model.sizes.inputs, model.sizes.dynamic
    z, cov = state.z[i], state.cov[i]
    information, vector = state.information[i], state.vector[i]
    variance, largest = state.noise.inputs[i], state.noise.largest[i].copy()
    if state.rows[i, NEWEST, model.sizes.kinematic + VANE] != 1.0:
        largest[0] = 0.0  # a reconstructed velocity's noise is not white
    moments = state.moments[i].copy()
    resting = _resting(state, i, largest, ns)
    k = vector.size
    work, covariance, before, mean = np.empty((k, k)), np.empty((k, k)), np.empty(k), np.empty(k)
    fresh, gained = inverse_of(cov, np.arange(first, first + k)), np.empty(k)
    times(fresh, z[first : first + k], gained)
    more = True
    while more:
        if resting.any():
            believe(information, vector, work, covariance, before)
            matrix, left = fresh.copy(), gained.copy()
            leave_out(matrix, left, information, before, resting, ns)
            believe(matrix, left, work, covariance, mean)
            reseat(z, cov, mean, covariance, first)
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
    return resting


@part
def _account(state, i, first, noise_information, fresh, resting):  # type: ignore[no-untyped-def]
    """Adds to what was gained; returns the fraction of all that is known which the last half second gave.

    ``fresh``: inverse of the derivatives' covariance. ``resting``: which states and inputs do. Where the states do,
    what ``leave_out`` left as it was has gained nothing; a difference of two inverses would leave rounding.
    """
    ns = state.noise.unmeasured.shape[1]
    still, mode = of_derivatives(resting, ns), resting[:ns].any()
    z, cov, information, vector = state.z[i], state.cov[i], state.information[i], state.vector[i]
    gained_matrix, gained_vector = state.gained_matrix[i], state.gained_vector[i]
    block_matrix, block_vector = state.scatter.matrix[i], state.scatter.vector[i]
    k, fraction = vector.size, 0.0
    for a in range(k):
        if mode and still[a]:
            continue
        gained = -vector[a]
        for b in range(k):
            gained += fresh[a, b] * z[first + b]
            if mode and still[b]:
                continue
            more = fresh[a, b] - noise_information[a, b] - information[a, b]
            gained_matrix[a, b] += more
            block_matrix[a, b] += more
            fraction += more * cov[first + a, first + b]
        gained_vector[a] += gained
        block_vector[a] += gained
        if not still[a] and cov[first + a, first + a] < INFORMED * state.variance[i, a]:
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
        copy_into(_without_noise(model, state, i, noise_information), solved.resting[m])
        fresh = inverse_of(cov, chosen)
        solved.gained[m] = _account(state, i, first, noise_information, fresh, solved.resting[m])
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
            coherent_dispersions(state.coherence, i, state.scatter.coherent[i])
        state.scatter.solutions[i] += 1
        state.solutions[i] += 1
