"""What noise of the measured surfaces adds to the information, taken out of it again."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

__all__ = ["signal_information"]

Array = NDArray[np.float64]

_LEAST_SIGNAL = 0.2
"""Least part of a direction's information that is taken to be signal where surfaces are measured with noise."""


def signal_information(information: Array, echo: Array, prior: Array) -> Array:
    """Information without that of the surfaces' noise; a direction that is mostly noise keeps a fifth."""
    if not echo.any():
        return information
    values, vectors = eigh(echo, information + prior)
    back = (information + prior) @ vectors
    return np.asarray(information - (back * np.minimum(values, 1.0 - _LEAST_SIGNAL)) @ back.T)
