"""Which directions of the Fourier form's regressors carry signal, and the information they give; compiled.

Derivation and symbols: ``docs/estimators.md`` section 5.
"""

import math

from wingwatch.estimators.hot import lean
from wingwatch.estimators.symmetric import backward, cholesky, eigen, forward

__all__ = ["DIRECTION_LINES", "DIRECTION_SQUARES", "noise_edge", "reduce_information"]

PIVOT = 1e-9
"""Least share of a regressor's power that is its own, not that of the regressors before it."""

DIRECTION_SQUARES, DIRECTION_LINES = 3, 5
"""Matrices (p, p) and vectors (p,) of room that ``reduce_information`` needs."""


@lean
def noise_edge(regressors, bins):  # type: ignore[no-untyped-def]
    """Share of "signal" that pure noise of a known level can show by chance.

    Of ``regressors`` channels of white noise over ``bins`` independent bins the largest eigenvalue tends to
    (1 + sqrt(regressors / bins))^2 times the true power (Marchenko and Pastur 1967).
    """
    if bins <= 0.0:
        return 1.0
    return 1.0 - 1.0 / (1.0 + math.sqrt(regressors / bins)) ** 2


@lean
def _all_below(matrix, bound, root):  # type: ignore[no-untyped-def]
    """Whether all eigenvalues of a symmetric matrix are below ``bound``: the root of bound - matrix exists."""
    n = matrix.shape[0]
    for a in range(n):
        if not matrix[a, a] < bound:
            return False
    for a in range(n):
        for b in range(a + 1):
            root[a, b] = -matrix[a, b]
        root[a, a] += bound
    return cholesky(root, 0.0, root)


@lean
def _whiten(lower, matrix):  # type: ignore[no-untyped-def]
    """L^-1 matrix L^-T of a symmetric matrix, in place."""
    n = matrix.shape[0]
    forward(lower, matrix)
    for a in range(n):
        for b in range(a):
            matrix[a, b], matrix[b, a] = matrix[b, a], matrix[a, b]
    forward(lower, matrix)
    for a in range(n):
        for b in range(a):
            matrix[a, b] = matrix[b, a] = 0.5 * (matrix[a, b] + matrix[b, a])


@lean
def _suspected_share(n_noise, suspected, size, direction, v):  # type: ignore[no-untyped-def]
    """Share of noise in a direction, column v of ``direction``, each state's noise ``suspected`` times as large."""
    ns = suspected.size
    columns = n_noise.shape[0] // ns
    total = 0.0
    for j in range(columns):
        level = suspected[j] if j < ns else 1.0
        for k in range(ns):
            a = k * columns + j
            for m in range(ns):
                b = m * columns + j
                total += level * n_noise[a, b] * direction[a, v] / size[a] * direction[b, v] / size[b]
    return total


@lean
def _add_direction(ray, share, power, drive, vectors, matrices):  # type: ignore[no-untyped-def]
    """Add the information of one direction, its ray (p,) in derivatives, to the sums of ``reduce_information``."""
    score_kept, driven_kept, evidence_score, evidence_bias = vectors
    sensitivity, kept, evidence = matrices
    for a in range(ray.size):
        score_kept[a] += ray[a] * power
        evidence_score[a] += ray[a] * share * power
        driven_kept[a] += ray[a] * drive
        evidence_bias[a] += ray[a] * share * drive
        for b in range(ray.size):
            outer = ray[a] * ray[b]
            sensitivity[a, b] += share * outer
            kept[a, b] += outer
            evidence[a, b] += share * share * outer


@lean
def reduce_information(  # type: ignore[no-untyped-def]
    m, n_noise, suspected, score, driven, smallest, squares, lines, vectors, matrices
):
    """Keep the directions in which the regressors' power is signal, not noise.

    The sensitivity of the estimating equation is M - N. In coordinates that whiten M its eigenvalues are
    the signal's share of the power (at most 1). A direction is kept if its share is at least ``smallest`` even were
    each state's noise ``suspected`` (ns,) times what is believed: all of the state's roughness. Records without noise
    make regressors dependent to the last digits: no pivot of M is believed below ``PIVOT``.

    Args:
        m, n_noise, score, driven: of the block, (p, p), (p, p), (p,), (p,).
        squares, lines: room, (DIRECTION_SQUARES, p, p) and (DIRECTION_LINES, p).
        vectors: become score and driven part restricted to the kept directions, and for the monitor the evidence's
            score and the information times the bias that gusts cause, (p,) each.
        matrices: become sensitivity, M restricted to the kept directions, and the evidence's information, (p, p) each.
    """
    p = m.shape[0]
    lower, turned, other = squares[0], squares[1], squares[2]
    size, share, off, room, ray = lines[0], lines[1], lines[2], lines[3], lines[4]
    for vector in vectors:
        vector[:] = 0.0
    for matrix in matrices:
        matrix[:, :] = 0.0
    for a in range(p):
        size[a] = math.sqrt(m[a, a]) if m[a, a] > 0.0 else 1.0
    for a in range(p):
        for b in range(p):
            other[a, b] = m[a, b] / (size[a] * size[b])
            turned[a, b] = (m[a, b] - n_noise[a, b]) / (size[a] * size[b])
        other[a, a] += 1e-9
    cholesky(other, PIVOT, lower)
    _whiten(lower, turned)
    if _all_below(turned, smallest, other):
        return
    eigen(turned, share, off, room)
    for a in range(p):
        for v in range(p):
            other[a, v] = turned[v, a]
    backward(lower, other)
    for v in range(p):
        if not share[v] >= smallest:
            continue
        if not 1.0 - _suspected_share(n_noise, suspected, size, other, v) >= smallest:
            continue
        # With d the direction, d' L^-1 is a column of L^-T d: what the score and the gusts say along it.
        power = drive = 0.0
        for a in range(p):
            power += other[a, v] * score[a] / size[a]
            drive += other[a, v] * driven[a] / size[a]
            total = 0.0
            for b in range(a + 1):
                total += lower[a, b] * turned[v, b]
            ray[a] = total * size[a]
        _add_direction(ray, min(share[v], 1.0), power, drive, vectors, matrices)
