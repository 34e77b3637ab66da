"""How much more the filter's derivatives scatter from block to block than it says; compiled.

A filter's stated errors are those of white residuals. Where residuals are coloured (moments that nobody measures, terms
that the model leaves out) what one block says of the derivatives differs from what was known before by more than both
admit, and errors are wider by that much. Derivation: ``docs/methods/fourier.md`` section 8; here blocks are of ten
solutions, so that inputs are in some and not in others: what only the one kind or the other says wrongly is seen.
"""

import math

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.ekf.coherence import coherent_dispersions
from wingwatch.estimators.ekf.state import EkfState, Scatter
from wingwatch.estimators.evidence.dispersion import (
    DISPERSION,
    disperse,
    dispersion_of,
    dispersion_workspace,
    gather_scatter,
)
from wingwatch.estimators.evidence.information import believe
from wingwatch.estimators.kernels.symmetric import invert
from wingwatch.kernels.copying import copy_into
from wingwatch.kernels.decorators import helper, whole

__all__ = [
    "BLOCK_SOLUTIONS",
    "begin_block",
    "close_block",
    "dispersed",
    "dispersion_before",
    "forget_block",
    "no_scatter",
    "stated_dispersions",
    "wider_covariances",
]

Array = NDArray[np.float64]

BLOCK_SOLUTIONS = 10
"""Solutions of a block, five seconds: longer than what gusts and unmodelled moments remember, shorter than the time
between two inputs."""


@helper
def begin_block(scatter, i, now_s, information, vector):  # type: ignore[no-untyped-def]
    """Vehicle i begins a block with ``information`` (k, k) and ``vector`` (k,) about the derivatives."""
    scatter.start_s[i] = now_s
    copy_into(information, scatter.start_matrix[i])
    copy_into(vector, scatter.start_vector[i])
    scatter.matrix[i] = 0.0
    scatter.vector[i] = 0.0


@helper
def close_block(scatter, i, now_s, memory_s, dispersing):  # type: ignore[no-untyped-def]
    """Compares a block that is full with what was known when it began; the next solution begins another.

    Args:
        scatter: ``Scatter``; i: the vehicle.
        now_s: on the rows' clock.
        memory_s: with which earlier blocks are forgotten.
        dispersing: ``DispersionWorkspace``.
    """
    if scatter.solutions[i] < BLOCK_SOLUTIONS:
        return
    scatter.solutions[i] = 0
    k = scatter.vector.shape[1]
    work, covariance, mean = np.empty((k, k)), np.empty((k, k)), np.empty(k)
    believe(scatter.start_matrix[i], scatter.start_vector[i], work, covariance, mean)
    keep = math.exp(-(now_s - scatter.start_s[i]) / memory_s)
    gather_scatter(
        scatter.matrix[i], scatter.vector[i], mean, covariance, keep, scatter.equations[i], dispersing
    )


def no_scatter(vehicles: int, ns: int, k: int) -> Scatter:
    """Before the first block."""
    return Scatter(
        solutions=np.zeros(vehicles, dtype=np.int64),
        start_s=np.zeros(vehicles),
        start_matrix=np.zeros((vehicles, k, k)),
        start_vector=np.zeros((vehicles, k)),
        matrix=np.zeros((vehicles, k, k)),
        vector=np.zeros((vehicles, k)),
        equations=np.zeros((vehicles, ns, 3)),
        coherent=np.ones((vehicles, ns)),
    )


def forget_block(state: EkfState, i: int) -> None:
    """What vehicle i's running block says is no evidence: the derivatives have been put elsewhere."""
    state.scatter.solutions[i] = 0


def stated_dispersions(state: EkfState, places: NDArray[np.int64]) -> Array:
    """Ratio by which the stated variances of vehicles (m,) grow, by equation, (m, ns): scatter of blocks, or what goes
    with the motion."""
    out = np.ones((places.size, state.scatter.coherent.shape[1]))
    _stated_into(state.scatter.equations, state.coherence, places, out)
    return out


@whole
def _stated_into(equations, coherence, places, out):  # type: ignore[no-untyped-def]
    """Compiled ``stated_dispersions``."""
    for m in range(places.size):
        coherent_dispersions(coherence, places[m], out[m])
        for e in range(out.shape[1]):
            out[m, e] = max(dispersion_of(equations[places[m], e]), out[m, e])


def _scattered(equations: Array) -> Array:
    """Dispersion of blocks by equation, (ns,)."""
    return np.array([dispersion_of(row) for row in equations])


def wider_covariances(covariance: Array, prior_std: Array, dispersion: Array) -> Array:
    """Covariances (m, k, k) of the derivatives with the information that data gave S^-1 (P^-1 - P_0^-1) S^-1, S the
    roots of the dispersions.

    Stabilised forgetting keeps the prior's information whole, so what is more than that is of data.

    Args:
        covariance: P of the filter, (m, k, k).
        prior_std: (k,).
        dispersion: (m, ns).
    """
    wider = covariance.copy()
    for m in np.flatnonzero(dispersion.max(axis=1) > 1.0):
        _widen(wider[m], prior_std, dispersion[m])
    return wider


@whole
def _widen(covariance, prior_std, dispersion):  # type: ignore[no-untyped-def]
    """In place, each equation's own part."""
    n = prior_std.size // dispersion.size
    known, own = np.empty((n, n)), np.empty((n, n))
    for e in range(dispersion.size):
        first, by = e * n, 1.0 / dispersion[e]
        for a in range(n):
            for b in range(n):
                own[a, b] = covariance[first + a, first + b]
        invert(own, known)
        for a in range(n):
            for b in range(n):
                own[a, b] = known[a, b] * by
            own[a, a] += (1.0 - by) / (prior_std[first + a] * prior_std[first + a])
        invert(own, known)
        for a in range(n):
            for b in range(n):
                covariance[first + a, first + b] = known[a, b]


def dispersion_before(scatter: Scatter, i: int) -> Array:
    """The same as ``stated_dispersion`` by what was before vehicle i's running block, (ns,)."""
    return np.asarray(np.maximum(_scattered(scatter.equations[i]), scatter.coherent[i]))


def dispersed(matrix: Array, vector: Array, dispersion: Array) -> tuple[Array, Array]:
    """Evidence (k, k), (k,) with its covariance made larger by the dispersions (ns,), ratios of variances."""
    matrix, vector, scatter = matrix.copy(), vector.copy(), np.zeros((dispersion.size, 3))
    scatter[:, DISPERSION] = dispersion
    disperse(matrix, vector, np.zeros_like(vector), scatter, dispersion_workspace(vector.size))
    return matrix, vector
