"""The algebra of changes and hypotheses, compiled: (3) and (4) of ``evidence``, (5) of ``sequential``.

Matrices have at most COLUMNS + 1 rows; they are factorised in place, and a direction without information is left out
where its pivot vanishes beside its own diagonal. Arrays without dimensions named go by row (``layout.ROWS``).
"""

import math

import numpy as np

from wingwatch.kernels.copying import copy_into
from wingwatch.kernels.decorators import helper, whole_entry
from wingwatch.monitor.detection.redundancy.layout import COLUMNS

__all__ = ["changes", "likelihoods", "most_gained", "scores"]

_STEPS = 8
"""Of size and noise after one another, at most."""
_ROUNDED = 1e-6
"""Part of a variance that differences of large sums may have lost."""
_MOST_PRECISE = 2.0
"""Of lambda: K holds what the constant part's prior says, which does not grow with the precision of the noise."""
_LOST = 1e-9
"""Part of a sum that what is left of it must be to count."""
_CLOSE = 1e-3
"""By so much a likelihood (in nats) and a precision (as a fraction) may still move when they are taken."""


@helper
def _factorise(a, n):  # type: ignore[no-untyped-def]
    """Lower Cholesky factor of ``a`` in place; the log of its determinant. Pivots that vanish become 0."""
    log = 0.0
    for j in range(n):
        d = own = a[j, j]
        for k in range(j):
            d -= a[j, k] * a[j, k]
        if d <= 1e-9 * own + 1e-300:
            a[j, j] = 0.0
            for i in range(j + 1, n):
                a[i, j] = 0.0
            continue
        log += math.log(d)
        root = math.sqrt(d)
        a[j, j] = root
        for i in range(j + 1, n):
            s = a[i, j]
            for k in range(j):
                s -= a[i, k] * a[j, k]
            a[i, j] = s / root
    return log


@helper
def _forward(a, b, n):  # type: ignore[no-untyped-def]
    """b <- L^-1 b; the sum of its squares."""
    total = 0.0
    for i in range(n):
        s = b[i]
        for k in range(i):
            s -= a[i, k] * b[k]
        b[i] = s / a[i, i] if a[i, i] > 0.0 else 0.0
        total += b[i] * b[i]
    return total


@helper
def _since(segments, onset, row, total, moved):  # type: ignore[no-untyped-def]
    """Sums of one row over the segments from an onset on; the samples, and their sums of e2/S and ln S."""
    information, vector, _, samples, square, _, decay, log_s = segments
    n, e2, logs, carry, c = 0.0, 0.0, 0.0, 1.0, COLUMNS
    total[:], moved[:] = 0.0, 0.0
    for s in range(onset, information.shape[0]):
        for i in range(c + 1):
            left = carry if i == c else 1.0
            moved[i] += left * vector[s, row, i]
            for j in range(c + 1):
                total[i, j] += left * information[s, row, i, j] * (carry if j == c else 1.0)
        n, e2, logs = n + samples[s, row], e2 + square[s, row], logs + log_s[s, row]
        carry *= decay[s, row]
    return n, e2, logs


