"""Compiled extended Kalman filter: predict, correct, adapt and forget, for a batch of vehicles.

Derivation in ``docs/estimators.md``.
"""

import numpy as np
from numba import njit

from wingwatch.estimators.ekf_model import measure, transition
from wingwatch.estimators.signals import MAX_GAP_S

__all__ = ["WARM_UP", "adapt_noise", "solve_all", "step_inputs", "trim_drift", "update_all", "warm_up"]

PROCESS_PACE = 0.2
"""Process noise adapts this much slower than measurement noise, so that the two are told apart."""

WARM_UP = 10
"""Samples that only set the states and the first noise levels."""


@njit(cache=True)
def step_inputs(new, old, older, held, reference, exponents, longitudinal, roll, by_accelerometer, ns, nu):  # type: ignore[no-untyped-def]
    """What a step needs besides the state: inputs over it, inputs at its end, scale, forward, kappa, rest."""
    kinematic = 2 + ns + nu
    over, at_end = np.empty(nu), np.empty(nu)
    for j in range(nu):
        c = 2 + ns + j
        at_end[j] = new[c]
        over[j] = old[c] if held[j] or old[c] == older[c] else 0.5 * (old[c] + new[c])
    kappa, speed, density = new[kinematic + 1], new[kinematic + 2], new[kinematic + 3]
    pressure = density * speed / (reference[0] * reference[1])
    scale = np.empty(ns * (ns + nu))
    for k in range(ns):
        for c in range(ns + nu):
            scale[k * (ns + nu) + c] = pressure if exponents[c] == 1.0 else kappa
    alpha = new[kinematic + 5]
    if not np.isfinite(alpha):
        alpha = 0.0
    forward = np.zeros(ns)
    forward[ns - 1] = speed * np.cos(alpha) * (1.0 if longitudinal else -1.0)
    if roll:
        forward[1] = speed * np.sin(alpha)
    rest = 0.5 * (old[kinematic] + new[kinematic])
    if by_accelerometer:
        rest += 0.5 * (old[1 + ns] + new[1 + ns])
    for j in range(1, ns):
        rest -= forward[j] * 0.5 * (old[1 + j] + new[1 + j])
    return over, at_end, scale, forward, kappa, rest


@njit(cache=True)
def adapt_noise(noise, residual, explained, correction, shrunk, measured, rate, ns):  # type: ignore[no-untyped-def]
    """Measurement variances from the residual after correction, process variances from the corrections.

    After correction E[r r'] = R - H P H', so R is the mean of r^2 + H P H'. A consistent filter corrects a state by as
    much as its variance shrinks, E[(K nu)^2] = P- - P+; what is corrected beyond that is process noise not yet
    in Q. Exponential means with weight ``rate``.
    """
    for j in range(ns + 1):
        if measured[j]:
            noise[j] += rate * (residual[j] * residual[j] + explained[j] - noise[j])
            noise[j] = max(noise[j], 1e-8 if j in (0, ns) else 1e-10)
    for k in range(ns):
        noise[ns + 1 + k] += PROCESS_PACE * rate * (correction[k] * correction[k] - shrunk[k])
        noise[ns + 1 + k] = max(noise[ns + 1 + k], 1e-12)


@njit(cache=True)
def trim_drift(noise, dt, corner, carried, ns):  # type: ignore[no-untyped-def]
    """Variance that a step adds to the trim constants: below ``corner`` (rad/s) they follow the data.

    A random walk of density s is seen through white noise of density R dt above the frequency where s / w^2
    equals it (a constant measured at once, by the accelerometer) or s / w^4 (one measured through an integration).
    """
    drift = np.empty(ns)
    for k in range(ns):
        if k == 0 and carried:
            drift[k] = noise[ns] * (corner * dt) ** 2
        else:
            drift[k] = noise[k] * dt * dt * corner**4
    return drift


