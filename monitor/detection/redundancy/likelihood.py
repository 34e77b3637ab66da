"""The algebra of changes and hypotheses, compiled: (3) and (4) of ``evidence``, (5) of ``sequential``.

Matrices have at most COLUMNS + 1 rows; they are factorised in place, and a direction without information is left out
where its pivot vanishes beside its own diagonal. Arrays without dimensions named go by row (``layout.ROWS``).
"""

import math

import numpy as np

from wingwatch.kernels.decorators import helper, whole_entry
from wingwatch.monitor.detection.redundancy.layout import COLUMNS
from wingwatch.monitor.detection.redundancy.samples import LEFT, LOG_S, SAMPLES, SQUARE
from wingwatch.monitor.detection.redundancy.segments import EXCESS, KNOWN_PAIRS, PAIRS, pair

__all__ = ["changes", "constant_part", "contest", "expected_gains", "likelihoods", "scores"]

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
_LOG_HALF = math.log(0.5)


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
def _sum_before(row, c, known, segments, places, out):  # type: ignore[no-untyped-def]
    """Sums of one row, of ``c`` parameters, over all before each onset: information, vector, samples and excess."""
    _, _, ref_information, ref_vector, ref_samples, ref_excess, _ = known
    information, vector, _, scalar = segments
    (first, last, _), (sums, moves, counts) = places, out
    pairs = c * (c + 1) // 2
    for p in range(pairs):
        sums[0, p] = ref_information[row, p]
    for i in range(c):
        moves[0, i] = ref_vector[row, i]
    counts[0, 0], counts[0, 1] = ref_samples[row], ref_excess[row]
    for s in range(last):
        # before the first onset wanted all is added up in its place
        to = max(0, s + 1 - first)
        of = max(0, s - first)
        for p in range(pairs):
            sums[to, p] = sums[of, p] + information[s, row, p]
        for i in range(c):
            moves[to, i] = moves[of, i] + vector[s, row, i]
        counts[to, 0] = counts[of, 0] + scalar[s, row, SAMPLES]
        counts[to, 1] = counts[of, 1] + scalar[s, row, EXCESS]


@helper
def _change(c, places, scale, given, earlier, since, work, out):  # type: ignore[no-untyped-def]
    """(3) and (4) of one row, of ``c`` parameters, at one onset.

    Args:
        places: of the onset in ``out`` and among the segments, and the row.
        scale: of the information, by the noise.
        given: precision beforehand, and X at the segments' starts.
        earlier: information and vector before each onset.
        since: packed information, vector and sum of e2/S from the onset on.
        work: three matrices, one of (E, f), and a vector.
        out: K, y and Q.
    """
    (at, onset, row), (prior, start), (sums, moves), (total, moved, e2) = places, given, earlier, since
    (before, both, solved, by, known), (out_k, out_y, out_q) = work, out
    for i in range(c):
        for j in range(i + 1):
            p = i * (i + 1) // 2 + j
            before[i, j] = scale * sums[at, p]
            both[i, j] = before[i, j] + scale * total[p]
        before[i, i] += prior[row, i]
        both[i, i] += prior[row, i]
        solved[COLUMNS, i] = scale * (moves[at, i] + moved[i])
        known[i] = scale * moves[at, i]
        began = start[onset, row, i]
        for j in range(c):
            by[i, j] = scale * (total[pair(i, j)] - began * total[KNOWN_PAIRS + j])
        by[i, c] = scale * (total[KNOWN_PAIRS + i] - began * total[PAIRS - 1])
    _factorise(both, c)
    _factorise(before, c)
    for i in range(c):
        for j in range(c):
            solved[i, j] = by[i, j]
        _forward(both, solved[i], c)
    explained = _forward(both, solved[COLUMNS], c) - _forward(before, known, c)
    for i in range(c):
        y = scale * (moved[i] - start[onset, row, i] * moved[COLUMNS])
        for k in range(c):
            y -= solved[i, k] * solved[COLUMNS, k]
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


