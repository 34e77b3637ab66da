"""Normal equations of one block of the recursive Fourier estimator, compiled, and the noise that its residual shows.

Derivation and symbols: ``docs/estimators.md`` sections 3 to 7. Real and imaginary parts lie apart and frequencies side
by side, (..., 2, frequencies), so that the processor takes several bins at once. All memory is the caller's.
"""

import numpy as np

from wingwatch.estimators.fourier_bank import NUISANCE
from wingwatch.estimators.fourier_between import rate_of
from wingwatch.estimators.fourier_weights import channel_level
from wingwatch.estimators.hot import hot, lean
from wingwatch.estimators.symmetric import backward, cholesky, forward

__all__ = ["block_equations", "eliminate", "noise_update", "nuisance_of", "residual_of", "responses"]

NO_COLUMN = 1e20
"""What is known beforehand of a column that an equation does not have: it is zero."""

NOTHING = 1e-20
"""Power of a trim column, relative to that of a ramp of one a second, below which it is rounding."""

RIDGE = 1e-10
"""Added to the nuisance columns' power, each of unit power, before they are eliminated."""


@lean
def responses(omega, bank, phase, start, end, lever, by_accelerometer, ns, response):  # type: ignore[no-untyped-def]
    """What each equation has on its left side, (ns, 2, frequencies): exact transforms of rates, or the accelerometer.

    Args:
        bank: (channels, 2, frequencies) as ``between_samples`` gives it; phase: e^{s T}, (2, frequencies).
    """
    for k in range(ns):
        rate_of(omega, bank[k], phase, start[1 + k], end[1 + k], response[k])
    for part in range(2):
        force, first = bank[ns, part], response[0, part]
        if by_accelerometer:
            for f in range(omega.size):
                first[f] = force[f]
            for j in range(1, ns):
                rate, arm = response[j, part], lever[j]
                for f in range(omega.size):
                    first[f] += arm * rate[f]
        else:
            for f in range(omega.size):
                first[f] -= force[f]


@hot
def _sums_2(x, y, u, v, weights):  # type: ignore[no-untyped-def]
    """Sums over bins of Re P Re W and Im P Im W, P = (x + jy)' (u + jv), pair by pair of two equations."""
    aa, bb = weights[0, 0, 0], weights[1, 1, 0]
    ab, ab_odd = weights[0, 1, 0], weights[0, 1, 1]
    s_aa = s_bb = s_ab = o_ab = 0.0
    for f in range(x.size):
        real = x[f] * u[f] + y[f] * v[f]
        s_aa += real * aa[f]
        s_ab += real * ab[f]
        o_ab += (x[f] * v[f] - y[f] * u[f]) * ab_odd[f]
        s_bb += real * bb[f]
    return (s_aa, s_ab, s_bb, 0.0, 0.0, 0.0), (0.0, o_ab, 0.0, 0.0, 0.0, 0.0)


@hot
def _sums_3(x, y, u, v, weights):  # type: ignore[no-untyped-def]
    """The same for three equations."""
    aa, bb, cc = weights[0, 0, 0], weights[1, 1, 0], weights[2, 2, 0]
    ab, ac, bc = weights[0, 1, 0], weights[0, 2, 0], weights[1, 2, 0]
    ab_odd, ac_odd, bc_odd = weights[0, 1, 1], weights[0, 2, 1], weights[1, 2, 1]
    s_aa = s_bb = s_cc = s_ab = s_ac = s_bc = o_ab = o_ac = o_bc = 0.0
    for f in range(x.size):
        real = x[f] * u[f] + y[f] * v[f]
        imaginary = x[f] * v[f] - y[f] * u[f]
        s_aa += real * aa[f]
        s_bb += real * bb[f]
        s_cc += real * cc[f]
        s_ab += real * ab[f]
        s_ac += real * ac[f]
        s_bc += real * bc[f]
        o_ab += imaginary * ab_odd[f]
        o_ac += imaginary * ac_odd[f]
        o_bc += imaginary * bc_odd[f]
    return (s_aa, s_ab, s_ac, s_bb, s_bc, s_cc), (0.0, o_ab, o_ac, 0.0, o_bc, 0.0)


