"""Directional forgetting: what new data replace is forgotten, everything else that is discounted is kept.

Derivation: ``docs/methods/fourier.md`` section 9, (33) and (34).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.kernels.symmetric import (
    all_above,
    all_below,
    cholesky,
    congruence,
    eigen,
    forward,
    product,
    solve_general,
)
from wingwatch.kernels.decorators import lean

__all__ = ["ForgettingWorkspace", "forgetting_workspace", "replaced"]

LEAST = 1e-8
"""Least pivot or eigenvalue of what is known, unit diagonal; what is less is taken for so much."""

SLIGHT = 1e-6
"""Added to what is known of a direction where it is inverted, all that is known being one. A double's last digit, 15
derivatives and ``LEAST`` leave 3e-7 of nothing, of either sign."""

EXCITED = 0.1
"""Fraction of the information that would keep the balance with forgetting, from which on a direction counts as
excited: a third of the amplitude that taught what is known."""


class ForgettingWorkspace(NamedTuple):
    """Workspace of ``replaced``, names as there.

    Attributes:
        axes, whitened, half, directions, root, inverse: (k, k).
        size, power, off, work: (k,).
    """

    axes: NDArray[np.float64]
    whitened: NDArray[np.float64]
    half: NDArray[np.float64]
    directions: NDArray[np.float64]
    root: NDArray[np.float64]
    inverse: NDArray[np.float64]
    size: NDArray[np.float64]
    power: NDArray[np.float64]
    off: NDArray[np.float64]
    work: NDArray[np.float64]


def forgetting_workspace(k: int) -> ForgettingWorkspace:
    """Workspace for k derivatives."""
    shapes = [(k, k)] * 6 + [(k,)] * 4
    return ForgettingWorkspace(*(np.empty(shape) for shape in shapes))


@lean
def _carry_over(turned, other, inner, rest, out):  # type: ignore[no-untyped-def]
    """What is carried over: one for the first ``other`` directions, of the rest what they predict, F_.C F_CC^-1.

    Args:
        turned: F in coordinates in which the first ``other`` directions stay, (k, k).
        inner, rest: workspace of (other, other) and (other, k).
        out: (k, k).
    """
    k = turned.shape[0]
    out[:, :] = 0.0
    for a in range(other):
        for b in range(other):
            inner[a, b] = turned[a, b]
        inner[a, a] += SLIGHT
        for b in range(k):
            rest[a, b] = turned[a, b]
    solve_general(inner, rest, other)
    for a in range(k):
        for b in range(other):
            out[a, b] = rest[b, a]
    for a in range(other):
        for b in range(other):
            out[a, b] = 1.0 if a == b else 0.0


@lean
def _whitener(known, power, off, work, root, inverse):  # type: ignore[no-untyped-def]
    """A root of ``known``, root root' = known, and its inverse, (k, k); by eigenvectors where it is near singular."""
    k = known.shape[0]
    for a in range(k):
        for b in range(k):
            root[a, b] = 0.0
            inverse[a, b] = 1.0 if a == b else 0.0
    if cholesky(known, LEAST, root):
        forward(root, inverse)
        return
    eigen(known, power, off, work)
    for v in range(k):
        length = math.sqrt(max(power[v], LEAST))
        for a in range(k):
            # Rows: axes over their lengths whiten; axes times their lengths, as columns, lead back.
            root[a, v] = known[v, a] * length
            inverse[v, a] = known[v, a] / length


@lean
def replaced(discounted, known, gained, decay, work, out):  # type: ignore[no-untyped-def]
    """What is left of discounted old information when new data have come.

    In coordinates that make ``known`` the unit matrix and ``gained`` diagonal, w_i of new information falls to a
    direction; it is excited where w_i is at least ``EXCITED`` of ``decay``. What the discounted information says of
    the excited directions goes, for the recent data speak for them; what it says of the others given these stays
    (Kulhavy 1987 for one reading; in a subspace, Lai and Bernstein 2024, SIFt-RLS). With A the excited and C the other
    directions, the score of the latter is carried over by G = F_.C F_CC^-1, so its mean and its variance remain those
    that are stated.

    Args:
        discounted: F, (k, k), positive semidefinite.
        known: all information, the new and the prior included, (k, k), positive definite.
        gained: the new data's part of it, (k, k). Where anything is not finite nothing goes.
        decay: fraction that the time constant discounts in the time that ``gained`` took, 0 to 1.
        work: ``ForgettingWorkspace``.
        out: becomes Q (k, k): F becomes Q F Q', a score b that goes with it Q b.

    Returns:
        how many directions stay; where it is k, Q is one.
    """
    k = known.shape[0]
    axes, whitened, half, directions = work.axes, work.whitened, work.half, work.directions
    root, inverse, size, power = work.root, work.inverse, work.size, work.power
    finite = True
    for a in range(k):
        size[a] = math.sqrt(max(known[a, a], 1e-300))
        for b in range(k):
            finite = finite and math.isfinite(known[a, b] + gained[a, b] + discounted[a, b])
            out[a, b] = 1.0 if a == b else 0.0
    if not finite:
        return k
    for a in range(k):
        for b in range(k):
            axes[a, b] = known[a, b] / (size[a] * size[b])
            directions[a, b] = gained[a, b] / (size[a] * size[b])
    _whitener(axes, power, work.off, work.work, root, inverse)
    congruence(inverse, directions, half, whitened)
    for a in range(k):
        for b in range(k):
            directions[a, b] = 0.5 * (whitened[a, b] + whitened[b, a])
    if all_below(directions, EXCITED * decay, half):
        return k
    if all_above(directions, EXCITED * decay, half):
        out[:, :] = 0.0
        return 0
    eigen(directions, power, work.off, work.work)
    other = 0
    while other < k and power[other] < EXCITED * decay:
        other += 1
    if other == k:
        return k
    product(directions, inverse, half)
    for a in range(k):
        for b in range(k):
            axes[a, b] = discounted[a, b] / (size[a] * size[b])
    congruence(half, axes, inverse, whitened)
    _carry_over(whitened, other, axes, inverse, out)
    product(out, half, whitened)
    for a in range(k):
        for v in range(k):
            inverse[a, v] = 0.0
        for b in range(k):
            for v in range(k):
                inverse[a, v] += root[a, b] * directions[v, b]
    product(inverse, whitened, out)
    for a in range(k):
        for b in range(k):
            out[a, b] *= size[a] / size[b]
    return other
