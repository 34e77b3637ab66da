"""How strong unmeasured accelerations e are: process variances as parameters of the likelihood of the innovations.

With lambda the logarithm of the variance, x' and P' the derivatives by lambda of the mean and covariance of states and
e, (I - K H) what a reading leaves of an error, nu its innovation and S the variance of that, a step and a reading do

    x' <- F x',                         P' <- F P' F' + Q_e,
    x' <- (I - K H) x' + K' nu,         P' <- (I - K H) P' (I - K H)',      K' = (I - K H) P' H' / S,

and the reading adds to score and information what ``docs/methods/kalman_filter.md``, (11), says. All of it is at given
derivatives; S is that of the filter, so that an innovation which unknown derivatives may have caused counts little.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.ekf.model import acceleration_state
from wingwatch.estimators.ekf.noise import UNMODELLED
from wingwatch.estimators.ekf.state import ACCELERATION
from wingwatch.kernels.decorators import hot, whole

__all__ = [
    "Slope",
    "correct_slope",
    "follow_moment_levels",
    "follow_moment_levels_inline",
    "forget_moment_levels",
    "predict_slope",
]

Array = NDArray[np.float64]

MOST_INFORMATION = 0.5
"""What one sample tells of the logarithm of a variance, were its noise itself seen."""


class Slope(NamedTuple):
    """Of one vehicle and one moment; all but the sizes advanced in place."""

    mean: Array
    """(ns + 1,): x'."""
    covariance: Array
    """(ns + 1, ns + 1): P'."""
    states: int
    """ns."""
    moment: int
    """Place of e in the augmented state."""


@whole
def follow_moment_levels(model, state, i, step, jacobian, measured, rate, work):  # type: ignore[no-untyped-def]
    """``follow_moment_levels_inline`` for the engine "filterpy"."""
    follow_moment_levels_inline(model, state, i, step, jacobian, measured, rate, work)


@hot
def follow_moment_levels_inline(model, state, i, step, jacobian, measured, rate, work):  # type: ignore[no-untyped-def]
    """One sample of vehicle i: the variance of each e goes a step of Fisher's scoring up the likelihood.

    The information is a mean over all samples, from ``adapt_s`` on over the last of them; to it comes that of one
    nat, for a sample alone says nothing. The logarithm rises by one, at most, while the span passes. Innovations many
    times their stated size, of a level far too low or of derivatives far off, seem to tell as much more: such a sample
    counts as one that tells ``MOST_INFORMATION``, in score and information alike. What is known of the logarithm is
    known at the present level, and goes with it: of a reading of which it makes the fraction f of the variance that is
    f^2 / 2, whose logarithm has the slope 2 (1 - f).

    Args:
        model: of the filter.
        state: ``Running``, advanced; i: the vehicle.
        step, jacobian: of the sample, the second (nx, nz).
        measured: its ``Readings`` and ``Gains``, as ``covariance.correct`` leaves them.
        rate: weight of the sample in the means.
        work: (ns + 1, ns + 1).
    """
    if model.sizes.gusts == 0:
        return
    ns, noise, level = model.sizes.states, state.noise, state.moment_level
    passing = 1.0 - step.decay[ACCELERATION]
    per_step = passing / step.dt_s
    for k in range(0 if model.roll and model.use_accelerometer else 1, ns):
        slope = Slope(level.mean[i, k], level.covariance[i, k], ns, acceleration_state(ns, k))
        variance = noise.unmeasured[i, k]
        predict_slope(slope, jacobian, variance, work)
        score, information = correct_slope(slope, measured, work)
        level.samples[i, k] += 1.0
        to_means = max(rate, 1.0 / level.samples[i, k])
        weight = min(1.0, MOST_INFORMATION / max(information, 1e-30))
        level.information[i, k] += to_means * (weight * information - level.information[i, k])
        change = min(to_means * weight * score / (level.information[i, k] + to_means), passing)
        fraction = min(np.sqrt(2.0 * level.information[i, k]), 1.0)
        level.information[i, k] *= np.exp(2.0 * (1.0 - fraction) * change)
        # what moves the aircraft less than the model is wrong in the calmest air cannot be distinguished from that
        least = UNMODELLED * passing * noise.reading[i, ns]
        if k > 0:
            least = UNMODELLED * noise.reading[i, k] * per_step * per_step
        noise.unmeasured[i, k] = max(variance * np.exp(change), least)


