"""Transforms of a tapered window that turn dx/dt = f into algebra without differentiating and without end points.

With a taper g that is zero at both ends, the transform of g dx/dt is the integral of -(d/dt)(g e^{-jwt}) x: the slope
falls on the taper, which is known (Shinbrot's modulating functions, 1957). So a kinematic identity holds bin by bin
for measured x and f, whatever their noise.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Bins", "make_bins", "noise_floor", "smoothed_power", "wiener_gain"]

Array = NDArray[np.float64]
Spectrum = NDArray[np.complex128]

_RAMP = 0.1
"""Share of the window over which the taper rises, and falls again."""
_FEWEST = 8
"""Bins to either side over which power is averaged."""


@dataclass(frozen=True, slots=True)
class Bins:
    """A window's bins, spaced by one over its length.

    Attributes:
        omega_rad_s: frequencies, shape (k,).
        step_s: of the samples.
        samples: in the window.
        taper: shape (n,).
        taper_slope: its rate, shape (n,).
        overlap: variance of a sum over bins over that of independent ones: T int g^4 / (int g^2)^2.
        kept: which of the window's bins these are.
    """

    omega_rad_s: Array
    step_s: float
    samples: int
    taper: Array
    taper_slope: Array
    overlap: float
    kept: NDArray[np.intp]

    def of(self, values: Array) -> Spectrum:
        """Transform of g x, shape (k,), of values (n,) at samples."""
        return self._transform(self.taper * values)

    def of_rate(self, values: Array) -> Spectrum:
        """Transform of g dx/dt from x itself."""
        return 1j * self.omega_rad_s * self._transform(self.taper * values) - self._transform(
            self.taper_slope * values
        )

    def all_power(self, values: Array) -> Array:
        """Squared transform of g x at every frequency up to Nyquist's."""
        return np.asarray(np.abs(np.fft.rfft(self.taper * values) * self.step_s) ** 2)

    def _transform(self, values: Array) -> Spectrum:
        return np.asarray(np.fft.rfft(values)[self.kept] * self.step_s, dtype=np.complex128)


def make_bins(samples: int, step_s: float, band_hz: tuple[float, float]) -> Bins:
    """Bins of a window within a band, at most 0.45 of the sample rate.

    Raises:
        ValueError: fewer than 16 bins.
    """
    length = samples * step_s
    frequency = np.arange(samples // 2 + 1) / length
    top = min(band_hz[1], 0.45 / step_s)
    kept = np.flatnonzero((frequency >= max(band_hz[0], 2.0 / length)) & (frequency <= top))
    if kept.size < 16:
        raise ValueError(
            f"{length:.3g} s hold {kept.size} frequencies between {band_hz[0]:g} and {top:g} Hz: at least 16 are needed"
        )
    position = (np.arange(samples) + 0.5) / samples
    edge = np.minimum(np.minimum(position, 1.0 - position) / _RAMP, 1.0)
    taper = np.sin(0.5 * np.pi * edge) ** 2
    slope = 0.5 * np.pi * np.sin(np.pi * edge) * np.where(position < 0.5, 1.0, -1.0) / (_RAMP * length)
    slope[edge >= 1.0] = 0.0
    overlap = float(samples * np.sum(taper**4) / np.sum(taper**2) ** 2)
    return Bins(2.0 * np.pi * frequency[kept], step_s, samples, taper, slope, overlap, kept)


def smoothed_power(power: Array) -> Array:
    """A spectrum's power averaged over neighbours: ``_FEWEST`` bins to either side, more towards high frequencies."""
    n = power.size
    total = np.concatenate([[0.0], np.cumsum(power)])
    index = np.arange(n)
    reach = np.maximum(_FEWEST, index // 8)
    low, high = np.maximum(index - reach, 0), np.minimum(index + reach + 1, n)
    return np.asarray((total[high] - total[low]) / (high - low))


def noise_floor(bins: Bins, values: Array) -> float:
    """Power of a channel's transform in the top fifth of its spectrum, where nothing but white noise is left."""
    power = bins.all_power(values)
    return float(np.mean(power[int(0.8 * power.size) :]))


def wiener_gain(bins: Bins, values: Array) -> Array:
    """Share of a channel's power that is signal, bin by bin, shape (k,); 0 where it is less than a half.

    The noise is taken as white, of the channel's power in the top fifth of its spectrum or between 0.3 and 0.5 of the
    highest frequency, where that is more: interpolated or filtered readings have lost their noise at the top.
    """
    power = bins.all_power(values)
    lower = float(np.mean(power[int(0.3 * power.size) : int(0.5 * power.size)]))
    share = 1.0 - max(noise_floor(bins, values), lower) / np.maximum(smoothed_power(power)[bins.kept], 1e-300)
    return np.where(share >= 0.5, share, 0.0)
