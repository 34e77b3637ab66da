"""Finite Fourier transforms of sampled signals at chosen frequencies, by the chirp-z transform (thesis 8.3).

Between samples a signal moves on a line or is held, and the integral over that is exact: for a step from x0 to x1,

    integral of x exp(-j w t) dt = c0 x0 + c1 x1,   c0 + c1 = h = (1 - exp(-j w dt)) / (j w),

so nothing is left of the sum's error in the step, and any spacing of frequencies may be asked for.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = ["harmonics_hz", "noise_power", "transform"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def harmonics_hz(band_hz: tuple[float, float], duration_s: float) -> Array:
    """Multiples of 1 / duration within the band: as many frequencies as the record tells apart, (bins,)."""
    low = max(int(np.ceil(band_hz[0] * duration_s - 1e-9)), 1)
    high = int(np.floor(band_hz[1] * duration_s + 1e-9))
    return np.arange(low, high + 1) / duration_s


def _weights(omega: Array, dt: float) -> tuple[Complex, Complex, Complex]:
    """c0, c1 of a line and h of a held value."""
    z = -1j * omega * dt
    held = dt * np.expm1(z) / z
    end = dt * (np.exp(z) * (z - 1.0) + 1.0) / z**2
    small = np.abs(z) < 1e-4
    end[small] = dt * (0.5 + z[small] / 3.0)
    return held - end, end, held


def transform(
    columns: Array, dt: float, frequency_hz: Array, held: NDArray[np.bool_] | None = None
) -> Complex:
    """Transforms over the record, in unit seconds, phase counted from its first sample.

    Args:
        columns: (n, m), evenly spaced.
        dt: step, s.
        frequency_hz: (bins,), evenly spaced, above 0.
        held: (n - 1, m), whether a column is held over a step; on a line everywhere where None.

    Returns:
        (bins, m).
    """
    n = columns.shape[0]
    omega = 2.0 * np.pi * frequency_hz
    start, end, flat = _weights(omega, dt)
    spacing = frequency_hz[1] - frequency_hz[0] if frequency_hz.size > 1 else 0.0
    chirp = scipy.signal.CZT(
        n - 1,
        frequency_hz.size,
        w=np.exp(-2j * np.pi * spacing * dt),
        a=np.exp(2j * np.pi * frequency_hz[0] * dt),
    )
    still = np.zeros((n - 1, columns.shape[1]), dtype=bool) if held is None else held
    before, after = columns[:-1], columns[1:]
    moving = start[:, None] * chirp(np.where(still, 0.0, before), axis=0)
    moving += end[:, None] * chirp(np.where(still, 0.0, after), axis=0)
    if still.any():
        moving += flat[:, None] * chirp(np.where(still, before, 0.0), axis=0)
    return np.asarray(moving)


def noise_power(dt: float, duration_s: float, frequency_hz: Array) -> Array:
    """Power that white noise of unit variance has in a transform of lines, (bins,)."""
    return np.asarray(dt * duration_s * np.sinc(frequency_hz * dt) ** 4)
