"""Noise variances of the Kalman filter, learned from the record, and what they add to its covariance; compiled."""

import numpy as np

from wingwatch.estimators.ekf.model import acceleration_state, gust_turn
from wingwatch.estimators.ekf.state import PATH, TURN
from wingwatch.kernels.decorators import helper, hot, whole

__all__ = [
    "LEAST",
    "adapt_accelerometer",
    "adapt_process",
    "adapt_reading",
    "difference_variance",
    "learn_reading_noise",
    "process_noise",
    "process_noise_into",
    "trim_drift",
    "trim_drift_into",
]

LAST, BEFORE_LAST, ROOT_MEAN, COVARIANCE, PREDICTED = 0, 1, 2, 3, 4
"""Of each state in ``Memory.differences``: its last difference and the one before, the mean root of their magnitudes,
their covariance (one or two samples apart), and the step that the filter predicted last."""

UNMODELLED = 1e-3
"""Process variance of a rate a step, over its sensor's variance: what the model leaves out in the calmest air."""

NORMAL_ROOT_MEAN = 0.8221790
"""Mean of the square root of a standard normal number's magnitude, 2^(1/4) Gamma(3/4) / sqrt(pi)."""

PATH_STD = 1.0
"""Standard deviation of what the aircraft feels of the air's rate, as a fraction of what a gust's slope makes."""

LEAST = 1e-8
LEAST_RATE = 1e-10
"""Below any sensor's resolution nothing is gained: 1e-4 m/s and m/s2, 1e-5 rad/s."""

GAIN_ERROR_MAX = 0.1
"""The accelerometer's equation is taken to be right within a tenth of the predicted specific force."""

FASTEST = 10.0
"""A variance grows at most by this factor within one time constant of its adaptation."""


@hot
def difference_variance(root_mean):  # type: ignore[no-untyped-def]
    """Variance of differences whose magnitudes' roots have the mean ``root_mean``, if they are normal."""
    return (root_mean / NORMAL_ROOT_MEAN) ** 4


@hot
def learn_reading_noise(variance, differences, stated, sample, z, after, rate, ns):  # type: ignore[no-untyped-def]
    """Variances of the measured states from how successive differences go together.

    White noise n leaves n - n' in a difference and n - 2 n' + n'' in a second one: variances 2 R and 6 R,
    covariances one and two samples apart -R and R. What moves an aircraft adds to the variance, but its increments
    do not go together over so few samples. Where the vane's velocity is known to have moved (``Sample.motion``), gust
    and noise are left, and the filter's own residuals adapt the variance (``adapt_reading``) within what the covariance
    allows by its own standard error; of the others what the filter predicts is taken out. A stated variance is believed
    where the covariance is less than two standard errors below it or one above, for what is taken for too little noise
    is claimed; else the variance alone, which is the sharper figure in calm air.

    The variance is taken from the mean root of the differences' magnitudes: the few large ones at a doublet's edges
    are no noise. A difference of exactly nothing is that of a reading that was repeated, and is passed over.

    Args:
        variance, differences: of one vehicle, advanced: (ns + 1,) of ``Noise`` and (ns, 5) of ``Memory``.
        stated: variances as the aircraft file states them, (ns + 1,), 0: not at all.
        sample: the ``Sample``.
        z, after: state before the step and as predicted after it; the same where nothing is predicted.
        rate: weight of the sample in the means.
        ns: number of states.
    """
    new, old, older = sample.new, sample.old, sample.older
    for j in range(ns):
        step = new[1 + j] - old[1 + j]
        if j == 0 and sample.inertial:
            repeated = step == 0.0
            step -= sample.motion
            product, white, spread = -differences[j, LAST] * step, 2.0, 1.3
        else:
            predicted = after[j] - z[j]
            step -= old[1 + j] - older[1 + j]
            repeated = step == 0.0
            step -= predicted - differences[j, PREDICTED]
            differences[j, PREDICTED] = predicted
            product, white, spread = differences[j, BEFORE_LAST] * step, 6.0, 1.4
        differences[j, BEFORE_LAST] = differences[j, LAST]
        differences[j, LAST] = step
        if not repeated:
            differences[j, ROOT_MEAN] += rate * (np.sqrt(abs(step)) - differences[j, ROOT_MEAN])
        differences[j, COVARIANCE] += rate * (product - differences[j, COVARIANCE])
        rough = difference_variance(differences[j, ROOT_MEAN]) / white
        # standard error of the covariance of N white samples: spread white R / sqrt(N), N = 2 / rate
        error = spread * white * rough * np.sqrt(0.5 * rate)
        covariance = differences[j, COVARIANCE]
        level = highest = min(rough, max(covariance, 0.0) + error)
        if j == 0 and sample.inertial:
            level = min(max(variance[j], covariance - error), highest)
        elif stated[j] > 0.0:
            level = min(max(stated[j], covariance - error), rough, max(covariance, 0.0) + 2.0 * error)
        variance[j] = max(level, LEAST if j == 0 else LEAST_RATE)


@hot
def adapt_reading(variance, residual, explained, rate):  # type: ignore[no-untyped-def]
    """Variance of a reading from its residual after correction, whose variance due to the state is ``explained``.

    E[r r'] + H P H' = R at the right variance, and each step brings the likelihood up (expectation maximisation).
    """
    return variance + rate * (residual * residual + explained - variance)