@lean
def _normal_matrix(bank, weights, ns, nc, m_full):  # type: ignore[no-untyped-def]
    """M of all columns, the wanted ones of every equation first, then the nuisance ones of every equation."""
    nd = nc - NUISANCE
    for c in range(nc):
        x, y = bank[c if c < ns else c + 1, 0], bank[c if c < ns else c + 1, 1]
        for d in range(c, nc):
            u, v = bank[d if d < ns else d + 1, 0], bank[d if d < ns else d + 1, 1]
            if ns == 2:
                evens, odds = _sums_2(x, y, u, v, weights)
            else:
                evens, odds = _sums_3(x, y, u, v, weights)
            pair = 0
            for k in range(ns):
                kc = k * nd + c if c < nd else ns * nd + NUISANCE * k + c - nd
                kd = k * nd + d if d < nd else ns * nd + NUISANCE * k + d - nd
                for m in range(k, ns):
                    mc = m * nd + c if c < nd else ns * nd + NUISANCE * m + c - nd
                    md = m * nd + d if d < nd else ns * nd + NUISANCE * m + d - nd
                    even, odd = evens[pair], odds[pair]
                    m_full[kc, md] = m_full[md, kc] = even - odd
                    m_full[kd, mc] = m_full[mc, kd] = even + odd
                    pair += 1


@lean
def _right_side(bank, weights, response, ns, nc, product, b_full):  # type: ignore[no-untyped-def]
    """b = sum Re(R' W y), ordered as ``_normal_matrix``."""
    nf = bank.shape[2]
    nd = nc - NUISANCE
    for k in range(ns):
        product[:, :] = 0.0
        _add_weighted(weights[k], response, product)
        real, imaginary = product[0], product[1]
        for c in range(nc):
            x, y = bank[c if c < ns else c + 1, 0], bank[c if c < ns else c + 1, 1]
            total = 0.0
            for f in range(nf):
                total += x[f] * real[f] + y[f] * imaginary[f]
            b_full[k * nd + c if c < nd else ns * nd + NUISANCE * k + c - nd] = total


@lean
def _add_weighted(weights, values, out):  # type: ignore[no-untyped-def]
    """out += sum over m of weights[m] values[m], all complex: (ns, 2, frequencies) twice, (2, frequencies)."""
    real, imaginary = out[0], out[1]
    for m in range(values.shape[0]):
        a, b, x, y = weights[m, 0], weights[m, 1], values[m, 0], values[m, 1]
        for f in range(real.size):
            real[f] += a[f] * x[f] - b[f] * y[f]
            imaginary[f] += a[f] * y[f] + b[f] * x[f]


@lean
def _driven(  # type: ignore[no-untyped-def]
    omega, theta, scale, forward_speed, noise, power, weights, ns, nu, product, matrix, driven
):
    """E[R' W e]: the equations' own noise drives the states through S^-1 = (s - A)^-1 and so enters the regressors.

    adj(s - A) is a polynomial: s - tr A + A for two states, s^2 + s (A - tr A) + adj A for three, so S^-1 needs no
    inverse but that of the characteristic polynomial.
    """
    nd = ns + nu
    trace = 0.0
    for k in range(ns):
        for j in range(ns):
            matrix[k, j] = theta[k * nd + j] * scale[k * nd + j]
            if k == 0:
                matrix[k, j] += forward_speed[j]
        trace += matrix[k, k]
    real, imaginary = product[0], product[1]
    if ns == 2:
        last = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
        for f in range(omega.size):
            x, y = last - omega[f] * omega[f], -trace * omega[f]
            size = 1.0 / (x * x + y * y)
            real[f], imaginary[f] = x * size, y * size
    else:
        middle, last = 0.0, 0.0
        for k in range(3):
            a, b = (k + 1) % 3, (k + 2) % 3
            middle += matrix[a, a] * matrix[b, b] - matrix[a, b] * matrix[b, a]
            last += matrix[0, k] * (matrix[1, a] * matrix[2, b] - matrix[1, b] * matrix[2, a])
        for f in range(omega.size):
            square = omega[f] * omega[f]
            x, y = trace * square - last, omega[f] * (middle - square)
            size = 1.0 / (x * x + y * y)
            real[f], imaginary[f] = x * size, y * size
    for k in range(ns):
        for m in range(ns):
            a, b = weights[k, m, 0], weights[k, m, 1]
            flat = turning = rising = 0.0
            for f in range(omega.size):
                # W / conj(characteristic polynomial); the conjugate of 1 / polynomial is (real, imaginary) here.
                x, y = a[f] * real[f] - b[f] * imaginary[f], a[f] * imaginary[f] + b[f] * real[f]
                flat += x
                turning += omega[f] * y
                rising += omega[f] * omega[f] * x
            level = power * noise[ns + 1 + m]
            for j in range(ns):
                shifted = matrix[j, m] - (trace if j == m else 0.0)
                if ns == 2:
                    part = shifted * flat + (turning if j == m else 0.0)
                else:
                    part = _adjugate(matrix, j, m) * flat + shifted * turning - (rising if j == m else 0.0)
                driven[k * nd + j] += level * part * scale[k * nd + j]


