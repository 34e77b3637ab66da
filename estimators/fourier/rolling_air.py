"""Rolling air, which no sensor measures: estimated from the residual, its motion taken from the regressors; compiled.

What is left of the regressors is the motion that surfaces and measured gusts cause, so neither the intensity of the
rolling air nor what the derivatives make of it enters the score. Derivation and equation numbers:
``docs/methods/fourier.md`` section 3, (14a) and (14b).
"""

from wingwatch.estimators.fourier.checkpoints import copy_bank
from wingwatch.estimators.fourier.noise import channel_variance, weighted_column
from wingwatch.estimators.fourier.state import ROLLING
from wingwatch.estimators.kernels.hot import lean

__all__ = ["rolling_gain", "rolling_noise", "without_rolling"]


@lean
def rolling_gain(noise, power, work):  # type: ignore[no-untyped-def]
    """K and K B of ``NoiseWorkspace``, with the weights as they are."""
    variance = power * noise[ROLLING]
    weighted_column(work, work.transfer.shape[0] - 2)
    for f in range(work.explained.size):
        work.explained[f] = variance * work.spread[f]
        for k in range(work.gain.shape[0]):
            work.gain[k, 0, f] = variance * work.weighted[k, 0, f]
            work.gain[k, 1, f] = -variance * work.weighted[k, 1, f]


@lean
def _add_product(left, right, factor, out):  # type: ignore[no-untyped-def]
    """out += factor left right, bin by bin, (2, bins)."""
    for f in range(out.shape[1]):
        out[0, f] += factor * (left[0, f] * right[0, f] - left[1, f] * right[1, f])
        out[1, f] += factor * (left[0, f] * right[1, f] + left[1, f] * right[0, f])


@lean
def without_rolling(residual, regressors, work, out):  # type: ignore[no-untyped-def]
    """Regressors less the motion that the rolling air in the residual has caused.

    Args:
        residual: (rows, 2, bins) at the linearisation.
        regressors: (channels, 2, bins), the states first.
        work: ``NoiseWorkspace``, after ``rolling_gain`` and ``driven_motions``; its ``moved`` is filled.
        out: (channels, 2, bins), filled.
    """
    air = work.weighted[0]
    air[:, :] = 0.0
    for k in range(residual.shape[0]):
        _add_product(work.gain[k], residual[k], 1.0, air)
    copy_bank(regressors, out)
    ns = work.moved.shape[0]
    for j in range(ns):
        for f in range(air.shape[1]):
            work.moved[j, 0, f], work.moved[j, 1, f] = (
                work.answers[f, j, ns + 1].real,
                work.answers[f, j, ns + 1].imag,
            )
        _add_product(work.moved[j], air, -1.0, out[j])


@lean
def rolling_noise(plant, noise, power, work, n_noise):  # type: ignore[no-untyped-def]
    """Add to the noise power of the regressors what taking the estimated rolling air from them changes, (docs (14b)).

    The estimate K r has the sensors' noise in it, and leaves 1 - K B of the rolling air.
    """
    ns, nd = plant.derivatives.shape
    gain, shared, common = work.gain, work.shared, work.weighted[0]
    for j in range(nd):
        source = j if j < ns else j + 1
        variance = power * channel_variance(noise, source, ns)
        shared[j, :, :] = 0.0
        for k in range(gain.shape[0]):
            _add_product(gain[k], work.transfer[source, k], variance, shared[j])
    for i in range(ns):
        for j in range(i, nd):
            _in_common(work, power * noise[ROLLING], i, j, common)
            for k in range(ns):
                for m in range(ns):
                    real, imaginary = work.weights[k, m, 0], work.weights[k, m, 1]
                    total = 0.0
                    for f in range(real.size):
                        total += real[f] * common[0, f] + imaginary[f] * common[1, f]
                    n_noise[k * nd + i, m * nd + j] += total
                    if j > i:
                        n_noise[m * nd + j, k * nd + i] += total


@lean
def _in_common(work, rolling, i, j, common):  # type: ignore[no-untyped-def]
    """E[v_i conj(v_j)] of the noise v in the regressors, beside the sensors' own, (2, bins); i is a state's."""
    ns = work.moved.shape[0]
    a, b, x, y = work.moved[i, 0], work.moved[i, 1], work.shared[j, 0], work.shared[j, 1]
    for f in range(common.shape[1]):
        common[0, f] = -(a[f] * x[f] - b[f] * y[f])
        common[1, f] = -(a[f] * y[f] + b[f] * x[f])
    if j >= ns:
        return
    c, d, u, v = work.moved[j, 0], work.moved[j, 1], work.shared[i, 0], work.shared[i, 1]
    for f in range(common.shape[1]):
        left = rolling * (1.0 - work.explained[f])
        common[0, f] += left * (a[f] * c[f] + b[f] * d[f]) - (u[f] * c[f] - v[f] * d[f])
        common[1, f] += left * (b[f] * c[f] - a[f] * d[f]) + (u[f] * d[f] + v[f] * c[f])
