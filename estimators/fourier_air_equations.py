"""Noise of a block of the Fourier form where the air turns and rolls: no line in s any more, so bin by bin; compiled.

Derivation and symbols: ``docs/estimators.md`` sections 4 to 7; the counterpart in calm air is ``fourier_equations``.
All memory is the caller's.
"""

from wingwatch.estimators.fourier_air import AIR_LEVELS, heard_turning, turning_level
from wingwatch.estimators.fourier_equations import residual_of
from wingwatch.estimators.fourier_weights import channel_level, invert_weights
from wingwatch.estimators.hot import lean

__all__ = ["air_noise_update", "air_products", "air_weights"]


@lean
def _replaced(k, air, ns):  # type: ignore[no-untyped-def]
    """Whether the air's own motion stands for the noise of equation k: rolling, and in pitch turning."""
    return k == 1 and (ns == 3 or air[0] < 0.0)


@lean
def air_weights(  # type: ignore[no-untyped-def]
    omega, theta, scale, noise, power, forward_speed, lever, air, by_accelerometer, ns, nu, room, rates, weights,
    moments,
):  # fmt: skip
    """The noise transfer L of every bin, what of it the air has, and the weights W = Sigma^-1.

    Args:
        air: of ``fourier_air.air_of``.
        room: transfer (frequencies, ns, ns + 1 + nu + AIR_COLUMNS) and heard (frequencies, ns + 1), complex, and
            levels (frequencies, AIR_COLUMNS): become L, how the rate relative to the air hears the sensors, and the
            variances of the air's columns.
        rates: (ns, ns + 1 + nu), of which the diagonal becomes 1 where an equation has a derivative.
        weights: becomes W, (ns, ns, 2, frequencies); moments: its first matrix becomes the sum over bins of Re W.
    """
    transfer, heard, levels = room[0], room[1], room[2]
    nd, rolling, turning = ns + nu, noise.size - 2, noise.size - AIR_LEVELS
    for k in range(ns):
        rates[k, k] = 1.0 if k > 0 or not by_accelerometer else 0.0
    for f in range(omega.size):
        s = 1j * omega[f]
        share, answer = heard_turning(
            omega[f], noise, noise[turning], air, forward_speed, lever, ns, heard[f]
        )
        levels[f, 0] = noise[rolling]
        levels[f, 1] = noise[turning] * (1.0 - share) + noise[noise.size - 1]
        for k in range(ns):
            row = transfer[f, k]
            row[:] = 0.0
            for j in range(nd):
                if j != ns - 1:
                    row[j if j < ns else j + 1] = -theta[k * nd + j] * scale[k * nd + j]
            turned = -theta[k * nd + ns - 1] * scale[k * nd + ns - 1]
            for j in range(ns + 1):
                row[j] += turned * heard[f, j]
            if ns == 3:
                row[nd + 1] = -theta[k * nd + 1] * scale[k * nd + 1] / (1.0 + s * air[2])
            row[nd + 2] = turned * answer
            if k > 0 or not by_accelerometer:
                row[k] += s
        if by_accelerometer:
            transfer[f, 0, ns] += 1.0
            for j in range(1, ns):
                transfer[f, 0, j] += lever[j] * s
        else:
            for j in range(1, ns):
                transfer[f, 0, j] -= forward_speed[j]
        for k in range(ns):
            for m in range(k, ns):
                total = 0.0j
                for j in range(nd + 3):
                    level = channel_level(noise, j, ns) if j <= nd else levels[f, j - nd - 1]
                    total += level * transfer[f, k, j] * transfer[f, m, j].conjugate()
                total *= power
                if k == m and not _replaced(k, air, ns):
                    total += power * noise[ns + 1 + k]
                weights[k, m, 0, f], weights[k, m, 1, f] = total.real, total.imag
    invert_weights(weights)
    for k in range(ns):
        for m in range(ns):
            moments[0, k, m] = 0.0
            for f in range(omega.size):
                moments[0, k, m] += weights[k, m, 0, f]


@lean
def _heard_products(k, c, f, room, noise, ns):  # type: ignore[no-untyped-def]
    """Element (c, k) of C* D L: how much of the error of equation k is noise that regressor c hears, at bin f."""
    transfer, heard = room[0], room[1]
    if c != ns - 1:
        column = c if c < ns else c + 1
        return channel_level(noise, column, ns) * transfer[f, k, column]
    total = 0.0j
    for j in range(ns + 1):
        total += heard[f, j].conjugate() * channel_level(noise, j, ns) * transfer[f, k, j]
    return total


@lean
def _heard_twice(c, d, f, heard, noise, ns):  # type: ignore[no-untyped-def]
    """Element (c, d) of C* D C', C how the regressors hear the sensors."""
    last = ns - 1
    if c != last and d != last:
        return (channel_level(noise, c if c < ns else c + 1, ns) if c == d else 0.0) + 0.0j
    if c == last and d == last:
        total = 0.0j
        for j in range(ns + 1):
            total += heard[f, j].conjugate() * channel_level(noise, j, ns) * heard[f, j]
        return total
    if c == last:
        return heard[f, d].conjugate() * noise[d] if d < last else 0.0j
    return heard[f, c] * noise[c] if c < last else 0.0j


