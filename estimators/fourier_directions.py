"""Which directions of the Fourier form's regressors carry signal, and the information they give; compiled.

Derivation and symbols: ``docs/estimators.md`` section 5.
"""

import numpy as np
from numba import njit

__all__ = ["noise_edge", "reduce_information"]

PIVOT = 1e-9
"""Least share of a regressor's power that is its own, not that of the regressors before it."""


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
def _root(matrix):  # type: ignore[no-untyped-def]
    """Lower Cholesky root of a matrix of unit diagonal that is positive semidefinite but for rounding.

    Records without noise make regressors dependent to the last digits: no pivot is believed below ``PIVOT``.
    """
    n = matrix.shape[0]
    root = np.zeros((n, n))
    for a in range(n):
        for b in range(a):
            total = matrix[a, b]
            for c in range(b):
                total -= root[a, c] * root[b, c]
            root[a, b] = total / root[b, b]
        pivot = matrix[a, a]
        for c in range(a):
            pivot -= root[a, c] * root[a, c]
        root[a, a] = np.sqrt(max(pivot, PIVOT))
    return root


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
    lower = _root(scaled)
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
