"""Noise levels of the Kalman filter, learned from the record itself, and what they add to its covariance; compiled.

``noise`` of one vehicle: variances of the measured states (ns), of the accelerometer's equation, of the gust a step
that the first state suffers, of the air's own unrest a step; then the accelerometer's share (squared) of error in
what it swings, and two running weights of its adaptation. ``NOISE_TAIL`` counts those three.
"""

import numpy as np
from numba import njit

from wingwatch.estimators.kernels.hot import hot

__all__ = [
    "NOISE_TAIL",
    "adapt_accelerometer",
    "adapt_unrest",
    "difference_variance",
    "process_noise",
    "process_noise_into",
    "sensor_noise",
    "trim_drift",
    "trim_drift_into",
]

NOISE_TAIL = 3

LEFT_OUT = 1e-3
"""Process variance of a rate a step, over its sensor's variance: what the model leaves out in the calmest air."""

ROOT_MEAN = 0.8221790
"""Mean of the square root of a standard normal number's magnitude, 2^(1/4) Gamma(3/4) / sqrt(pi)."""

LEAST = 1e-8
LEAST_RATE = 1e-10
"""Below any sensor's resolution nothing is gained: 1e-4 m/s and m/s2, 1e-5 rad/s."""

SWING_SHARE_MAX = 0.1
"""The accelerometer's equation is taken to be right within a tenth of what it swings."""

FASTEST = 10.0
"""A variance grows at most by this factor within one time constant of its adaptation."""


@hot
def difference_variance(root_mean):  # type: ignore[no-untyped-def]
    """Variance of differences whose magnitudes' roots have the mean ``root_mean``, if they are normal."""
    return (root_mean / ROOT_MEAN) ** 4


@hot
def sensor_noise(noise, lags, stated, new, old, older, motion, z, after, rate, carried, ns):  # type: ignore[no-untyped-def]
    """Variances of the measured states from how successive differences go together.

    White noise n leaves n - n' in a difference and n - 2 n' + n'' in a second one: variances 2 R and 6 R,
    covariances one and two samples apart -R and R. What moves an aircraft adds to the variance, but its increments
    do not go together over so few samples. Where the vane's velocity is known to have moved by ``motion``
    (inertial), what is left are gust and noise; of the others what the filter foresees, from ``z`` to ``after``, is
    taken out (where it foresees nothing, ``after`` is ``z``). Within what the covariance allows by its own standard
    error a ``stated`` variance (0: none) is believed, else the variance alone, which is the sharper figure in calm air.

    The variance is taken from the mean root of the differences' magnitudes: the few large ones at a doublet's edges
    are no noise. A difference of exactly nothing is that of a reading that was repeated, and is passed over.
    """
    for j in range(ns):
        step = new[1 + j] - old[1 + j]
        if j == 0 and carried:
            repeated = step == 0.0
            step -= motion
            far, white, chance = -lags[j, 0] * step, 2.0, 1.3
        else:
            foreseen = after[j] - z[j]
            step -= old[1 + j] - older[1 + j]
            repeated = step == 0.0
            step -= foreseen - lags[j, 4]
            lags[j, 4] = foreseen
            far, white, chance = lags[j, 1] * step, 6.0, 1.4
        lags[j, 1] = lags[j, 0]
        lags[j, 0] = step
        if not repeated:
            lags[j, 2] += rate * (np.sqrt(abs(step)) - lags[j, 2])
        lags[j, 3] += rate * (far - lags[j, 3])
        rough = difference_variance(lags[j, 2]) / white
        # standard error of the covariance of N white samples: chance white R / sqrt(N), N = 2 / rate
        doubt = chance * white * rough * np.sqrt(0.5 * rate)
        highest = min(rough, max(lags[j, 3], 0.0) + doubt)
        level = highest
        if stated[j] > 0.0:
            level = min(max(stated[j], lags[j, 3] - doubt), highest)
        noise[j] = max(level, LEAST if j == 0 else LEAST_RATE)


