"""What drives the states and no sensor measures: estimated from the residual, its motion taken from the regressors.

Rolling air, what moment equations leave out, and the gust where no kinematic row measures it. What is left of the
regressors is the motion that surfaces and measured gusts cause, so neither the variances of these drives nor what the
derivatives make of them enter the score. Compiled. Derivation and equation numbers: ``docs/methods/fourier.md``
section 3, (14a) and (14b).
"""

from wingwatch.estimators.fourier.checkpoints import copy_bank
from wingwatch.estimators.fourier.drives import driven_motion, entry_of, place_of, variance_of
from wingwatch.estimators.fourier.noise import channel_variance
from wingwatch.estimators.kernels.hot import lean

__all__ = ["estimator_of_drives", "noise_without_drives", "without_drives"]


@lean
def estimator_of_drives(omega, plant, noise, power, work):  # type: ignore[no-untyped-def]
    """K, the covariance that it leaves, and the motion c of ``NoiseWorkspace``, with the weights as they are."""
    ns = plant.lever.size
    drives, rows = work.gain.shape[0], work.gain.shape[1]
    for f in range(omega.size):
        driven_motion(omega, plant, work, f)
        for e in range(drives):
            place = place_of(e, ns)
            variance = power * variance_of(noise, e, ns, rows)
            for j in range(ns):
                work.moved[e, j, f] = work.answers[j, place]
            for k in range(rows):
                total = 0.0j
                if variance > 0.0:
                    for m in range(rows):
                        w = complex(work.weights[k, m, 0, f], work.weights[k, m, 1, f])
                        total += w * entry_of(work, e, m, f)
                work.gain[e, k, f] = variance * total.conjugate()
            for d in range(drives):
                explained = 0.0j
                for k in range(rows):
                    explained += work.gain[e, k, f] * entry_of(work, d, k, f)
                own = 1.0 if d == e else 0.0
                work.unexplained[e, d, f] = (own - explained) * power * variance_of(noise, d, ns, rows)


@lean
def without_drives(residual, regressors, work, out):  # type: ignore[no-untyped-def]
    """Regressors less the motion that the drives in the residual have caused.

    Args:
        residual: (rows, 2, bins) at the linearisation.
        regressors: (channels, 2, bins), the states first.
        out: (channels, 2, bins), filled.
    """
    copy_bank(regressors, out)
    for f in range(regressors.shape[2]):
        for e in range(work.gain.shape[0]):
            drive = 0.0j
            for k in range(residual.shape[0]):
                drive += work.gain[e, k, f] * complex(residual[k, 0, f], residual[k, 1, f])
            for j in range(work.moved.shape[1]):
                caused = work.moved[e, j, f] * drive
                out[j, 0, f] -= caused.real
                out[j, 1, f] -= caused.imag


@lean
def noise_without_drives(plant, noise, power, work, n_noise):  # type: ignore[no-untyped-def]
    """Add to the noise power of the regressors what taking the estimated drives from them changes, (docs (14b)).

    The estimate K r has the sensors' noise in it, and part of the drives is left.
    """
    ns, nd = plant.derivatives.shape
    drives = work.gain.shape[0]
    for f in range(work.unexplained.shape[2]):
        for j in range(ns):
            for i in range(nd):
                common = 0.0j
                for e in range(drives):
                    common -= (_shared(noise, power, work, e, i, f) * work.moved[e, j, f]).conjugate()
                    if i < ns:
                        common -= work.moved[e, i, f] * _shared(noise, power, work, e, j, f)
                        for d in range(drives):
                            left = work.unexplained[e, d, f]
                            common += work.moved[e, i, f] * left * work.moved[d, j, f].conjugate()
                for k in range(ns):
                    for m in range(ns):
                        # E[v_i conj(v_j)] of the noise v in the regressors, beside the sensors' own
                        w = complex(work.weights[k, m, 0, f], work.weights[k, m, 1, f])
                        seen = (w * common.conjugate()).real
                        n_noise[k * nd + i, m * nd + j] += seen
                        if i >= ns:
                            n_noise[m * nd + j, k * nd + i] += seen


@lean
def _shared(noise, power, work, e, column, f):  # type: ignore[no-untyped-def]
    """What the estimate of drive e and the noise of a regressor's sensor have in common: K L D."""
    ns = work.moved.shape[1]
    source = column if column < ns else column + 1
    total = 0.0j
    for k in range(work.gain.shape[1]):
        lead = complex(work.transfer[source, k, 0, f], work.transfer[source, k, 1, f])
        total += work.gain[e, k, f] * lead
    return total * power * channel_variance(noise, source, ns)
