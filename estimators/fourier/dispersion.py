"""How much more the blocks of the recursive Fourier estimator scatter than they say, compiled.

Derivation: ``docs/methods/fourier.md`` section 8. Arrays are those of one vehicle, all room is the caller's.
"""

import math

from wingwatch.estimators.kernels.hot import lean
from wingwatch.estimators.kernels.symmetric import congruence, eigen

__all__ = ["DISPERSION_LINES", "DISPERSION_SQUARES", "disperse", "dispersion_of", "gather_scatter"]

PRIOR_FREEDOM = 3.0
"""Weight of a dispersion of one, in degrees of freedom: that of the widest inverse chi-square, five degrees, that has a
variance; its mean is what counts, and two degrees of five stand for that."""

SMALLEST = 1e-6
"""Share of the largest eigenvalue, unit diagonal, below which a direction counts as not seen by a block."""

DISPERSION_SQUARES, DISPERSION_LINES = 2, 6
"""Room of this module's kernels, matrices (k, k) and vectors (k,)."""


@lean
def _solved(matrix, rows, size, values, off, work, vector, out):  # type: ignore[no-untyped-def]
    """Pseudo-inverse of a positive semidefinite matrix (n, n) times a vector (n,), in directions that are seen.

    Args:
        rows: (n, n), becomes the eigenvectors of the matrix of unit diagonal; size, values, off, work: (n,) each.
        out: becomes the product.

    Returns:
        rank of the matrix, and the vector times the product.
    """
    n = vector.size
    for a in range(n):
        size[a] = math.sqrt(matrix[a, a]) if matrix[a, a] > 0.0 else 1.0
    for a in range(n):
        out[a] = 0.0
        for b in range(n):
            rows[a, b] = matrix[a, b] / (size[a] * size[b])
    eigen(rows, values, off, work)
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
    """Mean of the dispersion given chi-square and degrees of freedom, at least one: sensors' noise is always there."""
    return max((PRIOR_FREEDOM + scatter[0]) / (PRIOR_FREEDOM + scatter[1]), 1.0)


@lean
def gather_scatter(evidence, vector, mean, spread, keep, scatter, squares, lines):  # type: ignore[no-untyped-def]
    """One closed block held against what was remembered before it: chi-square and degrees of freedom, by equation.

    What a block's score has that the memory does not expect, d = h - J mu, has covariance J + J P J. Of one equation
    after another its part of d' (J + J P J)^-1 d is added; over all blocks they add up to the scatter about the pooled
    estimate (recursive residuals, Brown, Durbin and Evans 1975), and each is independent of those before.

    Args:
        evidence, vector: J (k, k) and h (k,) of the block alone.
        mean, spread: mu (k,) and P (k, k) of the memory before it.
        keep: what is kept of the blocks before.
        scatter: (equations, 3): chi-square, degrees of freedom, and the dispersion that they gave before this block.
        squares, lines: room.
    """
    equations = scatter.shape[0]
    for e in range(equations):
        scatter[e, 2] = dispersion_of(scatter[e])
        scatter[e, 0] *= keep
        scatter[e, 1] *= keep
    k = vector.size
    columns = k // equations
    half, expected, surprise = squares[0], squares[1], lines[0]
    congruence(evidence, spread, half, expected)
    for a in range(k):
        surprise[a] = vector[a]
        for b in range(k):
            surprise[a] -= evidence[a, b] * mean[b]
            expected[a, b] += evidence[a, b]
    for e in range(equations):
        a, b = e * columns, (e + 1) * columns
        rank, square = _solved(
            expected[a:b, a:b], half[:columns, :columns], lines[1, :columns], lines[2, :columns],
            lines[3, :columns], lines[4, :columns], surprise[a:b], lines[5, :columns],
        )  # fmt: skip
        if math.isfinite(square):
            scatter[e, 0] += square
            scatter[e, 1] += rank


@lean
def disperse(evidence, vector, bias, scatter, squares, lines):  # type: ignore[no-untyped-def]
    """A block's evidence with its covariance made larger by the dispersion known before it, in place.

    With S the roots of the equations' dispersions J^-1 becomes S J^-1 S; what the block says of the derivatives, J^+ h,
    and how far gusts may bias it stay.

    Args:
        evidence, vector, bias: J (k, k), h (k,) and J times the bias (k,).
        scatter: as ``gather_scatter`` leaves it.
        squares, lines: room.
    """
    k = vector.size
    columns = k // scatter.shape[0]
    largest = 1.0
    for e in range(scatter.shape[0]):
        largest = max(largest, scatter[e, 2])
    if largest <= 1.0:
        return
    value, shift = lines[4], lines[5]
    _solved(evidence, squares[0], lines[0], lines[1], lines[2], lines[3], vector, value)
    _solved(evidence, squares[0], lines[0], lines[1], lines[2], lines[3], bias, shift)
    for a in range(k):
        vector[a] = bias[a] = 0.0
        for b in range(k):
            evidence[a, b] /= math.sqrt(scatter[a // columns, 2] * scatter[b // columns, 2])
            vector[a] += evidence[a, b] * value[b]
            bias[a] += evidence[a, b] * shift[b]
