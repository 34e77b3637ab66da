"""What closed blocks of the recursive Fourier estimator leave behind, and how it is forgotten; compiled.

Derivation: ``docs/methods/fourier.md`` section 9, (33) and (34).
"""

from wingwatch.estimators.fourier.forgetting import replaced
from wingwatch.estimators.kernels.hot import lean
from wingwatch.estimators.kernels.symmetric import congruence

__all__ = ["fade", "replace"]

RESERVE_THAT_COUNTS = 0.01
"""Share of a derivative's information in reserve, from which on the running block is asked what it replaces."""


@lean
def fade(share, memory, reserve):  # type: ignore[no-untyped-def]
    """What the clock makes fade goes into reserve; what is known in all stays as it is."""
    sensitivity, information, vector, driven = memory
    k = vector.size
    for a in range(k):
        for b in range(k):
            reserve[a, b] += share * (sensitivity[a, b] - reserve[a, b])
            reserve[a, k + b] += share * (information[a, b] - reserve[a, k + b])
        reserve[a, 2 * k] += share * (vector[a] - reserve[a, 2 * k])
        reserve[a, 2 * k + 1] += share * (driven[a] - reserve[a, 2 * k + 1])


@lean
def replace(share, gained, prior_std, memory, reserve, room):  # type: ignore[no-untyped-def]
    """Of the reserve goes what a block that brings ``gained`` replaces."""
    squares, lines = room[0], room[1]
    sensitivity, information, vector, driven = memory
    k = vector.size
    counts, trace = False, 0.0
    for a in range(k):
        counts = counts or reserve[a, a] > RESERVE_THAT_COUNTS * sensitivity[a, a]
        trace += gained[a, a]
    if not counts or trace <= 0.0:
        return
    left, old, known, new = squares[0], squares[1], squares[2], squares[3]
    score, gust = lines[0], lines[1]
    for a in range(k):
        for b in range(k):
            old[a, b] = reserve[a, b]
            known[a, b] = sensitivity[a, b] + gained[a, b]
        known[a, a] += 1.0 / (prior_std[a] * prior_std[a])
    if replaced(old, known, gained, share, squares[5:], lines[6:], left) == k:
        return
    congruence(left, old, known, new)
    for a in range(k):
        score[a] = gust[a] = 0.0
        for b in range(k):
            score[a] += left[a, b] * reserve[b, 2 * k]
            gust[a] += left[a, b] * reserve[b, 2 * k + 1]
            sensitivity[a, b] += new[a, b] - old[a, b]
    for a in range(k):
        vector[a] += score[a] - reserve[a, 2 * k]
        driven[a] += gust[a] - reserve[a, 2 * k + 1]
        reserve[a, 2 * k], reserve[a, 2 * k + 1] = score[a], gust[a]
        for b in range(k):
            old[a, b] = reserve[a, k + b]
            reserve[a, b] = new[a, b]
    congruence(left, old, known, new)
    for a in range(k):
        for b in range(k):
            information[a, b] += new[a, b] - old[a, b]
            reserve[a, k + b] = new[a, b]
