"""Directional forgetting: what new data replace is forgotten, everything else stays in reserve.

Derivation: ``docs/estimators.md`` section 9.
"""

import numpy as np
from numba import njit

__all__ = ["replaced"]

SMALLEST = 1e-14
"""Least eigenvalue of what is known beside its largest, unit diagonal: less is rounding."""

SLIGHT = 1e-9
"""Added to what is known of a direction where it is inverted, all that is known being one."""

EXCITED = 0.1
"""Share of the information that would keep the balance with forgetting, from which on a direction counts as excited: a
third of the amplitude that taught what is known."""


@njit(cache=True)
def replaced(reserve, known, gained, share):  # type: ignore[no-untyped-def]
    """What is left of a reserve of old information when new data have come.

    In coordinates that make ``known`` the unit matrix and ``gained`` diagonal, w_i of new information falls to a
    direction; it is excited where w_i is at least ``EXCITED`` of ``share``. What the reserve says of the excited
    directions goes, for the recent data speak for them; what it says of the others given these stays (Kulhavy 1987 for
    one reading; in a subspace, Lai and Bernstein 2024, SIFt-RLS). With A the excited and C the other directions, the
    score of the latter is carried over by G = F_.C F_CC^-1, so its mean and its variance remain those that are stated.

    Args:
        reserve: F, (k, k), positive semidefinite.
        known: all information, the new and the prior included, (k, k), positive definite.
        gained: the new data's part of it, (k, k). Where anything is not finite nothing goes.
        share: what the clock makes fade in the time that ``gained`` took, 0 to 1.

    Returns:
        Q (k, k): F becomes Q F Q', a score b that goes with it Q b.
    """
    k = known.shape[0]
    if not (np.isfinite(known).all() and np.isfinite(gained).all() and np.isfinite(reserve).all()):
        return np.eye(k)
    size = np.sqrt(np.maximum(np.diag(known), 1e-300))
    unit = np.outer(size, size)
    power, axes = np.linalg.eigh(known / unit)
    length = np.sqrt(np.maximum(power, SMALLEST * power[k - 1]))
    towards = np.ascontiguousarray(axes.T)
    whitened = towards @ (gained / unit) @ axes / np.outer(length, length)
    new, directions = np.linalg.eigh(0.5 * (whitened + whitened.T))
    root = axes @ (length.reshape(k, 1) * directions)
    back = np.ascontiguousarray(directions.T) @ (towards / length.reshape(k, 1))
    other = 0
    while other < k and new[other] < EXCITED * share:
        other += 1
    turned = back @ (reserve / unit) @ np.ascontiguousarray(back.T)
    carried = np.zeros((k, k))
    if other > 0:
        inner = np.ascontiguousarray(turned[:other, :other]) + SLIGHT * np.eye(other)
        carried[:, :other] = np.ascontiguousarray(
            np.linalg.solve(inner, np.ascontiguousarray(turned[:other])).T
        )
        for a in range(other):
            for b in range(other):
                carried[a, b] = 1.0 if a == b else 0.0
    return (root @ carried @ back) * np.outer(size, 1.0 / size)
