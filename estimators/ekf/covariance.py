"""The filter's algebra: covariance predicted, corrected and mixed with the prior, in place and without allocating.

Covariances are kept whole, both triangles: rows are then contiguous, and adding the product h h' of one vector changes
both triangles alike to the last bit.
"""

import numpy as np

from wingwatch.estimators.kernels.symmetric import invert
from wingwatch.kernels.decorators import helper, hot

__all__ = ["correct", "forget", "inverse_of", "leave_out", "of_derivatives", "predict", "reseat"]


@hot
def predict(model, cov, process, jacobian, drift, product):  # type: ignore[no-untyped-def]
    """F P F' + Q for the Jacobian's rows ``jacobian`` (nx, nz), identity below; the trim constants drift.

    A gust state depends on itself alone, so its row of F P is P's times its decay, and only the states' rows are sums.
    P is symmetric: what a row of F makes of a column of P is taken along P's row.

    ``process`` (nx, nx), of which the lower triangle is read; ``drift`` (ns,); ``product`` (ns or more, nz) is
    workspace.
    """
    ns, nx, nz = model.sizes.states, model.sizes.dynamic, model.sizes.augmented
    for c in range(nz):
        _states_with(cov[c], jacobian, c, ns, nz, product)
    for k in range(ns, nx):
        decay = jacobian[k, k]
        for m in range(ns):
            cov[k, m] = cov[m, k] = decay * product[m, k] + process[k, m]
        for m in range(ns, k + 1):
            cov[k, m] = cov[m, k] = decay * jacobian[m, m] * cov[k, m] + process[k, m]
        for c in range(nx, nz):
            cov[k, c] *= decay
            cov[c, k] = cov[k, c]
    for k in range(ns):
        for m in range(k + 1):
            total = process[k, m]
            for c in range(nz):
                total += product[k, c] * jacobian[m, c]
            cov[k, m] = cov[m, k] = total
        for c in range(nx, nz):
            cov[k, c] = cov[c, k] = product[k, c]
        c = nz - ns + k
        cov[c, c] += drift[k]


@hot
def _states_with(row, jacobian, c, ns, nz, product):  # type: ignore[no-untyped-def]
    """Column c of F P, the states' rows alone: of two or three of them at once, each number of P is read once."""
    first = second = third = 0.0
    for m in range(nz):
        first += jacobian[0, m] * row[m]
        second += jacobian[1, m] * row[m]
        if ns == 3:
            third += jacobian[2, m] * row[m]
    product[0, c], product[1, c] = first, second
    if ns == 3:
        product[2, c] = third


@hot
def correct(model, posterior, readings, gains):  # type: ignore[no-untyped-def]
    """All measurements of one instant, one after the other; equal to the joint update for independent noise.

    The gains are found first, each from the covariance that those before it leave; the covariance follows in one pass.

    Args:
        model: of the filter.
        posterior: predicted state z (nz,) and covariance (nz, nz), corrected in place.
        readings: the measurements.
        gains: filled, (states + 1, nz).

    Returns:
        the accelerometer's residual after correction, and its variance due to the state, H P H'.
    """
    ns, nz = model.sizes.states, model.sizes.augmented
    z, cov, gain = posterior.z, posterior.cov, gains.gain
    residual = explained = 0.0
    for j in range(ns + 1):
        for c in range(nz):
            gain[j, c] = 0.0
        gains.innovation[j] = gains.inverse_std[j] = 0.0
        if not readings.measured[j]:
            continue
        innovation = readings.innovation[j]
        _covariance_with(cov, readings.row, j, ns, nz, gain)
        for i in range(j):
            common = _measured_of(gain, i, readings.row, j, ns, nz)
            for c in range(nz):
                gain[j, c] -= common * gain[i, c]
            innovation -= common * gains.innovation[i]
        predicted = _measured_of(gain, j, readings.row, j, ns, nz)
        total = predicted + readings.variance[j]
        if j == ns:
            residual = innovation * readings.variance[j] / total
            explained = predicted * readings.variance[j] / total
        root = 1.0 / np.sqrt(total)
        for c in range(nz):
            gain[j, c] *= root
        gains.innovation[j] = innovation * root
        gains.inverse_std[j] = root
        for c in range(nz):
            z[c] += gain[j, c] * gains.innovation[j]
    for c in range(nz):
        g, h, i, j = gain[0, c], gain[1, c], gain[2, c], gain[ns, c]
        for d in range(nz):
            if ns == 3:
                cov[c, d] -= (g * gain[0, d] + h * gain[1, d]) + (i * gain[2, d] + j * gain[3, d])
            else:
                cov[c, d] -= g * gain[0, d] + h * gain[1, d] + j * gain[2, d]
    return residual, explained


