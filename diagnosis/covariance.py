"""Covariances of the filter of equation (1), from sample to sample: gains, deviations of the innovations, compiled.

Of equation (1) little is not 0, and a kernel is handed that (``Sparse``). Covariances stand in rows of ``ROW`` numbers,
the last two of them 0.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.linear_model import WIDTH
from wingwatch.kernels.decorators import compiled, helper
from wingwatch.kernels.rows import ROW, add_row, add_rows

__all__ = [
    "Covariances",
    "Sparse",
    "advance_covariances",
    "in_rows",
    "predict_covariances",
    "settle",
    "sparse",
]

Array = NDArray[np.float64]

_HOLDS = 1e-4
"""Relative change of gains below which they hold."""


class Sparse(NamedTuple):
    """Entries of matrices that are not 0 in all of them, row by row.

    Attributes:
        starts: where a row's entries begin, and the end of the last, (rows + 1,).
        columns: of each entry, (entries,); values: of each matrix, (matrices, entries).
    """

    starts: NDArray[np.int64]
    columns: NDArray[np.int64]
    values: Array


def sparse(matrices: Array) -> Sparse:
    """Of (matrices, rows, columns)."""
    there = matrices.any(axis=0) | np.isnan(matrices).any(axis=0)
    rows, columns = np.nonzero(there)
    starts = np.concatenate([[0], np.cumsum(there.sum(axis=1))])
    return Sparse(starts, np.ascontiguousarray(columns), np.ascontiguousarray(matrices[:, rows, columns]))


def in_rows(matrices: Array) -> Array:
    """Matrices (..., rows, columns) with rows of ``ROW`` numbers."""
    out = np.zeros((*matrices.shape[:-1], ROW))
    out[..., : matrices.shape[-1]] = matrices
    return out


class Covariances(NamedTuple):
    """Of the filters of several versions of equation (1), and where they are advanced.

    Attributes:
        transition, output: equation (1) of each.
        process: of the processes' noise, (versions, 22, ROW); variance: of the outputs', (versions, used).
        states: (versions, 22, ROW).
        half, turned: (22, ROW); new: (1, ROW).
    """

    transition: Sparse
    output: Sparse
    process: Array
    variance: Array
    states: Array
    half: Array
    turned: Array
    new: Array


@helper
def advance_covariances(them, version, seen, gain, deviation):  # type: ignore[no-untyped-def]
    """Correct the states' covariance of one version by a sample's outputs one after another, predict the next sample's.

    Args:
        them: ``Covariances``.
        version: which.
        seen: which readings are there, (used,).
        gain: of this sample, (used, 22), left as it is where none is; deviation: of the innovations, (used,); before:
            what they were.

    Returns the largest relative change of deviations and of gains by what they change in the output.
    """
    p, new, change = them.states[version], them.new, 0.0
    starts, columns, weights = them.output.starts, them.output.columns, them.output.values[version]
    for k in range(seen.size):
        if not seen[k]:
            continue
        new[:] = 0.0
        add_rows(new, 0, weights, columns, starts[k], starts[k + 1], p)
        s = them.variance[version, k]
        for n in range(starts[k], starts[k + 1]):
            s += weights[n] * new[0, columns[n]]
        now, inverse = math.sqrt(s), 1.0 / s
        change = max(change, abs(now / deviation[k] - 1.0))
        deviation[k] = now
        for n in range(starts[k], starts[k + 1]):
            moved = new[0, columns[n]] * inverse
            change = max(change, abs((moved - gain[k, columns[n]]) * weights[n]))
        for i in range(WIDTH):
            gain[k, i] = new[0, i] * inverse
        for i in range(WIDTH):
            add_row(p, i, -gain[k, i], new, 0)
    return change


@helper
def predict_covariances(them, version):  # type: ignore[no-untyped-def]
    """F P F' and the processes' noise, in place; P is symmetric."""
    p, half, turned = them.states[version], them.half, them.turned
    starts, columns, weights = (
        them.transition.starts,
        them.transition.columns,
        them.transition.values[version],
    )
    half[:] = 0.0
    for i in range(WIDTH):
        add_rows(half, i, weights, columns, starts[i], starts[i + 1], p)
    for i in range(WIDTH):
        for j in range(WIDTH):
            turned[i, j] = half[j, i]
    p[:] = them.process[version]
    for i in range(WIDTH):
        add_rows(p, i, weights, columns, starts[i], starts[i + 1], turned)


@compiled(error_model="numpy", nogil=True)
def settle(them, seen, gain, deviation, holds_from):  # type: ignore[no-untyped-def]
    """Gains (samples, used, 22) and deviations (samples, used) of one version until they hold; how many samples these
    are."""
    samples, outputs = deviation.shape
    now, spread = np.zeros((outputs, WIDTH)), np.ones(outputs)
    for t in range(samples):
        change = advance_covariances(them, 0, seen[t], now, spread)
        for k in range(outputs):
            if seen[t, k]:
                gain[t, k], deviation[t, k] = now[k], spread[k]
        if change < _HOLDS and t > holds_from:
            return t + 1
        predict_covariances(them, 0)
    return samples
