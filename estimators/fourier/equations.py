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
from wingwatch.estimators.fourier.nuisance import prior_of
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
def _product_sums(real, imaginary, weight):  # type: ignore[no-untyped-def]
    """Sums over bins of Re P Re W and of Im P Im W."""
    even = odd = 0.0
    for f in range(real.size):
        even += real[f] * weight[0, f]
        odd += imaginary[f] * weight[1, f]
    return even, odd


@lean
def _normal_matrix(bank, weights, columns, ns, nd, product, normal):  # type: ignore[no-untyped-def]
    """M, the wanted columns of every equation first, then the nuisance ones of every row: the products of the first
    so many columns with all that there are."""
    rows, nc, m_full, variances = weights.shape[0], nd + NUISANCE, normal.matrix, normal.variances
    real, imaginary = product[0], product[1]
    for c in range(columns):
        x, y = bank[c if c < ns else c + 1, 0], bank[c if c < ns else c + 1, 1]
        for d in range(c, nc):
            u, v = bank[d if d < ns else d + 1, 0], bank[d if d < ns else d + 1, 1]
            for f in range(real.size):
                real[f] = x[f] * u[f] + y[f] * v[f]
                imaginary[f] = x[f] * v[f] - y[f] * u[f]
            for k in range(rows):
                for m in range(k, rows):
                    first = _has(variances, k, c, ns, nd) and _has(variances, m, d, ns, nd)
                    second = _has(variances, k, d, ns, nd) and _has(variances, m, c, ns, nd)
                    if not (first or second):
                        continue
                    even, odd = _product_sums(real, imaginary, weights[k, m])
                    if first:
                        kc, md = _column(k, c, ns, nd), _column(m, d, ns, nd)
                        m_full[kc, md] = m_full[md, kc] = even - odd
                    if second:
                        kd, mc = _column(k, d, ns, nd), _column(m, c, ns, nd)
                        m_full[kd, mc] = m_full[mc, kd] = even + odd


@lean
def _has(variances, row, c, ns, nd):  # type: ignore[no-untyped-def]
    """Whether a row has column c: derivatives are in the equations, of nuisance columns there are those that may be
    more than nothing."""
    return row < ns if c < nd else variances[row, c - nd] > 0.0


@lean
def _column(row, c, ns, nd):  # type: ignore[no-untyped-def]
    """Place of column c of a row among all columns."""
    return row * nd + c if c < nd else ns * nd + NUISANCE * row + c - nd


@lean
def _right_side(bank, weights, response, ns, nd, product, normal):  # type: ignore[no-untyped-def]
    """b = sum Re(R' W y), ordered as ``_normal_matrix``."""
    b_full, variances = normal.vector, normal.variances
    for k in range(weights.shape[0]):
        product[:, :] = 0.0
        _add_weighted(weights[k], response, product)
        real, imaginary = product[0], product[1]
        for c in range(nd + NUISANCE):
            if not _has(variances, k, c, ns, nd):
                continue
            x, y = bank[c if c < ns else c + 1, 0], bank[c if c < ns else c + 1, 1]
            total = 0.0
            for f in range(real.size):
                total += x[f] * real[f] + y[f] * imaginary[f]
            b_full[_column(k, c, ns, nd)] = total


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
    _normal_matrix(bank, weights, nd + NUISANCE, ns, nd, product, normal)
    _right_side(bank, weights, sides.response, ns, nd, product, normal)
    for k in range(rows):
        for c in range(NUISANCE):
            if normal.variances[k, c] > 0.0:
                place = _column(k, nd + c, ns, nd)
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
    _normal_matrix(sides.regressors, weights, nd, ns, nd, sides.product, normal)
    _right_side(sides.regressors, weights, sides.response, ns, nd, sides.product, normal)
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
