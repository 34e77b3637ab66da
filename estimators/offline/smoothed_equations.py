"""Manoeuvres as equation error takes them: both sides smoothed alike, and what sensor noise makes of their sums."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dst

from wingwatch.estimators.offline.manoeuvre import Manoeuvre
from wingwatch.estimators.offline.regression import Equations, equations, noise_model
from wingwatch.estimators.offline.smoothing import sine_derivative, sine_series, wiener_gains

__all__ = ["SmoothedManoeuvre", "SumNoise", "busiest_cutoff_hz", "inner_samples", "passed", "smoothed"]

Array = NDArray[np.float64]

_MOST = 0.2
"""Highest cutoff that is chosen, of the sample rate: above, a derivative of sampled data is no derivative any more."""


@dataclass(frozen=True, slots=True)
class SumNoise:
    """What the sensors' noise alone makes of a manoeuvre's sums; n of the regressors, e of the equations' residuals.

    Attributes:
        residual: E[e_i(t) e_j(t + lag)] at lags 0 to n - 1, (equations, equations, n).
        crossed: the part of the covariance of sums of n_m e_i that comes of n and e being one noise, sums over t and t'
            of E[n_m(t) e_j(t')] E[e_i(t) n_k(t')], (equations, regressors, equations, regressors).
        right: sums of n_m n_k, (regressors, regressors); left: of n_m and y's noise, (equations, regressors).
        sources: variance of the residuals by sensor, (equations, noises).
        freedom: how many independent values the residuals have.
    """

    residual: Array
    crossed: Array
    right: Array
    left: Array
    sources: Array
    freedom: float


@dataclass(frozen=True, slots=True)
class SmoothedManoeuvre:
    """One manoeuvre smoothed, ends left out.

    Attributes:
        left: y, (n, equations); right: X by equation with trims projected out, (equations, n, regressors).
        clean: y with trims projected out, (n, equations).
        noise: what the sensors' noise makes of it.
        values: independent values of a smoothed signal.
    """

    left: Array
    right: Array
    clean: Array
    noise: SumNoise
    values: float


def busiest_cutoff_hz(parts: Sequence[Manoeuvre]) -> float:
    """Where the busiest measured state's signal falls to its noise."""
    found = []
    for part in parts:
        for j in np.flatnonzero(part.measured):
            series = sine_series(part.states[:, j], part.dt)
            found.append(series.cutoff_hz(series.noise_std))
    most = _MOST / parts[0].dt
    return min(max(found), most) if found else most


def passed(columns: Array, dt: float, cutoff_hz: float, gain_factor: Array | None = None) -> Array:
    """Every column, of samples ``dt`` s apart, smoothed; ``gain_factor`` (columns, n - 2) multiplies the gains."""
    out = np.empty_like(columns)
    for j in range(columns.shape[1]):
        series = sine_series(columns[:, j], dt)
        gains = wiener_gains(series, cutoff_hz)
        if gain_factor is not None:
            gains = gains * gain_factor[j]
        out[:, j] = np.linspace(series.first, series.last, columns.shape[0])
        out[1:-1, j] += 0.5 * dst(gains * series.coefficients, type=1)
    return out


def _held_as_smooth(part: Manoeuvre) -> tuple[Array, Array]:
    """Inputs as samples of what a low-pass makes of them, and the gains' factor for each, (inputs, n - 2).

    A held value acts half a step later than its sample. The mean of neighbours has that delay, with the amplitude
    cos(x) instead of sin(x)/x at x = w dt / 2.
    """
    inputs, held = part.inputs * part.control[:, None], part.held_steps
    still = held.mean(axis=0) > 0.5
    mean = inputs.copy()
    mean[1:] = 0.5 * (inputs[1:] + inputs[:-1])
    x = 0.5 * np.pi * np.arange(1, len(part) - 1) / (len(part) - 1)
    factor = np.where(still[:, None], np.tan(x) / x, 1.0)
    return np.where(still, mean, inputs), factor


def _unkinked(part: Manoeuvre, theta: Array) -> Array:
    """States plus dt/12 of the jump that a held input's step makes in their rate: a sum over samples then
    gives the integral over the kinked course (Euler and Maclaurin)."""
    ne, ns = theta.shape[0], part.states.shape[1]
    still = part.held_steps.mean(axis=0) > 0.5
    jumps = np.zeros_like(part.inputs)
    jumps[1:] = np.where(still, np.diff(part.inputs * part.control[:, None], axis=0), 0.0)
    states = part.states.copy()
    states[:, :ne] += part.dt / 12.0 * (jumps @ theta[:, ns:].T)
    return states


