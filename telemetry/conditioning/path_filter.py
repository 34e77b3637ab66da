"""The Kalman filter that a path is reconstructed by: filterpy's, with the state's prediction handed in.

A module of its own: filterpy is loaded by who reconstructs a path, and not by a service that starts.
"""

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

__all__ = ["PathFilter"]


class PathFilter(ExtendedKalmanFilter):  # type: ignore[misc]  # filterpy carries no types
    """filterpy's filter with the state's prediction handed in instead of F x.

    Attributes:
        predicted: the state that ``predict`` comes to.
    """

    predicted: NDArray[np.float64]

    def predict_x(self, u: float = 0) -> None:
        """The model's own prediction."""
        self.x = self.predicted
