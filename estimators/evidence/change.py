"""Where a derivative has changed, its covariance is inflated and what is known of the others stays; compiled.

What a window of the last seconds says alone (information J, vector h) is compared with what is remembered from before
it (mean mu, covariance P). With K = (J^-1 + P)^-1 and r = (I + J P)^-1 (h - J mu), a change d of the derivatives has
the log-likelihood r' d - d' K d / 2 over that of no change. The Bayes factor of "derivative k alone has changed, by
N(0, s^2)" is

    B_k = (1 + s^2 K_kk)^(-1/2) exp(s^2 r_k^2 / (2 (1 + s^2 K_kk))),

and the mean of all B_k has expectation one while nothing changes (a mixture of likelihood ratios), so by Markov's
inequality it passes a threshold c in at most one test of c, whatever the excitation, and a window in which nothing was
excited has B_k = 1. Past the threshold the likeliest derivative's change is made part of the model: P becomes
P + s^2 e e', so this derivative can move, the memory of all others stays exact, and the next derivative is tested.
What changes one derivative may have changed all of them a little (ice), or no other (a surface that has lost effect).
Of even odds, the window says how likely the first is, and by that probability the others' P is inflated, too.
Derivation: ``docs/methods/fourier.md`` section 10, after the change-point tests of Willsky and Jones 1976.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.kernels.symmetric import product, solve_general
from wingwatch.kernels.decorators import lean

__all__ = [
    "CHANGE_LOG_THRESHOLD",
    "ChangeWorkspace",
    "change_of",
    "change_workspace",
    "changed_derivatives",
    "inflate_covariance",
    "spread_of_change",
]

WITH_ANOTHER = 0.1
"""Standard deviation, in natural sizes, of what a derivative changes by where one that is seen to change is not alone:
Bragg's icing of severity 0.05 changes most of them by 3 to 17 %, of 0.3 by up to 100 % (decision 81 tried more)."""

TESTS_A_SECOND, FALSE_CHANGE_INTERVAL_H = 2.0, 10.0
CHANGE_LOG_THRESHOLD = math.log(FALSE_CHANGE_INTERVAL_H * 3600.0 * TESTS_A_SECOND)
"""Of the mean Bayes factor: a covariance is inflated by chance once in ten hours at most, at two tests a second."""

OFF_PATTERN = 0.02
"""Fraction of its natural size by which a derivative may differ from window to window for reasons that the linear model
does not know. The monitor's test, which has minutes, allows 0.03 (decision 0021); with that a step of 20 %, met with
two of its own standard deviations to the bad, stays below the threshold however exact the window is: (0.2/w - 2)^2 / 2
has to exceed the threshold, log(1/w) and log(6)."""


class ChangeWorkspace(NamedTuple):
    """Workspace of a test for changes of k derivatives.

    Attributes:
        information, vector: (k, k) K and (k,) r of the module.
        inner, both: (k, k), (k, k + 1).
        line, other: (k,).
    """

    information: NDArray[np.float64]
    vector: NDArray[np.float64]
    inner: NDArray[np.float64]
    both: NDArray[np.float64]
    line: NDArray[np.float64]
    other: NDArray[np.float64]


def change_workspace(k: int) -> ChangeWorkspace:
    """Workspace for k derivatives."""
    shapes = ((k, k), k, (k, k), (k, k + 1), k, k)
    return ChangeWorkspace(*(np.empty(shape) for shape in shapes))


@lean
def change_of(window, vector, mean, covariance, work):  # type: ignore[no-untyped-def]
    """K and r, into ``work``, of a window (information (k, k), vector (k,)) and a memory (mean, covariance)."""
    k, inner, both = mean.size, work.inner, work.both
    product(window, covariance, inner)
    for a in range(k):
        inner[a, a] += 1.0
        both[a, k] = vector[a]
        for b in range(k):
            both[a, b] = window[a, b]
            both[a, k] -= window[a, b] * mean[b]
    solve_general(inner, both, k)
    for a in range(k):
        work.vector[a] = both[a, k]
        for b in range(k):
            work.information[a, b] = 0.5 * (both[a, b] + both[b, a])


@lean
def _likeliest(information, vector, size):  # type: ignore[no-untyped-def]
    """Log of the mean Bayes factor of a change in one derivative, and the derivative that it is likeliest in.

    Args:
        information: K in its first k columns, (k, k) or wider.
    """
    k = size.size
    first, best = 0.0, 0
    for a in range(k):
        value = _log_factor(information[a, a], vector[a], size[a])
        if a == 0 or value > first:
            first, best = value, a
    total = 0.0
    for a in range(k):
        total += math.exp(_log_factor(information[a, a], vector[a], size[a]) - first)
    return first + math.log(total / k), best


