"""Rolling air, which no sensor measures: estimated from the residual, its motion taken from the regressors; compiled.

What is left of the regressors is the motion that surfaces and measured gusts cause, so neither the intensity of the
rolling air nor what the derivatives make of it enters the score. Derivation and equation numbers:
``docs/methods/fourier.md`` section 3, (14a).
"""

from wingwatch.estimators.fourier.checkpoints import copy_bank
from wingwatch.estimators.fourier.driven_motion import driven_motion
from wingwatch.estimators.fourier.noise import channel_variance, weighted_column
from wingwatch.estimators.fourier.state import ROLLING
from wingwatch.estimators.kernels.hot import lean

__all__ = ["rolling_gain", "rolling_noise", "without_rolling"]


@lean
def rolling_gain(omega, plant, noise, power, work):  # type: ignore[no-untyped-def]
    """K, K B and the motion c of ``NoiseWorkspace``, with the weights as they are."""
    ns, nd = plant.derivatives.shape
    variance = power * noise[ROLLING]
    weighted_column(work, nd + 2)
    for k in range(work.gain.shape[0]):
        for f in range(omega.size):
            work.gain[k, 0, f] = variance * work.weighted[k, 0, f]
            work.gain[k, 1, f] = -variance * work.weighted[k, 1, f]
    for f in range(omega.size):
        work.explained[f] = variance * work.spread[f]
        driven_motion(omega, plant, work, f)
        for j in range(ns):
            work.moved[j, 0, f] = work.answers[j, ns + 1].real
            work.moved[j, 1, f] = work.answers[j, ns + 1].imag


@lean
def without_rolling(residual, regressors, work, out):  # type: ignore[no-untyped-def]
    """Regressors less the motion that the rolling air in the residual has caused.

    Args:
        residual: (rows, 2, bins) at the linearisation.
        regressors: (channels, 2, bins), the states first.
        out: (channels, 2, bins), filled.
    """
    copy_bank(regressors, out)
    for f in range(regressors.shape[2]):
        air = 0.0j
        for k in range(residual.shape[0]):
            air += complex(work.gain[k, 0, f], work.gain[k, 1, f]) * complex(
                residual[k, 0, f], residual[k, 1, f]
            )
        for j in range(work.moved.shape[0]):
            caused = complex(work.moved[j, 0, f], work.moved[j, 1, f]) * air
            out[j, 0, f] -= caused.real
            out[j, 1, f] -= caused.imag


@lean
def rolling_noise(plant, noise, power, work, n_noise):  # type: ignore[no-untyped-def]
    """Add to the noise power of the regressors what taking the estimated rolling air from them changes, (docs (14b)).

    The estimate K r has the sensors' noise in it, and leaves 1 - K B of the rolling air.
    """
    ns, nd = plant.derivatives.shape
    for f in range(work.explained.size):
        left = power * noise[ROLLING] * (1.0 - work.explained[f])
        for i in range(nd):
            of_i = complex(work.moved[i, 0, f], work.moved[i, 1, f]) if i < ns else 0.0j
            shared_i = _shared(noise, power, work, i, f)
            for j in range(nd):
                if i >= ns and j >= ns:
                    continue
                of_j = complex(work.moved[j, 0, f], work.moved[j, 1, f]) if j < ns else 0.0j
                shared_j = _shared(noise, power, work, j, f)
                # E[v_i conj(v_j)] of the noise v in the regressors, beside the sensors' own
                common = (
                    of_i * of_j.conjugate() * left - shared_i.conjugate() * of_j.conjugate() - of_i * shared_j
                )
                for k in range(ns):
                    for m in range(ns):
                        w = complex(work.weights[k, m, 0, f], work.weights[k, m, 1, f])
                        n_noise[k * nd + i, m * nd + j] += (w * common.conjugate()).real


@lean
def _shared(noise, power, work, column, f):  # type: ignore[no-untyped-def]
    """What the estimate of the rolling air and the noise of a regressor's sensor have in common: K L D."""
    ns = work.moved.shape[0]
    source = column if column < ns else column + 1
    total = 0.0j
    for k in range(work.gain.shape[0]):
        lead = complex(work.transfer[source, k, 0, f], work.transfer[source, k, 1, f])
        total += complex(work.gain[k, 0, f], work.gain[k, 1, f]) * lead
    return total * power * channel_variance(noise, source, ns)
