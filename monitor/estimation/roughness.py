"""What the supervisor follows of the readings themselves: how the states move, and how rough an accelerometer is.

Compiled; arrays of all vehicles, one row each. Why: ``supervision``, rough air and flight without a vane.
"""

import numpy as np
from numpy.typing import NDArray

from wingwatch.kernels.decorators import compiled, helper

__all__ = [
    "ROUGHNESS", "ROUGHNESS_SAMPLES", "follow_motion", "follow_motions", "follow_roughness", "follow_roughnesses",
    "is_gusty",
]  # fmt: skip

Array = NDArray[np.float64]

ROUGHNESS_SAMPLES = 250.0
"""Time constant, 5 s at 50 Hz: an autopilot's or doublet's jerk passes, gusts stay."""

MEAN_S, MEAN_SAMPLES = 0.1, 150.0
"""Weak gusts drown in the noise of a noisy accelerometer from sample to sample. Of means over ``MEAN_S`` n samples make
n^2 times as much of gusts beside noise; their time constant is 15 s, in means."""

ROUGHNESS = 7
"""Numbers remembered of a level: logarithm of the median, readings seen, the last difference and the last reading; of
the mean that is being formed the sum, the number of samples and the number of its span of time."""

LEARN = 50
"""Samples over which the first level is averaged."""

MEDIAN = 0.4549
"""Median of the square of a standard normal number."""

LOG_MEAN = -1.2704
"""Mean of its logarithm."""


@compiled()
def follow_motions(motion, signals, lanes, memory_s):  # type: ignore[no-untyped-def]
    """``follow_motion`` of vehicles in lanes: ``motion`` (n, 3, ns), ``signals`` (vehicles, samples, columns)."""
    for m in range(lanes.place.size):
        follow_motion(motion[lanes.place[m]], signals[m, : lanes.counts[m]], memory_s)


@compiled()
def follow_roughnesses(memory, signals, lanes, column):  # type: ignore[no-untyped-def]
    """``follow_roughness`` of vehicles in lanes, of samples and of means: ``memory`` (n, 2, ROUGHNESS), times in the
    first column of ``signals`` and readings in ``column``."""
    for m in range(lanes.place.size):
        own, count = memory[lanes.place[m]], lanes.counts[m]
        follow_roughness(own[0], signals[m, :count, 0], signals[m, :count, column], 0.0, ROUGHNESS_SAMPLES)
        follow_roughness(own[1], signals[m, :count, 0], signals[m, :count, column], MEAN_S, MEAN_SAMPLES)


@helper
def follow_motion(motion, signals, memory_s):  # type: ignore[no-untyped-def]
    """Running mean and mean square of the measured states of one vehicle, sample by sample, in place.

    Args:
        motion: (3, ns): means, mean squares, and the last time in the third row's first place; NaN at the start.
        signals: (samples, columns) from ``Signals``.
        memory_s: time constant.
    """
    ns = motion.shape[1]
    for k in range(signals.shape[0]):
        row = signals[k]
        complete = True
        for j in range(1 + ns):
            complete = complete and np.isfinite(row[j])
        if not complete:
            continue
        weight = 1.0
        if np.isfinite(motion[2, 0]):
            weight = 1.0 - np.exp(-max(row[0] - motion[2, 0], 0.0) / memory_s)
        for j in range(ns):
            before, square = (motion[0, j], motion[1, j]) if weight < 1.0 else (0.0, 0.0)
            motion[0, j] = before + weight * (row[1 + j] - before)
            motion[1, j] = square + weight * (row[1 + j] * row[1 + j] - square)
        motion[2, 0] = row[0]


@helper
def follow_roughness(memory, times, values, mean_s, memory_readings):  # type: ignore[no-untyped-def]
    """Follow the median of squared second differences of one vehicle's readings, in place.

    Args:
        memory: (ROUGHNESS,), zeros at the start.
        times: (samples,) in order, s.
        values: (samples,) what the sensor reads; what is not finite is passed over.
        mean_s: the readings are means over such spans, times the root of the number of their samples, so that white
            noise leaves them its variance; samples as they are where it is 0.
        memory_readings: time constant, in readings.
    """
    for k in range(values.size):
        if not np.isfinite(values[k]):
            continue
        if mean_s <= 0.0:
            _take_reading(memory, values[k], 1.0, memory_readings)
            continue
        span = np.floor(times[k] / mean_s + 1e-6)
        if memory[5] > 0.0 and span != memory[6]:
            _take_reading(memory, memory[4] / memory[5], memory[5], memory_readings)
            memory[4] = memory[5] = 0.0
        memory[4] += values[k]
        memory[5] += 1.0
        memory[6] = span


@helper
def _take_reading(memory, reading, samples, memory_readings):  # type: ignore[no-untyped-def]
    """One more reading, the mean of ``samples``."""
    step = reading - memory[3]
    twice = step - memory[2]
    memory[2], memory[3] = step, reading
    memory[1] += 1.0
    seen = memory[1] - 2.0
    if seen < 1.0:
        return
    log = np.log(max(twice * twice * samples, 1e-16))
    if seen <= LEARN:
        memory[0] += (log - LOG_MEAN + np.log(MEDIAN) - memory[0]) / seen
    else:
        # a step of 2 to either side moves the median as fast as a mean with this time constant
        memory[0] += np.sign(log - memory[0]) * 2.0 / memory_readings


def is_gusty(memory: Array, noise_variance: float) -> bool:
    """Whether more of the roughness is the air's than sensor noise makes.

    The level of samples scatters by a tenth or two: twice the noise's is far beyond chance. In means there is half as
    much as noise of the aircraft's own motion between doublets every 20 s, too, and they scatter by a sixth.

    Args:
        memory: of ``follow_roughness``, of samples and of means, (2, ROUGHNESS).
        noise_variance: of the accelerometer, m2/s4; where it is not known 0, and all roughness is the air's.
    """
    level = np.exp(memory[:, 0]) / (6.0 * MEDIAN)
    return bool(((memory[:, 1] > LEARN) & (level > _BEYOND_CHANCE * noise_variance)).any())


_BEYOND_CHANCE = np.array([2.0, 3.0])
