"""What drives the states of a Fourier block is in its regressors and in its residual; compiled.

That are gusts, rolling air and moments that nobody measures. Noise of the sensors: ``regressor_errors``.
Derivation and equation numbers: ``docs/methods/fourier.md`` section 3. Memory is that of ``noise``.
"""

from wingwatch.estimators.fourier.noise import DRIVING
from wingwatch.estimators.fourier.state import GUST, ROLLING
from wingwatch.estimators.kernels.hot import lean

__all__ = ["expected_products", "motion_by_moments"]


@lean
def motion_by_moments(omega, plant, noise, power, work, n_noise):  # type: ignore[no-untyped-def]
    """What of R' W R is motion by a moment that an equation leaves out, in that equation, (docs (13)).

    It counts as noise there, in present derivatives; to the other equations that motion is as good as any.

    Args:
        n_noise: becomes that power, (p, p).
    """
    ns, nd = plant.derivatives.shape
    n_noise[:, :] = 0.0
    weights = work.weights
    for f in range(omega.size):
        answers = work.answers[f]
        for e in range(ns):
            variance = power * noise[ns + 1 + e] * weights[e, e, 0, f]
            for j in range(ns):
                for c in range(ns):
                    moved = answers[j, ns + DRIVING + e].conjugate() * answers[c, ns + DRIVING + e]
                    n_noise[e * nd + j, e * nd + c] += variance * moved.real


@lean
def expected_products(omega, plant, air, noise, power, span, work, equation):  # type: ignore[no-untyped-def]
    """Expected products of regressors and weighted residual, in present derivatives, (docs (14), (14c), (15)).

    The gust drives the states, by (s - A)^-1, between samples too, and the last rate is relative to the air that it
    turns; so it is in regressors and residual. Motion by rolling air has been taken out of the regressors, but for what
    of it is in the readings at the block's ends. What moment equations leave out drives the states as well; of that
    neither time history nor loop is known.

    Args:
        span: length of the block, s.
        work: ``NoiseWorkspace``, after ``driven_motions`` and ``roll_shared_at_ends``; ``driven`` and
            ``caused`` are filled.
        equation: ``Equation``; to ``expected`` is added what of R' W r is due to the air, and ``bias`` becomes what of
            it is due to what moment equations leave out.
    """
    ns, nd = work.doubt.shape[1], work.shared.shape[0]
    g, bias = equation.expected, equation.bias
    bias[:] = 0.0
    work.driven[:, :, :] = 0.0
    weights, transfer, driven, caused = work.weights, work.transfer, work.driven, work.caused
    rows = weights.shape[0]
    rolling = power * noise[ROLLING]
    work.rolled[0] = 0.0
    for f in range(omega.size):
        answers = work.answers[f]
        work.rolled[0] += rolling * abs(answers[1, ns + 1]) ** 2 * weights[1, 1, 0, f]
        for e in range(DRIVING):
            variance = power * noise[GUST + e]
            if variance == 0.0:
                continue
            for k in range(ns):
                caused[k] = 0.0j
                for m in range(rows):
                    w = complex(weights[k, m, 0, f], weights[k, m, 1, f])
                    caused[k] += w * complex(transfer[nd + 1 + e, m, 0, f], transfer[nd + 1 + e, m, 1, f])
            for j in range(ns):
                motion = 0.0j if e == 1 else answers[j, ns + e]
                if e == 0 and j == ns - 1:
                    motion -= air.turn / (1.0 + 1j * omega[f] * air.turn_s)
                for i in range(ns):
                    at_ends = (work.at_ends[i] if e == 1 else 0.0) - answers[i, ns + e]
                    motion += answers[j, ns + DRIVING + i] * at_ends / span
                for k in range(ns):
                    shared = variance * caused[k] * motion.conjugate()
                    g[k * nd + j] += shared.real
                    driven[k, 0, f] += plant.derivatives[k, j] * shared.real
                    driven[k, 1, f] += plant.derivatives[k, j] * shared.imag
        for k in range(ns):
            for m in range(ns):
                variance = power * noise[ns + 1 + m]
                w = complex(weights[k, m, 0, f], weights[k, m, 1, f])
                for j in range(ns):
                    bias[k * nd + j] += variance * (w * answers[j, ns + DRIVING + m].conjugate()).real