@whole_entry
def changes(prior, reference, segments, first, last, least_variance, variance_samples, out):  # type: ignore[no-untyped-def]
    """(3) and (4) for every onset from ``first`` to ``last``.

    Args:
        prior: precision of parameters (rows, COLUMNS).
        reference: information (rows, COLUMNS, COLUMNS), vector, samples, excess, scatter.
        segments: stacked in order (segments, rows, ...): information, vector, start, samples, square, excess, decay,
            sum of ln S.
        first, last: onsets wanted; the last one included.
        least_variance, variance_samples: of ``evidence``.
        out: ``evidence.Changes`` before its base, by onset.
    """
    ref_information, ref_vector, ref_samples, ref_excess, scatter = reference
    information, vector, start, samples, _, excess, _, _ = segments
    out_k, out_y, out_q, out_n, out_v, out_s = out
    rows = information.shape[1]
    c = COLUMNS
    known, both, solved = np.empty((c, c)), np.empty((c, c)), np.empty((c + 1, c))
    total, moved = np.empty((c + 1, c + 1)), np.empty(c + 1)
    by, earlier = np.empty((c, c + 1)), np.empty(c)
    for row in range(rows):
        for onset in range(first, last + 1):
            n, e2, logs = _since(segments, onset, row, total, moved)
            n_before, e_before = ref_samples[row], ref_excess[row]
            copy_into(ref_information[row], known)
            copy_into(ref_vector[row], earlier)
            for s in range(onset):
                n_before, e_before = n_before + samples[s, row], e_before + excess[s, row]
                for i in range(c):
                    earlier[i] += vector[s, row, i]
                    for j in range(c):
                        known[i, j] += information[s, row, i, j]
            v = max((e_before + variance_samples) / (n_before + variance_samples), least_variance)
            scale = 1.0 / (v * scatter[row])
            for i in range(c):
                for j in range(c):
                    known[i, j] *= scale
                    both[i, j] = known[i, j] + scale * total[i, j]
                known[i, i] += prior[row, i]
                both[i, i] += prior[row, i]
                solved[c, i] = scale * (earlier[i] + moved[i])
                earlier[i] *= scale
                for j in range(c + 1):
                    by[i, j] = scale * (total[i, j] - start[onset, row, i] * total[c, j])
            _factorise(both, c)
            _factorise(known, c)
            for i in range(c):
                for j in range(c):
                    solved[i, j] = by[i, j]
                _forward(both, solved[i], c)
            explained = _forward(both, solved[c], c) - _forward(known, earlier, c)
            at = onset - first
            for i in range(c):
                y = scale * (moved[i] - start[onset, row, i] * moved[c])
                for k in range(c):
                    y -= solved[i, k] * solved[c, k]
                out_y[at, row, i] = y
                for j in range(i + 1):
                    w = by[i, j] - start[onset, row, j] * by[i, c]
                    for k in range(c):
                        w -= solved[i, k] * solved[j, k]
                    out_k[at, row, i, j] = out_k[at, row, j, i] = w
            for i in range(c):
                if out_k[at, row, i, i] <= _LOST * by[i, i]:  # rounding of large sums
                    out_y[at, row, i] = 0.0
                    for j in range(c):
                        out_k[at, row, i, j] = out_k[at, row, j, i] = 0.0
            out_q[at, row] = max(0.0, e2 * scale - explained)
            out_n[at, row], out_v[at, row], out_s[at, row] = n / scatter[row], v, logs / scatter[row]


@whole_entry
def scores(information, vector, floors):  # type: ignore[no-untyped-def]
    """Mean square of each row's y over what K and the floors state, (rows,); NaN where it says nothing."""
    rows, c = vector.shape
    found, a, b = np.full(rows, np.nan), np.empty((c, c)), np.empty(c)
    for row in range(rows):
        for i in range(c):
            b[i] = vector[row, i]
            for j in range(c):
                a[i, j] = information[row, i, j]
                for k in range(c):
                    a[i, j] += information[row, i, k] * floors[row, k] ** 2 * information[row, k, j]
            a[i, i] *= 1.0 + _ROUNDED
        _factorise(a, c)
        square, rank = _forward(a, b, c), 0
        for i in range(c):
            rank += a[i, i] > 0.0
        if rank > 0:
            found[row] = square / rank
    return found


@helper
def _student(q, n, nu):  # type: ignore[no-untyped-def]
    """t(Q) of (5)."""
    constant = math.lgamma(0.5 * (nu + n)) - math.lgamma(0.5 * nu) - 0.5 * n * math.log(0.5 * nu)
    return constant - 0.5 * (nu + n) * math.log1p(q / nu)


@whole_entry
def most_gained(information, vector, square, samples, at_rest, nu):  # type: ignore[no-untyped-def]
    """Log-likelihood, in nats, by onset and row where every direction is free, (m, rows)."""
    m, rows, c = vector.shape
    out, a, b = np.empty((m, rows)), np.empty((c, c)), np.empty(c)
    for onset in range(m):
        for row in range(rows):
            a[:], b[:] = information[onset, row], vector[onset, row]
            _factorise(a, c)
            left = max(0.0, square[onset, row] - _forward(a, b, c))
            out[onset, row] = _student(left, samples[onset, row], nu) + at_rest[onset, row]
    return out


