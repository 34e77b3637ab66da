"""Normal equations of one block of the recursive Fourier estimator, compiled, and the noise that its residual shows.

Derivation and symbols: ``docs/estimators.md`` sections 3 to 7.
"""

import numpy as np
from numba import njit

__all__ = ["block_equations", "noise_update"]

NOTHING = 1e-20
"""Power of a trim column, relative to that of a ramp of one a second, below which it is rounding."""


@njit(cache=True)
def _weight(covariance, out):  # type: ignore[no-untyped-def]
    """Inverse of a small Hermitian matrix into ``out`` (2 x 2 by hand, else general)."""
    if covariance.shape[0] == 2:
        a, d, b = covariance[0, 0].real, covariance[1, 1].real, covariance[0, 1]
        determinant = a * d - (b.real * b.real + b.imag * b.imag)
        out[0, 0] = d / determinant
        out[1, 1] = a / determinant
        out[0, 1] = -b / determinant
        out[1, 0] = -np.conj(b) / determinant
    else:
        out[:] = np.linalg.inv(covariance)


@njit(cache=True)
def _bin(  # type: ignore[no-untyped-def]
    f, omega, bank, decay, start, end, theta, scale, noise, power, forward, lever, by_accelerometer, ns, nu,
    regressors, response, transfer, weight,
):  # fmt: skip
    """Regressors, response, noise transfer L and weight of one frequency.

    The equation error of row k is sum_j L[k, j] n_j plus the equation's own noise, n the noise of the measured
    states, of the accelerometer and of the inputs. Differentiation adds the noise of both end points (2 D, flat).
    """
    s = 1j * omega[f]
    nc = ns + nu + 3
    for j in range(ns):
        regressors[j] = bank[f, j]
    for j in range(nc - ns):
        regressors[ns + j] = bank[f, ns + 1 + j]
    transfer[:] = 0.0
    for k in range(ns):
        for j in range(ns + nu):
            column = j if j < ns else j + 1
            transfer[k, column] = -theta[k * (ns + nu) + j] * scale[k * (ns + nu) + j]
        if k > 0 or not by_accelerometer:
            transfer[k, k] += s
            response[k] = s * bank[f, k] + end[1 + k] - decay[f] * start[1 + k]
    if by_accelerometer:
        response[0] = bank[f, ns]
        transfer[0, ns] = 1.0
        for j in range(1, ns):
            if lever[j] != 0.0:
                response[0] += lever[j] * (s * bank[f, j] + end[1 + j] - decay[f] * start[1 + j])
                transfer[0, j] += lever[j] * s
    else:
        response[0] -= bank[f, ns]
        for j in range(1, ns):
            transfer[0, j] -= forward[j]
    covariance = np.zeros((ns, ns), dtype=np.complex128)
    for k in range(ns):
        for m in range(ns):
            total = 0.0 + 0.0j
            for j in range(ns + 1):
                total += transfer[k, j] * noise[j] * np.conj(transfer[m, j])
            for j in range(ns + 1, ns + 1 + nu):
                total += transfer[k, j] * noise[ns + j] * np.conj(transfer[m, j])
            covariance[k, m] = power * total
        covariance[k, k] += power * noise[ns + 1 + k]
        if k > 0 or not by_accelerometer:
            covariance[k, k] += 2.0 * noise[k]
    _weight(covariance, weight)


@njit(cache=True)
def _driven(f, omega, theta, scale, forward, ns, nu, out):  # type: ignore[no-untyped-def]
    """(j omega I - A)^-1: how the states answer to the equations' own noise, which so enters the regressors."""
    matrix = np.zeros((ns, ns), dtype=np.complex128)
    for k in range(ns):
        for j in range(ns):
            matrix[k, j] = -theta[k * (ns + nu) + j] * scale[k * (ns + nu) + j]
        matrix[k, k] += 1j * omega[f]
    for j in range(ns):
        matrix[0, j] -= forward[j]
    if ns == 2:
        _inverse_2(matrix, out)
    else:
        out[:] = np.linalg.inv(matrix)


@njit(cache=True)
def _inverse_2(matrix, out):  # type: ignore[no-untyped-def]
    determinant = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
    out[0, 0] = matrix[1, 1] / determinant
    out[1, 1] = matrix[0, 0] / determinant
    out[0, 1] = -matrix[0, 1] / determinant
    out[1, 0] = -matrix[1, 0] / determinant


