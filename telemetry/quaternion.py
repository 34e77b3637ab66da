"""Euler angles of a quaternion: Hamilton's, scalar first, turning body axes (forward, right, down) into earth axes
(north, east, down), as PX4 and ArduPilot log it."""

from typing import Any

import numpy as np

__all__ = ["euler_heading", "euler_pitch", "euler_roll"]


def euler_roll(w: Any, x: Any, y: Any, z: Any) -> Any:
    """Bank angle, rad, -pi to pi; shapes (n,) of parts of any common length, NaN where all are 0."""
    return np.where(
        _length(w, x, y, z) > 0.0, np.arctan2(2.0 * (w * x + y * z), w * w - x * x - y * y + z * z), np.nan
    )


def euler_pitch(w: Any, x: Any, y: Any, z: Any) -> Any:
    """Pitch attitude, rad, -pi/2 to pi/2; else as ``euler_roll``."""
    return np.arcsin(np.clip(2.0 * (w * y - x * z) / _length(w, x, y, z), -1.0, 1.0))


def euler_heading(w: Any, x: Any, y: Any, z: Any) -> Any:
    """Heading, rad, -pi to pi; else as ``euler_roll``."""
    return np.where(
        _length(w, x, y, z) > 0.0, np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z), np.nan
    )


def _length(w: Any, x: Any, y: Any, z: Any) -> Any:
    """The square of the length, by which nothing but the sine of the pitch depends on it."""
    return w * w + x * x + y * y + z * z