@helper
def _of_part(changed, std, size, precision, nu, work):  # type: ignore[no-untyped-def]
    """(5) of one relation at one onset for a size, at its own noise.

    Args:
        changed: a'y, a'Ka; K, y, Ka; Q, n, base.
        std: of what varies, W^(1/2), (COLUMNS,).
        size: of the hypothesis.
        precision: lambda to begin with.
        work: a matrix and three vectors.

    With A = W^(1/2) K W^(1/2), M = I + lambda A and b = W^(1/2) (y - m K a), g = M^-1 b.

    Returns:
        the log-likelihood, lambda, and the curvature and gradient of the size at that lambda.
    """
    projected, total, k, y, ka, q, n, base = changed
    a, b, d, g = work
    c, log, curvature, gradient = COLUMNS, 0.0, 0.0, 0.0
    for _ in range(2):
        for i in range(c):
            b[i], d[i] = std[i] * (y[i] - size * ka[i]), std[i] * ka[i]
            for j in range(c):
                a[i, j] = precision * std[i] * k[i, j] * std[j]
            a[i, i] += 1.0
        determinant = _factorise(a, c)
        along, across, both, within = _forward(a, b, c), _forward(a, d, c), 0.0, 0.0
        for i in range(c - 1, -1, -1):
            both += b[i] * d[i]
            s = b[i]
            for j in range(i + 1, c):
                s -= a[j, i] * g[j]
            g[i] = s / a[i, i] if a[i, i] > 0.0 else 0.0
            within += g[i] * g[i]
        # at w = lambda W^(1/2) g: Q(m, w) = Q - 2 m a'y + m^2 a'Ka - lambda (b'g + g'g), and w'W^-1 w = lambda^2 g'g
        square = max(0.0, q + size * (size * total - 2.0 * projected) - precision * (along + within))
        log = _student(square, n, nu) + base - 0.5 * (precision * precision * within + determinant)
        curvature = precision * (total - precision * across)
        gradient = precision * (projected - size * total - precision * both)
        renewed = min(_MOST_PRECISE, (nu + n) / (nu + square))
        if abs(renewed - precision) < _CLOSE * precision:
            break
        precision = renewed
    return log, precision, curvature, gradient


@whole_entry
def likelihoods(evidence, parts, variations, usual, prior, limits, nu):  # type: ignore[no-untyped-def]
    """(5) of a hypothesis at the mode of its size, by onset.

    Args:
        evidence: information, vector, square, samples and base by onset and relation.
        parts: relations (p,) and directions (p, COLUMNS).
        variations: standard deviation of what varies, whatever the size, and what it is besides by size (p, COLUMNS).
        usual: size for which that is taken at first; then it is the one found.
        prior: precision of the size beforehand; 0 where there is none.
        limits: of the size; where both are the same, that is its size.
        nu: samples that the noise counts as.

    Returns:
        logs (p, m), size (m,), its precision (m,).
    """
    information, vector, square, samples, at_rest = evidence
    (relations, directions), (least, by_size), (lowest, highest) = parts, variations, limits
    fixed = lowest == highest
    m, p, c = len(square), len(relations), COLUMNS
    logs, size, precision_of_size = np.zeros((p, m)), np.zeros(m), np.zeros(m)
    work = (np.empty((c, c)), np.empty(c), np.empty(c), np.empty(c))
    ka, std = np.empty((p, c)), np.empty((p, c))
    projected, total, precision = np.empty(p), np.empty(p), np.empty(p)
    for onset in range(m):
        for r in range(p):
            k, y = information[onset, relations[r]], vector[onset, relations[r]]
            projected[r], total[r], precision[r] = 0.0, 0.0, 1.0
            for i in range(c):
                s = 0.0
                for j in range(c):
                    s += k[i, j] * directions[r, j]
                ka[r, i] = s
                projected[r] += directions[r, i] * y[i]
                total[r] += directions[r, i] * s
        now, about = lowest if fixed else 0.0, usual
        for _ in range(1 if fixed else 2):
            before = -np.inf
            for r in range(p):
                for i in range(c):
                    std[r, i] = math.hypot(least[r, i], about * by_size[r, i])
            for _ in range(_STEPS):
                curvature, gradient, sum_of_logs = prior, -prior * now, -0.5 * prior * now * now
                for r in range(p):
                    i = relations[r]
                    changed = (
                        projected[r], total[r], information[onset, i], vector[onset, i], ka[r], square[onset, i],
                        samples[onset, i], at_rest[onset, i],
                    )  # fmt: skip
                    log, precision[r], more, along = _of_part(changed, std[r], now, precision[r], nu, work)
                    logs[r, onset] = log
                    curvature, gradient, sum_of_logs = curvature + more, gradient + along, sum_of_logs + log
                precision_of_size[onset] = curvature
                if fixed or curvature <= 0.0 or abs(sum_of_logs - before) < _CLOSE:
                    break
                before = sum_of_logs
                now = min(highest, max(lowest, now + gradient / curvature))
            about = abs(now)
        size[onset] = now
    return logs, size, precision_of_size
