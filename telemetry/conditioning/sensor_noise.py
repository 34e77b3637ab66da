"""What the channels' own white noise leaves in a kinematic identity."""

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.conditioning.kinematics import IDENTITIES, Columns
from wingwatch.telemetry.conditioning.spectra import Bins, noise_floor

__all__ = ["detrended", "identity_noise"]

Array = NDArray[np.float64]


def detrended(values: Array) -> Array:
    """Values (n,) less the straight line through them."""
    position = np.linspace(-1.0, 1.0, values.size)
    centred = values - np.mean(values)
    return np.asarray(centred - position * (position @ centred) / (position @ position))


def identity_noise(identity: str, columns: Columns, bins: Bins) -> tuple[float, float]:
    """Power of the transform of (measured' - rate) that noise makes: of the rate's channels, and of the measured ones.

    The first is flat, the second goes with the frequency squared. Each channel's level is that of the top of its own
    spectrum; how it enters is the identity's slope in it, root mean square over the window.
    """
    measured, rate = IDENTITIES[identity](columns)
    flat, rising = 0.0, 0.0
    for name, column in columns.items():
        floor = noise_floor(bins, detrended(column))
        nudge = 1e-4 * max(float(np.std(column)), 1e-6)
        near_measured, near_rate = IDENTITIES[identity]({**columns, name: column + nudge})
        flat += floor * float(np.mean(((near_rate - rate) / nudge) ** 2))
        rising += floor * float(np.mean(((near_measured - measured) / nudge) ** 2))
    return flat, rising
