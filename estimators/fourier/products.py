"""What drives the states of a Fourier block is in its regressors and in its residual; compiled.

That are gusts, rolling air and moments that nobody measures. Noise of the sensors: ``regressor_errors``.
Derivation and equation numbers: ``docs/methods/fourier.md`` section 3. Memory is that of ``noise``.
"""

from wingwatch.estimators.fourier.noise import DRIVING
from wingwatch.estimators.fourier.state import GUST, ROLLING
from wingwatch.kernels.decorators import lean

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
    for e in range(ns):
        variance, weight = power * noise[ns + 1 + e], work.weights[e, e, 0]
        if variance == 0.0:
            continue
        for j in range(ns):
            a, b = work.answers[j, ns + DRIVING + e, 0], work.answers[j, ns + DRIVING + e, 1]
            for c in range(j, ns):
                u, v = work.answers[c, ns + DRIVING + e, 0], work.answers[c, ns + DRIVING + e, 1]
                total = 0.0
                for f in range(omega.size):
                    total += weight[f] * (a[f] * u[f] + b[f] * v[f])
                n_noise[e * nd + j, e * nd + c] = n_noise[e * nd + c, e * nd + j] = variance * total


@lean
def expected_products(omega, plant, air, noise, power, span, work, equation):  # type: ignore[no-untyped-def]
    """Expected products of regressors and weighted residual, in present derivatives, (docs (14), (15), (15a)).

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
    bias = equation.bias
    weights, answers = work.weights, work.answers
    bias[:] = 0.0
    work.driven[:, :, :] = 0.0
    rolled, weight, a, b = 0.0, weights[1, 1, 0], answers[1, ns + 1, 0], answers[1, ns + 1, 1]
    for f in range(omega.size):
        rolled += weight[f] * (a[f] * a[f] + b[f] * b[f])
    work.rolled[0] = power * noise[ROLLING] * rolled
    for e in range(DRIVING):
        variance = power * noise[GUST + e]
        if variance == 0.0:
            continue
        _weighted_air(nd + 1 + e, work)
        for j in range(ns):
            _motion_by_air(omega, air, span, e, j, work)
            for k in range(ns):
                _add_shared(variance, plant, k, j, work, equation.expected)
    for k in range(ns):
        for m in range(ns):
            variance, x, y = power * noise[ns + 1 + m], weights[k, m, 0], weights[k, m, 1]
            for j in range(ns):
                a, b = answers[j, ns + DRIVING + m, 0], answers[j, ns + DRIVING + m, 1]
                total = 0.0
                for f in range(omega.size):
                    total += x[f] * a[f] + y[f] * b[f]
                bias[k * nd + j] += variance * total


@lean
def _weighted_air(source, work):  # type: ignore[no-untyped-def]
    """Into ``work.caused`` W times one column of the transfer, of every equation."""
    weights, drive, caused = work.weights, work.transfer[source], work.caused
    for k in range(caused.shape[0]):
        real, imaginary = caused[k, 0], caused[k, 1]
        for f in range(real.size):
            real[f] = imaginary[f] = 0.0
        for m in range(weights.shape[0]):
            a, b, x, y = weights[k, m, 0], weights[k, m, 1], drive[m, 0], drive[m, 1]
            for f in range(real.size):
                real[f] += a[f] * x[f] - b[f] * y[f]
                imaginary[f] += a[f] * y[f] + b[f] * x[f]


@lean
def _motion_by_air(omega, air, span, e, j, work):  # type: ignore[no-untyped-def]
    """Into ``work.common`` what one motion e of the air does to the transform of state j, the block's ends included."""
    answers, real, imaginary = work.answers, work.common[0], work.common[1]
    ns = work.doubt.shape[1]
    a, b = answers[j, ns + e, 0], answers[j, ns + e, 1]
    own = 0.0 if e == 1 else 1.0  # of rolling air it has been taken out of the regressors
    for f in range(omega.size):
        real[f], imaginary[f] = own * a[f], own * b[f]
    if e == 0 and j == ns - 1 and air.turn != 0.0:
        for f in range(omega.size):
            late = omega[f] * air.turn_s
            turn = air.turn / (1.0 + late * late)
            real[f] -= turn
            imaginary[f] += turn * late
    for i in range(ns):
        at_end = work.at_ends[i] if e == 1 else 0.0
        a, b = answers[j, ns + DRIVING + i, 0], answers[j, ns + DRIVING + i, 1]
        u, v = answers[i, ns + e, 0], answers[i, ns + e, 1]
        for f in range(omega.size):
            x = at_end - u[f]
            real[f] += (a[f] * x + b[f] * v[f]) / span
            imaginary[f] += (b[f] * x - a[f] * v[f]) / span


@lean
def _add_shared(variance, plant, k, j, work, expected):  # type: ignore[no-untyped-def]
    """What the air in the residual of equation k has in common with the motion of state j in ``work.common``."""
    real, imaginary, derivative = work.driven[k, 0], work.driven[k, 1], plant.derivatives[k, j]
    a, b, x, y = work.caused[k, 0], work.caused[k, 1], work.common[0], work.common[1]
    total = 0.0
    for f in range(real.size):
        shared = variance * (a[f] * x[f] + b[f] * y[f])
        total += shared
        real[f] += derivative * shared
        imaginary[f] += derivative * variance * (b[f] * x[f] - a[f] * y[f])
    expected[k * plant.derivatives.shape[1] + j] += total
