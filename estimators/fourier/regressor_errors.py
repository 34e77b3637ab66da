"""What sensors and air put into the regressors: as much as the residual shows of it is taken out; compiled.

A regressor is what the equations hold and an error v: noise of its sensor, the turning of the air in the last rate,
motion by rolling air in the states. The residual r shows v, as E[v r'] W r. What is left of v has nothing in common
with the residual. Derivation and equation numbers: ``docs/methods/fourier.md`` section 3. Memory is that of ``noise``.
"""

from wingwatch.estimators.fourier.checkpoints import copy_bank
from wingwatch.estimators.fourier.noise import channel_variance
from wingwatch.estimators.fourier.state import GUST, ROLLING
from wingwatch.kernels.decorators import lean

__all__ = ["add_unseen_errors", "shared_with_residual", "shown_by_residual", "without_errors"]


@lean
def shown_by_residual(weights, residual, explained):  # type: ignore[no-untyped-def]
    """How far a residual shows the errors of the regressors, from 0 to 1, (docs (12a)).

    Far from the truth the residual is more than noise makes, and other derivatives explain it.

    Args:
        weights, residual: (rows, rows, 2, bins) W and (rows, 2, bins) r.
        explained: what of its power other derivatives explain.
    """
    total = 0.0
    for k in range(residual.shape[0]):
        u, v = residual[k, 0], residual[k, 1]
        for m in range(residual.shape[0]):
            a, b, x, y = weights[k, m, 0], weights[k, m, 1], residual[m, 0], residual[m, 1]
            for f in range(u.size):
                total += u[f] * (a[f] * x[f] - b[f] * y[f]) + v[f] * (a[f] * y[f] + b[f] * x[f])
    noise = residual.shape[0] * residual.shape[2]
    return 1.0 if total <= noise else max(noise, total - explained) / total


@lean
def shared_with_residual(omega, plant, air, noise, power, work):  # type: ignore[no-untyped-def]
    """Into ``work.shared`` the covariance of each regressor's error with the residual, E[v r'], (docs (12)).

    Args:
        noise: all variances.
        power: of white noise of unit variance in a bin.
        work: ``NoiseWorkspace``, after ``weigh`` and ``driven_motions``.
    """
    ns, nd = plant.derivatives.shape
    shared, transfer = work.shared, work.transfer
    gust, rolling = power * noise[GUST], power * noise[ROLLING]
    for c in range(nd):
        source = c if c < ns else c + 1
        variance = power * channel_variance(noise, source, ns)
        for k in range(shared.shape[1]):
            real, imaginary = shared[c, k, 0], shared[c, k, 1]
            a, b = transfer[source, k, 0], transfer[source, k, 1]
            for f in range(omega.size):
                real[f], imaginary[f] = variance * a[f], -variance * b[f]
            if c == ns - 1 and air.turn != 0.0:
                a, b = transfer[nd + 1, k, 0], transfer[nd + 1, k, 1]
                for f in range(omega.size):
                    late = omega[f] * air.turn_s
                    turn = gust * air.turn / (1.0 + late * late)
                    real[f] += turn * (a[f] - late * b[f])
                    imaginary[f] -= turn * (b[f] + late * a[f])
            if c < ns and ns == 3:
                a, b = transfer[nd + 2, k, 0], transfer[nd + 2, k, 1]
                u, v = work.answers[c, ns + 1, 0], work.answers[c, ns + 1, 1]
                for f in range(omega.size):
                    real[f] += rolling * (u[f] * a[f] + v[f] * b[f])
                    imaginary[f] += rolling * (v[f] * a[f] - u[f] * b[f])


