"""The nuisance columns of a Fourier block: eliminated, and what they take from its bins; compiled.

Every row of a block has columns of its own whose values nobody wants (``bank.NUISANCE``). Known beforehand is
how large they may be. Once they are fitted, less than the whole residual is left, and less of it goes with the
regressors than the noise model says of a bin. Derivation and equation numbers: ``docs/methods/fourier.md`` section 4.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.fourier.bank import (
    CONSTANT,
    FIRST_READING,
    FIRST_TURN,
    LAST_READING,
    LAST_TURN,
    NUISANCE,
    PRESSURE,
    RAMP,
    TURN_LAG,
    TURN_SIZE,
    VANE_LEAD,
)
from wingwatch.estimators.fourier.state import GUST
from wingwatch.estimators.kernels.hot import lean
from wingwatch.estimators.kernels.symmetric import backward, cholesky, forward

__all__ = [
    "NO_COLUMN",
    "NormalWorkspace",
    "bins_left",
    "degrees_of_freedom",
    "eliminate",
    "factorise",
    "fitted_columns",
    "normal_workspace",
    "nuisance_of",
    "nuisance_variances",
    "of_the_same_nuisance",
    "prior_of",
    "reduce_weights",
]

NO_COLUMN = 1e20
"""What is known beforehand of a column that an equation does not have: it is zero."""

RIDGE = 1e-10
"""Added to the nuisance columns' power, each of unit power, before they are eliminated."""

NOTHING = 1e-20
"""Power of a trim column, relative to that of a ramp of one a second, below which it is rounding."""

TURN_STD, LAG_STD = 1.0, 0.7
"""Standard deviations of what a gust's gradient does over what the span says, and of the logarithm of its time
constant: the span filter is that of a wing in a gust that varies along it, and a gust meets wing and tail apart."""


class NormalWorkspace(NamedTuple):
    """Normal equations of one block: p columns of derivatives, then q = NUISANCE columns of every row.

    Attributes:
        matrix, vector: (p + q, p + q), (p + q,) sum Re(R' W R) with the nuisance columns' prior, sum Re(R' W y).
        variances: (rows, NUISANCE) what is known beforehand of the nuisance columns.
        size: (q,) roots of the nuisance columns' power; infinite where a column is none.
        root, inverse: (q, q) Cholesky root of their power, each of unit power, and the inverse of that power.
        crossed, rest: (q, p), (q, 1) root^-1 of their products with the derivatives' columns, and with the left side.
        values: (q, 1) what they come out as.
    """

    matrix: NDArray[np.float64]
    vector: NDArray[np.float64]
    variances: NDArray[np.float64]
    size: NDArray[np.float64]
    root: NDArray[np.float64]
    inverse: NDArray[np.float64]
    crossed: NDArray[np.float64]
    rest: NDArray[np.float64]
    values: NDArray[np.float64]


def normal_workspace(derivatives: int, rows: int) -> NormalWorkspace:
    """Memory for one structure."""
    p, q = derivatives, NUISANCE * rows
    shapes = ((p + q, p + q), p + q, (rows, NUISANCE), q, (q, q), (q, q), (q, p), (q, 1), (q, 1))
    return NormalWorkspace(*(np.empty(shape) for shape in shapes))


def of_the_same_nuisance(normal: NormalWorkspace) -> NormalWorkspace:
    """Memory for the same block with other columns of derivatives; what is of nuisance columns alone is shared."""
    own = (normal.matrix, normal.vector, normal.crossed, normal.rest, normal.values)
    matrix, vector, crossed, rest, values = (np.empty_like(array) for array in own)
    return normal._replace(matrix=matrix, vector=vector, crossed=crossed, rest=rest, values=values)


