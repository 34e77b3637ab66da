"""The filter's algebra: covariance predicted, corrected and mixed with the prior, in place and without allocating.

Covariances are kept whole, both triangles: rows are then contiguous, and adding the product h h' of one vector changes
both triangles alike to the last bit.
"""

import numpy as np
from numba import njit

from wingwatch.estimators.hot import hot

__all__ = ["correct", "forget", "keep_marginal", "predict", "reseat"]


@hot
def predict(cov, process, jacobian, drift, top, ns, nx, nz):  # type: ignore[no-untyped-def]
    """F P F' + Q for the Jacobian's rows ``jacobian`` (nx, nz), identity below; the last ``ns`` states drift.

    ``process`` (nx, nx), ``drift`` (ns,); ``top`` (nx, nz) is scratch.
    """
    top[:] = 0.0
    for k in range(nx):
        for m in range(nz):
            factor = jacobian[k, m]
            if factor != 0.0:
                for c in range(nz):
                    top[k, c] += factor * cov[m, c]
    for k in range(nx):
        for m in range(k + 1):
            total = 0.0
            for c in range(nz):
                total += top[k, c] * jacobian[m, c]
            total += 0.5 * (process[k, m] + process[m, k])
            cov[k, m] = total
            cov[m, k] = total
        for c in range(nx, nz):
            cov[k, c] = top[k, c]
            cov[c, k] = top[k, c]
    for k in range(ns):
        c = nz - ns + k
        cov[c, c] += drift[k]


@hot
def correct(z, cov, variance, excess, row, measured, ns, nz, gains, pushes, roots):  # type: ignore[no-untyped-def]
    """All measurements of one instant, one after the other; equal to the joint update for independent noise.

    The gains are found first, each from the covariance that those before it leave; the covariance follows in one pass.

    Args:
        z, cov: corrected in place.
        variance: of the measurements, the states' and the accelerometer's, (ns + 1,).
        excess: readings less what is expected, (ns + 1,).
        row: the accelerometer's Jacobian, (nz,).
        measured: which of them are there, (ns + 1,).
        gains, pushes, roots: scratch (m, nz), (m,), (m,), m an even number of at least ns + 1; rows past ns are zero.
            In the end ``gains`` are the gains times ``1 / roots``, the inverse standard deviations of the innovations.

    Returns:
        the accelerometer's residual after correction, and its variance due to the state, H P H'.
    """
    residual = explained = 0.0
    for j in range(ns + 1):
        for c in range(nz):
            gains[j, c] = 0.0
        pushes[j] = roots[j] = 0.0
        if not measured[j]:
            continue
        innovation = excess[j]
        _sees(cov, row, j, ns, nz, gains)
        for i in range(j):
            shared = _seen(gains, i, row, j, ns, nz)
            for c in range(nz):
                gains[j, c] -= shared * gains[i, c]
            innovation -= shared * pushes[i]
        spread = _seen(gains, j, row, j, ns, nz)
        total = spread + variance[j]
        if j == ns:
            residual, explained = innovation * variance[j] / total, spread * variance[j] / total
        root = 1.0 / np.sqrt(total)
        for c in range(nz):
            gains[j, c] *= root
        pushes[j] = innovation * root
        roots[j] = root
        for c in range(nz):
            z[c] += gains[j, c] * pushes[j]
    for j in range(0, ns + 1, 2):
        for c in range(nz):
            g, h = gains[j, c], gains[j + 1, c]
            for d in range(nz):
                cov[c, d] -= g * gains[j, d] + h * gains[j + 1, d]
    return residual, explained


@hot
def _sees(cov, row, j, ns, nz, gains):  # type: ignore[no-untyped-def]
    """P H' of measurement j, into row j of ``gains``."""
    if j < ns:
        for c in range(nz):
            gains[j, c] = cov[j, c]
        return
    for d in range(nz):
        factor = row[d]
        if factor != 0.0:
            for c in range(nz):
                gains[j, c] += factor * cov[d, c]