@lean
def without_errors(whitened, shown, regressors, work, out):  # type: ignore[no-untyped-def]
    """Regressors less what the residual shows of their errors, (docs (12)).

    Args:
        whitened: (rows, 2, bins) W r.
        shown: of ``shown_by_residual``.
        regressors: (channels, 2, bins).
        work: ``NoiseWorkspace``, after ``shared_with_residual``.
        out: (channels, 2, bins), filled.
    """
    shared, ns = work.shared, work.doubt.shape[1]
    copy_bank(regressors, out)
    for c in range(shared.shape[0]):
        real, imaginary = out[c if c < ns else c + 1, 0], out[c if c < ns else c + 1, 1]
        for k in range(whitened.shape[0]):
            a, b, x, y = shared[c, k, 0], shared[c, k, 1], whitened[k, 0], whitened[k, 1]
            for f in range(real.size):
                real[f] -= shown * (a[f] * x[f] - b[f] * y[f])
                imaginary[f] -= shown * (a[f] * y[f] + b[f] * x[f])


@lean
def _error_products(noise, power, work, i, j, common):  # type: ignore[no-untyped-def]
    """E[v_i conj(v_j)] before anything is known of the residual, (2, bins)."""
    ns = work.doubt.shape[1]
    rolling = power * noise[ROLLING]
    own = power * channel_variance(noise, i if i < ns else i + 1, ns) if i == j else 0.0
    turned = power * noise[GUST] if i == j == ns - 1 else 0.0
    real, imaginary = common[0], common[1]
    for f in range(real.size):
        real[f], imaginary[f] = own + turned * work.shaped[1, f], 0.0
    if ns == 3 and i < ns and j < ns:
        a, b, u, v = (
            work.answers[i, ns + 1, 0],
            work.answers[i, ns + 1, 1],
            work.answers[j, ns + 1, 0],
            work.answers[j, ns + 1, 1],
        )
        for f in range(real.size):
            real[f] += rolling * (a[f] * u[f] + b[f] * v[f])
            imaginary[f] += rolling * (b[f] * u[f] - a[f] * v[f])


@lean
def add_unseen_errors(noise, power, shown, work, equation):  # type: ignore[no-untyped-def]
    """Add to the noise power of the regressors what of their errors the residual does not show, (docs (13)), and to the
    expected score what of them has something in common with it still, (docs (13a)).

    Args:
        noise, power, work: of ``shared_with_residual``.
        shown: of ``shown_by_residual``.
        equation: ``Equation``, its ``noise`` and ``expected`` in place.
    """
    n_noise, expected = equation.noise, equation.expected
    left = shown * (2.0 - shown)
    nd, rows = work.shared.shape[0], work.shared.shape[1]
    ns = work.doubt.shape[1]
    shared, weights, sure, common, half = work.shared, work.weights, work.sure, work.common, work.weighted
    for j in range(nd):
        for k in range(rows):
            real, imaginary = half[k, 0], half[k, 1]
            for f in range(real.size):
                real[f] = imaginary[f] = 0.0
            for m in range(rows):
                a, b, x, y = sure[k, m, 0], sure[k, m, 1], shared[j, m, 0], shared[j, m, 1]
                for f in range(real.size):
                    real[f] += a[f] * x[f] + b[f] * y[f]
                    imaginary[f] += b[f] * x[f] - a[f] * y[f]
            if k < ns:
                for f in range(real.size):
                    expected[k * nd + j] += (1.0 - shown) * real[f]
        for i in range(j + 1):
            _error_products(noise, power, work, i, j, common)
            for k in range(rows):
                a, b, x, y = shared[i, k, 0], shared[i, k, 1], half[k, 0], half[k, 1]
                for f in range(common.shape[1]):
                    common[0, f] -= left * (a[f] * x[f] - b[f] * y[f])
                    common[1, f] -= left * (a[f] * y[f] + b[f] * x[f])
            for k in range(ns):
                for m in range(ns):
                    real, imaginary = weights[k, m, 0], weights[k, m, 1]
                    total = 0.0
                    for f in range(real.size):
                        total += real[f] * common[0, f] + imaginary[f] * common[1, f]
                    n_noise[k * nd + i, m * nd + j] += total
                    if j > i:
                        n_noise[m * nd + j, k * nd + i] += total
