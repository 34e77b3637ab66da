"""What closed blocks of the recursive Fourier estimator leave behind, and how it is forgotten; compiled.

Derivation: ``docs/methods/fourier.md`` section 9, (33) and (34).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.evidence.forgetting import ForgettingWorkspace, forgetting_workspace, replaced
from wingwatch.estimators.kernels.symmetric import congruence
from wingwatch.kernels.decorators import lean

__all__ = ["MemoryWorkspace", "discount", "memory_workspace", "replace"]

FRACTION_THAT_COUNTS = 0.01
"""Discounted fraction of a derivative's information from which on the running block is asked what it replaces."""


class MemoryWorkspace(NamedTuple):
    """Workspace of ``replace``.

    Attributes:
        left, old, known, new: (k, k).
        vector, bias: (k,).
        forgetting: of ``replaced``.
    """

    left: NDArray[np.float64]
    old: NDArray[np.float64]
    known: NDArray[np.float64]
    new: NDArray[np.float64]
    vector: NDArray[np.float64]
    bias: NDArray[np.float64]
    forgetting: ForgettingWorkspace


def memory_workspace(k: int) -> MemoryWorkspace:
    """Workspace for k derivatives."""
    left, old, known, new = np.empty((4, k, k))
    return MemoryWorkspace(left, old, known, new, np.empty(k), np.empty(k), forgetting_workspace(k))


@lean
def discount(decay, memory, discounted):  # type: ignore[no-untyped-def]
    """A fraction ``decay`` of what has not been discounted yet is; what is known in all stays as it is."""
    k = memory.vector.size
    for a in range(k):
        for b in range(k):
            discounted.sensitivity[a, b] += decay * (memory.sensitivity[a, b] - discounted.sensitivity[a, b])
            discounted.information[a, b] += decay * (memory.information[a, b] - discounted.information[a, b])
        discounted.vector[a] += decay * (memory.vector[a] - discounted.vector[a])
        discounted.bias[a] += decay * (memory.bias[a] - discounted.bias[a])


@lean
def replace(decay, gained, theta, prior_std, memory, discounted, work):  # type: ignore[no-untyped-def]
    """Of the discounted memory goes what a block that adds the sensitivity ``gained`` (k, k) replaces.

    Scores are carried over about what is known, ``theta`` (k,): from zero they are thousands of standard errors long,
    and what a direction without information keeps of them in rounding would move the others by many.
    """
    sensitivity, k = memory.sensitivity, memory.vector.size
    counts, trace = False, 0.0
    for a in range(k):
        counts = counts or discounted.sensitivity[a, a] > FRACTION_THAT_COUNTS * sensitivity[a, a]
        trace += gained[a, a]
    if not counts or trace <= 0.0:
        return
    left, old, known, new, vector, bias = work.left, work.old, work.known, work.new, work.vector, work.bias
    for a in range(k):
        for b in range(k):
            old[a, b] = discounted.sensitivity[a, b]
            known[a, b] = sensitivity[a, b] + gained[a, b]
        known[a, a] += 1.0 / (prior_std[a] * prior_std[a])
    if replaced(old, known, gained, decay, work.forgetting, left) == k:
        return
    congruence(left, old, known, new)
    vector[:] = 0.0
    bias[:] = 0.0
    for b in range(k):
        score = discounted.vector[b]
        for c in range(k):
            score -= old[b, c] * theta[c]
        for a in range(k):
            vector[a] += left[a, b] * score + new[a, b] * theta[b]
            bias[a] += left[a, b] * discounted.bias[b]
            sensitivity[a, b] += new[a, b] - old[a, b]
    for a in range(k):
        memory.vector[a] += vector[a] - discounted.vector[a]
        memory.bias[a] += bias[a] - discounted.bias[a]
        discounted.vector[a], discounted.bias[a] = vector[a], bias[a]
        for b in range(k):
            old[a, b] = discounted.information[a, b]
            discounted.sensitivity[a, b] = new[a, b]
    congruence(left, old, known, new)
    for a in range(k):
        for b in range(k):
            memory.information[a, b] += new[a, b] - old[a, b]
            discounted.information[a, b] = new[a, b]