@lean
def _adjugate(matrix, j, m):  # type: ignore[no-untyped-def]
    """Element (j, m) of the adjugate of a 3 x 3 matrix."""
    a, b, c, d = (m + 1) % 3, (m + 2) % 3, (j + 1) % 3, (j + 2) % 3
    return matrix[a, c] * matrix[b, d] - matrix[a, d] * matrix[b, c]


@lean
def block_equations(  # type: ignore[no-untyped-def]
    omega, bank, response, theta, scale, noise, power, share, forward_speed, ns, nu, transfer, weights, moments, room,
    m_full, b_full, n_noise, g, driven,
):  # fmt: skip
    """Normal equations of one block at ``theta``, with the nuisance columns still in them.

    Args:
        omega ... nu: the block, ``share`` of a whole one (of its bins only as many are independent); bank as
            ``between_samples`` gives it, response of ``responses``.
        transfer, weights, moments: of ``bin_weights``.
        room: (2, frequencies) and (ns, ns).
        m_full, b_full: become sum Re(R' W R) and sum Re(R' W y), (ns (nd + NUISANCE),) squared, the columns of the
            derivatives first; in present derivatives.
        n_noise, g, driven: become N (p, p), what of M is due to noise in the regressors, the same of b (p,), and the
            part of the score that is expected because the equations' own noise (gusts) drives the states, (p,);
            ``n_noise`` and ``driven`` in referred derivatives (``scale`` applied), g in present ones.

    Returns:
        how many equally weighted bins would be worth as many degrees of freedom as the weights leave (of the equation
        that they leave fewest, Satterthwaite 1946).
    """
    nd = ns + nu
    product, matrix = room
    _normal_matrix(bank, weights, ns, nd + NUISANCE, m_full)
    _right_side(bank, weights, response, ns, nd + NUISANCE, product, b_full)
    for k in range(ns):
        for c in range(ns * nd + NUISANCE * k + 3, ns * nd + NUISANCE * (k + 1)):
            m_full[c, c] += 0.5 / (share * noise[k]) if transfer[1, k, k] == 1.0 else NO_COLUMN
    n_noise[:, :] = 0.0
    g[:] = 0.0
    driven[:] = 0.0
    for k in range(ns):
        for j in range(nd):
            column = j if j < ns else j + 1
            level = power * channel_level(noise, column, ns)
            for m in range(ns):
                a, b = k * nd + j, m * nd + j
                n_noise[a, b] = moments[0, k, m] * level * scale[a] * scale[b]
                g[a] += level * (
                    moments[0, k, m] * transfer[0, m, column] - moments[1, k, m] * transfer[1, m, column]
                )
    _driven(omega, theta, scale, forward_speed, noise, power, weights, ns, nu, product, matrix, driven)
    bins = np.inf
    for k in range(ns):
        total = 0.0
        weight = weights[k, k, 0]
        for f in range(omega.size):
            total += weight[f] * weight[f]
        bins = min(bins, moments[0, k, k] ** 2 / total)
    return bins


@lean
def eliminate(m_full, b_full, g, theta, scale, span, p, root, size, crossed, rest, m, score):  # type: ignore[no-untyped-def]
    """Schur complement on the nuisance columns, the last q of ``m_full``.

    Over a whole number of periods a constant has no transform: what rounding leaves of it is no column.

    Args:
        p: how many columns are wanted.
        root (q, q), size (q,): become the root of the nuisance columns' power, of unit diagonal, and their sizes.
        crossed (q, p): becomes root^-1 of their products with the wanted columns.
        rest (q, 1): becomes root^-1 of what they have to explain.
        m (p, p), score (p,): become M and b - g - M theta, in referred derivatives.
    """
    q = size.size
    for a in range(q):
        column = a % NUISANCE
        ramp = m_full[p + a - column + 2, p + a - column + 2] / (span * span)
        own = m_full[p + a, p + a]
        size[a] = np.sqrt(own) if column > 1 or own > NOTHING * ramp else np.inf
    for a in range(q):
        share = 1.0 / size[a]
        for b in range(a + 1):
            root[a, b] = m_full[p + a, p + b] * share / size[b]
        root[a, a] += RIDGE
        total = b_full[p + a]
        for b in range(p):
            total -= m_full[p + a, b] * theta[b] * scale[b]
            crossed[a, b] = m_full[p + a, b] * share
        rest[a, 0] = total * share
    cholesky(root, 1e-3 * RIDGE, root)
    forward(root, crossed)
    forward(root, rest)
    for a in range(p):
        total = b_full[a] - g[a]
        for b in range(p):
            total -= m_full[a, b] * theta[b] * scale[b]
            m[a, b] = m_full[a, b]
        for b in range(q):
            total -= crossed[b, a] * rest[b, 0]
            factor = crossed[b, a]
            for c in range(p):
                m[a, c] -= factor * crossed[b, c]
        score[a] = total * scale[a]
        for b in range(p):
            m[a, b] *= scale[a] * scale[b]