def smoothed(
    part: Manoeuvre, forces: NDArray[np.bool_], drift: bool, cutoff_hz: float, theta: Array, variance: Array
) -> SmoothedManoeuvre:
    """A manoeuvre's equations, both sides through the same smoothing.

    Args:
        part: evenly sampled.
        forces: equations that rest on an accelerometer, (equations,).
        drift: whether each equation has a drift of its own.
        cutoff_hz: of the smoothing.
        theta: derivatives so far, for the kinks that held inputs make, (equations, regressors).
        variance: of the sensors' noise, (noises,).
    """
    eq = equations(part, forces, drift)
    (ne, ns), n, dt = eq.rates.shape, len(part), part.dt
    inner = inner_samples(part, eq, cutoff_hz)
    states = _unkinked(part, theta)
    slopes = np.empty_like(states)
    for j in range(ns):
        series = sine_series(states[:, j], dt)
        slopes[:, j] = sine_derivative(series, wiener_gains(series, cutoff_hz))
    shift = np.einsum("nij,nj->ni", part.known, states - part.states)[:, :ne]
    direct = eq.direct - np.where(forces, 0.0, shift)
    left = (passed(direct, dt, cutoff_hz) + slopes @ eq.rates.T)[inner]
    inputs, factor = _held_as_smooth(part)
    moved = np.column_stack([states * part.stability[:, None], inputs])
    gain_factor = np.vstack([np.ones((ns, n - 2)), factor])
    by_rate = passed(moved, dt, cutoff_hz, gain_factor)[inner]
    by_force = passed(eq.regressors, dt, cutoff_hz)[inner]
    trims, _ = np.linalg.qr(passed(eq.trims, dt, cutoff_hz)[inner])
    right = np.stack([by_force if f else by_rate for f in forces])
    right = right - np.einsum("nt,st,eso->eno", trims, trims, right, optimize=True)
    series = sine_series(states[:, 0], dt)
    gains = wiener_gains(series, cutoff_hz)
    noise = _expected_noise(part, eq, theta, variance, gains, series.frequency_hz, trims)
    return SmoothedManoeuvre(left, right, left - trims @ (trims.T @ left), noise, float(np.sum(gains**2)))


def _expected_noise(
    part: Manoeuvre,
    eq: Equations,
    theta: Array,
    variance: Array,
    gains: Array,
    frequency_hz: Array,
    trims: Array,
) -> SumNoise:
    """What the sensors' noise makes of sums over the samples that are kept, smoothed and without ``trims``."""
    count = trims.shape[0]
    in_band = gains > 1e-3
    s = np.asarray(2j * np.pi * frequency_hz[in_band], dtype=np.complex128)
    power = gains[in_band] ** 2
    model = noise_model(part, eq, s)
    answer = model.residual(theta * part.regressor_scale)
    spectrum = np.einsum("bim,m,bjm,b->ijb", answer.conj(), variance, answer, power, optimize=True)
    spectrum /= len(part) - 1
    order = np.flatnonzero(in_band) + 1
    sources = np.einsum("bim,m,b->im", np.abs(answer) ** 2, variance, power) / (len(part) - 1)
    power *= _kept_share(order, len(part), trims)
    common = np.einsum("bml,l,m->bml", model.of_regressors.conj(), variance, part.regressor_scale)
    products = np.einsum("bml,bjl->bjm", common, answer, optimize=True)
    crossed = np.einsum("bjm,bik,b->imjk", products, products, power**2, optimize=True).real
    right = np.einsum(
        "bml,bnl,b->mn", common, model.of_regressors * part.regressor_scale[:, None], power, optimize=True
    )
    left = np.einsum("bml,bjl,b->jm", common, model.left, power, optimize=True)
    total = np.einsum("iib->b", spectrum).real
    freedom = float(total.sum() ** 2 / max(np.sum(total**2), 1e-300))
    share = count / (len(part) - 1)
    return SumNoise(
        _by_lag(spectrum, order, len(part))[..., :count],
        crossed * share,
        right.real * share,
        left.real * share,
        sources,
        freedom,
    )


def _by_lag(spectrum: NDArray[np.complex128], order: NDArray[np.int64], samples: int) -> Array:
    """Real part of the sum over k of spectrum_k exp(j pi k lag / (samples - 1)), (..., samples), by the fast
    transform; ``order`` holds the k of the last axis."""
    whole = np.zeros((*spectrum.shape[:-1], 2 * (samples - 1)), dtype=np.complex128)
    whole[..., order] = spectrum
    return np.asarray(np.fft.ifft(whole, norm="forward")[..., :samples].real)


def _kept_share(order: NDArray[np.int64], samples: int, trims: Array) -> Array:
    """Share of the sine waves sin(pi k i / (samples - 1)) that is left without ``trims``, over the middle samples,
    (orders,)."""
    count = trims.shape[0]
    first = (samples - count) // 2
    padded = np.zeros((trims.shape[1], 2 * (samples - 1)))
    padded[:, first : first + count] = trims.T
    found = np.fft.ifft(padded, norm="forward")[:, order].imag
    twice = np.exp(2j * np.pi * order / (samples - 1))
    squares = 0.5 * (count - (twice**first * (1.0 - twice**count) / (1.0 - twice)).real)
    return np.asarray(1.0 - np.sum(found**2, axis=0) / squares)


def inner_samples(part: Manoeuvre, eq: Equations, cutoff_hz: float) -> slice:
    """Samples that smoothing's ends do not reach."""
    n, ns = len(part), eq.rates.shape[1]
    edge = min(int(np.ceil(0.5 / (cutoff_hz * part.dt))), (n - 2 * ns - 4) // 4)
    return slice(edge, n - edge)