@hot
def _covariance_with(cov, row, j, ns, nz, gain):  # type: ignore[no-untyped-def]
    """P H' of measurement j, into row j of ``gain``."""
    if j < ns:
        for c in range(nz):
            gain[j, c] = cov[j, c]
        return
    for d in range(nz):
        factor = row[d]
        if factor != 0.0:
            for c in range(nz):
                gain[j, c] += factor * cov[d, c]


@hot
def _measured_of(gain, i, row, j, ns, nz):  # type: ignore[no-untyped-def]
    """What measurement j sees of gain i: its own state's element, or the accelerometer's row times it."""
    if j < ns:
        return gain[i, j]
    total = 0.0
    for c in range(nz):
        total += row[c] * gain[i, c]
    return total


@helper
def inverse_of(cov, chosen):  # type: ignore[no-untyped-def]
    """Inverse of the covariance of some parameters, (m, m)."""
    m = chosen.size
    now, inverse = np.empty((m, m)), np.empty((m, m))
    for a in range(m):
        for b in range(m):
            now[a, b] = cov[chosen[a], chosen[b]]
    invert(now, inverse)
    return inverse


@helper
def put_marginal(z, cov, chosen, inverse, value, covariance):  # type: ignore[no-untyped-def]
    """Gives some parameters another mean and covariance; all else, given these, stays.

    Args:
        z, cov: changed in place.
        chosen: which of ``z``, indices, (m,).
        inverse: of their covariance as it is, (m, m).
        value, covariance: that they get, (m,) and (m, m).
    """
    m, n = chosen.size, z.size - chosen.size
    rest, others = np.empty(n, dtype=np.int64), 0
    for c in range(z.size):
        if not (chosen == c).any():
            rest[others] = c
            others += 1
    regression, half, cross = np.zeros((n, m)), np.zeros((n, m)), np.zeros((n, m))
    for r in range(n):
        for a in range(m):
            factor = cov[rest[r], chosen[a]]
            for b in range(m):
                regression[r, b] += factor * inverse[a, b]
        for a in range(m):
            factor = regression[r, a]
            z[rest[r]] += factor * (value[a] - z[chosen[a]])
            for b in range(m):
                cross[r, b] += factor * covariance[a, b]
        for b in range(m):
            half[r, b] = cross[r, b] - cov[rest[r], chosen[b]]
    for r in range(n):
        for q in range(r + 1):
            total = 0.5 * (cov[rest[r], rest[q]] + cov[rest[q], rest[r]])
            for b in range(m):
                total += half[r, b] * regression[q, b]
            cov[rest[r], rest[q]] = cov[rest[q], rest[r]] = total
    for a in range(m):
        z[chosen[a]] = value[a]
        for r in range(n):
            cov[rest[r], chosen[a]] = cov[chosen[a], rest[r]] = cross[r, a]
        for b in range(m):
            cov[chosen[a], chosen[b]] = covariance[a, b]


@helper
def forget(z, cov, prior_value, prior_information, keep, noise_information, first):  # type: ignore[no-untyped-def]
    """Stabilised forgetting: what is known of the parameters is mixed with the prior, keep : 1 - keep.

    The parameters begin at ``first``. Before that ``noise_information`` (k, k), which reading errors gave, is taken
    out: of J and h = J theta only J becomes smaller.

    Information keep P^-1 + (1 - keep) P0^-1, so a quiet flight returns to the prior instead of drifting and
    nothing can grow. The states keep their regression on the parameters.
    """
    p = z.size - first
    chosen = np.arange(first, z.size)
    inverse = inverse_of(cov, chosen)
    information, mixed, value = np.empty((p, p)), np.empty((p, p)), np.zeros(p)
    vector = np.empty(p)
    for a in range(p):
        vector[a] = (1.0 - keep) * prior_information[a] * prior_value[a]
        for b in range(p):
            vector[a] += keep * inverse[a, b] * z[first + b]
            information[a, b] = keep * inverse[a, b]
            if a < noise_information.shape[0] and b < noise_information.shape[0]:
                information[a, b] -= keep * noise_information[a, b]
        information[a, a] += (1.0 - keep) * prior_information[a]
    invert(information, mixed)
    for a in range(p):
        for b in range(a):
            mixed[a, b] = mixed[b, a] = 0.5 * (mixed[a, b] + mixed[b, a])
    for a in range(p):
        for b in range(p):
            value[a] += mixed[a, b] * vector[b]
    put_marginal(z, cov, chosen, inverse, value, mixed)


