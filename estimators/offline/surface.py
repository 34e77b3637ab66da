"""Surfaces at rest: a reading that only its sensor's noise moves drives nothing.

A filter that is driven by a noisy reading of a surface at rest expects motion that is not there, and learns that the
surface has no effect. Where a reading scatters no more than its noise does, the surface is taken to be at its mean over
that rest. What moves is taken as measured; its noise is a small part of it.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = ["at_rest"]

Array = NDArray[np.float64]

_HALF_S = 0.25
"""Half the span over which a reading's scatter is judged."""

_CHANCE = 1e-6
"""That noise alone scatters more."""

_DRIFT = 4.0
"""Errors of its mean over the span by which a level may deviate and still be one level."""


def at_rest(reading: Array, dt: float, noise_std: float) -> Array:
    """A surface with its rests at their levels, (n,).

    Args:
        reading: rad, (n,).
        dt: step, s.
        noise_std: of the reading, rad; nothing is changed where it is 0.
    """
    half = max(round(_HALF_S / dt), 2)
    width = 2 * half + 1
    if noise_std <= 0.0 or reading.size <= width:
        return reading
    mean, variance = _moving(reading, half)
    limit = noise_std**2 * float(scipy.stats.chi2.ppf(1.0 - _CHANCE, width - 1)) / width
    calm = variance <= limit
    levels = np.full(reading.size, np.nan)
    for start, end in _runs(calm):
        level = float(reading[start:end].mean())
        if np.abs(mean[start:end] - level).max() <= _DRIFT * noise_std / np.sqrt(width):
            levels[start:end] = level
    return np.where(np.isfinite(levels), levels, reading)


def _moving(reading: Array, half: int) -> tuple[Array, Array]:
    """Mean and variance over each sample's neighbours, ends mirrored."""
    padded = np.pad(reading - reading.mean(), half, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
    return windows.mean(axis=1) + reading.mean(), windows.var(axis=1)


def _runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(start, end) of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