@lean
def nuisance_variances(plant, air, noise, dt, variances):  # type: ignore[no-untyped-def]
    """What is known beforehand of the nuisance columns of every row, (docs (6), (8)).

    Errors of reading a state at the ends of a block come with its rate. The gust-induced pitch (yaw) rate, q_g = a G
    d, has over a block the transform a G D + a G tau (q_g(0) e^{sT} - q_g(T)); q_g is white noise d, held over dt,
    behind a lag. How much the gust turns the air is known to TURN_STD, the time constant of that to LAG_STD, both
    relative, and when the vane meets the gust to a sample.

    Args:
        variances: (rows, NUISANCE), filled; infinite where nothing is known, 0 where a row has no such column.
    """
    ns = plant.lever.size
    turn_variance = air.turn * air.turn * noise[GUST] * dt * air.turn_s / 2.0
    rows = variances.shape[0]
    for k in range(rows):
        row = variances[k]
        row[:] = 0.0
        row[CONSTANT] = row[RAMP] = math.inf
        row[PRESSURE] = math.inf if k < ns else 0.0
        has_rate = k > 0 or not plant.by_accelerometer
        row[LAST_READING] = row[FIRST_READING] = noise[k if k < ns else 0] if has_rate else 0.0
        if k < ns < rows:
            turned = plant.derivatives[k, ns - 1] ** 2
            row[LAST_TURN] = row[FIRST_TURN] = turned * turn_variance
            row[TURN_SIZE] = turned * (air.turn * TURN_STD) ** 2
            row[TURN_LAG] = turned * (air.turn * LAG_STD) ** 2
            row[VANE_LEAD] = (plant.derivatives[k, 0] * dt) ** 2


@lean
def prior_of(variance, fraction):  # type: ignore[no-untyped-def]
    """What is known beforehand of a nuisance column, in sums over bins; ``fraction`` is of a whole block."""
    return 0.5 / (fraction * variance) if variance > 0.0 else NO_COLUMN


@lean
def factorise(normal, derivatives, span):  # type: ignore[no-untyped-def]
    """Root and inverse of the nuisance columns' power, for ``eliminate``.

    Over a whole number of periods a constant has no transform: what rounding leaves of it is no column.

    Args:
        normal: with a matrix; its size, root and inverse are made.
        derivatives: how many columns before the nuisance ones.
        span: length of the block, s.
    """
    p, q = derivatives, normal.size.size
    matrix, size, root = normal.matrix, normal.size, normal.root
    for a in range(q):
        column = a % NUISANCE
        ramp = matrix[p + a - column + RAMP, p + a - column + RAMP] / (span * span)
        own = matrix[p + a, p + a]
        size[a] = np.sqrt(own) if column > PRESSURE or own > NOTHING * ramp else np.inf
    for a in range(q):
        for b in range(a + 1):
            root[a, b] = matrix[p + a, p + b] / size[a] / size[b]
        root[a, a] += RIDGE
    cholesky(root, 1e-3 * RIDGE, root)
    _inverse_of_root(root, normal.inverse)


@lean
def eliminate(normal, theta, scale, m, score):  # type: ignore[no-untyped-def]
    """Schur complement on the nuisance columns.

    Args:
        normal: with matrix and vector, after ``factorise``; crossed and rest are made.
        theta, scale: referred derivatives that the block is linearised at, and what makes them present ones, (p,).
        m (p, p), score (p,): become M and b - M theta, in referred derivatives.
    """
    p, q = theta.size, normal.size.size
    matrix, crossed, rest = normal.matrix, normal.crossed, normal.rest
    for a in range(q):
        unit = 1.0 / normal.size[a]
        total = normal.vector[p + a]
        for b in range(p):
            total -= matrix[p + a, b] * theta[b] * scale[b]
            crossed[a, b] = matrix[p + a, b] * unit
        rest[a, 0] = total * unit
    forward(normal.root, crossed)
    forward(normal.root, rest)
    for a in range(p):
        total = normal.vector[a]
        for b in range(p):
            total -= matrix[a, b] * theta[b] * scale[b]
            m[a, b] = matrix[a, b]
        for b in range(q):
            total -= crossed[b, a] * rest[b, 0]
            factor = crossed[b, a]
            for c in range(p):
                m[a, c] -= factor * crossed[b, c]
        score[a] = total * scale[a]
        for b in range(p):
            m[a, b] *= scale[a] * scale[b]


@lean
def nuisance_of(normal, change, scale):  # type: ignore[no-untyped-def]
    """Values that belong to derivatives that differ by ``change`` (p,) from those of ``eliminate``."""
    size, values = normal.size, normal.values
    for a in range(size.size):
        total = normal.rest[a, 0]
        for b in range(change.size):
            total -= normal.crossed[a, b] * scale[b] * change[b]
        values[a, 0] = total
    backward(normal.root, values)
    for a in range(size.size):
        values[a, 0] /= size[a]


@lean
def _inverse_of_root(root, out):  # type: ignore[no-untyped-def]
    """(L L')^-1 of a lower triangular ``root`` L (n, n) into ``out``."""
    n = root.shape[0]
    for a in range(n):
        for b in range(a):
            out[a, b] = 0.0
        out[a, a] = 1.0 / root[a, a]
        for b in range(a + 1, n):
            total = 0.0
            for c in range(a, b):
                total -= root[b, c] * out[a, c]
            out[a, b] = total / root[b, b]
    # Rows of ``out`` are columns of L^-1; the product needs from each pair only what lies behind both.
    for a in range(n):
        for b in range(a, n):
            total = 0.0
            for c in range(b, n):
                total += out[a, c] * out[b, c]
            out[a, b] = total
    for a in range(n):
        for b in range(a):
            out[a, b] = out[b, a]