@njit(cache=True)
def _predict(z, cov, noise, after, jacobian, drift, ns):  # type: ignore[no-untyped-def]
    nz = z.size
    top = jacobian @ cov
    for k in range(ns):
        for m in range(ns):
            total = 0.0
            for c in range(nz):
                total += top[k, c] * jacobian[m, c]
            cov[k, m] = total
        for c in range(ns, nz):
            cov[k, c] = top[k, c]
            cov[c, k] = top[k, c]
    for c in range(nz - ns, nz):
        cov[c, c] += drift[c - nz + ns]
    for k in range(ns):
        cov[k, k] += noise[ns + 1 + k]
        for m in range(k):
            mean = 0.5 * (cov[k, m] + cov[m, k])
            cov[k, m] = mean
            cov[m, k] = mean
    z[:] = after


@njit(cache=True)
def _correct(z, cov, noise, expected, jacobian, reading, measured, ns):  # type: ignore[no-untyped-def]
    """All measurements of one instant, one after the other; equal to the joint update for independent noise."""
    nz = z.size
    before = z.copy()
    gain = np.empty(nz)
    for j in range(ns + 1):
        if not measured[j]:
            continue
        row = jacobian[j]
        spread = noise[j]
        innovation = reading[j] - expected[j]
        for c in range(nz):
            gain[c] = 0.0
            if j < ns:
                gain[c] = cov[c, j]
            else:
                for d in range(nz):
                    gain[c] += cov[c, d] * row[d]
            innovation -= row[c] * (z[c] - before[c])
        if j < ns:
            spread += gain[j]
        else:
            for c in range(nz):
                spread += row[c] * gain[c]
        for c in range(nz):
            z[c] += gain[c] * innovation / spread
        for c in range(nz):
            for d in range(c + 1):
                cov[c, d] -= gain[c] * gain[d] / spread
                cov[d, c] = cov[c, d]


@njit(cache=True)
def _after_correction(z, cov, jacobian, expected, before, reading, ns):  # type: ignore[no-untyped-def]
    """Residual of each measurement after correction and its variance due to the state."""
    residual, explained = np.zeros(ns + 1), np.zeros(ns + 1)
    for j in range(ns + 1):
        residual[j] = reading[j] - expected[j]
        for c in range(z.size):
            if jacobian[j, c] == 0.0:
                continue
            residual[j] -= jacobian[j, c] * (z[c] - before[c])
            for d in range(z.size):
                explained[j] += jacobian[j, c] * cov[c, d] * jacobian[j, d]
    return residual, explained