@whole_entry
def changes(known, segments, places, assumed, out):  # type: ignore[no-untyped-def]
    """(3) and (4) for every onset from ``first`` to ``last``.

    Args:
        known: precision of parameters beforehand (rows, COLUMNS); how many each row has (rows,); of what was before the
            segments the information (rows, KNOWN_PAIRS), vector, samples, excess; scatter.
        segments: information, vector, start and scalar of ``Segments``.
        places: ``first`` and ``last`` onset wanted, the last one included, and how many segments there are.
        assumed: least variance, and samples that what is assumed of it counts as.
        out: ``evidence.Changes`` before its base, by onset, and the sum of ln S; zeros.
    """
    prior, parameters, _, _, _, _, scatter = known
    information, vector, start, scalar = segments
    first, last, count = places
    out_k, out_y, out_q, out_n, out_v, out_s = out
    c_most, m = COLUMNS, last - first + 1
    sums, moves, counts = np.empty((m, KNOWN_PAIRS)), np.empty((m, c_most)), np.empty((m, 2))
    total, moved = np.empty(PAIRS), np.empty(c_most + 1)
    work = (
        np.empty((c_most, c_most)), np.empty((c_most, c_most)), np.empty((c_most + 1, c_most)),
        np.empty((c_most, c_most + 1)), np.empty(c_most),
    )  # fmt: skip
    for row in range(information.shape[1]):
        c = parameters[row]
        _sum_before(row, c, known, segments, places, (sums, moves, counts))
        for p in range(PAIRS):
            total[p] = 0.0
        for i in range(c_most + 1):
            moved[i] = 0.0
        n, e2, logs = 0.0, 0.0, 0.0
        for onset in range(count - 1, first - 1, -1):
            left = scalar[onset, row, LEFT]  # what later segments have f for is what this one has left of it
            for p in range(c * (c + 1) // 2):
                total[p] += information[onset, row, p]
            for j in range(c):
                p = KNOWN_PAIRS + j
                total[p] = information[onset, row, p] + left * total[p]
                moved[j] += vector[onset, row, j]
            total[PAIRS - 1] = information[onset, row, PAIRS - 1] + left * left * total[PAIRS - 1]
            moved[c_most] = vector[onset, row, c_most] + left * moved[c_most]
            n, e2 = n + scalar[onset, row, SAMPLES], e2 + scalar[onset, row, SQUARE]
            logs += scalar[onset, row, LOG_S]
            if onset > last:
                continue
            at = onset - first
            v = max((counts[at, 1] + assumed[1]) / (counts[at, 0] + assumed[1]), assumed[0])
            scale = 1.0 / (v * scatter[row])
            out_n[at, row], out_v[at, row], out_s[at, row] = n / scatter[row], v, logs / scatter[row]
            if n == 0.0:
                continue
            places_of = at, onset, row
            since, result = (total, moved, e2), (out_k, out_y, out_q)
            _change(c, places_of, scale, (prior, start), (sums, moves), since, work, result)


@whole_entry
def constant_part(prior, parameters, information, vector, scale):  # type: ignore[no-untyped-def]
    """Parameters by what is known, (rows, COLUMNS).

    Args:
        prior: precision beforehand (rows, COLUMNS); how many parameters each row has (rows,).
        information, vector: packed (rows, KNOWN_PAIRS), (rows, COLUMNS), times ``scale`` (rows,).
    """
    rows, most = vector.shape
    found, a, b = np.zeros((rows, most)), np.empty((most, most)), np.empty(most)
    for row in range(rows):
        c = parameters[row]
        for i in range(c):
            b[i] = scale[row] * vector[row, i]
            for j in range(i + 1):
                a[i, j] = scale[row] * information[row, i * (i + 1) // 2 + j]
            a[i, i] += prior[row, i]
        _factorise(a, c)
        _forward(a, b, c)
        for i in range(c - 1, -1, -1):
            s = b[i]
            for k in range(i + 1, c):
                s -= a[k, i] * found[row, k]
            found[row, i] = s / a[i, i] if a[i, i] > 0.0 else 0.0
    return found


@whole_entry
def scores(information, vector, parameters, floors):  # type: ignore[no-untyped-def]
    """Mean square of each row's y over what K and the floors state, (rows,); NaN where it says nothing."""
    rows, most = vector.shape
    found, a, b = np.full(rows, np.nan), np.empty((most, most)), np.empty(most)
    for row in range(rows):
        c = parameters[row]
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


@helper
def _of_part(c, changed, std, size, precision, nu, work):  # type: ignore[no-untyped-def]
    """(5) of one relation at one onset for a size, at its own noise.

    Args:
        c: its parameters, how many.
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
    log, curvature, gradient = 0.0, 0.0, 0.0
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


@helper
def _log_sum_of_two(a, b):  # type: ignore[no-untyped-def]
    """ln(e^a + e^b)."""
    most = max(a, b)
    return most + math.log1p(math.exp(min(a, b) - most))


@whole_entry
def contest(evidence, layout, floors, nu, log_rougher):  # type: ignore[no-untyped-def]
    """What the relations' changes are judged by, whatever the hypothesis.

    Of a relation with two rows the one counts by onset that could gain more.

    Args:
        evidence: ``Changes`` by onset and row: information, vector, square, samples, base.
        layout: how many parameters each row has; row of each relation in rougher air, -1 without.
        floors: standard deviation of what varies in a healthy aircraft (rows, COLUMNS).
        nu: samples that the noise counts as.
        log_rougher: log-probability that the air became rougher.

    Returns:
        the evidence by onset and relation (m, relations, ...); (5) with m = 0 by onset and relation; the same of
        earlier onsets up to this one; of any onset (relations,); nats that each could gain at most (relations,).
    """
    information, vector, square, samples, at_rest = evidence
    parameters, rough = layout
    m, c_most, n = len(vector), vector.shape[2], len(rough)
    k, y = np.empty((m, n, c_most, c_most)), np.empty((m, n, c_most))
    q, counted, base = np.empty((m, n)), np.empty((m, n)), np.empty((m, n))
    varied, before, most_at = np.empty((m, n)), np.empty((m, n)), np.empty((m, n))
    null, most = np.empty(n), np.zeros(n)
    a, b = np.empty((c_most, c_most)), np.empty(c_most)
    work, nothing = (
        (np.empty((c_most, c_most)), np.empty(c_most), np.empty(c_most), np.empty(c_most)),
        np.zeros(c_most),
    )
    for i in range(n):
        c = parameters[i]
        for onset in range(m):
            best, at, both = -np.inf, i, -np.inf
            for second in range(2):
                row = rough[i] if second else i
                if row < 0:
                    continue
                extra = log_rougher if second else 0.0
                for p in range(c):
                    b[p] = vector[onset, row, p]
                    for r in range(p + 1):
                        a[p, r] = information[onset, row, p, r]
                _factorise(a, c)
                left = max(0.0, square[onset, row] - _forward(a, b, c))
                gained = _student(left, samples[onset, row], nu) + at_rest[onset, row] + extra
                changed = (
                    0.0, 0.0, information[onset, row], vector[onset, row], nothing, square[onset, row],
                    samples[onset, row], at_rest[onset, row],
                )  # fmt: skip
                healthy = _of_part(c, changed, floors[row], 0.0, 1.0, nu, work)[0] + extra
                both = _log_sum_of_two(both, healthy) if second else healthy
                if gained > best:
                    best, at = gained, row
            varied[onset, i], most_at[onset, i] = both, best
            for p in range(c_most):
                y[onset, i, p] = vector[onset, at, p]
                for r in range(c_most):
                    k[onset, i, p, r] = information[onset, at, p, r]
            q[onset, i], counted[onset, i] = square[onset, at], samples[onset, at]
            base[onset, i] = at_rest[onset, at] + (log_rougher if at != i else 0.0)
        total = -np.inf
        for onset in range(m):
            # what varied at an earlier onset, up to this one
            before[onset, i] = _log_sum_of_two(_LOG_HALF, _LOG_HALF - math.log(m) + total - varied[onset, i])
            total = _log_sum_of_two(varied[onset, i], total)
        null[i] = _log_sum_of_two(_LOG_HALF, _LOG_HALF - math.log(m) + total)
        for onset in range(m):
            most[i] = max(most[i], most_at[onset, i] + before[onset, i] - null[i])
    return (k, y, q, counted, base), varied, before, null, most


@whole_entry
def likelihoods(evidence, parts, floors, sizes, nu):  # type: ignore[no-untyped-def]
    """(5) of a hypothesis at the mode of its size, by onset.

    Args:
        evidence: information, vector, square, samples and base by onset and relation.
        parts: relations (p,) and how many parameters each has; directions, and the standard deviations of what varies
            besides, whatever the size and by size (p, COLUMNS).
        floors: standard deviation of what varies in a healthy aircraft, (rows, COLUMNS).
        sizes: standard deviation beforehand, 0 where the size is 1; whether it may be negative.
        nu: samples that the noise counts as.

    Returns:
        logs (p, m), size (m,), its precision (m,).
    """
    information, vector, square, samples, at_rest = evidence
    relations, parameters, directions, free, by_size = parts
    fixed, usual = sizes[0] == 0.0, sizes[0] if sizes[0] > 0.0 else 1.0
    prior = 0.0 if fixed else usual**-2.0
    lowest = -np.inf if sizes[1] else 0.0
    m, p, most = len(square), len(relations), COLUMNS
    logs, size, precision_of_size = np.zeros((p, m)), np.zeros(m), np.zeros(m)
    work = (np.empty((most, most)), np.empty(most), np.empty(most), np.empty(most))
    ka, std = np.empty((p, most)), np.empty((p, most))
    projected, total, precision = np.empty(p), np.empty(p), np.empty(p)
    for onset in range(m):
        for r in range(p):
            k, y = information[onset, relations[r]], vector[onset, relations[r]]
            projected[r], total[r], precision[r] = 0.0, 0.0, 1.0
            for i in range(parameters[r]):
                s = 0.0
                for j in range(parameters[r]):
                    s += k[i, j] * directions[r, j]
                ka[r, i] = s
                projected[r] += directions[r, i] * y[i]
                total[r] += directions[r, i] * s
        now, about = 1.0 if fixed else 0.0, usual
        for _ in range(1 if fixed else 2):
            before = -np.inf
            for r in range(p):
                for i in range(parameters[r]):
                    least = math.hypot(floors[relations[r], i], free[r, i])
                    std[r, i] = math.hypot(least, about * by_size[r, i])
            for _ in range(_STEPS):
                curvature, gradient, sum_of_logs = prior, -prior * now, -0.5 * prior * now * now
                for r in range(p):
                    i = relations[r]
                    changed = (
                        projected[r], total[r], information[onset, i], vector[onset, i], ka[r], square[onset, i],
                        samples[onset, i], at_rest[onset, i],
                    )  # fmt: skip
                    log, precision[r], more, along = _of_part(
                        parameters[r], changed, std[r], now, precision[r], nu, work
                    )
                    logs[r, onset] = log
                    curvature, gradient, sum_of_logs = curvature + more, gradient + along, sum_of_logs + log
                precision_of_size[onset] = curvature
                if fixed or curvature <= 0.0 or abs(sum_of_logs - before) < _CLOSE:
                    break
                before = sum_of_logs
                now = max(lowest, now + gradient / curvature)
            about = abs(now)
        size[onset] = now
    return logs, size, precision_of_size


@whole_entry
def expected_gains(information, floors, begins, parts, varying):  # type: ignore[no-untyped-def]
    """2 ln L that each of many hypotheses gains, in expectation, by the square of its size, (hypotheses,).

    Args:
        information: K by row, (rows, COLUMNS, COLUMNS).
        floors: standard deviation of what varies in a healthy aircraft, (rows, COLUMNS).
        begins: first of each hypothesis' parts, and the end of the last one's (hypotheses + 1,).
        parts: relations (p,), how many parameters each has, and directions (p, COLUMNS).
        varying: standard deviation of what varies besides (p, COLUMNS).
    """
    relations, parameters, directions = parts
    found = np.zeros(len(begins) - 1)
    within, along, std, moved = (
        np.empty((COLUMNS, COLUMNS)),
        np.empty(COLUMNS),
        np.empty(COLUMNS),
        np.empty(COLUMNS),
    )
    for h in range(len(found)):
        for r in range(begins[h], begins[h + 1]):
            row, c = relations[r], parameters[r]
            for i in range(c):
                std[i], moved[i] = math.hypot(floors[row, i], varying[r, i]), 0.0
                for j in range(c):
                    moved[i] += information[row, i, j] * directions[r, j]
            for i in range(c):
                along[i] = std[i] * moved[i]
                found[h] += directions[r, i] * moved[i]
                for j in range(i + 1):
                    within[i, j] = std[i] * information[row, i, j] * std[j]
                within[i, i] += 1.0
            _factorise(within, c)
            found[h] -= _forward(within, along, c)
    return found
