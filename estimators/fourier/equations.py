"""Normal equations of one block of the recursive Fourier estimator, compiled.

Derivation and symbols: ``docs/methods/fourier.md``. Rows are the force equation, the moment equations and, where there
is one, the kinematic row, which has no derivative. Real and imaginary parts lie apart and bins side by side,
(..., 2, bins), so that the processor takes several bins at once. All memory is the caller's.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.fourier.bank import NUISANCE
from wingwatch.estimators.fourier.between import rate_of
from wingwatch.estimators.fourier.checkpoints import copy_matrix
from wingwatch.estimators.fourier.nuisance import RUN, prior_of
from wingwatch.estimators.fourier.state import LAST, START
from wingwatch.kernels.decorators import lean

__all__ = ["EquationSides", "normal_equations", "residual_of", "responses", "with_other_regressors"]


class EquationSides(NamedTuple):
    """Both sides of the equations of one block.

    Attributes:
        regressors: (channels, 2, bins).
        response: (rows, 2, bins).
        product: (2, bins) workspace.
    """

    regressors: NDArray[np.float64]
    response: NDArray[np.float64]
    product: NDArray[np.float64]


@lean
def responses(omega, rows, plant, transforms):  # type: ignore[no-untyped-def]
    """What each row has on its left side, (rows, 2, bins): exact transforms of rates, or the accelerometer.

    Args:
        rows: of ``Block``.
        plant: of ``noise``.
        transforms: ``Transforms``: regressors of ``between_samples``, the kinematic term and the known moments last;
            the response is made.
    """
    bank, phase, response = transforms.regressors, transforms.phase, transforms.response
    start, end = rows[START], rows[LAST]
    ns, lever = plant.lever.size, plant.lever
    term = bank.shape[0] - ns
    for k in range(ns):
        rate_of(omega, bank[k], phase, start[1 + k], end[1 + k], response[k])
    for part in range(2):
        force, kinematic, first = bank[ns, part], bank[term, part], response[0, part]
        if not plant.by_accelerometer:
            for f in range(omega.size):
                first[f] -= kinematic[f]
        else:
            kept = response.shape[0] > ns
            for f in range(omega.size):
                at_cg = force[f]
                for j in range(1, ns):
                    at_cg += lever[j] * response[j, part, f]
                if kept:
                    response[ns, part, f] = first[f] - at_cg - kinematic[f]
                first[f] = at_cg
        for j in range(1, ns):
            known, rate = bank[term + j, part], response[j, part]
            for f in range(omega.size):
                rate[f] -= known[f]


@lean
def _note_columns(ns, nd, normal):  # type: ignore[no-untyped-def]
    """Which columns each row has: derivatives are in the equations, of nuisance columns there are those that may be
    more than nothing."""
    variances = normal.variances
    for k in range(variances.shape[0]):
        n = 0
        for c in range(nd if k < ns else 0):
            normal.channels[k, n], normal.columns[k, n] = c if c < ns else c + 1, k * nd + c
            n += 1
        for c in range(NUISANCE):
            if variances[k, c] > 0.0:
                normal.channels[k, n], normal.columns[k, n] = nd + 1 + c, ns * nd + NUISANCE * k + c
                n += 1
        normal.held[k] = n
        for c in range(n, n + RUN):
            normal.channels[k, c], normal.columns[k, c] = normal.channels[k, n - 1], normal.columns[k, n - 1]


@lean
def _dots(bank, product, channels, c, dots):  # type: ignore[no-untyped-def]
    """Sums over bins of Re(x' P) of ``RUN`` columns x, those of ``channels`` from c on, and one product (2, bins)."""
    i, j, k, m = channels[c], channels[c + 1], channels[c + 2], channels[c + 3]
    first = second = third = fourth = 0.0
    for part in range(2):
        values, x, y, z, w = product[part], bank[i, part], bank[j, part], bank[k, part], bank[m, part]
        for f in range(values.size):
            value = values[f]
            first += x[f] * value
            second += y[f] * value
            third += z[f] * value
            fourth += w[f] * value
    dots[0], dots[1], dots[2], dots[3] = first, second, third, fourth


@lean
def _products(bank, weights, ns, nd, wanted, product, normal):  # type: ignore[no-untyped-def]
    """M = sum Re(R' W R) of all columns; of ``wanted`` ones alone, their products with all that there are.

    M is symmetric, and of each pair of columns one order is computed.
    """
    rows, matrix, dots = weights.shape[0], normal.matrix, normal.dots
    real, imaginary = product[0], product[1]
    for m in range(ns if wanted else rows):
        for k in range(rows if wanted else m + 1):
            a, b = weights[k, m, 0], weights[k, m, 1]
            begin = nd if m < k < ns else 0
            for d in range(nd if wanted else normal.held[m]):
                u, v = bank[normal.channels[m, d], 0], bank[normal.channels[m, d], 1]
                for f in range(real.size):
                    real[f] = a[f] * u[f] - b[f] * v[f]
                    imaginary[f] = a[f] * v[f] + b[f] * u[f]
                own = normal.columns[m, d]
                end = d + 1 if k == m and not wanted else normal.held[k]
                for c in range(begin, end, RUN):
                    _dots(bank, product, normal.channels[k], c, dots)
                    for j in range(RUN):
                        other = normal.columns[k, c + j]
                        matrix[other, own] = matrix[own, other] = dots[min(j, normal.held[k] - 1 - c)]


@lean
def _right_side(bank, weights, response, product, normal):  # type: ignore[no-untyped-def]
    """b = sum Re(R' W y), ordered as M."""
    vector, dots = normal.vector, normal.dots
    for k in range(weights.shape[0]):
        product[:, :] = 0.0
        _add_weighted(weights[k], response, product)
        for c in range(0, normal.held[k], RUN):
            _dots(bank, product, normal.channels[k], c, dots)
            for j in range(min(RUN, normal.held[k] - c)):
                vector[normal.columns[k, c + j]] = dots[j]


@lean
def _add_weighted(weights, values, out):  # type: ignore[no-untyped-def]
    """out += sum over m of weights[m] values[m], all complex: (rows, 2, bins) twice, (2, bins)."""
    real, imaginary = out[0], out[1]
    for m in range(values.shape[0]):
        a, b, x, y = weights[m, 0], weights[m, 1], values[m, 0], values[m, 1]
        for f in range(real.size):
            real[f] += a[f] * x[f] - b[f] * y[f]
            imaginary[f] += a[f] * y[f] + b[f] * x[f]


@lean
def normal_equations(sides, plant, fraction, weights, normal):  # type: ignore[no-untyped-def]
    """Normal equations of one block, the nuisance columns still in them, in present derivatives.

    Args:
        sides: ``EquationSides``.
        fraction: of a whole block.
        weights: of ``noise.weigh``.
        normal: ``NormalWorkspace`` with variances; its matrix and vector become sum Re(R' W R), the nuisance columns'
            prior in it, and sum Re(R' W y), of the columns that there are.
    """
    ns, nd = plant.derivatives.shape
    rows = weights.shape[0]
    bank, product = sides.regressors, sides.product
    _note_columns(ns, nd, normal)
    _products(bank, weights, ns, nd, False, product, normal)
    _right_side(bank, weights, sides.response, product, normal)
    for k in range(rows):
        for c in range(NUISANCE):
            if normal.variances[k, c] > 0.0:
                place = ns * nd + NUISANCE * k + c
                normal.matrix[place, place] += prior_of(normal.variances[k, c], fraction)


@lean
def with_other_regressors(sides, plant, weights, whole, normal):  # type: ignore[no-untyped-def]
    """Normal equations of one block with other regressors, of a residual to which the nuisance columns have been fitted
    beside the first ones.

    About the values of the nuisance columns the residual's products with them are what is known beforehand of these, so
    their right sides are nothing.

    Args:
        sides: ``EquationSides``: the other columns, and the residual.
        weights: of ``noise.weigh``.
        whole: ``NormalWorkspace`` of all columns.
        normal: ``NormalWorkspace``; its matrix and vector are made.
    """
    ns, nd = plant.derivatives.shape
    copy_matrix(whole.matrix, normal.matrix)
    _products(sides.regressors, weights, ns, nd, True, sides.product, normal)
    _right_side(sides.regressors, weights, sides.response, sides.product, normal)
    normal.vector[ns * nd :] = 0.0


@lean
def residual_of(bank, response, whitened, plant, nuisance, weights):  # type: ignore[no-untyped-def]
    """The residual in the place of the response, and W times it as ``whitened``; nuisance columns' values (rows,
    NUISANCE)."""
    ns, nd = plant.derivatives.shape
    nf = bank.shape[2]
    nc = nd + NUISANCE
    for k in range(response.shape[0]):
        real, imaginary = response[k, 0], response[k, 1]
        for c in range(nc):
            if c < nd and k >= ns:
                continue
            factor = plant.derivatives[k, c] if c < nd else nuisance[k, c - nd]
            if factor == 0.0:
                continue
            x, y = bank[c if c < ns else c + 1, 0], bank[c if c < ns else c + 1, 1]
            for f in range(nf):
                real[f] -= factor * x[f]
                imaginary[f] -= factor * y[f]
    for k in range(response.shape[0]):
        whitened[k] = 0.0
        _add_weighted(weights[k], response, whitened[k])
