"""Smoothing of a measured signal, locally and over the whole record, with the error that is left (thesis 6.5).

Local: a polynomial through a few neighbours (6.7 to 6.12). Global: a Fourier sine series of the record with its
ends brought to nought, each term weighted by Wiener's filter, signal power over signal and noise power (6.13 to
6.20, Morelli 1995). Spline: the cubic that trades misfit against curvature.

Noise is white here; signals are evenly spaced. Errors are of the noise left in and, for Wiener's filter, of the
signal taken out as its own model expects it.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import dct, dst
from scipy.interpolate import BSpline, make_smoothing_spline

__all__ = [
    "SineSeries",
    "Smoothed",
    "doubled_cosines",
    "local_noise",
    "local_polynomial",
    "local_weights",
    "sine_series",
    "smooth_local",
    "smooth_spline",
    "smooth_wiener",
    "smoothing_spline",
    "white_noise_std",
    "wiener_gains",
]

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
class Smoothed:
    """A smoothed or differentiated signal.

    Attributes:
        value: (n,), in the signal's unit, or that per second.
        standard_error: (n,), of each value.
        noise_std: of the measured signal, as found or given.
        cutoff_hz: where half of the amplitude passes; NaN where that has no meaning.
    """

    value: Array
    standard_error: Array
    noise_std: float
    cutoff_hz: float


@dataclass(frozen=True, slots=True)
class SineSeries:
    """A record as a line between its ends and a sine series.

    Attributes:
        dt: step, s.
        first, last: the line's ends, read from local fits; their errors in noise standard deviations.
        coefficients: b(1) to b(n - 2) (6.16).
        end_error: standard error of each end over the noise's standard deviation.
        noise_std: of white noise in the record (``white_noise_std``).
    """

    dt: float
    first: float
    last: float
    coefficients: Array
    end_error: float
    noise_std: float

    @property
    def samples(self) -> int:
        """Samples of the record."""
        return self.coefficients.size + 2

    @property
    def frequency_hz(self) -> Array:
        """Frequency of each term (6.17)."""
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
    """Standard deviation of the white noise in an evenly spaced signal, (n,), from its third differences.

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


def local_weights(half_width: int, order: int, at: int, derivative: int = 0) -> Array:
    """Weights of 2 half_width + 1 samples whose sum is a least-squares polynomial's value at sample ``at``.

    Args:
        half_width: neighbours on either side; 2 is the thesis's.
        order: of the polynomial; 2 is the thesis's.
        at: place of the value, -half_width to half_width from the middle.
        derivative: 0 for the value (6.12), 1 for its derivative per step (6.23).

    Raises:
        ValueError: a polynomial of more coefficients than samples.
    """
    if not 0 <= order <= 2 * half_width:
        raise ValueError(f"order is {order}; {2 * half_width + 1} samples bear 0 to {2 * half_width}")
    places = np.arange(-half_width, half_width + 1.0)
    powers = np.arange(order + 1)
    basis = places[:, None] ** powers
    slope = powers * float(at) ** np.maximum(powers - 1, 0)
    row = slope if derivative else float(at) ** powers
    return np.asarray(row @ np.linalg.pinv(basis))


def local_polynomial(
    signal: ArrayLike, dt: float, half_width: int, order: int, derivative: int
) -> tuple[Array, Array]:
    """Value (or derivative per step) at every sample, and the root of its summed squared weights, (n,) each."""
    z = _evenly(signal, dt, 2 * half_width + 1)
    value, size = np.empty(z.size), np.empty(z.size)
    centre = local_weights(half_width, order, 0, derivative)
    value[half_width : z.size - half_width] = np.correlate(z, centre, mode="valid")
    size[:] = float(np.sqrt(centre @ centre))
    width = 2 * half_width + 1
    for k in range(half_width):
        left = local_weights(half_width, order, k - half_width, derivative)
        right = local_weights(half_width, order, half_width - k, derivative)
        value[k], value[z.size - 1 - k] = left @ z[:width], right @ z[-width:]
        size[k], size[z.size - 1 - k] = np.sqrt(left @ left), np.sqrt(right @ right)
    return value, size


def local_noise(signal: ArrayLike, dt: float, half_width: int, order: int) -> float:
    """Noise from what a local fit leaves: of white noise 1 - (weight of the sample itself) remains."""
    z = _evenly(signal, dt, 2 * half_width + 1)
    centre = local_weights(half_width, order, 0)
    left = z[half_width : z.size - half_width] - np.correlate(z, centre, mode="valid")
    return float(np.sqrt(np.mean(left**2) / (1.0 - centre[half_width])))


