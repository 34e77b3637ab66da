"""How rough the air is as the accelerometer alone tells it, for aircraft without vanes; compiled.

A gust reaches the accelerometer through z_w (or y_v) at once, and within a sample's time it moves as a random walk: of
variance Q a step it leaves 2 Q in the square of a second difference, white sensor noise of variance R leaves 6 R, and
the aircraft's own motion, which is smooth, next to nothing. Doublets and faults are rare beside gusts, which never
rest, so the median of the squares is followed, not their mean.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["ROUGHNESS", "follow_roughness", "is_gusty"]

ROUGHNESS = 4
"""Numbers that are remembered: logarithm of the median, samples seen, the last difference and the last reading."""

LEARN = 50
"""Samples over which the first level is averaged."""

MEDIAN = 0.4549
"""Median of the square of a standard normal number."""

LOG_MEAN = -1.2704
"""Mean of its logarithm."""


@njit(cache=True)
def follow_roughness(memory, values, memory_samples):  # type: ignore[no-untyped-def]
    """Follow the median of squared second differences of one vehicle's readings, in place.

    Args:
        memory: (4,), zeros at the start.
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


def is_gusty(memory: NDArray[np.float64], noise_variance: float) -> bool:
    """Whether more of the roughness is the air's than sensor noise makes.

    The level scatters by a tenth or two; twice the noise's is far beyond chance.

    Args:
        memory: of ``follow_roughness``.
        noise_variance: of the accelerometer, m2/s4; where it is not known 0, and all roughness is the air's.
    """
    return bool(memory[1] > LEARN and np.exp(memory[0]) / MEDIAN > 2.0 * 6.0 * noise_variance)