@lean
def nuisance_of(root, size, crossed, rest, change, scale, nuisance):  # type: ignore[no-untyped-def]
    """Nuisance values (q, 1) that belong to derivatives that differ by ``change`` (p,) from those of ``eliminate``."""
    for a in range(size.size):
        total = rest[a, 0]
        for b in range(change.size):
            total -= crossed[a, b] * scale[b] * change[b]
        nuisance[a, 0] = total
    backward(root, nuisance)
    for a in range(size.size):
        nuisance[a, 0] /= size[a]


@lean
def residual_of(bank, response, theta, scale, nuisance, ns, nu, weights, whitened):  # type: ignore[no-untyped-def]
    """The residual in the place of ``response``, and W times it into ``whitened``, both (ns, 2, frequencies).

    Returns:
        bins over the degrees of freedom that the columns leave of them.
    """
    nd, nf = ns + nu, bank.shape[2]
    nc = nd + NUISANCE
    for k in range(ns):
        real, imaginary = response[k, 0], response[k, 1]
        for c in range(nc):
            factor = theta[k * nd + c] * scale[k * nd + c] if c < nd else nuisance[NUISANCE * k + c - nd, 0]
            x, y = bank[c if c < ns else c + 1, 0], bank[c if c < ns else c + 1, 1]
            for f in range(nf):
                real[f] -= factor * x[f]
                imaginary[f] -= factor * y[f]
    for k in range(ns):
        whitened[k] = 0.0
        _add_weighted(weights[k], response, whitened[k])
    # What an equation fits, half a bin each: over whole periods its two ends are one column.
    return nf / max(nf - 0.5 * (nc - 1), 0.25 * nf)


@lean
def noise_update(  # type: ignore[no-untyped-def]
    omega,
    bank,
    response,
    theta,
    scale,
    nuisance,
    noise,
    power,
    ns,
    nu,
    transfer,
    weights,
    moments,
    room,
    total,
):
    """One fixed-point step to the likeliest noise variances, from the residual of one block.

    A component's power expected from the residual over the share of it that the residual determines (the fixed
    point of expectation-maximisation, reached in far fewer steps). Components: measured states, accelerometer,
    then the equations' own noise.

    Args:
        response: of the block, becomes the residual.
        transfer, weights, moments: of ``bin_weights`` at ``theta``.
        room: (ns, 2, frequencies) and (2, frequencies).
        total: becomes the new variances, at most ten times larger or smaller.
    """
    nf = omega.size
    whitened, product = room
    freedom = power * residual_of(bank, response, theta, scale, nuisance, ns, nu, weights, whitened)
    for j in range(noise.size):
        total[j] = noise[j]
    for j in range(2 * ns + 1):
        own = j - ns - 1
        found, spread = 0.0, 0.0
        if own >= 0:
            real, imaginary = whitened[own, 0], whitened[own, 1]
            spread = moments[0, own, own]
        else:
            real, imaginary = product[0], product[1]
            spread = _part_of(omega, transfer, whitened, moments, j, ns, product)
        for f in range(nf):
            found += real[f] * real[f] + imaginary[f] * imaginary[f]
        found *= freedom * noise[j] * noise[j]
        spread *= power * noise[j]
        if spread > 1e-12:
            total[j] = min(max(found / spread, 0.1 * noise[j]), 10.0 * noise[j])


@lean
def _part_of(omega, transfer, whitened, moments, j, ns, product):  # type: ignore[no-untyped-def]
    """L_j' r of a measured channel j into ``product`` (2, frequencies); returns sum Re(L_j' W L_j)."""
    real, imaginary = product[0], product[1]
    product[:, :] = 0.0
    spread = 0.0
    for k in range(ns):
        a, b = transfer[0, k, j], transfer[1, k, j]
        x, y = whitened[k, 0], whitened[k, 1]
        for f in range(omega.size):
            real[f] += a * x[f] + b * omega[f] * y[f]
            imaginary[f] += a * y[f] - b * omega[f] * x[f]
        for m in range(ns):
            c, d = transfer[0, m, j], transfer[1, m, j]
            spread += a * c * moments[0, k, m] - (a * d - b * c) * moments[1, k, m] + b * d * moments[2, k, m]
    return spread
