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
from wingwatch.estimators.kernels.symmetric import backward, cholesky, forward
from wingwatch.kernels.decorators import lean

__all__ = [
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

RIDGE = 1e-10
"""Added to the nuisance columns' power, each of unit power, before they are eliminated."""

NOTHING = 1e-20
"""Power of a trim column, relative to that of a ramp of one a second, below which it is rounding."""

RUN = 4
"""Columns that are taken at once: what they are multiplied by is read once for all of them."""

TURN_STD, LAG_STD = 1.0, 0.7
"""Standard deviations of what a gust's gradient does over what the span says, and of the logarithm of its time
constant: the span filter is that of a wing in a gust that varies along it, and a gust meets wing and tail apart."""


class NormalWorkspace(NamedTuple):
    """Normal equations of one block: p columns of derivatives, then q = NUISANCE columns of every row.

    Attributes:
        matrix, vector: (p + q, p + q), (p + q,) sum Re(R' W R) with the nuisance columns' prior, sum Re(R' W y).
        variances: (rows, NUISANCE) what is known beforehand of the nuisance columns; 0 where a row has no such column.
        number, places: (1,), (q,) how many nuisance columns there are, and which; what follows is of these, the first
            ones of each array.
        size: (q,) roots of their power.
        root, inverse: (q, q) Cholesky root of their power, each of unit power, and the inverse of that power; half:
            workspace.
        crossed, rest: (q, p), (q, 1) root^-1 of their products with the derivatives' columns, and with the left side.
        solved: (q, 1) what they come out as, in units of their size.
        values: (rows, NUISANCE) what all come out as, 0 where there is no such column.
        held: (rows,) how many columns each row has, wanted and nuisance ones.
        channels, columns: (rows, RUN more than there may be) channel of each of these among the regressors, and its
            place among all columns; the last one is repeated up to a whole ``RUN``.
        dots: (RUN,) workspace.
    """

    matrix: NDArray[np.float64]
    vector: NDArray[np.float64]
    variances: NDArray[np.float64]
    number: NDArray[np.int64]
    places: NDArray[np.int64]
    size: NDArray[np.float64]
    root: NDArray[np.float64]
    inverse: NDArray[np.float64]
    half: NDArray[np.float64]
    crossed: NDArray[np.float64]
    rest: NDArray[np.float64]
    solved: NDArray[np.float64]
    values: NDArray[np.float64]
    held: NDArray[np.int64]
    channels: NDArray[np.int64]
    columns: NDArray[np.int64]
    dots: NDArray[np.float64]


def normal_workspace(derivatives: int, rows: int) -> NormalWorkspace:
    """Memory for one structure."""
    p, q = derivatives, NUISANCE * rows
    most = (rows, derivatives + NUISANCE + RUN)
    return NormalWorkspace(
        np.empty((p + q, p + q)), np.empty(p + q), np.empty((rows, NUISANCE)),
        np.empty(1, dtype=np.int64), np.empty(q, dtype=np.int64), np.empty(q),
        np.empty((q, q)), np.empty((q, q)), np.empty((q, q)),
        np.empty((q, p)), np.empty((q, 1)), np.empty((q, 1)), np.empty((rows, NUISANCE)),
        np.zeros(rows, dtype=np.int64), np.zeros(most, dtype=np.int64), np.zeros(most, dtype=np.int64), np.zeros(RUN),
    )  # fmt: skip


def of_the_same_nuisance(normal: NormalWorkspace) -> NormalWorkspace:
    """Memory for the same block with other columns of derivatives; what is of nuisance columns alone is shared."""
    own = ("matrix", "vector", "crossed", "rest", "solved", "values")
    return normal._replace(**{name: np.empty_like(getattr(normal, name)) for name in own})


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
    """Prior information of a nuisance column, a scalar in sums over bins, one over the unit of ``variance``.

    ``fraction``: length over that of a whole block.
    """
    return 0.5 / (fraction * variance)


@lean
def factorise(normal, derivatives, span):  # type: ignore[no-untyped-def]
    """Which nuisance columns there are, root and inverse of their power, for ``eliminate``.

    Over a whole number of periods a constant has no transform: what rounding leaves of it is no column.

    Args:
        normal: with variances and matrix; its number, places, size, root and inverse are made.
        derivatives: how many columns before the nuisance ones.
        span: length of the block, s.
    """
    p = derivatives
    matrix, variances, places, size, root = (
        normal.matrix,
        normal.variances,
        normal.places,
        normal.size,
        normal.root,
    )
    n = 0
    for k in range(variances.shape[0]):
        first = p + NUISANCE * k
        ramp = matrix[first + RAMP, first + RAMP] / (span * span)
        for column in range(NUISANCE):
            own = matrix[first + column, first + column]
            if variances[k, column] > 0.0 and (column > PRESSURE or own > NOTHING * ramp):
                places[n], size[n] = NUISANCE * k + column, np.sqrt(own)
                n += 1
    normal.number[0] = n
    for a in range(n):
        for b in range(a + 1):
            root[a, b] = matrix[p + places[a], p + places[b]] / size[a] / size[b]
        root[a, a] += RIDGE
    cholesky(root[:n], 1e-3 * RIDGE, root[:n])
    _inverse_of_root(root[:n], normal.half[:n], normal.inverse[:n])


@lean
def eliminate(normal, theta, scale, m, score):  # type: ignore[no-untyped-def]
    """Schur complement on the nuisance columns.

    Args:
        normal: with matrix and vector, after ``factorise``; crossed and rest are made.
        theta, scale: referred derivatives that the block is linearised at, and what makes them present ones, (p,).
        m (p, p), score (p,): become M and b - M theta, in referred derivatives.
    """
    p, n = theta.size, normal.number[0]
    matrix, crossed, rest = normal.matrix, normal.crossed[:n], normal.rest[:n]
    for a in range(n):
        unit, place = 1.0 / normal.size[a], p + normal.places[a]
        total = normal.vector[place]
        for b in range(p):
            total -= matrix[place, b] * theta[b] * scale[b]
            crossed[a, b] = matrix[place, b] * unit
        rest[a, 0] = total * unit
    forward(normal.root, crossed)
    forward(normal.root, rest)
    for a in range(p):
        total = normal.vector[a]
        for b in range(p):
            total -= matrix[a, b] * theta[b] * scale[b]
        for b in range(a + 1):
            m[a, b] = matrix[a, b]
        for b in range(n):
            total -= crossed[b, a] * rest[b, 0]
            factor = crossed[b, a]
            for c in range(a + 1):
                m[a, c] -= factor * crossed[b, c]
        score[a] = total * scale[a]
        for b in range(a + 1):
            m[a, b] *= scale[a] * scale[b]
            m[b, a] = m[a, b]


@lean
def nuisance_of(normal, change, scale):  # type: ignore[no-untyped-def]
    """Values that belong to derivatives that differ by ``change`` (p,) from those of ``eliminate``."""
    n, solved, values = normal.number[0], normal.solved, normal.values
    for a in range(n):
        total = normal.rest[a, 0]
        for b in range(change.size):
            total -= normal.crossed[a, b] * scale[b] * change[b]
        solved[a, 0] = total
    backward(normal.root, solved[:n])
    values[:, :] = 0.0
    for a in range(n):
        place = normal.places[a]
        values[place // NUISANCE, place % NUISANCE] = solved[a, 0] / normal.size[a]


@lean
def _inverse_of_root(root, half, out):  # type: ignore[no-untyped-def]
    """(L L')^-1 of a lower triangular ``root`` L into ``out``, L^-1 into the lower triangle of ``half``; all (n, n or
    more)."""
    n = root.shape[0]
    for a in range(n):
        own = 1.0 / root[a, a]
        for b in range(n):
            half[a, b] = out[a, b] = 0.0
        for c in range(a):
            factor = -root[a, c] * own
            for b in range(c + 1):
                half[a, b] += factor * half[c, b]
        half[a, a] = own
    for c in range(n):
        for a in range(c + 1):
            factor = half[c, a]
            for b in range(a + 1):
                out[a, b] += factor * half[c, b]
    for a in range(n):
        for b in range(a):
            out[b, a] = out[a, b]


@lean
def degrees_of_freedom(normal, fraction):  # type: ignore[no-untyped-def]
    """Number of real numbers that the nuisance columns fit, the scalar tr(data (data + prior)^-1).

    ``fraction``: length over that of a whole block.
    """
    taken = 0.0
    for a in range(normal.number[0]):
        size, place = normal.size[a], normal.places[a]
        prior = (
            prior_of(normal.variances[place // NUISANCE, place % NUISANCE], fraction) / (size * size) + RIDGE
        )
        taken += max(0.0, 1.0 - prior * normal.inverse[a, a])
    return taken


@lean
def fitted_columns(bank, first, normal, work):  # type: ignore[no-untyped-def]
    """Into ``work.fitted`` P = C (C' W C + prior)^-1 C', C the nuisance columns of one bin, (docs (19)).

    Args:
        bank: regressors, (columns, 2, bins); first: place of the first nuisance column in it.
        normal: of ``eliminate``.
        work: ``NoiseWorkspace``.
    """
    fitted, count, places, size = work.fitted, normal.number[0], normal.places, normal.size
    common = work.common
    rows, bins = fitted.shape[0], fitted.shape[3]
    fitted[:, :, :, :] = 0.0
    for a in range(count):
        k, column = places[a] // NUISANCE, first + places[a] % NUISANCE
        x, y, scale = bank[column, 0], bank[column, 1], 1.0 / size[a]
        b = 0
        for m in range(k + 1):
            end = b
            while end < count and places[end] // NUISANCE == m:
                end += 1
            _combined(bank, first, normal, (a, b, end, scale), common)
            b = end
            real, imaginary = common[0], common[1]
            to_real, to_imaginary = fitted[k, m, 0], fitted[k, m, 1]
            for f in range(bins):
                to_real[f] += x[f] * real[f] + y[f] * imaginary[f]
                to_imaginary[f] += y[f] * real[f] - x[f] * imaginary[f]
    for k in range(rows):
        for m in range(k):
            for f in range(bins):
                fitted[m, k, 0, f], fitted[m, k, 1, f] = fitted[k, m, 0, f], -fitted[k, m, 1, f]


@lean
def _combined(bank, first, normal, which, out):  # type: ignore[no-untyped-def]
    """Nuisance columns b to ``end`` of a row, each times what the inverse has of it and column a: (2, bins).

    ``which``: a, b, end, and one over the size of a.
    """
    a, begin, end, scale = which
    places, size, inverse = normal.places, normal.size, normal.inverse
    for part in range(2):
        for f in range(out.shape[1]):
            out[part, f] = 0.0
    for b in range(begin, end, RUN):
        p, q, r = min(b + 1, end - 1), min(b + 2, end - 1), min(b + 3, end - 1)
        by_b = scale * inverse[a, b] / size[b]
        by_p = scale * inverse[a, p] / size[p] if b + 1 < end else 0.0
        by_q = scale * inverse[a, q] / size[q] if b + 2 < end else 0.0
        by_r = scale * inverse[a, r] / size[r] if b + 3 < end else 0.0
        for part in range(2):
            to = out[part]
            u, v = bank[first + places[b] % NUISANCE, part], bank[first + places[p] % NUISANCE, part]
            w, x = bank[first + places[q] % NUISANCE, part], bank[first + places[r] % NUISANCE, part]
            for f in range(to.size):
                to[f] += (by_b * u[f] + by_p * v[f]) + (by_q * w[f] + by_r * x[f])


@lean
def reduce_weights(weights, work):  # type: ignore[no-untyped-def]
    """W - W P W / 2 in place: what fitting the nuisance columns leaves of the weights, (docs (19)).

    The columns' values are real, and a bin has two real parts. W, P and what is left are Hermitian.

    Args:
        weights: (rows, rows, 2, bins), in place.
        work: ``NoiseWorkspace``, after ``fitted_columns``.
    """
    rows, half, taken = weights.shape[0], work.half, work.taken
    for k in range(rows):
        for m in range(rows):
            _row_times_column(weights[k], work.fitted, m, half[k, m])
    for k in range(rows):
        for m in range(k, rows):
            _row_times_column(half[k], weights, m, taken[k, m])
    for k in range(rows):
        for m in range(k, rows):
            a, b, x, y = weights[k, m, 0], weights[k, m, 1], taken[k, m, 0], taken[k, m, 1]
            for f in range(a.size):
                a[f] -= 0.5 * x[f]
                b[f] -= 0.5 * y[f]
            if m > k:
                for f in range(a.size):
                    weights[m, k, 0, f], weights[m, k, 1, f] = a[f], -b[f]


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
def _row_times_column(row, matrix, m, out):  # type: ignore[no-untyped-def]
    """A row (rows, 2, bins) of a complex matrix times column m of another, bin by bin, two products at a time."""
    real, imaginary = out[0], out[1]
    rows = row.shape[0]
    for f in range(real.size):
        real[f] = imaginary[f] = 0.0
    for j in range(0, rows, 2):
        other, more = min(j + 1, rows - 1), 1.0 if j + 1 < rows else 0.0
        a, b, x, y = row[j, 0], row[j, 1], matrix[j, m, 0], matrix[j, m, 1]
        c, d, u, v = row[other, 0], row[other, 1], matrix[other, m, 0], matrix[other, m, 1]
        for f in range(real.size):
            first, second = a[f] * x[f] - b[f] * y[f], a[f] * y[f] + b[f] * x[f]
            real[f] += first + more * (c[f] * u[f] - d[f] * v[f])
            imaginary[f] += second + more * (c[f] * v[f] + d[f] * u[f])
