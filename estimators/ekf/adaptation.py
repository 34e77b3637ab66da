"""How a sample changes the levels of the filter's noise: what readings alone show, and what its corrections show.

Derivation in ``docs/methods/kalman_filter.md``, section 4. The formulas by themselves are in ``noise``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.ekf.noise import (
    LEAST,
    ROOT_MEAN,
    adapt_accelerometer,
    adapt_process,
    adapt_reading,
    difference_variance,
    learn_reading_noise,
)
from wingwatch.estimators.kernels.levels import advance_level
from wingwatch.estimators.kernels.reading_noise import follow_reading, largest_variance, reading_variance
from wingwatch.kernels.decorators import hot, whole

__all__ = [
    "Prediction",
    "Residuals",
    "adapt_noise",
    "adapt_noise_inline",
    "adapt_vane",
    "first_noise",
    "inertial_motion",
    "learn_noise",
]

Array = NDArray[np.float64]

_GAINS, _ERRORS = 0, 2
"""Rows of a level's memory (``kernels.levels``): the smoothers' gains, and their mean squared errors."""


LEAST_GUST = 1e-4 * LEAST
"""Variance of a gust a step, m2/s2, below which there is none."""


class Prediction(NamedTuple):
    """Before a correction: mean of the augmented state (nz,), variances of states and gust states (nx,)."""

    z: Array
    variance: Array


class Residuals(NamedTuple):
    """Of accelerometer and vane: what a correction leaves."""

    force: float
    """Accelerometer's reading less what the corrected state predicts, m/s2."""
    explained: float
    """Variance of ``force`` that is due to the state, m2/s4."""
    predicted: float
    """Specific force that was predicted, less the trim's part, m/s2."""
    input_variance: float
    """Variance that the inputs' reading errors add, m2/s4."""
    velocity: float
    """Vane's velocity less the corrected state's, m/s."""


@hot
def inertial_motion(new, old, dt, ns, kinematic):  # type: ignore[no-untyped-def]
    """How far the first state goes between two signal rows by specific force and kinematics, m/s.

    ``new``, ``old``: signal rows, (columns,); ``dt``: between them, s; ``ns``: number of states.
    """
    force = 1 + ns
    return 0.5 * dt * (new[force] + new[kinematic] + old[force] + old[kinematic])


@hot
def learn_noise(model, noise, memory, i, sample, z, after, rate):  # type: ignore[no-untyped-def]
    """Noise that needs no filter: the sensors', the inputs', and the gusts that the vane sees against inertial motion.

    ``after`` (augmented,) is what the filter predicts after ``z`` (augmented,), ``rate`` the weight of the sample in
    the means.
    """
    ns = model.sizes.states
    learn_reading_noise(
        noise.reading[i], memory.differences[i], model.stated_variance, sample, z, after, rate, ns
    )
    for j in range(ns + model.sizes.inputs):
        of_state = j < ns
        readings = memory.readings[i, j]
        stated = noise.reading[i, j] if of_state else model.input_variance[j - ns]
        follow_reading(readings, sample.new[1 + j if of_state else 2 + j], sample.dt_s, stated)
        noise.largest[i, j] = largest_variance(readings, stated)
        if not of_state:
            noise.inputs[i, j - ns] = reading_variance(readings, stated)
    if sample.inertial:
        level = memory.levels[i]
        index = advance_level(level, sample.new[1], sample.motion, sample.dt_s, model.adapt_s)
        gain, error = level[_GAINS, index], level[_ERRORS, index]
        carried = noise.reading[i, ns] * sample.dt_s * sample.dt_s
        noise.reading[i, 0] = max(min(noise.reading[i, 0], (1.0 - gain) * error), LEAST)
        noise.gust[i] = max(gain * gain * error - carried, LEAST_GUST)


@whole
def adapt_noise(model, noise, i, posterior, prediction, step, residuals, rate):  # type: ignore[no-untyped-def]
    """``adapt_vane`` and ``adapt_noise_inline`` for the engine "filterpy"."""
    adapt_vane(noise, i, posterior, step, residuals, rate)
    adapt_noise_inline(model, noise, i, posterior, prediction, step, residuals, rate)


@hot
def adapt_vane(noise, i, posterior, step, residuals, rate):  # type: ignore[no-untyped-def]
    """Noise of the vane that the filter's own corrections show, arguments as below.

    Only the first time that a sample is run. About derivatives that are wrong the vane contradicts the model, and run
    again and again it would pass for noise: nothing would contradict the model any more.
    """
    if step.inertial:
        noise.reading[i, 0] = adapt_reading(
            noise.reading[i, 0], residuals.velocity, posterior.cov[0, 0], rate
        )


@hot
def adapt_noise_inline(model, noise, i, posterior, prediction, step, residuals, rate):  # type: ignore[no-untyped-def]
    """Noise that the filter's own corrections show: of the accelerometer, and of the gusts that it does not see.

    Args:
        model: of the filter.
        noise: ``Noise``, advanced; i: the vehicle.
        posterior: after correction; prediction: before it.
        step, residuals: of this sample.
        rate: weight of the sample in the means.
    """
    ns, z, cov = model.sizes.states, posterior.z, posterior.cov
    if model.use_accelerometer:
        squared = residuals.force * residuals.force + residuals.explained
        adapt_accelerometer(noise, i, squared, residuals, rate, ns)
    if not step.inertial:
        noise.gust[i], noise.corrections[i] = adapt_process(
            noise.gust[i],
            noise.corrections[i],
            z[0] - prediction.z[0],
            prediction.variance[0],
            cov[0, 0],
            rate,
        )
        noise.gust[i] = max(noise.gust[i], LEAST_GUST)


@hot
def first_noise(model, noise, memory, i, sample, samples):  # type: ignore[no-untyped-def]
    """Noise that the filter starts from: unmeasured accelerations are as strong as second differences say.

    The variance of the accelerometer's equation is at most all of its roughness, at least its sensor's own: it starts
    in the middle of their logarithms.
    """
    reading, ns = noise.reading[i], model.sizes.states
    most = max(memory.roughness[i] / (6.0 * max(samples - 2.0, 1.0)), LEAST)
    stated = model.stated_variance[ns]
    reading[ns] = np.sqrt(most * stated) if 0.0 < stated < most else most
    if not sample.inertial:
        noise.gust[i] = 1e-4 * reading[0]
    noise.unmeasured[i, 0] = max(most - reading[ns], 0.01 * reading[ns]) if model.use_accelerometer else 0.0
    for k in range(1, ns):
        rough = difference_variance(memory.differences[i, k, ROOT_MEAN]) - 6.0 * reading[k]
        noise.unmeasured[i, k] = max(rough, 0.01 * reading[k]) / (sample.dt_s * sample.dt_s)
