"""What nuisance columns take from a block: beside projections written out, and beside residuals that are drawn."""

import math

import numpy as np
import pytest
from estimator_kernels import in_python
from numpy.typing import NDArray

from wingwatch.estimators.fourier import nuisance
from wingwatch.estimators.fourier.bank import NUISANCE
from wingwatch.estimators.fourier.noise import Air, Plant, noise_workspace
from wingwatch.estimators.fourier.nuisance import NormalWorkspace, normal_workspace
from wingwatch.estimators.fourier.state import AIR_VARIANCES, GUST

bins_left, degrees_of_freedom, eliminate, factorise, fitted_columns, nuisance_of = map(
    in_python,
    (
        nuisance.bins_left,
        nuisance.degrees_of_freedom,
        nuisance.eliminate,
        nuisance.factorise,
        nuisance.fitted_columns,
        nuisance.nuisance_of,
    ),
)
nuisance_variances, prior_of, reduce_weights = map(
    in_python, (nuisance.nuisance_variances, nuisance.prior_of, nuisance.reduce_weights)
)

BINS, ROWS, STATES, FIRST = 12, 3, 2, 4

Array = NDArray[np.float64]


def columns(seed: int) -> tuple[Array, NDArray[np.complex128], Array]:
    """A bank with NUISANCE columns behind FIRST others; the same as complex numbers; priors (rows, NUISANCE)."""
    rng = np.random.default_rng(seed)
    bank = rng.standard_normal((FIRST + NUISANCE, 2, BINS))
    variances = np.zeros((ROWS, NUISANCE))
    variances[:, 0], variances[:, 2], variances[1:, 3] = math.inf, math.inf, 0.2
    return bank, bank[FIRST:, 0] + 1j * bank[FIRST:, 1], variances


def weights(seed: int) -> NDArray[np.complex128]:
    """Hermitian positive definite W of every bin, (bins, rows, rows)."""
    rng = np.random.default_rng(seed)
    z = rng.standard_normal((BINS, ROWS, 4)) + 1j * rng.standard_normal((BINS, ROWS, 4))
    return np.asarray(z @ z.conj().transpose(0, 2, 1))


def power_of(w: NDArray[np.complex128], c: NDArray[np.complex128], variances: Array) -> tuple[Array, Array]:
    """Re sum C' W C with the prior, of unit diagonal, and the sizes."""
    full = np.einsum("cf,fkm,df->kcmd", c.conj(), w, c).real.reshape(ROWS * NUISANCE, -1)
    present = np.flatnonzero(variances)
    full = full[np.ix_(present, present)] + np.diag([prior_of(v, 1.0) for v in variances.ravel()[present]])
    size = np.sqrt(np.diag(full))
    return full / np.outer(size, size), size


def eliminated(unit: Array, size: Array, variances: Array) -> NormalWorkspace:
    """As ``eliminate`` leaves the workspace, of these nuisance columns and no derivatives."""
    found, present = normal_workspace(0, ROWS), np.flatnonzero(variances)
    n = found.number[0] = len(present)
    found.variances[...], found.places[:n], found.size[:n] = variances, present, size
    found.inverse[:n, :n] = np.linalg.inv(unit)
    return found