@njit(cache=True)
def block_equations(  # type: ignore[no-untyped-def]
    omega, bank, decay, start, end, theta, scale, noise, power, forward, lever, by_accelerometer, ns, nu
):
    """Normal equations of one block at ``theta``, with the nuisance columns eliminated.

    Returns:
        M (p, p), N (p, p) its part due to noise in the regressors, score (p,) = b - g - M theta, the nuisance
        values (ns, 3) that belong to theta and how they follow it (3 ns, p), and the part of the score that is
        expected because the equations' own noise (gusts) drives the states, (p,); all in referred derivatives
        (``scale`` applied). Last, how many equally weighted bins would be worth as many degrees of freedom as the
        weights leave (of the equation that they leave fewest, Satterthwaite 1946).
    """
    nc, nd = ns + nu + 3, ns + nu
    full = ns * nc
    m_full = np.zeros((full, full))
    b_full = np.zeros(full)
    n_noise = np.zeros((ns * nd, ns * nd))
    g = np.zeros(ns * nd)
    driven = np.zeros(ns * nd)
    weights = np.zeros((2, ns))
    regressors = np.zeros(nc, dtype=np.complex128)
    response = np.zeros(ns, dtype=np.complex128)
    transfer = np.zeros((ns, ns + 1 + nu), dtype=np.complex128)
    weight = np.zeros((ns, ns), dtype=np.complex128)
    response_to = np.zeros((ns, ns), dtype=np.complex128)
    for f in range(omega.size):
        _bin(f, omega, bank, decay, start, end, theta, scale, noise, power, forward, lever, by_accelerometer,
             ns, nu, regressors, response, transfer, weight)  # fmt: skip
        _driven(f, omega, theta, scale, forward, ns, nu, response_to)
        for k in range(ns):
            weights[0, k] += weight[k, k].real
            weights[1, k] += weight[k, k].real ** 2
            wy = 0.0 + 0.0j
            for m in range(ns):
                wy += weight[k, m] * response[m]
                w = weight[k, m]
                for c in range(nc):
                    left = np.conj(regressors[c]) * w
                    for d in range(nc):
                        m_full[k * nc + c, m * nc + d] += (left * regressors[d]).real
                for j in range(nd):
                    level = noise[j] if j < ns else noise[ns + j + 1]
                    n_noise[k * nd + j, m * nd + j] += w.real * power * level
            for c in range(nc):
                b_full[k * nc + c] += (np.conj(regressors[c]) * wy).real
            for j in range(nd):
                crossed = 0.0 + 0.0j
                for m in range(ns):
                    crossed += weight[k, m] * transfer[m, j if j < ns else j + 1]
                level = noise[j] if j < ns else noise[ns + j + 1]
                g[k * nd + j] += power * level * crossed.real
            for j in range(ns):
                crossed = 0.0 + 0.0j
                for m in range(ns):
                    crossed += weight[k, m] * noise[ns + 1 + m] * np.conj(response_to[j, m])
                driven[k * nd + j] += power * crossed.real
    m, n_noise, score, nuisance, follow = _eliminate(
        m_full, b_full, n_noise, g, theta, scale, end[0] - start[0], ns, nc
    )
    bins = np.min(weights[0] ** 2 / weights[1])
    return m, n_noise, score, nuisance, follow, driven * scale, bins


