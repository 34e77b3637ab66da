"""What noise and air put into regressors and residual of a Fourier block alike; compiled.

Sensors' noise is in both. Gusts, rolling air and moments that nobody measures drive the states, so they are in both.
Derivation and equation numbers: ``docs/methods/fourier.md`` section 3. Memory is that of ``noise``.
"""

from wingwatch.estimators.fourier.noise import DRIVING, channel_variance, weighted_column
from wingwatch.estimators.fourier.state import BETWEEN, GUST, ROLLING
from wingwatch.estimators.kernels.hot import lean

__all__ = ["expected_products", "noise_power"]


@lean
def noise_power(omega, plant, air, noise, power, work, n_noise):  # type: ignore[no-untyped-def]
    """Power of noise in the regressors, as ``work.weights`` weigh it, in present derivatives, (docs (13)).

    That of sensors, and in each moment equation the motion that the moment left out of it causes; to the other
    equations that motion is as good as any.

    Args:
        n_noise: becomes what of R' W R is noise, (p, p).
    """
    ns, nd = plant.derivatives.shape
    n_noise[:, :] = 0.0
    for c in range(nd):
        variance = power * channel_variance(noise, c if c < ns else c + 1, ns)
        if c == 0:
            variance += power * noise[BETWEEN]
        for k in range(ns):
            for m in range(ns):
                n_noise[k * nd + c, m * nd + c] = variance * work.sums[k, m]
    if work.weights.shape[0] > ns and air.turn != 0.0:
        _noise_of_turn_rate(omega, plant, air, noise, power, work, n_noise)
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
def expected_products(omega, plant, noise, power, span, work, g, bias):  # type: ignore[no-untyped-def]
    """Expected products of regressors and weighted residual, in present derivatives, (docs (12) to (15)).

    Sensors' noise is in regressors and residual. The gust drives the states, by (s - A)^-1, and so is in both, too. So
    is what moment equations leave out; of that neither time history nor loop is known.

    Args:
        span: length of the block, s.
        work: ``NoiseWorkspace``, after ``driven_motions`` and ``roll_shared_at_ends``.
        g: becomes what of R' W r is due to sensors and air, (p,).
        bias: becomes what of it is due to what moment equations leave out, (p,).
    """
    ns, nd = plant.derivatives.shape
    g[:] = 0.0
    bias[:] = 0.0
    for c in range(nd):
        column = c if c < ns else c + 1
        variance = power * channel_variance(noise, column, ns)
        if variance == 0.0:
            continue
        weighted_column(work, column)
        for k in range(ns):
            total = 0.0
            for f in range(omega.size):
                total += work.weighted[k, 0, f]
            g[k * nd + c] = variance * total
    variance = power * noise[BETWEEN]
    weighted_column(work, nd + 3)
    for k in range(ns):
        for f in range(omega.size):
            g[k * nd] -= variance * work.weighted[k, 0, f]
    _driven_states(omega, plant, noise, power, span, work, g, bias)


@lean
def _noise_of_turn_rate(omega, plant, air, noise, power, work, n_noise):  # type: ignore[no-untyped-def]
    """What the turn rate that is taken from the kinematic row adds to the noise in its rate, (docs (13)).

    The rate relative to the air is taken as q + a H r_kin; its error is n_q + a H (L n)_kin + a (1 - H) d, and the
    errors of reading the velocity at both ends.
    """
    ns, nd = plant.derivatives.shape
    gust = power * noise[GUST]
    rate = ns - 1
    for f in range(omega.size):
        turn = air.turn / (1.0 + 1j * omega[f] * air.turn_s)
        part = turn * work.believed[f]
        own = gust * abs(turn * (1.0 - work.believed[f])) ** 2 + 2.0 * noise[0] * abs(part) ** 2
        for j in range(ns + 1):
            variance = power * noise[j]
            transferred = part * complex(work.transfer[j, ns, 0, f], work.transfer[j, ns, 1, f])
            if j == rate:
                own += variance * (abs(1.0 + transferred) ** 2 - 1.0)
                continue
            own += variance * abs(transferred) ** 2
            if j == ns:
                continue
            for k in range(ns):
                for m in range(ns):
                    w = complex(work.weights[k, m, 0, f], work.weights[k, m, 1, f])
                    cross = variance * (w * transferred).real
                    n_noise[k * nd + j, m * nd + rate] += cross
                    n_noise[m * nd + rate, k * nd + j] += cross
        for k in range(ns):
            for m in range(ns):
                n_noise[k * nd + rate, m * nd + rate] += own * work.weights[k, m, 0, f]


@lean
def _driven_states(omega, plant, noise, power, span, work, g, bias):  # type: ignore[no-untyped-def]
    """What ``expected_products`` has of all that drives the states, (docs (14), (14c), (15)).

    Motion by the gust is in the regressors. Motion by rolling air has been taken out of them, but for what of it is in
    the readings at the block's ends.
    """
    ns, nd = plant.derivatives.shape
    weights, transfer = work.weights, work.transfer
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
            for j in range(ns):
                motion = answers[j, ns] if e == 0 else 0.0j
                for i in range(ns):
                    at_ends = (work.at_ends[i] if e == 1 else 0.0) - answers[i, ns + e]
                    motion += answers[j, ns + DRIVING + i] * at_ends / span
                for k in range(ns):
                    cause = 0.0j
                    for m in range(rows):
                        w = complex(weights[k, m, 0, f], weights[k, m, 1, f])
                        cause += w * complex(transfer[nd + 1 + e, m, 0, f], transfer[nd + 1 + e, m, 1, f])
                    g[k * nd + j] += variance * (cause * motion.conjugate()).real
        for k in range(ns):
            for m in range(ns):
                variance = power * noise[ns + 1 + m]
                w = complex(weights[k, m, 0, f], weights[k, m, 1, f])
                for j in range(ns):
                    bias[k * nd + j] += variance * (w * answers[j, ns + DRIVING + m].conjugate()).real