@lean
def _log_factor(information, vector, size):  # type: ignore[no-untyped-def]
    """log B of one derivative; zero where rounding has made its information negative."""
    variance = size * size
    if variance * information < 0.0:
        return 0.0
    grown = 1.0 + variance * max(information, 0.0)
    return -0.5 * math.log(grown) + 0.5 * variance * vector * vector / grown


@lean
def changed_derivatives(size, threshold, work, changed):  # type: ignore[no-untyped-def]
    """Which derivatives have changed, one after another.

    Args:
        size: natural size s of each derivative's change, (k,).
        threshold: log of what the mean Bayes factor has to pass.
        work: of ``change_of``; K and r are overwritten.
        changed: set to whether each derivative has changed, (k,) of bool.

    Returns:
        log of the mean Bayes factor of the first test.
    """
    information, vector, inner, both, line = work.information, work.vector, work.inner, work.both, work.line
    k = size.size
    changed[:] = False
    first, _ = _likeliest(information, vector, size)
    if not first > threshold:
        return first
    for turn in range(k):
        for a in range(k):
            for b in range(k):
                inner[a, b] = information[a, b] * (OFF_PATTERN * size[b]) ** 2
                both[a, b] = information[a, b]
            inner[a, a] += 1.0
            both[a, k] = vector[a]
        solve_general(inner, both, k)
        for a in range(k):
            line[a] = both[a, k]
        value, best = _likeliest(both, line, size)
        if turn == 0:
            first = value
        if not value > threshold or changed[best]:
            break
        changed[best] = True
        for a in range(k):
            line[a] = information[a, best]
        gain = 1.0 / (1.0 / (size[best] * size[best]) + max(line[best], 0.0))
        moved = gain * vector[best]
        for a in range(k):
            vector[a] -= line[a] * moved
            for b in range(k):
                information[a, b] -= gain * line[a] * line[b]
    return first


@lean
def spread_of_change(size, changed, work, spread):  # type: ignore[no-untyped-def]
    """Standard deviation of what each derivative has changed by, in natural sizes, into ``spread`` (k,): 1 of those
    that were seen to, of all others as one may where another has, by the probability that they have.

    Args:
        size: natural size s of each derivative's change, (k,).
        changed: of ``changed_derivatives``, (k,).
        work: K and r as that leaves them; overwritten.
    """
    information, vector, line = work.information, work.vector, work.line
    k, factor = size.size, 0.0
    for a in range(k):
        if changed[a]:
            continue
        for b in range(k):
            line[b] = information[b, a]
        variance = (WITH_ANOTHER * size[a]) ** 2
        grown = 1.0 + variance * max(line[a], 0.0)
        factor += 0.5 * (variance * vector[a] * vector[a] / grown - math.log(grown))
        gain = variance / grown
        moved = gain * vector[a]
        for b in range(k):
            vector[b] -= line[b] * moved
            for c in range(k):
                information[b, c] -= gain * line[b] * line[c]
    probability = 1.0 / (1.0 + math.exp(-max(min(factor, 30.0), -30.0)))
    for a in range(k):
        spread[a] = 1.0 if changed[a] else WITH_ANOTHER * math.sqrt(probability)


@lean
def inflate_covariance(memory, size, work):  # type: ignore[no-untyped-def]
    """Covariance inflation: the memory's P becomes P + s^2 e e' for each derivative.

    The memory is an estimating equation A theta = v with P = A^-1 C A^-1. By Sherman and Morrison A becomes T A, v
    becomes T v and C becomes T C T' + t^2 / s^2 (A e) (A e)', with t = 1 / (s^-2 + e' A e) and T = I - t A e e'.

    Args:
        memory: ``Memory``, in place.
        size: s of each derivative's change, (k,); 0 of none.
        work: ``ChangeWorkspace``.
    """
    sensitivity, information, vector, bias = (
        memory.sensitivity,
        memory.information,
        memory.vector,
        memory.bias,
    )
    line, other = work.line, work.other
    k = vector.size
    for a in range(k):
        if not size[a] > 0.0:
            continue
        precision = 1.0 / (size[a] * size[a])
        for b in range(k):
            line[b] = sensitivity[b, a]
        gain = 1.0 / (precision + line[a])
        for b in range(k):
            other[b] = information[a, b]
        for b in range(k):
            for c in range(k):
                information[b, c] -= gain * line[b] * other[c]
        for b in range(k):
            other[b] = information[b, a]
        for b in range(k):
            for c in range(k):
                information[b, c] += gain * line[c] * (gain * precision * line[b] - other[b])
                sensitivity[b, c] -= gain * line[b] * line[c]
        of_vector, of_bias = gain * vector[a], gain * bias[a]
        for b in range(k):
            vector[b] -= line[b] * of_vector
            bias[b] -= line[b] * of_bias