@lean
def air_products(  # type: ignore[no-untyped-def]
    omega, theta, scale, noise, power, forward_speed, air, ns, nu, room, weights, n_noise, g, driven
):
    """N, g and the driven part of ``block_equations`` where the air turns and rolls, in their places.

    What the air drives, E[R' W B n] with the states' answer S^-1 B n to it, S = s - A, is part of g: rolling in the
    lateral structure, in pitch the turning that is not in the regressor.
    """
    transfer, heard, levels, answers = room[0], room[1], room[2], room[3]
    nd = ns + nu
    unseen = 1 if air[0] < 0.0 else 0
    n_noise[:, :] = 0.0
    g[:] = 0.0
    driven[:] = 0.0
    for f in range(omega.size):
        for k in range(ns):
            for m in range(ns):
                w = complex(weights[k, m, 0, f], weights[k, m, 1, f])
                for c in range(nd):
                    g[k * nd + c] += power * (w * _heard_products(m, c, f, room, noise, ns)).real
                    for d in range(nd):
                        part = power * (w * _heard_twice(c, d, f, heard, noise, ns)).real
                        n_noise[k * nd + c, m * nd + d] += part * scale[k * nd + c] * scale[m * nd + d]
        # The columns of S^-1 of the air and of the equations' own noise, side by side.
        for k in range(ns):
            for j in range(ns):
                answers[k, j] = -theta[k * nd + j] * scale[k * nd + j] - (forward_speed[j] if k == 0 else 0.0)
                answers[k, ns + 1 + j] = 1.0 if k == j else 0.0
            answers[k, k] += 1j * omega[f]
            answers[k, ns] = transfer[f, k, nd + 1 + unseen]
        _eliminated(answers, ns)
        for k in range(ns):
            cause = 0.0j
            for m in range(ns):
                w = complex(weights[k, m, 0, f], weights[k, m, 1, f])
                cause += w * transfer[f, m, nd + 1 + unseen] * levels[f, unseen]
                if not _replaced(m, air, ns):
                    for j in range(ns):
                        part = (w * answers[j, ns + 1 + m].conjugate()).real
                        driven[k * nd + j] += power * noise[ns + 1 + m] * part * scale[k * nd + j]
            for j in range(ns):
                g[k * nd + j] += power * (cause * answers[j, ns].conjugate()).real


@lean
def _eliminated(rows, n):  # type: ignore[no-untyped-def]
    """Solve the complex system in the first n columns of ``rows`` for the others, in place.

    s - A has a pivot in every row: it is no eigenvalue of a part of A, none of which has no damping.
    """
    for a in range(n):
        share = 1.0 / rows[a, a]
        for c in range(rows.shape[1]):
            rows[a, c] *= share
        for b in range(n):
            if b != a:
                factor = rows[b, a]
                for c in range(rows.shape[1]):
                    rows[b, c] -= factor * rows[a, c]


@lean
def air_noise_update(  # type: ignore[no-untyped-def]
    omega, bank, response, theta, scale, nuisance, noise, power, forward_speed, lever, air, ns, nu, room, weights,
    moments, whitened, total,
):  # fmt: skip
    """``noise_update`` where the air turns and rolls; arguments as there and in ``air_weights``."""
    transfer = room[0]
    nd, nf = ns + nu, omega.size
    freedom = residual_of(bank, response, theta, scale, nuisance, ns, nu, weights, whitened) * power
    for j in range(noise.size):
        total[j] = noise[j]
    for j in range(ns + 3):
        column, own = (j, j) if j <= ns else (nd + j - ns, noise.size - AIR_LEVELS + j - ns)
        found, spread = 0.0, 0.0
        for f in range(nf):
            part = 0.0j
            for k in range(ns):
                left = transfer[f, k, column].conjugate()
                part += left * complex(whitened[k, 0, f], whitened[k, 1, f])
                for m in range(ns):
                    w = complex(weights[k, m, 0, f], weights[k, m, 1, f])
                    spread += (left * w * transfer[f, m, column]).real
            found += part.real * part.real + part.imag * part.imag
        _step(found * freedom, spread * power, own, noise, total)
    for k in range(ns):
        if _replaced(k, air, ns):
            continue
        found = 0.0
        for f in range(nf):
            found += whitened[k, 0, f] ** 2 + whitened[k, 1, f] ** 2
        _step(found * freedom, moments[0, k, k] * power, ns + 1 + k, noise, total)
    total[noise.size - AIR_LEVELS] = turning_level(
        omega, bank, noise, power, air, forward_speed, lever, ns, nu
    )


@lean
def _step(found, spread, j, noise, total):  # type: ignore[no-untyped-def]
    """New variance of component j, at most ten times larger or smaller."""
    found *= noise[j] * noise[j]
    spread *= noise[j]
    if spread > 1e-12:
        total[j] = min(max(found / spread, 0.1 * noise[j]), 10.0 * noise[j])
