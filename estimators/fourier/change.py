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
Derivation: ``docs/methods/fourier.md`` section 10, after the change-point tests of Willsky and Jones 1976.
"""

import math

from wingwatch.estimators.kernels.hot import lean
from wingwatch.estimators.kernels.symmetric import product, solve_general

__all__ = ["CHANGE_LOG_THRESHOLD", "MODEL_WANDER", "change_of", "changed_derivatives", "free_memory"]

TESTS_A_SECOND, FALSE_RELEASE_INTERVAL_H = 2.0, 10.0
CHANGE_LOG_THRESHOLD = math.log(FALSE_RELEASE_INTERVAL_H * 3600.0 * TESTS_A_SECOND)
"""Of the mean Bayes factor: memory is set free by chance once in ten hours at most, at two tests a second."""

MODEL_WANDER = 0.02
"""Share of its natural size by which a derivative may differ from window to window for reasons that the linear model
does not know. The monitor's test, which has minutes, allows 0.03 (decision 0021); with that a step of 20 %, met with
two of its own standard deviations to the bad, stays below the threshold however exact the window is: (0.2/w - 2)^2 / 2
has to exceed the threshold, log(1/w) and log(6)."""


@lean
def change_of(window, vector, mean, covariance, inner, both, weight, pull):  # type: ignore[no-untyped-def]
    """K (k, k) and pull (k,) of a window (information (k, k), vector (k,)) against a memory (mean, covariance).

    Args:
        inner, both: room, (k, k) and (k, k + 1).
        weight, pull: become K and pull.
    """
    k = mean.size
    product(window, covariance, inner)
    for a in range(k):
        inner[a, a] += 1.0
        both[a, k] = vector[a]
        for b in range(k):
            both[a, b] = window[a, b]
            both[a, k] -= window[a, b] * mean[b]
    solve_general(inner, both, k)
    for a in range(k):
        pull[a] = both[a, k]
        for b in range(k):
            weight[a, b] = 0.5 * (both[a, b] + both[b, a])


@lean
def _likeliest(weight, pull, size, least):  # type: ignore[no-untyped-def]
    """Log of the mean Bayes factor of a change in one derivative, and the derivative that it is likeliest in.

    Args:
        weight: K in its first k columns, (k, k) or wider.
    """
    k = size.size
    first, best = 0.0, 0
    for a in range(k):
        value = _log_factor(weight[a, a], pull[a], size[a], least)
        if a == 0 or value > first:
            first, best = value, a
    total = 0.0
    for a in range(k):
        total += math.exp(_log_factor(weight[a, a], pull[a], size[a], least) - first)
    return first + math.log(total / k), best


@lean
def _log_factor(weight, pull, size, least):  # type: ignore[no-untyped-def]
    """log B of one derivative; zero where the window does not see it."""
    variance = size * size
    if variance * weight < least:
        return 0.0
    grown = 1.0 + variance * max(weight, 0.0)
    return -0.5 * math.log(grown) + 0.5 * variance * pull * pull / grown


@lean
def changed_derivatives(weight, pull, size, threshold, least, inner, both, line, changed):  # type: ignore[no-untyped-def]
    """Which derivatives have changed, one after another.

    Args:
        weight, pull: K and pull of the module, (k, k) and (k,); overwritten.
        size: natural size s of each derivative's change, (k,).
        threshold: log of what the mean Bayes factor has to pass.
        least: a derivative is not asked where s^2 K_kk is less: the window does not see it that well.
        inner, both, line: room, (k, k), (k, k + 1) and (k,).
        changed: set to whether each derivative has changed, (k,) of bool.

    Returns:
        log of the mean Bayes factor of the first test.
    """
    k = size.size
    changed[:] = False
    first, _ = _likeliest(weight, pull, size, least)
    if not first > threshold:
        return first
    for turn in range(k):
        for a in range(k):
            for b in range(k):
                inner[a, b] = weight[a, b] * (MODEL_WANDER * size[b]) ** 2
                both[a, b] = weight[a, b]
            inner[a, a] += 1.0
            both[a, k] = pull[a]
        solve_general(inner, both, k)
        for a in range(k):
            line[a] = both[a, k]
        value, best = _likeliest(both, line, size, least)
        if turn == 0:
            first = value
        if not value > threshold or changed[best]:
            break
        changed[best] = True
        for a in range(k):
            line[a] = weight[a, best]
        share = 1.0 / (1.0 / (size[best] * size[best]) + max(line[best], 0.0))
        moved = share * pull[best]
        for a in range(k):
            pull[a] -= line[a] * moved
            for b in range(k):
                weight[a, b] -= share * line[a] * line[b]
    return first


@lean
def free_memory(sensitivity, information, vector, driven, size, changed, line, other):  # type: ignore[no-untyped-def]
    """Set the memory of the changed derivatives free: its covariance P becomes P + s^2 e e' for each of them.

    The memory is an estimating equation A theta = v with P = A^-1 C A^-1. By Sherman and Morrison A becomes T A, v
    becomes T v and C becomes T C T' + t^2 / s^2 (A e) (A e)', with t = 1 / (s^-2 + e' A e) and T = I - t A e e'.

    Args:
        sensitivity, information: A and C, (k, k), in place.
        vector, driven: v, and the part of it that the model expects of gusts, (k,), in place.
        size: natural size s of each derivative's change, (k,).
        changed: which derivatives, (k,) of bool.
        line, other: room, (k,) each.
    """
    k = vector.size
    for a in range(k):
        if not changed[a]:
            continue
        precision = 1.0 / (size[a] * size[a])
        for b in range(k):
            line[b] = sensitivity[b, a]
        share = 1.0 / (precision + line[a])
        for b in range(k):
            other[b] = information[a, b]
        for b in range(k):
            for c in range(k):
                information[b, c] -= share * line[b] * other[c]
        for b in range(k):
            other[b] = information[b, a]
        for b in range(k):
            for c in range(k):
                information[b, c] += share * line[c] * (share * precision * line[b] - other[b])
                sensitivity[b, c] -= share * line[b] * line[c]
        told, drive = share * vector[a], share * driven[a]
        for b in range(k):
            vector[b] -= line[b] * told
            driven[b] -= line[b] * drive