@hot
def adapt_accelerometer(noise, i, squared, residuals, rate, ns):  # type: ignore[no-untyped-def]
    """Variance of the accelerometer's equation: R + gain force^2, both by steps of Fisher's scoring.

    Information is that of a record with the present R: of one with a smaller R much more would be known, and a level
    that has come up by mistake would not come down again.

    ``residuals`` hold what the filter predicts and what the inputs' reading errors add, which is known; ``squared`` is
    the square of the residual after correction plus its variance due to the state: E[r r'] = R - H P H'.
    """
    reading, fisher = noise.reading[i], noise.fisher[i]
    power = residuals.predicted * residuals.predicted
    total = reading[ns] + noise.gain[i] * power + residuals.input_variance
    share = (reading[ns] / total) ** 2
    fisher[0] += rate * (share - fisher[0])
    fisher[1] += rate * (share * power * power - fisher[1])
    excess = share * (squared - total)
    reading[ns] = max(reading[ns] + rate * excess / max(fisher[0], 1e-30), LEAST)
    noise.gain[i] += rate * excess * power / max(fisher[1], 1e-30)
    noise.gain[i] = min(max(noise.gain[i], 0.0), GAIN_ERROR_MAX**2)


@hot
def adapt_process(variance, discounted, correction, before, after, rate):  # type: ignore[no-untyped-def]
    """Process variance of one state from its corrections; returns the variance and the corrections' discounted sum.

    Corrections of a consistent filter are white with variance P- - P+. Summed with the filter's own forgetting of an
    error, P+ / P-, they show a gain that is too low by too much power, one that is too high by too little.
    """
    shrunk = max(before - after, 1e-30)
    contraction = after / max(before, 1e-30)
    discounted = contraction * discounted + correction
    ratio = discounted * discounted * (1.0 - contraction * contraction) / shrunk
    return variance * (1.0 + rate * (min(ratio, FASTEST) - 1.0)), discounted


@helper
def process_noise(model, noise, i, jacobian, step):  # type: ignore[no-untyped-def]
    """Covariance that a step adds to states and gust states, (nx, nx): sources that strike at any time within the step.

    A source v of unit strength, propagated for the rest of the step, adds v v' + (v u' + u v') / 2 + u u' / 3 with
    u = (F - I) v. The gust takes its change from the first state and, smoothed over the span, turns the air.
    """
    nx = model.sizes.dynamic
    q = np.empty((nx, nx))
    process_noise_into(model, noise, i, jacobian, step, np.empty((2, nx)), q)
    for a in range(nx):
        for b in range(a):
            q[b, a] = q[a, b]
    return q


@hot
def process_noise_into(model, noise, i, jacobian, step, work, q):  # type: ignore[no-untyped-def]
    """The lower triangle of ``process_noise`` into ``q``, the sum above as w w' + u u' / 12, w = v + u / 2; ``work``
    is (2, nx)."""
    ns, gusts = model.sizes.states, model.sizes.gusts
    driven = ns + (1 if gusts > 0 else 0)
    q[:] = 0.0
    for s in range(2 * ns if gusts > 0 else ns):
        turn = gust_turn(model) if s == 0 else 0.0
        source = s
        if s == 0:
            power = noise.gust[i]
        elif s < ns:
            power = UNMODELLED * noise.reading[i, s]
        elif model.roll or s == ns + 1:
            power, source = noise.unmeasured[i, s - ns], acceleration_state(ns, s - ns)
        else:
            continue
        own = (
            source if s >= ns else ns + TURN
        )  # the one gust state that the source drives, or the gust with it
        for m in range(driven):
            a = m if m < ns else own
            v = (1.0 if a == source else 0.0) + (turn if a == ns + TURN else 0.0)
            u = jacobian[a, source] + (jacobian[a, ns + TURN] * turn if turn != 0.0 else 0.0) - v
            work[0, m], work[1, m] = u, v + 0.5 * u
        for m in range(driven):
            a = m if m < ns else own
            u, w = power * work[0, m] / 12.0, power * work[1, m]
            for k in range(m + 1):
                q[a, k if k < ns else own] += w * work[1, k] + u * work[0, k]
    for g in range(PATH, PATH + ns if gusts > 0 else PATH):
        q[ns + g, ns + g] += (1.0 - step.decay[g] ** 2) * PATH_STD * PATH_STD


@whole
def trim_drift(model, noise, i, step):  # type: ignore[no-untyped-def]
    """Variance that a step adds to the trim constants, (ns,): slower changes than the trim corner are theirs."""
    drift = np.empty(model.sizes.states)
    trim_drift_into(model, noise, i, step, drift)
    return drift


@hot
def trim_drift_into(model, noise, i, step, drift):  # type: ignore[no-untyped-def]
    """``trim_drift`` into ``drift``.

    A random walk of density s is seen through white noise of density R dt above the frequency where s / w^2
    equals it (a constant measured at once, by the accelerometer) or s / w^4 (one measured through an integration).
    """
    ns, dt, corner = model.sizes.states, step.dt_s, model.trim_corner_rad_s
    for k in range(ns):
        if k == 0 and step.inertial:
            drift[k] = noise.reading[i, ns] * (corner * dt) ** 2
        else:
            drift[k] = noise.reading[i, k] * dt * dt * corner**4