@hot
def adapt_accelerometer(noise, squared, swing, heard, rate, ns):  # type: ignore[no-untyped-def]
    """Variance of the accelerometer's equation: R + share swing^2, both by steps of Fisher's scoring.

    ``heard``: what the reading errors of the inputs add, known.

    ``squared`` is the square of the residual after correction plus its variance due to the state: E[r r'] = R - H P H'.
    """
    tail = noise.size - NOISE_TAIL
    power = swing * swing
    total = noise[ns] + noise[tail] * power + heard
    excess = (squared - total) / (total * total)
    noise[tail + 1] += rate * (1.0 / (total * total) - noise[tail + 1])
    noise[tail + 2] += rate * (power * power / (total * total) - noise[tail + 2])
    noise[ns] = max(noise[ns] + rate * excess / max(noise[tail + 1], 1e-30), LEAST)
    noise[tail] += rate * excess * power / max(noise[tail + 2], 1e-30)
    noise[tail] = min(max(noise[tail], 0.0), SWING_SHARE_MAX**2)


@hot
def adapt_unrest(variance, slow, correction, before, after, decay, rate):  # type: ignore[no-untyped-def]
    """Process variance of one state from its corrections; returns the variance and the corrections' slow sum.

    Corrections of a consistent filter are white with variance P- - P+. Summed with the filter's own forgetting of an
    error, decay P+ / P-, they show a gain that is too low by too much power, one that is too high by too little.
    """
    shrunk = max(before - after, 1e-30)
    contraction = decay * after / max(before, 1e-30)
    slow = contraction * slow + correction
    ratio = slow * slow * (1.0 - contraction * contraction) / shrunk
    return variance * (1.0 + rate * (min(ratio, FASTEST) - 1.0)), slow


@njit(cache=True)
def process_noise(noise, jacobian, dt, speed, decay, longitudinal, ns, gusts):  # type: ignore[no-untyped-def]
    """Covariance that a step adds to states and unrest, (nx, nx): sources that strike at any time within the step.

    A source v of unit strength, carried on for the rest of the step, adds v v' + (v u' + u v') / 2 + u u' / 3 with
    u = (F - I) v. The gust takes its change from the first state and, smoothed over the span, turns the air.
    """
    nx = ns + gusts
    q = np.empty((nx, nx))
    process_noise_into(noise, jacobian, dt, speed, decay, longitudinal, ns, gusts, np.empty((2, nx)), q)
    return q


@hot
def process_noise_into(noise, jacobian, dt, speed, decay, longitudinal, ns, gusts, uw, q):  # type: ignore[no-untyped-def]
    """``process_noise`` into ``q``: with w = v + u / 2 the sum above is w w' + u u' / 12; scratch ``uw`` (2, nx)."""
    nx = ns + gusts
    q[:] = 0.0
    for source in range(ns + (1 if gusts > 0 else 0)):
        turned = 0.0
        if source == 0:
            power = noise[ns + 1]
            if gusts > 0:
                turned = (1.0 - decay[1]) / (speed * dt)
                turned = turned if longitudinal else -turned
        elif source < ns:
            power = LEFT_OUT * noise[source]
        else:
            power = noise[ns + 2]
        for a in range(nx):
            v = (1.0 if a == source else 0.0) + (turned if a == nx - 1 else 0.0)
            u = jacobian[a, source] + jacobian[a, nx - 1] * turned - v
            uw[0, a], uw[1, a] = u, v + 0.5 * u
        for a in range(nx):
            u, w = power * uw[0, a] / 12.0, power * uw[1, a]
            for b in range(nx):
                q[a, b] += w * uw[1, b] + u * uw[0, b]


@njit(cache=True)
def trim_drift(noise, dt, corner, carried, ns):  # type: ignore[no-untyped-def]
    """Variance that a step adds to the trim constants: below ``corner`` (rad/s) they follow the data, (ns,)."""
    drift = np.empty(ns)
    trim_drift_into(noise, dt, corner, carried, ns, drift)
    return drift


@hot
def trim_drift_into(noise, dt, corner, carried, ns, drift):  # type: ignore[no-untyped-def]
    """``trim_drift`` into ``drift``.

    A random walk of density s is seen through white noise of density R dt above the frequency where s / w^2
    equals it (a constant measured at once, by the accelerometer) or s / w^4 (one measured through an integration).
    """
    for k in range(ns):
        if k == 0 and carried:
            drift[k] = noise[ns] * (corner * dt) ** 2
        else:
            drift[k] = noise[k] * dt * dt * corner**4
