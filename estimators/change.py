"""Where a derivative has changed, what is remembered of it is set free and that of the others stays; compiled.

What the last seconds say alone (a window: information J, vector h) is held against what is remembered from before them
(mean mu, covariance P). With K = (J^-1 + P)^-1 and pull = (I + J P)^-1 (h - J mu), a change d of the derivatives has
the log-likelihood pull' d - d' K d / 2 over that of no change. The Bayes factor of "derivative k alone has changed, by
N(0, s^2)" is

    B_k = (1 + s^2 K_kk)^(-1/2) exp(s^2 pull_k^2 / (2 (1 + s^2 K_kk))),

and the mean of all B_k has expectation one while nothing changes (a mixture of likelihood ratios), so by Markov's
inequality it passes a threshold c in at most one test of c, whatever the excitation, and a window in which nothing was
excited has B_k = 1. Past the threshold the likeliest derivative's change is made part of the model: P becomes
P + s^2 e e', so its memory is free to move, that of all others stays exact, and the next derivative is tested.
Derivation: ``docs/estimators.md`` section 14, after the change-point tests of Willsky and Jones 1976.
"""

import math

import numpy as np
from numba import njit

__all__ = ["CHANGE_LOG_THRESHOLD", "MODEL_WANDER", "change_of", "changed_derivatives", "free_memory"]

TESTS_A_SECOND, FALSE_RELEASE_INTERVAL_H = 2.0, 10.0
CHANGE_LOG_THRESHOLD = math.log(FALSE_RELEASE_INTERVAL_H * 3600.0 * TESTS_A_SECOND)
"""Of the mean Bayes factor: memory is set free by chance once in ten hours at most, at two tests a second."""

MODEL_WANDER = 0.02
"""Share of its natural size by which a derivative may differ from window to window for reasons that the linear model
does not know. The monitor's test, which has minutes, allows 0.03 (decision 0021); with that a step of 20 %, met with
two of its own standard deviations to the bad, stays below the threshold however exact the window is: (0.2/w - 2)^2 / 2
has to exceed the threshold, log(1/w) and log(6)."""


@njit(cache=True)
def change_of(window, vector, mean, covariance):  # type: ignore[no-untyped-def]
    """K (k, k) and pull (k,) of a window (information (k, k), vector (k,)) against a memory (mean, covariance)."""
    k = mean.size
    inner = np.eye(k) + window @ covariance
    both = np.empty((k, k + 1))
    both[:, :k] = window
    both[:, k] = vector - window @ mean
    solved = np.linalg.solve(inner, both)
    weight = np.ascontiguousarray(solved[:, :k])
    return 0.5 * (weight + weight.T), np.ascontiguousarray(solved[:, k])


@njit(cache=True)
def _likeliest(weight, pull, size, least):  # type: ignore[no-untyped-def]
    """Log of the mean Bayes factor of a change in one derivative, and the derivative that it is likeliest in."""
    k = pull.size
    logs = np.zeros(k)
    for a in range(k):
        variance = size[a] * size[a]
        if variance * weight[a, a] < least:
            continue
        grown = 1.0 + variance * max(weight[a, a], 0.0)
        logs[a] = -0.5 * np.log(grown) + 0.5 * variance * pull[a] * pull[a] / grown
    best = int(np.argmax(logs))
    return logs[best] + np.log(np.mean(np.exp(logs - logs[best]))), best


@njit(cache=True)
def changed_derivatives(weight, pull, size, threshold, least, changed):  # type: ignore[no-untyped-def]
    """Which derivatives have changed, one after another.

    Args:
        weight, pull: K and pull of the module, (k, k) and (k,); overwritten.
        size: natural size s of each derivative's change, (k,).
        threshold: log of what the mean Bayes factor has to pass.
        least: a derivative is not asked where s^2 K_kk is less: the window does not see it that well.
        changed: set to whether each derivative has changed, (k,) of bool.

    Returns:
        log of the mean Bayes factor of the first test.
    """
    changed[:] = False
    first, _ = _likeliest(weight, pull, size, least)
    if not first > threshold:
        return first
    wander = np.square(MODEL_WANDER * size)
    for turn in range(pull.size):
        inner = np.eye(pull.size) + weight * wander
        both = np.empty((pull.size, pull.size + 1))
        both[:, : pull.size] = weight
        both[:, pull.size] = pull
        solved = np.linalg.solve(inner, both)
        value, best = _likeliest(solved, np.ascontiguousarray(solved[:, pull.size]), size, least)
        if turn == 0:
            first = value
        if not value > threshold or changed[best]:
            break
        changed[best] = True
        column = weight[:, best].copy()
        share = 1.0 / (1.0 / (size[best] * size[best]) + max(column[best], 0.0))
        pull -= column * (share * pull[best])
        weight -= share * np.outer(column, column)
    return first


@njit(cache=True)
def free_memory(sensitivity, information, vector, driven, size, changed):  # type: ignore[no-untyped-def]
    """Set the memory of the changed derivatives free: its covariance P becomes P + s^2 e e' for each of them.

    The memory is an estimating equation A theta = v with P = A^-1 C A^-1. By Sherman and Morrison A becomes T A, v
    becomes T v and C becomes T C T' + t^2 / s^2 (A e) (A e)', with t = 1 / (s^-2 + e' A e) and T = I - t A e e'.

    Args:
        sensitivity, information: A and C, (k, k), in place.
        vector, driven: v, and the part of it that the model expects of gusts, (k,), in place.
        size: natural size s of each derivative's change, (k,).
        changed: which derivatives, (k,) of bool.
    """
    k = vector.size
    for a in range(k):
        if not changed[a]:
            continue
        column = sensitivity[:, a].copy()
        precision = 1.0 / (size[a] * size[a])
        share = 1.0 / (precision + column[a])
        step = np.eye(k)
        step[:, a] -= share * column
        information[:, :] = step @ information @ np.ascontiguousarray(
            step.T
        ) + share * share * precision * np.outer(column, column)
        sensitivity -= share * np.outer(column, column)
        vector -= column * (share * vector[a])
        driven -= column * (share * driven[a])