def test_elimination_leaves_the_inverse_and_what_the_derivatives_columns_keep() -> None:
    """Beside numpy: Schur complement, the values that least squares has, the inverse of the columns' power."""
    p, rows = 3, 2
    q = NUISANCE * rows
    rng = np.random.default_rng(1)
    z = rng.standard_normal((p + q, 3 * (p + q)))
    normal = normal_workspace(p, rows)
    normal.matrix[...], normal.vector[...] = z @ z.T, rng.standard_normal(p + q)
    normal.variances[...] = 1.0
    normal.variances[1, 3:5] = 0.0
    there = np.r_[: p + q][np.r_[np.ones(p, dtype=bool), normal.variances.ravel() > 0.0]]
    full, right = normal.matrix[np.ix_(there, there)], normal.vector[there]
    theta, scale, n = rng.standard_normal(p), np.ones(p), len(there) - p
    m, score = np.empty((p, p)), np.empty(p)
    factorise(normal, p, 10.0)
    eliminate(normal, theta, scale, m, score)
    assert normal.number[0] == n == q - 2
    cross, power = full[:p, p:], full[p:, p:]
    unit = power / np.outer(normal.size[:n], normal.size[:n])
    np.testing.assert_allclose(normal.inverse[:n, :n], np.linalg.inv(unit), rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(m, full[:p, :p] - cross @ np.linalg.solve(power, cross.T), rtol=1e-6)
    left = right - full[:, :p] @ theta
    np.testing.assert_allclose(score, left[:p] - cross @ np.linalg.solve(power, left[p:]), rtol=1e-6)
    change = np.array([0.1, -0.2, 0.3])
    nuisance_of(normal, change, scale)
    want = np.linalg.solve(power, left[p:] - cross.T @ change)
    np.testing.assert_allclose(normal.values[normal.variances > 0.0], want, rtol=1e-6, atol=1e-9)
    assert (normal.values[1, 3:5] == 0.0).all()


def test_columns_take_as_many_real_numbers_as_are_free() -> None:
    """Flat columns take one each, a column with a prior as much as the data say beside it, an absent one nothing."""
    _, c, variances = columns(2)
    unit, size = power_of(weights(2), c, variances)
    taken = degrees_of_freedom(eliminated(unit, size, variances), 1.0)
    prior = np.diag([prior_of(v, 1.0) for v in variances[variances > 0.0]])
    both = unit * np.outer(size, size)
    want = np.trace((both - prior) @ np.linalg.inv(both))
    assert taken == pytest.approx(want, abs=1e-6)
    assert 2 * ROWS < taken < len(size)
    assert prior_of(math.inf, 0.5) == 0.0


def test_weights_are_reduced_to_what_residuals_keep_once_columns_are_fitted() -> None:
    """E[x' P r] with real columns fitted out of r, of 20,000 draws with E[r r'] = W^-1 and x a part of r."""
    bank, c, variances = columns(3)
    w = weights(3)
    unit, size = power_of(w, c, variances)
    work = noise_workspace(STATES, 1, ROWS, BINS)
    work.weights[:, :, 0], work.weights[:, :, 1] = w.real.transpose(1, 2, 0), w.imag.transpose(1, 2, 0)
    fitted_columns(bank, FIRST, eliminated(unit, size, variances), work)
    reduce_weights(work.weights, work)
    bins = bins_left(work)
    reduced = (work.weights[:, :, 0] + 1j * work.weights[:, :, 1]).transpose(2, 0, 1)
    np.testing.assert_allclose(work.sums, reduced.real.sum(axis=0)[:STATES, :STATES], rtol=1e-12)
    assert 1.0 < bins < BINS
    rng, draws = np.random.default_rng(4), 20_000
    z = (
        rng.standard_normal((draws, BINS, ROWS)) + 1j * rng.standard_normal((draws, BINS, ROWS))
    ) / math.sqrt(2.0)
    r = np.einsum("fkm,nfm->nfk", np.linalg.cholesky(np.linalg.inv(w)), z)
    whitened = np.einsum("fkm,nfm->nfk", w, r)
    right = np.einsum("cf,nfk->nkc", c.conj(), whitened).real[:, variances > 0.0] / size
    fitted = np.zeros((draws, ROWS, NUISANCE))
    fitted[:, variances > 0.0] = right @ np.linalg.inv(unit) / size
    left = whitened - np.einsum("fkm,nmc,cf->nfk", w, fitted, c)
    # the regressor of row 0 is that row's residual
    got = np.real(np.conj(r[:, :, 0]) * left[:, :, 0]).sum(axis=1)
    sigma = np.linalg.inv(w)
    want = np.real(np.einsum("fk,fk->f", reduced[:, 0], sigma[:, :, 0])).sum()
    assert got.mean() == pytest.approx(want, abs=4.0 * got.std() / math.sqrt(draws))
    whole = np.real(np.einsum("fk,fk->f", w[:, 0], sigma[:, :, 0])).sum()
    assert abs(want - whole) > 8.0 * got.std() / math.sqrt(draws), "the columns take nothing here: no test"


def test_what_is_known_of_columns_before_the_flight() -> None:
    derivatives = np.array([[-4.0, -1.0, -2.0], [-3.0, -5.0, -30.0]])
    plant = Plant(derivatives, np.array([0.0, 25.0]), np.zeros(2), np.zeros(2), True, True)
    air, noise = Air(-1.0 / 25.0, 0.15, 0.12, 1.0), np.full(2 * 2 + 2 + AIR_VARIANCES, 1e-2)
    noise[0], noise[1], noise[GUST] = 2e-2, 3e-2, 20.0
    found = np.empty((3, NUISANCE))
    nuisance_variances(plant, air, noise, 0.02, found)
    assert np.isinf(found[:, 0]).all()
    assert np.isinf(found[:, 2]).all()
    np.testing.assert_array_equal(np.isinf(found[:, 1]), [True, True, False])
    np.testing.assert_allclose(found[:, 3], [0.0, 3e-2, 2e-2])
    turn_variance = 20.0 * 0.02 * 0.15 / 2.0 / 25.0**2
    np.testing.assert_allclose(found[:, 5], [turn_variance, 25.0 * turn_variance, 0.0])
    np.testing.assert_allclose(found[:, 7], [1.0 / 25.0**2, 25.0 / 25.0**2, 0.0])
    np.testing.assert_allclose(found[:, 9], [(4.0 * 0.02) ** 2, (3.0 * 0.02) ** 2, 0.0])