def smooth_local(
    signal: ArrayLike, dt: float, half_width: int = 2, order: int = 2, noise_std: float | None = None
) -> Smoothed:
    """Local polynomial smoothing; with the defaults (-6 24 34 24 -6) / 70 (6.12).

    Args:
        signal: (n,), evenly spaced.
        dt: step, s.
        half_width, order: of the fit, see ``local_weights``.
        noise_std: of the signal; from what the fits leave where None.

    Raises:
        ValueError: too short, not finite, or no step.
    """
    noise = local_noise(signal, dt, half_width, order) if noise_std is None else noise_std
    value, size = local_polynomial(signal, dt, half_width, order, 0)
    return Smoothed(value, noise * size, noise, float("nan"))


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
    weights = local_weights(_END // 2, 2, -(_END // 2))
    first, last = float(weights @ z[:_END]), float(weights[::-1] @ z[-_END:])
    line = np.linspace(first, last, z.size)
    g = (z - line)[1:-1]
    return SineSeries(
        dt, first, last, dst(g, type=1) / (z.size - 1), float(np.sqrt(weights @ weights)), white_noise_std(z)
    )


def wiener_gains(series: SineSeries, cutoff_hz: float) -> Array:
    """Wiener's filter (6.18) for a signal that falls as k^-3 and equals the noise at ``cutoff_hz``, (n - 2,)."""
    return np.asarray(1.0 / (1.0 + (series.frequency_hz / cutoff_hz) ** _STEEPNESS))


def smooth_wiener(
    signal: ArrayLike, dt: float, cutoff_hz: float | None = None, noise_std: float | None = None
) -> Smoothed:
    """Global Fourier smoothing (6.20).

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
    value = np.linspace(series.first, series.last, n)
    value[1:-1] += 0.5 * dst(gains * series.coefficients, type=1)
    # what is left of a coefficient: gain times the noise's variance; sin^2 = (1 - cos 2x) / 2
    left = gains * 2.0 * noise**2 / (n - 1)
    variance = 0.5 * (left.sum() - doubled_cosines(left, n)) + _line_variance(series, noise)
    return Smoothed(value, np.sqrt(np.maximum(variance, 0.0)), noise, cutoff)


def doubled_cosines(weights: Array, n: int) -> Array:
    """Sum over k of weights(k) cos(2 pi k i / (n - 1)), (n,)."""
    padded = np.zeros(n)
    padded[1:-1] = weights
    table = 0.5 * dct(padded, type=1)
    index = np.mod(2 * np.arange(n), 2 * (n - 1))
    return np.asarray(table[np.minimum(index, 2 * (n - 1) - index)])


def _line_variance(series: SineSeries, noise: float) -> Array:
    """Variance of the line that both ends' errors tilt, (n,)."""
    along = np.linspace(0.0, 1.0, series.samples)
    return np.asarray((noise * series.end_error) ** 2 * ((1.0 - along) ** 2 + along**2))


def smoothing_spline(signal: ArrayLike, dt: float, cutoff_hz: float | None, noise_std: float | None):  # type: ignore[no-untyped-def]
    """The cubic smoothing spline, its time constant a (1 / (1 + (a w)^4) passes), noise and cutoff."""
    series = sine_series(signal, dt)
    z = np.asarray(signal, dtype=np.float64)
    noise = series.noise_std if noise_std is None else noise_std
    cutoff = series.cutoff_hz(noise) if cutoff_hz is None else cutoff_hz
    a = 1.0 / (2.0 * np.pi * cutoff)
    spline: BSpline = make_smoothing_spline(dt * np.arange(z.size), z, lam=a**4 / dt)
    return spline, a, noise, cutoff


def smooth_spline(
    signal: ArrayLike, dt: float, cutoff_hz: float | None = None, noise_std: float | None = None
) -> Smoothed:
    """Cubic smoothing spline that passes half of the amplitude at ``cutoff_hz``.

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
    # noise^2 dt / (2 pi) times the integral of 1 / (1 + (a w)^4), which is pi / (sqrt(2) a)
    error = noise * np.sqrt(dt / (2.0 * np.sqrt(2.0) * a))
    return Smoothed(np.asarray(spline(dt * np.arange(n))), np.full(n, min(error, noise)), noise, cutoff)
