"""How much more the blocks of an online estimator scatter than they say, compiled.

Derivation and symbols: ``docs/methods/fourier.md`` section 8. Arrays are those of one vehicle, memory is the caller's.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.kernels.symmetric import congruence, eigen, invert
from wingwatch.kernels.decorators import lean

__all__ = [
    "CHI_SQUARE",
    "DISPERSION",
    "FREEDOM",
    "PRIOR_FREEDOM",
    "coherent_dispersion",
    "DispersionWorkspace",
    "disperse",
    "dispersion_of",
    "dispersion_workspace",
    "gather_scatter",
]

CHI_SQUARE, FREEDOM, DISPERSION = range(3)
"""Columns of the scatter of one equation."""

PRIOR_FREEDOM = 3.0
"""Weight of a dispersion of one, in degrees of freedom: that of the widest inverse chi-square, five degrees, that has a
variance; its mean is what counts, and two degrees of five stand for that."""

SMALLEST = 1e-6
"""Fraction of the largest eigenvalue, unit diagonal, below which a direction counts as not seen by a block."""


class EigenWorkspace(NamedTuple):
    """Workspace of ``_solved`` for n derivatives.

    Attributes:
        vectors: (n, n) eigenvectors of the matrix of unit diagonal, one a row.
        size, values, off, work: (n,) roots of the diagonal, eigenvalues, workspace.
    """

    vectors: NDArray[np.float64]
    size: NDArray[np.float64]
    values: NDArray[np.float64]
    off: NDArray[np.float64]
    work: NDArray[np.float64]


class DispersionWorkspace(NamedTuple):
    """Workspace of this module's kernels.

    Attributes:
        half, expected: (k, k); the second becomes the covariance of the innovation.
        innovation, value, shift: (k,).
        eigen: of k derivatives.
    """

    half: NDArray[np.float64]
    expected: NDArray[np.float64]
    innovation: NDArray[np.float64]
    value: NDArray[np.float64]
    shift: NDArray[np.float64]
    eigen: EigenWorkspace


def dispersion_workspace(k: int) -> DispersionWorkspace:
    """Workspace for k derivatives."""
    eigen_work = EigenWorkspace(np.empty((k, k)), *(np.empty(k) for _ in range(4)))
    half, expected = np.empty((k, k)), np.empty((k, k))
    return DispersionWorkspace(half, expected, np.empty(k), np.empty(k), np.empty(k), eigen_work)


@lean
def _solved(matrix, vector, work, out):  # type: ignore[no-untyped-def]
    """Pseudo-inverse of a positive semidefinite matrix (n, n) times a vector (n,), in directions that are seen.

    Args:
        work: ``EigenWorkspace``.
        out: becomes the product.

    Returns:
        rank of the matrix, and the vector times the product.
    """
    rows, size, values = work.vectors, work.size, work.values
    n = vector.size
    for a in range(n):
        size[a] = math.sqrt(matrix[a, a]) if matrix[a, a] > 0.0 else 1.0
    for a in range(n):
        out[a] = 0.0
        for b in range(n):
            rows[a, b] = matrix[a, b] / (size[a] * size[b])
    eigen(rows, values, work.off, work.work)
    rank, square = 0, 0.0
    for v in range(n):
        if not values[v] > max(SMALLEST * values[n - 1], 1e-300):
            continue
        rank += 1
        along = 0.0
        for a in range(n):
            along += rows[v, a] * vector[a] / size[a]
        square += along * along / values[v]
        for a in range(n):
            out[a] += rows[v, a] * along / (values[v] * size[a])
    return rank, square


@lean
def dispersion_of(scatter):  # type: ignore[no-untyped-def]
    """Mean of the dispersion, a scalar ratio, given chi-square and degrees of freedom in ``scatter``; at least one,
    because sensors' noise is always there."""
    return max((PRIOR_FREEDOM + scatter[CHI_SQUARE]) / (PRIOR_FREEDOM + scatter[FREEDOM]), 1.0)


@lean
def coherent_dispersion(found, expected, freedom, taken):  # type: ignore[no-untyped-def]
    """Power of the products of residual and motion over that which noise gives them, a scalar ratio, at least one.

    Args:
        found, expected: that power, and what noise is expected to make of it.
        freedom: degrees of freedom of ``expected`` (Satterthwaite 1946); taken: how many of them fits have taken.
    """
    left = max(freedom - taken, 0.0)
    return max((PRIOR_FREEDOM + freedom * found / expected) / (PRIOR_FREEDOM + left), 1.0)