@hot
def _seen(gains, i, row, j, ns, nz):  # type: ignore[no-untyped-def]
    """What measurement j sees of gain i: its own state's element, or the accelerometer's row times it."""
    if j < ns:
        return gains[i, j]
    total = 0.0
    for c in range(nz):
        total += row[c] * gains[i, c]
    return total


@njit(cache=True)
def forget(z, cov, prior_value, prior_information, keep, less, ns):  # type: ignore[no-untyped-def]
    """Stabilised forgetting: what is known of the parameters is mixed with the prior, keep : 1 - keep.

    Before that ``less`` (k, k), information on the derivatives that was none, is taken out: of J and h = J theta
    only J becomes smaller.

    Information keep P^-1 + (1 - keep) P0^-1, so a quiet flight returns to the prior instead of drifting and
    nothing can grow. The states keep their regression on the parameters.
    """
    nz = z.size
    p = nz - ns
    parameters = np.ascontiguousarray(cov[ns:, ns:])
    cross = np.ascontiguousarray(cov[:ns, ns:])
    information = np.linalg.inv(parameters)
    regression = cross @ information
    conditional = cov[:ns, :ns] - regression @ np.ascontiguousarray(cross.T)
    vector = keep * (information @ z[ns:]) + (1.0 - keep) * (prior_information * prior_value)
    for a in range(less.shape[0]):
        for b in range(less.shape[0]):
            information[a, b] -= less[a, b]
    information *= keep
    for a in range(p):
        information[a, a] += (1.0 - keep) * prior_information[a]
    mixed = np.linalg.inv(information)
    mixed = 0.5 * (mixed + mixed.T)
    value = mixed @ vector
    z[:ns] += regression @ (value - z[ns:])
    z[ns:] = value
    cov[ns:, ns:] = mixed
    cross = regression @ mixed
    cov[:ns, ns:] = cross
    cov[ns:, :ns] = cross.T
    states = conditional + cross @ np.ascontiguousarray(regression.T)
    cov[:ns, :ns] = 0.5 * (states + states.T)


@njit(cache=True)
def keep_marginal(z, cov, value, covariance, chosen, first):  # type: ignore[no-untyped-def]
    """Takes back what was learned of some parameters; what the others are, given these, stays.

    Args:
        z, cov: changed in place.
        value, covariance: of all derivatives as they were, (k,) and (k, k).
        chosen: which of the derivatives to put back, indices.
        first: where the derivatives begin in ``z``.
    """
    nz, m = z.size, chosen.size
    now, before, shift = np.empty((m, m)), np.empty((m, m)), np.empty(m)
    cross = np.empty((nz, m))
    for a in range(m):
        shift[a] = value[chosen[a]] - z[first + chosen[a]]
        cross[:, a] = cov[:, first + chosen[a]]
        for b in range(m):
            now[a, b] = cov[first + chosen[a], first + chosen[b]]
            before[a, b] = covariance[chosen[a], chosen[b]]
    regression = cross @ np.linalg.inv(now)
    z += regression @ shift
    cov += regression @ (before - now) @ np.ascontiguousarray(regression.T)
    for a in range(nz):
        for b in range(a):
            cov[a, b] = cov[b, a] = 0.5 * (cov[a, b] + cov[b, a])


@njit(cache=True)
def reseat(z, cov, value, covariance, first):  # type: ignore[no-untyped-def]
    """Gives the derivatives another mean and covariance; all else, given the derivatives, stays.

    Args:
        z, cov: changed in place.
        value, covariance: of the derivatives, (k,) and (k, k).
        first: where they begin in ``z``.
    """
    last = first + value.size
    now = np.ascontiguousarray(cov[first:last, first:last])
    regression = np.ascontiguousarray(cov[:, first:last]) @ np.linalg.inv(now)
    z += regression @ (value - z[first:last])
    z[first:last] = value
    turned = np.ascontiguousarray(regression.T)
    cov += regression @ (covariance - now) @ turned
    cov[:] = 0.5 * (cov + cov.T)
    cross = regression @ covariance
    cov[:, first:last] = cross
    cov[first:last] = cross.T
    cov[first:last, first:last] = covariance