@hot
def forget_moment_levels(level, i):  # type: ignore[no-untyped-def]
    """The states of vehicle i begin anew."""
    level.mean[i] = 0.0
    level.covariance[i] = 0.0


@hot
def predict_slope(slope, jacobian, variance, work):  # type: ignore[no-untyped-def]
    """x' and P' over a step in which e is driven with ``variance``, at any time within it (docs (5)).

    e goes on as it decays alone: the last row of F holds nothing else.
    """
    ns, moment, mean, cov = slope.states, slope.moment, slope.mean, slope.covariance
    decay = jacobian[moment, moment]
    for a in range(ns):
        work[0, a] = jacobian[a, moment] * mean[ns]
        for b in range(ns):
            work[0, a] += jacobian[a, b] * mean[b]
    for a in range(ns):
        mean[a] = work[0, a]
    mean[ns] *= decay
    for b in range(ns + 1):
        for a in range(ns):
            work[a, b] = jacobian[a, moment] * cov[ns, b]
            for c in range(ns):
                work[a, b] += jacobian[a, c] * cov[c, b]
        work[ns, b] = decay * cov[ns, b]
    for a in range(ns + 1):
        later_a = jacobian[a, moment] if a < ns else decay - 1.0
        driven_a = 0.5 * later_a + (1.0 if a == ns else 0.0)
        for b in range(min(a + 1, ns)):
            later_b = jacobian[b, moment]
            total = variance * (driven_a * (0.5 * later_b) + later_a * later_b / 12.0)
            total += work[a, ns] * jacobian[b, moment]
            for c in range(ns):
                total += work[a, c] * jacobian[b, c]
            cov[a, b] = cov[b, a] = total
    later = decay - 1.0
    cov[ns, ns] = variance * ((1.0 + 0.5 * later) ** 2 + later * later / 12.0) + work[ns, ns] * decay


@hot
def correct_slope(slope, measured, work):  # type: ignore[no-untyped-def]
    """x' and P' by the readings of an instant, one after the other; returns their score and information."""
    readings, gains = measured
    ns, mean, cov, crossed, row = slope.states, slope.mean, slope.covariance, work[0], readings.row
    score = information = 0.0
    for j in range(ns + 1):
        root = gains.inverse_std[j]
        if root == 0.0:
            continue
        if j < ns:
            moved, spread = -mean[j] * root, cov[j, j] * root * root
            for a in range(ns + 1):
                crossed[a] = cov[j, a]
        else:
            moved, spread = _seen_by_row(slope, row, crossed)
            moved, spread = moved * root, spread * root * root
        gain, innovation = gains.gain[j], gains.innovation[j]
        score += 0.5 * (innovation * innovation - 1.0) * spread - innovation * moved
        information += moved * moved + 0.5 * spread * spread
        for a in range(ns + 1):
            by = gain[a] if a < ns else gain[slope.moment]
            crossed_a = crossed[a] * root
            mean[a] += (crossed_a - by * spread) * innovation + by * moved
            for b in range(a + 1):
                other = gain[b] if b < ns else by
                left = by * other * spread - (by * (crossed[b] * root) + other * crossed_a)
                cov[a, b] += left
                cov[b, a] = cov[a, b]
    return score, information


@hot
def _seen_by_row(slope, row, crossed):  # type: ignore[no-untyped-def]
    """Of the accelerometer's ``row``: less what it sees of x', what it sees of P', and P' times it into ``crossed``."""
    ns, mean, cov, by_moment = slope.states, slope.mean, slope.covariance, row[slope.moment]
    moved, spread = -by_moment * mean[ns], 0.0
    for a in range(ns + 1):
        crossed[a] = cov[a, ns] * by_moment
        for b in range(ns):
            crossed[a] += cov[a, b] * row[b]
    for a in range(ns):
        moved -= row[a] * mean[a]
        spread += row[a] * crossed[a]
    return moved, spread + by_moment * crossed[ns]