@njit(cache=True)
def _forget(z, cov, prior_value, prior_information, keep, ns):  # type: ignore[no-untyped-def]
    """Stabilised forgetting: what is known of the parameters is mixed with the prior, keep : 1 - keep.

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
def warm_up(z, cov, new, noise, count, roughness, ns):  # type: ignore[no-untyped-def]
    """Warm-up: states as measured, first variances from second differences (their variance is 6 D)."""
    z[:ns] = new[1 : 1 + ns]
    for k in range(ns):
        cov[k, :] = 0.0
        cov[:, k] = 0.0
    for j in range(ns + 1):
        least = 1e-8 if j in (0, ns) else 1e-10
        noise[j] = max(roughness[j] / (6.0 * max(count - 2.0, 1.0)), least)
    for k in range(ns):
        cov[k, k] = noise[k]
        noise[ns + 1 + k] = 1e-4 * noise[k]


@njit(cache=True)
def update_all(  # type: ignore[no-untyped-def]
    signals, held, lever, exponents, reference, longitudinal, roll, use_accelerometer, adapt_s, corner,
    z, cov, noise, rows, roughness, condition, counts,
):  # fmt: skip
    """Run all samples of all vehicles; arrays lead with the vehicle axis and are advanced in place."""
    ns, nu = lever.size, held.size
    kinematic = 2 + ns + nu
    measured = np.ones(ns + 1, dtype=np.bool_)
    for i in range(signals.shape[0]):
        for k in range(signals.shape[1]):
            new = signals[i, k]
            complete = True
            for j in range(kinematic + 5):
                complete = complete and np.isfinite(new[j])
            if not complete:
                continue
            old, older = rows[i, 0], rows[i, 1]
            dt = new[0] - old[0]
            if not (0.0 < dt <= MAX_GAP_S):
                z[i, :ns] = new[1 : 1 + ns]
                for s in range(ns):
                    cov[i, s, :] = 0.0
                    cov[i, :, s] = 0.0
                    cov[i, s, s] = noise[i, s]
                rows[i, 1] = np.nan
                rows[i, 0] = new
                condition[i] = new[kinematic + 1 : kinematic + 6]
                continue
            counts[i, 0] += 1
            if counts[i, 0] <= WARM_UP:
                if np.isfinite(older[0]):
                    for j in range(ns + 1):
                        bend = new[1 + j] - 2.0 * old[1 + j] + older[1 + j]
                        roughness[i, j] += bend * bend
                warm_up(z[i], cov[i], new, noise[i], counts[i, 0], roughness[i], ns)
            else:
                carried = use_accelerometer and new[kinematic + 6] == 1.0 and old[kinematic + 6] == 1.0
                over, at_end, scale, forward, kappa, rest = step_inputs(
                    new, old, older, held, reference, exponents, longitudinal, roll, carried, ns, nu
                )
                after, jacobian = transition(z[i], dt, scale, forward, over, kappa, rest, carried, ns, nu)
                drift = trim_drift(noise[i], dt, corner, carried, ns)
                _predict(z[i], cov[i], noise[i], after, jacobian, drift, ns)
                expected, row = measure(z[i], scale, at_end, kappa, lever, ns, nu)
                measured[0] = new[kinematic + 6] == 1.0
                measured[ns] = use_accelerometer
                reading = new[1 : 2 + ns]
                before = z[i].copy()
                shrunk = np.diag(cov[i, :ns, :ns]).copy()
                _correct(z[i], cov[i], noise[i], expected, row, reading, measured, ns)
                residual, explained = _after_correction(z[i], cov[i], row, expected, before, reading, ns)
                correction = z[i, :ns] - before[:ns]
                shrunk -= np.diag(cov[i, :ns, :ns])
                rate = max(dt / adapt_s, 1.0 / (counts[i, 0] + 50.0))
                adapt_noise(noise[i], residual, explained, correction, shrunk, measured, rate, ns)
            rows[i, 1] = old
            rows[i, 0] = new
            condition[i] = new[kinematic + 1 : kinematic + 6]


@njit(cache=True)
def solve_all(  # type: ignore[no-untyped-def]
    memory_s, stale_s, prior_value, prior_std, z, cov, rows, clock, informed, variance, information, vector,
    gained_matrix, gained_vector, counts,
):  # fmt: skip
    """Note what the last half second taught, then forget; after ``stale_s`` of quiet, nothing is forgotten."""
    k = informed.shape[1]
    ns = z.shape[1] - prior_value.size
    prior_information = 1.0 / (prior_std * prior_std)
    for i in range(z.shape[0]):
        if counts[i, 0] <= WARM_UP:
            continue
        now = rows[i, 0, 0]
        parameters = np.ascontiguousarray(cov[i, ns : ns + k, ns : ns + k])
        fresh = np.linalg.inv(parameters)
        gained = fresh - information[i]
        gained_matrix[i] += gained
        gained_vector[i] += fresh @ z[i, ns : ns + k] - vector[i]
        for a in range(k):
            if parameters[a, a] < 0.98 * variance[i, a]:
                informed[i, a] = now
        elapsed = now - clock[i]
        clock[i] = now
        if 0.0 < elapsed < stale_s and now - np.max(informed[i]) < stale_s:
            _forget(z[i], cov[i], prior_value, prior_information, np.exp(-elapsed / memory_s), ns)
        parameters = np.ascontiguousarray(cov[i, ns : ns + k, ns : ns + k])
        information[i] = np.linalg.inv(parameters)
        vector[i] = information[i] @ z[i, ns : ns + k]
        variance[i] = np.diag(parameters)
        counts[i, 1] += 1
