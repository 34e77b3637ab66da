"""Compiled kernels of the recursive Fourier estimator: the bank, the normal equations of one block, their solution.

Derivation in ``docs/estimators.md``; symbols as there. Arrays lead with the vehicle axis; nothing here
allocates per sample.
"""

import numpy as np
from numba import njit

__all__ = ["advance_bank", "block_equations", "noise_edge", "noise_update", "reduce_information"]

LOWEST_NOISE = 0.5
"""A noise variance is not believed to be less than this share of the roughness (which signal, too, enlarges)."""


@njit(cache=True)
def _coefficients(omega, dt, exponential, linear_old, linear_new, held):  # type: ignore[no-untyped-def]
    """One-pole coefficients of a step: exact for a signal linear between samples, and for a held one."""
    for f in range(omega.size):
        s = 1j * omega[f]
        z = s * dt
        e = np.exp(z)
        whole = (e - 1.0) / s
        new = (e - 1.0 - z) / (s * s * dt)
        exponential[f], linear_new[f], linear_old[f], held[f] = e, new, whole - new, whole


@njit(cache=True)
def advance_bank(  # type: ignore[no-untyped-def]
    omega, bank, decay, step, coefficients, old, new, before, hold_always, elapsed, ns, nu, force
):
    """Advance the bank of one vehicle by one sample.

    Channels of ``bank`` (frequencies, channels): states, force, inputs, constant, dynamic pressure, ramp.
    An input is held between samples if its channel is a command, or where a position repeats exactly
    (a step of a held signal); else it is linear like the states.

    Args:
        decay: exp(j omega T) of the block so far, shape (frequencies,), advanced in place.
        step: shape (1,), time step that ``coefficients`` (4, frequencies) were made for.
        old, new: signal rows at the two ends of the step; before: the row before ``old`` (inputs only).
        elapsed: time since the block began, at ``old``.
    """
    dt = new[0] - old[0]
    e, c0, c1, h = coefficients[0], coefficients[1], coefficients[2], coefficients[3]
    if abs(dt - step[0]) > 1e-6 * dt:
        _coefficients(omega, dt, e, c0, c1, h)
        step[0] = dt
    ratio = 2 + ns + nu + 1
    first = ns + 1
    for f in range(omega.size):
        row = bank[f]
        ef, of, nf, hf = e[f], c0[f], c1[f], h[f]
        for j in range(ns):
            row[j] = ef * row[j] + of * old[1 + j] + nf * new[1 + j]
        row[ns] = ef * row[ns] + of * old[force] + nf * new[force]
        for j in range(nu):
            a, b = old[2 + ns + j], new[2 + ns + j]
            if hold_always[j] or a == before[2 + ns + j]:
                row[first + j] = ef * row[first + j] + hf * a
            else:
                row[first + j] = ef * row[first + j] + of * a + nf * b
        c = first + nu
        row[c] = ef * row[c] + hf
        row[c + 1] = ef * row[c + 1] + of * (old[ratio] - 1.0) + nf * (new[ratio] - 1.0)
        row[c + 2] = ef * row[c + 2] + of * elapsed + nf * (elapsed + dt)
        decay[f] *= ef


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
        (``scale`` applied).
    """
    nc, nd = ns + nu + 3, ns + nu
    full = ns * nc
    m_full = np.zeros((full, full))
    b_full = np.zeros(full)
    n_noise = np.zeros((ns * nd, ns * nd))
    g = np.zeros(ns * nd)
    driven = np.zeros(ns * nd)
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
    m, n_noise, score, nuisance, follow = _eliminate(m_full, b_full, n_noise, g, theta, scale, ns, nc)
    return m, n_noise, score, nuisance, follow, driven * scale


@njit(cache=True)
def _eliminate(m_full, b_full, n_noise, g, theta, scale, ns, nc):  # type: ignore[no-untyped-def]
    """Schur complement on the nuisance columns; result in referred derivatives."""
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
        size[a] = np.sqrt(mcc[a, a]) if mcc[a, a] > 0.0 else 1.0
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


@njit(cache=True)
def noise_edge(regressors, bins):  # type: ignore[no-untyped-def]
    """Share of "signal" that pure noise of a known level can show by chance.

    Of ``regressors`` channels of white noise over ``bins`` independent bins the largest eigenvalue tends to
    (1 + sqrt(regressors / bins))^2 times the true power (Marchenko and Pastur 1967).
    """
    if bins <= 0.0:
        return 1.0
    return 1.0 - 1.0 / (1.0 + np.sqrt(regressors / bins)) ** 2


@njit(cache=True)
def reduce_information(m, n_noise, suspected, score, driven, smallest):  # type: ignore[no-untyped-def]
    """Keep the directions in which the regressors' power is signal, not noise.

    The sensitivity of the estimating equation is M - N. In coordinates that whiten M its eigenvalues are
    the signal's share of the power (at most 1). A direction is kept if its share is at least ``smallest`` even were
    each state's noise ``suspected`` (ns,) times what is believed: all of the state's roughness.

    Returns:
        sensitivity (p, p), M, score and driven part restricted to the kept directions, and for the monitor the
        evidence: information (p, p), its score (p,) and the information times the bias that gusts cause (p,).
    """
    p = m.shape[0]
    size = np.empty(p)
    for a in range(p):
        size[a] = np.sqrt(m[a, a]) if m[a, a] > 0.0 else 1.0
    scaled = np.empty((p, p))
    for a in range(p):
        for b in range(p):
            scaled[a, b] = m[a, b] / (size[a] * size[b])
        scaled[a, a] += 1e-9
    lower = np.ascontiguousarray(np.linalg.cholesky(scaled))
    inner = np.empty((p, p))
    for a in range(p):
        for b in range(p):
            inner[a, b] = (m[a, b] - n_noise[a, b]) / (size[a] * size[b])
    half = np.linalg.solve(lower, inner)
    inner = np.linalg.solve(lower, np.ascontiguousarray(half.T))
    share, vectors = np.linalg.eigh(0.5 * (inner + inner.T))
    ns = suspected.size
    columns = p // ns
    worst = np.zeros((p, p))
    for k in range(ns):
        for m_row in range(ns):
            for j in range(columns):
                a, b = k * columns + j, m_row * columns + j
                level = suspected[j] if j < ns else 1.0
                worst[a, b] = level * n_noise[a, b] / (size[a] * size[b])
    half = np.linalg.solve(lower, worst)
    worst = np.linalg.solve(lower, np.ascontiguousarray(half.T))
    root = lower @ np.ascontiguousarray(vectors)
    turned = np.ascontiguousarray(vectors.T)
    z = turned @ np.linalg.solve(lower, score / size)
    gust = turned @ np.linalg.solve(lower, driven / size)
    sensitivity = np.zeros((p, p))
    kept = np.zeros((p, p))
    evidence = np.zeros((p, p))
    score_kept = np.zeros(p)
    evidence_score = np.zeros(p)
    driven_kept = np.zeros(p)
    evidence_bias = np.zeros(p)
    for v in range(p):
        direction = np.ascontiguousarray(vectors[:, v])
        if min(share[v], 1.0 - direction @ worst @ direction) < smallest:
            continue
        rho = min(share[v], 1.0)
        for a in range(p):
            ra = root[a, v] * size[a]
            score_kept[a] += ra * z[v]
            evidence_score[a] += ra * rho * z[v]
            driven_kept[a] += ra * gust[v]
            evidence_bias[a] += ra * rho * gust[v]
            for b in range(p):
                outer = ra * root[b, v] * size[b]
                sensitivity[a, b] += rho * outer
                kept[a, b] += outer
                evidence[a, b] += rho * rho * outer
    return sensitivity, kept, score_kept, driven_kept, evidence, evidence_score, evidence_bias
