"""Differentiation of a measured signal, locally and over the whole record, with its error (thesis 6.6).

Each is the derivative of the smoothing of the same name (``smoothing``), and as good as that.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import dct

from wingwatch.estimators.batch.smoothing import (
    SineSeries,
    Smoothed,
    doubled_cosines,
    local_noise,
    local_polynomial,
    sine_series,
    smoothing_spline,
    wiener_gains,
)

__all__ = ["differentiate_local", "differentiate_spline", "differentiate_wiener", "sine_derivative"]

Array = NDArray[np.float64]


def differentiate_local(
    signal: ArrayLike, dt: float, half_width: int = 2, order: int = 2, noise_std: float | None = None
) -> Smoothed:
    """Slope of a local polynomial; with the defaults (-2 -1 0 1 2) / (10 dt) (6.23).

    Args:
        signal: (n,), evenly spaced.
        dt: step, s.
        half_width, order: of the fit.
        noise_std: of the signal; from what the fits leave where None.

    Raises:
        ValueError: too short, not finite, or no step.
    """
    value, size = local_polynomial(signal, dt, half_width, order, 1)
    noise = local_noise(signal, dt, half_width, order) if noise_std is None else noise_std
    return Smoothed(value / dt, noise * size / dt, noise, float("nan"))


def sine_derivative(series: SineSeries, gains: Array) -> Array:
    """Derivative of the line and the weighted sine series at every sample (6.24), (n,)."""
    n = series.samples
    terms = np.zeros(n)
    terms[1:-1] = gains * series.coefficients * 2.0 * np.pi * series.frequency_hz
    slope = (series.last - series.first) / ((n - 1) * series.dt)
    return np.asarray(slope + 0.5 * dct(terms, type=1))


def differentiate_wiener(
    signal: ArrayLike, dt: float, cutoff_hz: float | None = None, noise_std: float | None = None
) -> Smoothed:
    """Derivative of the global Fourier smoothing (6.24).

    Args:
        signal: (n,), evenly spaced, n at least 11.
        dt: step, s.
        cutoff_hz: where signal and noise are taken to be equal; found in the record where None.
        noise_std: of the signal; from its third differences where None.

    Raises:
        ValueError: too short, not finite, or no step.
    """
    series = sine_series(signal, dt)
    noise = series.noise_std if noise_std is None else noise_std
    cutoff = series.cutoff_hz(noise) if cutoff_hz is None else cutoff_hz
    gains = wiener_gains(series, cutoff)
    n = series.samples
    left = gains * (2.0 * np.pi * series.frequency_hz) ** 2 * 2.0 * noise**2 / (n - 1)
    line = 2.0 * (noise * series.end_error / ((n - 1) * dt)) ** 2
    variance = 0.5 * (left.sum() + doubled_cosines(left, n)) + line
    return Smoothed(sine_derivative(series, gains), np.sqrt(np.maximum(variance, 0.0)), noise, cutoff)


def differentiate_spline(
    signal: ArrayLike, dt: float, cutoff_hz: float | None = None, noise_std: float | None = None
) -> Smoothed:
    """Derivative of the cubic smoothing spline.

    Args:
        signal: (n,), evenly spaced, n at least 11.
        dt: step, s.
        cutoff_hz: found in the record where None: where signal and noise are equal.
        noise_std: from its third differences where None.

    Returns:
        The standard error is the one within the record; within 2 / cutoff_hz of its ends it is larger.

    Raises:
        ValueError: too short, not finite, or no step.
    """
    spline, a, noise, cutoff = smoothing_spline(signal, dt, cutoff_hz, noise_std)
    n = np.asarray(signal).size
    # noise^2 dt / (2 pi) times the integral of w^2 / (1 + (a w)^4), which is pi / (sqrt(2) a^3)
    error = noise * np.sqrt(dt / (2.0 * np.sqrt(2.0) * a**3))
    return Smoothed(np.asarray(spline.derivative()(dt * np.arange(n))), np.full(n, error), noise, cutoff)