@njit(cache=True)
def _eliminate(m_full, b_full, n_noise, g, theta, scale, span, ns, nc):  # type: ignore[no-untyped-def]
    """Schur complement on the nuisance columns; result in referred derivatives.

    Over a whole number of periods a constant has no transform: what rounding leaves of it is no column.
    """
    nd = nc - 3
    p, q = ns * nd, ns * 3
    wanted = np.empty(p, dtype=np.int64)
    other = np.empty(q, dtype=np.int64)
    for k in range(ns):
        for c in range(nd):
            wanted[k * nd + c] = k * nc + c
        for c in range(3):
            other[k * 3 + c] = k * nc + nd + c
    mcc = np.empty((q, q))
    mpc = np.empty((p, q))
    m = np.empty((p, p))
    for a in range(q):
        for b in range(q):
            mcc[a, b] = m_full[other[a], other[b]]
    for a in range(p):
        for b in range(q):
            mpc[a, b] = m_full[wanted[a], other[b]]
        for b in range(p):
            m[a, b] = m_full[wanted[a], wanted[b]]
    size = np.empty(q)
    for a in range(q):
        ramp = mcc[a - a % 3 + 2, a - a % 3 + 2] / (span * span)
        size[a] = np.sqrt(mcc[a, a]) if mcc[a, a] > NOTHING * ramp else np.inf
    for a in range(q):
        for b in range(q):
            mcc[a, b] /= size[a] * size[b]
        mcc[a, a] += 1e-10
        mpc[:, a] /= size[a]
    rest = b_full[other] / size - mpc.T @ (theta * scale)
    solved = np.linalg.solve(mcc, np.concatenate((mpc.T, rest.reshape(q, 1)), axis=1))
    nuisance = solved[:, p]
    score = b_full[wanted] - g - m @ (theta * scale) - mpc @ nuisance
    m = m - mpc @ np.ascontiguousarray(solved[:, :p])
    for a in range(p):
        score[a] *= scale[a]
        for b in range(p):
            m[a, b] *= scale[a] * scale[b]
            n_noise[a, b] *= scale[a] * scale[b]
    follow = np.empty((q, p))
    for a in range(q):
        for b in range(p):
            follow[a, b] = -solved[a, b] / size[a] * scale[b]
    return m, n_noise, score, (nuisance / size).reshape(ns, 3), follow


@njit(cache=True)
def noise_update(  # type: ignore[no-untyped-def]
    omega,
    bank,
    decay,
    start,
    end,
    theta,
    scale,
    nuisance,
    noise,
    power,
    forward,
    lever,
    by_accelerometer,
    ns,
    nu,
):
    """One fixed-point step to the likeliest noise variances, from the residual of one block.

    A component's power expected from the residual over the share of it that the residual determines (the fixed
    point of expectation-maximisation, reached in far fewer steps). Components: measured states, accelerometer,
    then the equations' own noise. Returns the new variances, at most ten times larger or smaller.
    """
    nc, nd = ns + nu + 3, ns + nu
    regressors = np.zeros(nc, dtype=np.complex128)
    response = np.zeros(ns, dtype=np.complex128)
    transfer = np.zeros((ns, ns + 1 + nu), dtype=np.complex128)
    weight = np.zeros((ns, ns), dtype=np.complex128)
    total = np.zeros(noise.size)
    determined = np.zeros(noise.size)
    freedom = omega.size / max(omega.size - 0.5 * nc, 0.25 * omega.size)
    whitened = np.zeros(ns, dtype=np.complex128)
    for f in range(omega.size):
        _bin(f, omega, bank, decay, start, end, theta, scale, noise, power, forward, lever, by_accelerometer,
             ns, nu, regressors, response, transfer, weight)  # fmt: skip
        for k in range(ns):
            for c in range(nd):
                response[k] -= theta[k * nd + c] * scale[k * nd + c] * regressors[c]
            for c in range(3):
                response[k] -= nuisance[k, c] * regressors[nd + c]
        for k in range(ns):
            whitened[k] = 0.0
            for m in range(ns):
                whitened[k] += weight[k, m] * response[m]
        for j in range(ns + 1):
            part = 0.0 + 0.0j
            spread = 0.0
            for k in range(ns):
                part += np.conj(transfer[k, j]) * whitened[k]
                for m in range(ns):
                    spread += (np.conj(transfer[k, j]) * weight[k, m] * transfer[m, j]).real
            estimate = noise[j] * part
            total[j] += freedom * power * (estimate.real**2 + estimate.imag**2)
            determined[j] += power * noise[j] * spread
        for k in range(ns):
            estimate = noise[ns + 1 + k] * whitened[k]
            total[ns + 1 + k] += freedom * power * (estimate.real**2 + estimate.imag**2)
            determined[ns + 1 + k] += power * noise[ns + 1 + k] * weight[k, k].real
    for j in range(noise.size):
        if determined[j] > 1e-12:
            total[j] = min(max(total[j] / determined[j], 0.1 * noise[j]), 10.0 * noise[j])
        else:
            total[j] = noise[j]
    return total
