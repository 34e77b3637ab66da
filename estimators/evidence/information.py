"""Evidence as a quadratic log-likelihood, h' theta - theta' J theta / 2; compiled.

Of an estimate with mean mu and covariance P it is J = P^-1 and h = J mu. Evidence of independent data adds up.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.kernels.symmetric import invert
from wingwatch.kernels.decorators import helper

__all__ = ["Belief", "Information", "believe", "inverse_into", "times"]

Array = NDArray[np.float64]


class Information(NamedTuple):
    """On the derivatives: matrix J (k, k) and vector h (k,)."""

    matrix: Array
    vector: Array


class Belief(NamedTuple):
    """About the derivatives: mean (k,) and covariance (k, k)."""

    value: Array
    covariance: Array


@helper
def inverse_into(matrix, work, out):  # type: ignore[no-untyped-def]
    """Inverse of a symmetric matrix into ``out``, all (n, n); returns whether it is positive definite and finite."""
    n = matrix.shape[0]
    for a in range(n):
        for b in range(n):
            work[a, b] = matrix[a, b]
    invert(work, out)
    sound = True
    for a in range(n):
        sound = sound and 0.0 < work[a, a] < np.inf
    return sound


@helper
def times(matrix, vector, out):  # type: ignore[no-untyped-def]
    """out = matrix vector, (n, m) (m,)."""
    for a in range(out.size):
        out[a] = 0.0
        for b in range(vector.size):
            out[a] += matrix[a, b] * vector[b]


@helper
def believe(matrix, vector, work, covariance, mean):  # type: ignore[no-untyped-def]
    """Covariance and mean that J and h stand for, into ``covariance`` and ``mean``; ``work`` (k, k) is workspace.

    Returns:
        whether J is positive definite and finite.
    """
    sound = inverse_into(matrix, work, covariance)
    times(covariance, vector, mean)
    return sound
