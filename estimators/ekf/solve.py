"""What a solution does to the filter: it notes what was learned, and forgets; compiled."""

import numpy as np
from numba import njit

from wingwatch.estimators.ekf.covariance import forget, inverse_of, keep_marginal
from wingwatch.estimators.ekf.inputs import pretended
from wingwatch.estimators.ekf.kernel import WARM_UP
from wingwatch.estimators.kernels.symmetric import invert

__all__ = ["controls_of", "solve_all"]

MOVED_SHARE = 2.0
"""An input has moved if its variance within half a second is over this many times that of its reading."""

MOVED_S = 1.75
"""Time that a motion of an input is given to die out."""

PRETENDED_SHARE = 0.5
"""Share of all that is known of an input's derivatives beyond which a half second of its noise is not corrected for."""


@njit(cache=True)
def _resting(moments, moved, variance, now):  # type: ignore[no-untyped-def]
    """Which inputs have not moved beyond their own noise for ``MOVED_S``."""
    resting = np.zeros(variance.size, dtype=np.bool_)
    for j in range(variance.size):
        count = moments[j, 0]
        if count > 1.0:
            spread = (moments[j, 2] - moments[j, 1] * moments[j, 1] / count) / (count - 1.0)
            if spread > MOVED_SHARE * variance[j]:
                moved[j] = now
        resting[j] = variance[j] > 0.0 and not now - moved[j] < MOVED_S
    return resting


@njit(cache=True)
def controls_of(resting, ns, nu):  # type: ignore[no-untyped-def]
    """Indices of the derivatives that belong to resting inputs."""
    chosen = np.zeros(ns * (ns + nu), dtype=np.bool_)
    for a in range(ns):
        for j in range(nu):
            chosen[a * (ns + nu) + ns + j] = resting[j]
    return np.flatnonzero(chosen)


@njit(cache=True)
def _without_noise(  # type: ignore[no-untyped-def]
    z, cov, moments, moved, echo, variance, information, vector, now, solved, first, ns, less
):
    """Takes back what resting inputs taught; what noise pretended of the others goes into ``less`` (k, k).

    An input whose noise pretends half as much as is known altogether, when what others taught is taken back and what
    theirs pretends is counted, is treated as one at rest: surfaces that move together are known by their sum alone.
    """
    nu = variance.size
    resting = _resting(moments, moved, variance, now)
    k = vector.size
    before, mean = np.empty((k, k)), np.zeros(k)
    more = True
    while more:
        if solved and resting.any():
            invert(information.copy(), before)
            mean[:] = 0.0
            for a in range(k):
                for b in range(k):
                    mean[a] += before[a, b] * vector[b]
            keep_marginal(z, cov, mean, before, controls_of(resting, ns, nu), first)
        pretended(echo, moments, variance, resting, ns, less)
        more = False
        share = 0.0
        for j in range(nu):
            for a in range(ns):
                for b in range(ns):
                    c, d = a * (ns + nu) + ns + j, b * (ns + nu) + ns + j
                    share += less[c, d] * cov[first + c, first + d]
            if share > PRETENDED_SHARE and not resting[j]:
                resting[j] = more = True
                break
    moments[:] = 0.0
    if not solved:
        resting[:] = False
    return resting


@njit(cache=True)
def solve_all(  # type: ignore[no-untyped-def]
    memory_s, stale_s, prior_value, prior_std, input_variance, z, cov, rows, clock, informed, variance, information,
    vector, gained_matrix, gained_vector, moments, moved, echo, counts, done,
):  # fmt: skip
    """Note what the last half second taught, then forget; after ``stale_s`` of quiet, nothing is forgotten.

    What was done is left in ``done`` (vehicles, 2 + nu): what share of its information the vehicle keeps, NaN where
    nothing was solved, what share of all that it knows (mean over directions) the last half second gave, and 1 for
    every input whose teaching was taken back.
    """
    k = informed.shape[1]
    first, ns = z.shape[1] - prior_value.size, prior_value.size - k
    prior_information = 1.0 / (prior_std * prior_std)
    less, chosen = np.zeros((k, k)), np.arange(first, first + k)
    for i in range(z.shape[0]):
        now = rows[i, 0, 0]
        if counts[i, 0] <= WARM_UP:
            moments[i] = 0.0
            done[i] = np.nan
            continue
        resting = _without_noise(
            z[i], cov[i], moments[i], moved[i], echo[i], input_variance, information[i], vector[i], now,
            counts[i, 1] > 0, first, ns, less,
        )  # fmt: skip
        fresh, share = inverse_of(cov[i], chosen), 0.0
        for a in range(k):
            told = -vector[i, a]
            for b in range(k):
                told += fresh[a, b] * z[i, first + b]
                more = fresh[a, b] - less[a, b] - information[i, a, b]
                gained_matrix[i, a, b] += more
                share += more * cov[i, first + a, first + b]
            gained_vector[i, a] += told
            if cov[i, first + a, first + a] < 0.98 * variance[i, a]:
                informed[i, a] = now
        elapsed = now - clock[i]
        clock[i] = now
        forgets = 0.0 < elapsed < stale_s and now - np.max(informed[i]) < stale_s
        keep = np.exp(-elapsed / memory_s) if forgets else 1.0
        done[i, 0], done[i, 1] = keep, max(share / k, 0.0)
        for j in range(resting.size):
            done[i, 2 + j] = 1.0 if resting[j] else 0.0
        if forgets or less.any():
            forget(z[i], cov[i], prior_value, prior_information, keep, less, first)
            fresh = inverse_of(cov[i], chosen)
        for a in range(k):
            variance[i, a], vector[i, a] = cov[i, first + a, first + a], 0.0
            for b in range(k):
                information[i, a, b] = fresh[a, b]
                vector[i, a] += fresh[a, b] * z[i, first + b]
        counts[i, 1] += 1