@lean
def degrees_of_freedom(normal, fraction):  # type: ignore[no-untyped-def]
    """How many real numbers the nuisance columns fit, tr(data (data + prior)^-1); ``fraction`` is of a whole block."""
    taken = 0.0
    for a in range(normal.size.size):
        size = normal.size[a]
        if math.isinf(size):
            continue
        prior = prior_of(normal.variances[a // NUISANCE, a % NUISANCE], fraction) / (size * size) + RIDGE
        taken += max(0.0, 1.0 - prior * normal.inverse[a, a])
    return taken


@lean
def fitted_columns(bank, first, normal, work):  # type: ignore[no-untyped-def]
    """Into ``work.fitted`` P = C (C' W C + prior)^-1 C', C the nuisance columns of one bin, (docs (19)).

    Args:
        bank: regressors; first: place of the first nuisance column in it.
        normal: of ``eliminate``.
        work: ``NoiseWorkspace``.
    """
    fitted = work.fitted
    rows, bins = fitted.shape[0], fitted.shape[3]
    fitted[:, :, :, :] = 0.0
    for c in range(NUISANCE):
        x, y = bank[first + c, 0], bank[first + c, 1]
        for d in range(NUISANCE):
            u, v = bank[first + d, 0], bank[first + d, 1]
            for f in range(bins):
                work.spread[f] = x[f] * u[f] + y[f] * v[f]
                work.weighted[0, 0, f] = y[f] * u[f] - x[f] * v[f]
            for k in range(rows):
                a = NUISANCE * k + c
                for m in range(rows):
                    b = NUISANCE * m + d
                    factor = normal.inverse[a, b] / (normal.size[a] * normal.size[b])
                    if factor == 0.0:
                        continue
                    real, imaginary = fitted[k, m, 0], fitted[k, m, 1]
                    for f in range(bins):
                        real[f] += factor * work.spread[f]
                        imaginary[f] += factor * work.weighted[0, 0, f]


@lean
def reduce_weights(weights, work):  # type: ignore[no-untyped-def]
    """W - W P W / 2 in place: what fitting the nuisance columns leaves of the weights, (docs (19)).

    The columns' values are real, and a bin has two real parts.

    Args:
        weights: (rows, rows, 2, bins), in place.
        work: ``NoiseWorkspace``, after ``fitted_columns``.
    """
    _multiply(weights, work.fitted, work.half)
    _multiply(work.half, weights, work.taken)
    for k in range(weights.shape[0]):
        for m in range(weights.shape[0]):
            for part in range(2):
                for f in range(weights.shape[3]):
                    weights[k, m, part, f] -= 0.5 * work.taken[k, m, part, f]


@lean
def bins_left(work):  # type: ignore[no-untyped-def]
    """How many equally weighted bins are worth as many degrees of freedom as the weights leave (of the equation that
    they leave fewest, Satterthwaite 1946); ``work.sums`` are made."""
    weights = work.weights
    bins, fewest = weights.shape[3], math.inf
    for k in range(work.sums.shape[0]):
        for m in range(work.sums.shape[0]):
            total = 0.0
            for f in range(bins):
                total += weights[k, m, 0, f]
            work.sums[k, m] = total
        squares = 0.0
        for f in range(bins):
            squares += weights[k, k, 0, f] ** 2
        fewest = min(fewest, work.sums[k, k] ** 2 / squares)
    return fewest


@lean
def _multiply(left, right, out):  # type: ignore[no-untyped-def]
    """Products of complex matrices, bin by bin, (rows, rows, 2, bins)."""
    rows, bins = left.shape[0], left.shape[3]
    for k in range(rows):
        for m in range(rows):
            real, imaginary = out[k, m, 0], out[k, m, 1]
            for f in range(bins):
                real[f] = imaginary[f] = 0.0
            for j in range(rows):
                a, b, x, y = left[k, j, 0], left[k, j, 1], right[j, m, 0], right[j, m, 1]
                for f in range(bins):
                    real[f] += a[f] * x[f] - b[f] * y[f]
                    imaginary[f] += a[f] * y[f] + b[f] * x[f]
