"""What the channels' own white noise leaves in a kinematic identity."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.conditioning.kinematics import IDENTITIES, Columns
from wingwatch.telemetry.conditioning.spectra import Bins, noise_floor

__all__ = ["detrended", "identity_noise"]

Array = NDArray[np.float64]

_ROWS = 300
"""Rows at which the slope of an identity is taken: it changes as slowly as the aircraft moves."""


def detrended(values: Array) -> Array:
    """Values (n,) less the straight line through them."""
    position = np.linspace(-1.0, 1.0, values.size)
    centred = values - np.mean(values)
    return np.asarray(centred - position * (position @ centred) / (position @ position))


def identity_noise(identity: str, columns: Columns, bins: Bins) -> float:
    """Power of the transform of an identity's rate that noise of its channels makes; it is flat.

    Each channel's level is that of the top of its own spectrum; how it enters is the identity's slope in it, root mean
    square over rows of the window.
    """
    few = {name: column[:: max(1, bins.samples // _ROWS)] for name, column in columns.items()}
    _, rate = IDENTITIES[identity](few)
    power = 0.0
    for name, column in columns.items():
        nudge = 1e-4 * max(float(np.std(few[name])), 1e-6)
        _, near = IDENTITIES[identity]({**few, name: few[name] + nudge})
        slope = float(np.mean(((near - rate) / nudge) ** 2))
        if slope > 0.0:
            power += noise_floor(bins, detrended(column)) * slope
    return power