@helper
def of_derivatives(resting, ns):  # type: ignore[no-untyped-def]
    """Whether each derivative is by a resting state or input, (k,), of ``resting`` (ns + nu,)."""
    nd = resting.size
    chosen = np.empty(ns * nd, dtype=np.bool_)
    for a in range(ns):
        for j in range(nd):
            chosen[a * nd + j] = resting[j]
    return chosen


@helper
def leave_out(matrix, vector, before, mean, resting, ns):  # type: ignore[no-untyped-def]
    """Leaves out what was learned of the derivatives by resting states and inputs.

    Where the states of the mode rest, all that ties other derivatives to theirs is noise, and the others are as the
    data say at the mean that these had. An input that rests within its noise while the states move may follow the trim
    slowly: what the others are known for goes with its derivatives, and is no better known than they are. These keep
    their distribution; the others have theirs given these.

    Args:
        matrix, vector: information about all derivatives now, (k, k) and (k,), changed in place.
        before: (k, k), the matrix before it was learned.
        mean: (k,), the mean then.
        resting: which states and inputs, (ns + nu,).
    """
    chosen = of_derivatives(resting, ns)
    if resting[:ns].any():
        _leave_out_alone(matrix, vector, before, mean, chosen)
    else:
        _keep_distribution(matrix, vector, before, mean, np.flatnonzero(chosen))


@helper
def _leave_out_alone(matrix, vector, before, mean, chosen):  # type: ignore[no-untyped-def]
    """The information about ``chosen`` derivatives, (k,) of bool, becomes that of ``before``; the others' that at the
    mean that these had."""
    k = mean.size
    for a in range(k):
        if chosen[a]:
            vector[a] = 0.0
            for b in range(k):
                vector[a] += before[a, b] * mean[b]
        else:
            for b in range(k):
                if chosen[b]:
                    vector[a] -= (matrix[a, b] - before[a, b]) * mean[b]
    for a in range(k):
        for b in range(k):
            if chosen[a] or chosen[b]:
                matrix[a, b] = before[a, b]


@helper
def _keep_distribution(matrix, vector, before, mean, chosen):  # type: ignore[no-untyped-def]
    """The ``chosen`` derivatives, indices (m,), get the distribution of ``before``; the others, given these, stay."""
    k, m = mean.size, chosen.size
    covariance, earlier, value = np.empty((k, k)), np.empty((k, k)), np.zeros(k)
    invert(matrix, covariance)
    invert(before.copy(), earlier)
    for a in range(k):
        for b in range(k):
            value[a] += covariance[a, b] * vector[b]
    kept, kept_covariance = np.empty(m), np.empty((m, m))
    for a in range(m):
        kept[a] = mean[chosen[a]]
        for b in range(m):
            kept_covariance[a, b] = earlier[chosen[a], chosen[b]]
    put_marginal(value, covariance, chosen, inverse_of(covariance, chosen), kept, kept_covariance)
    invert(covariance, matrix)
    for a in range(k):
        vector[a] = 0.0
        for b in range(k):
            vector[a] += matrix[a, b] * value[b]


@helper
def reseat(z, cov, value, covariance, first):  # type: ignore[no-untyped-def]
    """Gives the derivatives another mean and covariance; all else, given the derivatives, stays.

    Args:
        z, cov: changed in place.
        value, covariance: of the derivatives, (k,) and (k, k).
        first: where they begin in ``z``.
    """
    chosen = np.arange(first, first + value.size)
    put_marginal(z, cov, chosen, inverse_of(cov, chosen), value, covariance)
