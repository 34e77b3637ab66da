"""Smoothing and differentiation of a whole record by a sine series (thesis 6.5 and 6.6).

The record, its ends brought to nought, is a Fourier sine series, each term weighted by Wiener's filter, signal power
over signal and noise power (6.13 to 6.20, Morelli 1995). Noise is white here; signals are evenly spaced.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import dct, dst

__all__ = ["SineSeries", "sine_derivative", "sine_series", "white_noise_std", "wiener_gains"]

Array = NDArray[np.float64]

_CLIP = 3.5
"""Third differences beyond this many standard deviations are kinks of the signal, where an input jumps."""

_CLIPPED = math.erf(_CLIP / math.sqrt(2.0)) - math.sqrt(2.0 / math.pi) * _CLIP * math.exp(-0.5 * _CLIP**2)
"""Mean square of a standard normal variable within the clip, times the share that lies within ..."""

_WITHIN = math.erf(_CLIP / math.sqrt(2.0))
"""... and that share."""

_STEEPNESS = 6
"""A smooth signal's sine coefficients fall as k^-3 in the end, so their power as k^-6 (Morelli 1995)."""

_END = 11
"""Samples of the local fit that the ends of the record are read from."""


@dataclass(frozen=True, slots=True)
class SineSeries:
    """A record as a line between its ends and a sine series.

    Attributes:
        dt: step, s.
        first, last: the line's ends, read from local fits.
        coefficients: b(1) to b(n - 2) (6.16).
        noise_std: of white noise in the record (``white_noise_std``).
    """

    dt: float
    first: float
    last: float
    coefficients: Array
    noise_std: float

    @property
    def samples(self) -> int:
        """Samples of the record."""
        return self.coefficients.size + 2

    @property
    def frequency_hz(self) -> Array:
        """Frequency of each term in Hz, (samples - 2,) (6.17)."""
        return np.arange(1, self.samples - 1) / (2.0 * (self.samples - 1) * self.dt)

    def cutoff_hz(self, noise_std: float) -> float:
        """Where, past the peak, the signal's power falls to the noise's; the band's end where it never does."""
        noise = 2.0 * noise_std**2 / (self.samples - 1)
        width = max(9, self.samples // 60)
        power = np.convolve(self.coefficients**2, np.ones(width) / width, mode="same")
        peak = int(np.argmax(power))
        below = np.flatnonzero(power[peak:] <= 2.0 * noise)
        at = peak + int(below[0]) if below.size else power.size - 1
        return float(self.frequency_hz[at])


def _evenly(signal: ArrayLike, dt: float, least: int) -> Array:
    z = np.asarray(signal, dtype=np.float64)
    if z.ndim != 1 or z.size < least:
        raise ValueError(f"a signal has shape (n,) with n at least {least}, got {z.shape}")
    if not np.isfinite(z).all():
        raise ValueError("the signal has values that are not finite; leave them out or interpolate first")
    if not dt > 0.0:
        raise ValueError(f"dt is {dt}; give a step above 0 s")
    return z


def white_noise_std(signal: ArrayLike) -> float:
    """Standard deviation of the white noise in an evenly spaced signal, (n,), in its unit, from its third differences.

    A smooth signal hardly has any, white noise has 20 times its variance in them. Where the signal has kinks (an
    input that jumps) they stand out and are left out.
    """
    d = np.diff(np.asarray(signal, dtype=np.float64), 3)
    if d.size == 0:
        return 0.0
    std = float(np.median(np.abs(d))) / 0.6745
    for _ in range(20):
        within = np.abs(d) <= _CLIP * std
        fresh = float(np.sqrt(np.sum(d[within] ** 2) / max(int(within.sum()), 1) * _WITHIN / _CLIPPED))
        if abs(fresh - std) <= 1e-9 * std:
            break
        std = fresh
    return std / math.sqrt(20.0)


def _end_weights() -> Array:
    """Weights of the first eleven samples whose sum is their least-squares parabola's value at the first, (11,)."""
    powers, half = np.arange(3), _END // 2
    basis = np.arange(-half, half + 1.0)[:, None] ** powers
    return np.asarray((-float(half)) ** powers @ np.linalg.pinv(basis))


def sine_series(signal: ArrayLike, dt: float) -> SineSeries:
    """The record as a line and a sine series (6.13 to 6.16).

    The ends of the line are not the noisy end samples but a parabola through the eleven nearest.

    Args:
        signal: (n,), evenly spaced, n at least 11.
        dt: step, s.

    Raises:
        ValueError: too short, not finite, or no step.
    """
    z = _evenly(signal, dt, _END)
    weights = _end_weights()
    first, last = float(weights @ z[:_END]), float(weights[::-1] @ z[-_END:])
    line = np.linspace(first, last, z.size)
    g = (z - line)[1:-1]
    return SineSeries(dt, first, last, dst(g, type=1) / (z.size - 1), white_noise_std(z))


def wiener_gains(series: SineSeries, cutoff_hz: float) -> Array:
    """Wiener's filter (6.18) for a signal that falls as k^-3 and equals the noise at ``cutoff_hz``, (n - 2,)."""
    return np.asarray(1.0 / (1.0 + (series.frequency_hz / cutoff_hz) ** _STEEPNESS))


def sine_derivative(series: SineSeries, gains: Array) -> Array:
    """Derivative of the line and the weighted sine series at every sample (6.24), (n,), per s."""
    n = series.samples
    terms = np.zeros(n)
    terms[1:-1] = gains * series.coefficients * 2.0 * np.pi * series.frequency_hz
    slope = (series.last - series.first) / ((n - 1) * series.dt)
    return np.asarray(slope + 0.5 * dct(terms, type=1))
