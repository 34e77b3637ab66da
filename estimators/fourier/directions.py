"""Which directions of the Fourier form's regressors carry signal, and the information they give; compiled.

Derivation and symbols: ``docs/methods/fourier.md`` section 3, (16).
"""

import math

from wingwatch.estimators.kernels.hot import lean
from wingwatch.estimators.kernels.symmetric import (
    all_above,
    all_below,
    backward,
    cholesky,
    eigen,
    forward,
    product,
    whiten,
)

__all__ = ["DIRECTION_LINES", "DIRECTION_SQUARES", "noise_edge", "reduce_information"]

PIVOT = 1e-9
"""Least share of a regressor's power that is its own, not that of the regressors before it."""

RIDGE = 1e-9
"""Added to M, every regressor of unit power."""

DIRECTION_SQUARES, DIRECTION_LINES = 4, 5
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
def _seen_by_all(n_noise, suspected, size, lower, smallest, whitened, root):  # type: ignore[no-untyped-def]
    """Whether no direction is more noise than ``smallest`` leaves room for, were all of the roughness noise.

    Where no state's roughness is more than is believed, the shares themselves have said so.
    """
    ns, p = suspected.size, size.size
    rougher = False
    for j in range(ns):
        rougher = rougher or suspected[j] > 1.0
    if not rougher:
        return True
    columns = p // ns
    for a in range(p):
        level = suspected[a % columns] if a % columns < ns else 1.0
        for b in range(p):
            whitened[a, b] = level * n_noise[a, b] / (size[a] * size[b])
    whiten(lower, whitened)
    return all_below(whitened, 1.0 - smallest, root)


@lean
def _keep_all(m, n_noise, score, driven, lower, size, inner, squares, columns, vectors, matrices):  # type: ignore[no-untyped-def]
    """The sums of ``reduce_information`` where every direction is kept: no eigenvectors are needed.

    With L the root of M and L (1 - N) L' = M - N in its coordinates, the evidence is H' H, H = (1 - N) L'.
    """
    score_kept, driven_kept, evidence_score, evidence_bias = vectors
    sensitivity, kept, evidence = matrices
    turned, half = squares
    p = size.size
    for a in range(p):
        for b in range(p):
            turned[a, b] = lower[b, a] * size[b] if b >= a else 0.0
        columns[a, 0], columns[a, 1] = score[a] / size[a], driven[a] / size[a]
    product(inner, turned, half)
    forward(lower, columns)
    for a in range(p):
        score_kept[a], driven_kept[a] = score[a], driven[a]
        for b in range(p):
            sensitivity[a, b] = m[a, b] - n_noise[a, b]
            kept[a, b] = m[a, b]
            evidence_score[b] += half[a, b] * columns[a, 0]
            evidence_bias[b] += half[a, b] * columns[a, 1]
        kept[a, a] += RIDGE * m[a, a]
    for c in range(p):
        for a in range(p):
            factor = half[c, a]
            for b in range(p):
                evidence[a, b] += factor * half[c, b]


@lean
def reduce_information(  # type: ignore[no-untyped-def]
    m, n_noise, suspected, score, driven, smallest, squares, lines, columns, vectors, matrices
):
    """Keep the directions in which the regressors' power is signal, not noise.

    The sensitivity of the estimating equation is M - N. In coordinates that whiten M its eigenvalues are
    the signal's share of the power (at most 1). A direction is kept if its share is at least ``smallest`` even were
    each state's noise ``suspected`` (ns,) times what is believed: all of the state's roughness. Records without noise
    make regressors dependent to the last digits: no pivot of M is believed below ``PIVOT``.

    Args:
        m, n_noise, score, driven: of the block, (p, p), (p, p), (p,), (p,).
        squares, lines, columns: room, (DIRECTION_SQUARES, p, p), (DIRECTION_LINES, p) and (p, 2).
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
        other[a, a] += RIDGE
    sound = cholesky(other, PIVOT, lower)
    whiten(lower, turned)
    if all_below(turned, smallest, other):
        return
    if (
        sound
        and all_above(turned, smallest, other)
        and _seen_by_all(n_noise, suspected, size, lower, smallest, other, squares[3])
    ):
        _keep_all(
            m, n_noise, score, driven, lower, size, turned, (other, squares[3]), columns, vectors, matrices
        )  # fmt: skip
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
