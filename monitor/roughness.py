"""What the supervisor follows of the readings themselves: how the states move, and how rough an accelerometer is.

Compiled; arrays of all vehicles, one row each. Why: ``supervision``, rough air and flight without a vane.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = [
    "ROUGHNESS", "ROUGHNESS_SAMPLES", "follow_motion", "follow_motions", "follow_roughness", "follow_roughnesses",
    "is_gusty",
]  # fmt: skip

Array = NDArray[np.float64]

ROUGHNESS_SAMPLES = 250.0
"""Time constant, 5 s at 50 Hz: an autopilot's or doublet's jerk passes, gusts stay."""

ROUGHNESS = 4
"""Numbers remembered of it: logarithm of the median, samples seen, the last difference and the last reading."""

LEARN = 50
"""Samples over which the first level is averaged."""

MEDIAN = 0.4549
"""Median of the square of a standard normal number."""

LOG_MEAN = -1.2704
"""Mean of its logarithm."""


@njit(cache=True)
def follow_motions(motion, signals, lanes, memory_s):  # type: ignore[no-untyped-def]
    """``follow_motion`` of vehicles in lanes: ``motion`` (n, 3, ns), ``signals`` (vehicles, samples, columns)."""
    for m in range(lanes.place.size):
        follow_motion(motion[lanes.place[m]], signals[m, : lanes.counts[m]], memory_s)


@njit(cache=True)
def follow_roughnesses(memory, signals, lanes, column, memory_samples):  # type: ignore[no-untyped-def]
    """``follow_roughness`` of vehicles in lanes: ``memory`` (n, ROUGHNESS), readings in a column of ``signals``."""
    for m in range(lanes.place.size):
        follow_roughness(memory[lanes.place[m]], signals[m, : lanes.counts[m], column], memory_samples)


@njit(cache=True)
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


@njit(cache=True)
def follow_roughness(memory, values, memory_samples):  # type: ignore[no-untyped-def]
    """Follow the median of squared second differences of one vehicle's readings, in place.

    Args:
        memory: (ROUGHNESS,), zeros at the start.
        values: (samples,) readings in order; what is not finite is passed over.
        memory_samples: time constant, in samples.
    """
    for k in range(values.size):
        reading = values[k]
        if not np.isfinite(reading):
            continue
        step = reading - memory[3]
        twice = step - memory[2]
        memory[2], memory[3] = step, reading
        memory[1] += 1.0
        seen = memory[1] - 2.0
        if seen < 1.0:
            continue
        log = np.log(max(twice * twice, 1e-16))
        if seen <= LEARN:
            memory[0] += (log - LOG_MEAN + np.log(MEDIAN) - memory[0]) / seen
        else:
            # a step of 2 to either side moves the median as fast as a mean with this time constant
            memory[0] += np.sign(log - memory[0]) * 2.0 / memory_samples


def is_gusty(memory: Array, noise_variance: float) -> bool:
    """Whether more of the roughness is the air's than sensor noise makes.

    The level scatters by a tenth or two; twice the noise's is far beyond chance.

    Args:
        memory: of ``follow_roughness``.
        noise_variance: of the accelerometer, m2/s4; where it is not known 0, and all roughness is the air's.
    """
    return bool(memory[1] > LEARN and np.exp(memory[0]) / MEDIAN > 2.0 * 6.0 * noise_variance)