@lean
def gather_scatter(evidence, vector, mean, covariance, keep, scatter, work):  # type: ignore[no-untyped-def]
    """One closed block compared with what was remembered before it: chi-square and degrees of freedom, by equation.

    What a block's score has that the memory does not expect, d = h - J mu, has covariance J + J P J. Of one equation
    after another its part of d' (J + J P J)^-1 d is added; over all blocks they add up to the scatter about the pooled
    estimate (recursive residuals, Brown, Durbin and Evans 1975), and each is independent of those before.

    Args:
        evidence, vector: J (k, k) and h (k,) of the block alone.
        mean, covariance: mu (k,) and P (k, k) of the memory before it.
        keep: what is kept of the blocks before.
        scatter: (equations, 3): chi-square, degrees of freedom, and the dispersion that they gave before this block.
        work: ``DispersionWorkspace``.
    """
    equations = scatter.shape[0]
    for e in range(equations):
        scatter[e, DISPERSION] = dispersion_of(scatter[e])
        scatter[e, CHI_SQUARE] *= keep
        scatter[e, FREEDOM] *= keep
    k = vector.size
    columns = k // equations
    expected, innovation, eigen_work = work.expected, work.innovation, work.eigen
    congruence(evidence, covariance, work.half, expected)
    for a in range(k):
        innovation[a] = vector[a]
        for b in range(k):
            innovation[a] -= evidence[a, b] * mean[b]
            expected[a, b] += evidence[a, b]
    for e in range(equations):
        a, b = e * columns, (e + 1) * columns
        own = EigenWorkspace(
            eigen_work.vectors[:columns, :columns], eigen_work.size[:columns], eigen_work.values[:columns],
            eigen_work.off[:columns], eigen_work.work[:columns],
        )  # fmt: skip
        rank, square = _solved(expected[a:b, a:b], innovation[a:b], own, work.value[:columns])
        if math.isfinite(square):
            scatter[e, CHI_SQUARE] += square
            scatter[e, FREEDOM] += rank


@lean
def disperse(evidence, vector, bias, scatter, work):  # type: ignore[no-untyped-def]
    """A block's evidence with its covariance made larger by the dispersion known before it, in place.

    With S the roots of the equations' dispersions J^-1 becomes S J^-1 S; what the block says of the derivatives, J^+ h,
    and how far it may be biased stay.

    Args:
        evidence, vector, bias: J (k, k), h (k,) and J times the bias (k,).
        scatter: as ``gather_scatter`` leaves it.
        work: ``DispersionWorkspace``.
    """
    k = vector.size
    columns = k // scatter.shape[0]
    largest = 1.0
    for e in range(scatter.shape[0]):
        largest = max(largest, scatter[e, DISPERSION])
    if largest <= 1.0:
        return
    value, shift, eigen_work, half, inner = work.value, work.shift, work.eigen, work.half, work.expected
    _solved(evidence, vector, eigen_work, value)
    _solved(evidence, bias, eigen_work, shift)
    rows, size, values = eigen_work.vectors, eigen_work.size, eigen_work.values
    smallest = max(SMALLEST * values[k - 1], 1e-300)
    for a in range(k):
        for b in range(k):
            half[a, b] = 0.0
            if a // columns == b // columns:
                for v in range(k):
                    if values[v] > smallest:
                        half[a, b] += rows[v, a] * rows[v, b] / values[v]
                half[a, b] *= (scatter[a // columns, DISPERSION] - 1.0) / (size[a] * size[b])
    # J = B' B with the rows of B along what is seen; J' = B' (I + B E B')^-1 B
    for v in range(k):
        root = math.sqrt(values[v]) if values[v] > smallest else 0.0
        for a in range(k):
            rows[v, a] *= root * size[a]
    congruence(rows, half, evidence, inner)
    for v in range(k):
        inner[v, v] += 1.0
    invert(inner, half)
    for a in range(k):
        for b in range(a):
            rows[a, b], rows[b, a] = rows[b, a], rows[a, b]
    congruence(rows, half, inner, evidence)
    for a in range(k):
        vector[a] = bias[a] = 0.0
        for b in range(k):
            vector[a] += evidence[a, b] * value[b]
            bias[a] += evidence[a, b] * shift[b]
