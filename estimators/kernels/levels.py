"""A level in a random walk, read with noise: followed with the gain that has predicted it best so far, compiled.

Of a random walk with variance Q a step, read with variance R, exponential smoothing is the best predictor, and its
gain K tells the two apart: Q = K^2 R / (1 - K) (Muth, Journal of the American Statistical Association 55, 1960).
So a few smoothers of fixed gain run side by side, and the one with the least mean squared error of prediction is
the most likely. What is known of the level's motion (inertial navigation, say) is handed in and taken out.
"""

import numpy as np

from wingwatch.kernels.decorators import helper

__all__ = ["LEVELS", "SLOWEST_S", "advance_level", "set_gains", "start_level"]

LEVELS = 16
"""Smoothers a level; a level's memory is (4, LEVELS): gains, levels, mean squared errors, and the gains' time step."""

SLOWEST_S = 4.0
"""Time constant of the slowest smoother."""

HIGHEST_GAIN = 0.99
"""Gain of the fastest one: a level that moves by ten times its noise a step is followed by the readings alone."""

_ALLOWED = 4.0
"""Twice the log-likelihood that a slower smoother may be worse by: it is preferred within chance."""


@helper
def set_gains(memory, dt):  # type: ignore[no-untyped-def]
    """Gains of the smoothers for a step of ``dt`` s, into ``memory`` (4, gains); unchanged for an unchanged step."""
    if abs(dt - memory[3, 0]) > 1e-6 * dt:
        fastest = -dt / np.log(1.0 - HIGHEST_GAIN)
        for g in range(memory.shape[1]):
            smoothing_s = fastest * (SLOWEST_S / fastest) ** (g / (memory.shape[1] - 1.0))
            memory[0, g] = 1.0 - np.exp(-dt / smoothing_s)
        memory[3, 0] = dt


@helper
def start_level(memory, reading):  # type: ignore[no-untyped-def]
    """Every smoother of ``memory`` (4, gains) at a first reading, in its unit; nothing known of its errors."""
    memory[1, :] = reading
    memory[2, :] = 0.0
    memory[3, 1] = 1.0


@helper
def advance_level(memory, reading, motion, dt, memory_s):  # type: ignore[no-untyped-def]
    """One reading more; returns the index of the smoother to go by.

    Args:
        memory: (4, LEVELS), advanced; ``memory[1, index]`` is the level, ``memory[0, index]`` the gain.
        reading: the level with its noise.
        motion: how far the level is known to have moved since the last reading.
        dt: time since then, s.
        memory_s: time constant of the mean squared errors.
    """
    set_gains(memory, dt)
    memory[3, 1] += 1.0
    seen = memory[3, 1]
    rate = max(dt / memory_s, 1.0 / seen)
    best = np.inf
    for g in range(memory.shape[1]):
        gain = max(memory[0, g], 1.0 / seen)
        error = reading - memory[1, g] - motion
        memory[1, g] += motion + gain * error
        # a young smoother errs more than its gain alone says: R / (1 - K), K = 1 / seen
        error *= np.sqrt((1.0 - gain) / (1.0 - memory[0, g])) if gain > memory[0, g] else 1.0
        memory[2, g] += rate * (error * error - memory[2, g])
        best = min(best, memory[2, g])
    for g in range(memory.shape[1] - 1, -1, -1):
        if memory[2, g] <= best * (1.0 + _ALLOWED * rate):
            return g
    return 0
