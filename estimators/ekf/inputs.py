"""What the errors of the inputs' readings do to the filter, and the bias that they cause; compiled.

A reading m of an input is off by a white error n. The filter predicts with m, so the same n is in the innovation,
through the control derivatives B, and in its sensitivity to B: the product of the two has the mean -n^2 B, and B would
come out too small, by the fraction of noise in what the filter takes for the input's motion (the bias of errors in
variables). So:

- the effect of n on states and accelerometer belongs to their variances;
- while an input rests within its noise, nothing is learned of its derivatives (``solve``);
- else the information N that comes of n alone is taken out again. A least-squares solution with the true regressors is
  (M - N)^-1 h where one with noisy ones is M^-1 h. N is the energy that one error sends into the normalised
  innovations, summed over all errors. The filter's gains change slowly, so one error in ``FOLLOWED_STEPS`` is followed.
"""

import numpy as np

from wingwatch.estimators.ekf.state import FIRST_READING, READINGS, SQUARES, SUM
from wingwatch.kernels.decorators import helper, hot, whole

__all__ = [
    "FOLLOWED_STEPS",
    "correct_input_errors",
    "input_error_effect",
    "input_noise",
    "input_noise_information",
    "input_noise_into",
    "predict_input_errors",
    "track_readings",
]

FOLLOWED_STEPS = 40
"""Steps for which the effect of one reading error is followed."""


@hot
def track_readings(moments, new, ns, nu):  # type: ignore[no-untyped-def]
    """Sum and sum of squares of each state and input of a signal row (columns,), about its first reading, into
    ``moments``; see ``EkfState``."""
    for j in range(ns + nu):
        reading = new[1 + j if j < ns else 2 + j]
        if moments[j, READINGS] == 0.0:
            moments[j, FIRST_READING] = reading
        off = reading - moments[j, FIRST_READING]
        moments[j, READINGS] += 1.0
        moments[j, SUM] += off
        moments[j, SQUARES] += off * off


@hot
def input_error_effect(model, row, z, j, variance):  # type: ignore[no-untyped-def]
    """Effect of one standard error of input ``j``, of ``variance``, as ``row`` (nz,) of the Jacobian answers.

    Controls, as the trim constants, go with dynamic pressure, so an input acts as its own part of each constant.
    """
    ns, nd, nz = model.sizes.states, model.sizes.states + model.sizes.inputs, row.size
    effect = 0.0
    for k in range(ns):
        effect += row[nz - ns + k] * z[nz - ns - ns * nd + k * nd + ns + j]
    return effect * np.sqrt(variance)


@hot
def input_noise_into(model, jacobian, z, variance, course_variance, effect, q):  # type: ignore[no-untyped-def]
    """What reading errors of ``variance`` (nu,), and what is not known between the readings, of ``course_variance``
    (nu,), add to ``q`` of ``process_noise_into``; ``effect`` (nx,) is workspace.

    An error is in the means of two steps, its fractions adding up to one: over more than a step it acts as one whole.
    """
    ns = model.sizes.states
    for j in range(model.sizes.inputs):
        both = variance[j] + course_variance[j]
        if both > 0.0:
            for a in range(ns):
                effect[a] = input_error_effect(model, jacobian[a], z, j, both)
            for a in range(ns):
                for b in range(ns):
                    q[a, b] += effect[a] * effect[b]


@whole
def input_noise(model, jacobian, row, z, variance, course_variance, q):  # type: ignore[no-untyped-def]
    """``input_noise_into``; returns what the reading errors add to the variance of the accelerometer's ``row``."""
    input_noise_into(model, jacobian, z, variance, course_variance, np.empty(model.sizes.dynamic), q)
    added = 0.0
    for j in range(model.sizes.inputs):
        added += input_error_effect(model, row, z, j, variance[j]) ** 2
    return added


@hot
def predict_input_errors(model, errors, i, jacobian, newest_fraction, work):  # type: ignore[no-untyped-def]
    """Propagates the followed error of each input over a step's prediction.

    Args:
        model: of the filter.
        errors: ``InputErrors``, advanced; i: the vehicle.
        jacobian: of the step, (nx, nz).
        newest_fraction: of the newer reading in the step's mean, (nu,).
        work: (nx,).
    """
    ns, nx, nz, age = model.sizes.states, model.sizes.dynamic, jacobian.shape[1], errors.age[i]
    for j in range(model.sizes.inputs):
        if model.input_variance[j] == 0.0:
            continue
        response, energy = errors.response[i, j], errors.energy[i, j]
        fraction = newest_fraction[j] if age == 0 else (1.0 - newest_fraction[j] if age == 1 else 0.0)
        for r in range(ns):
            if age == 0:
                for a in range(nx):
                    response[a, r] = 0.0
                for a in range(ns):
                    energy[a, r] = 0.0
            for a in range(ns):
                total = fraction * jacobian[a, nz - ns + r]
                for b in range(nx):
                    total += jacobian[a, b] * response[b, r]
                work[a] = total
            for a in range(ns):
                response[a, r] = work[a]
            for a in range(ns, nx):
                response[a, r] *= jacobian[a, a]


@hot
def correct_input_errors(model, errors, i, readings, gains, work):  # type: ignore[no-untyped-def]
    """Sums the followed errors' energy in the normalised innovations and corrects them as the states were.

    ``readings`` and ``gains`` as ``covariance.correct`` leaves them; ``work`` has at least ns elements.
    """
    ns, nu, nx, row = model.sizes.states, model.sizes.inputs, model.sizes.dynamic, readings.row
    age, nz = errors.age[i], row.size
    for j in range(nu):
        if model.input_variance[j] == 0.0:
            continue
        response, energy = errors.response[i, j], errors.energy[i, j]
        for m in range(ns + 1):
            if not readings.measured[m]:
                continue
            for r in range(ns):
                seen = response[m, r] if m < ns else (row[nz - ns + r] if age == 0 else 0.0)
                if m == ns:
                    for a in range(nx):
                        seen += row[a] * response[a, r]
                work[r] = seen * gains.inverse_std[m]
            for r in range(ns):
                for a in range(nx):
                    response[a, r] -= gains.gain[m, a] * work[r]
                for c in range(ns):
                    energy[c, r] += work[c] * work[r]
    errors.age[i] = age + 1
    if age + 1 < FOLLOWED_STEPS:
        return
    errors.age[i] = 0
    for j in range(nu):
        for c in range(ns):
            for r in range(ns):
                errors.information[i, j, c, r] = errors.energy[i, j, c, r]


@helper
def input_noise_information(error_information, moments, variance, resting, out):  # type: ignore[no-untyped-def]
    """Information that came of reading errors since the last solution, into ``out`` (k, k); none of a resting input.

    ``error_information`` (nu, ns, ns) of ``InputErrors`` and ``moments`` (ns + nu, 4) of ``EkfState``, one vehicle's;
    ``variance`` of the readings, (nu,); ``resting`` (ns + nu,).
    """
    nu, ns = variance.size, error_information.shape[1]
    nd = ns + nu
    out[:] = 0.0
    for j in range(nu):
        if not resting[ns + j]:
            for a in range(ns):
                for b in range(ns):
                    power = moments[ns + j, READINGS] * variance[j] * error_information[j, a, b]
                    out[a * nd + ns + j, b * nd + ns + j] = power
