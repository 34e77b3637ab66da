"""Turbulence as exact discrete filters of white noise, in Dryden's and von Karman's form.

Crossed at one airspeed, a frozen gust field (``turbulence_spectra``, where its spectra stand) is white noise through a
linear filter with constant coefficients. p_g has one time constant; q_g and r_g are the gradients of w_g and v_g along
the path, smoothed over the span. Signs: the air at a place x ahead of the centre of gravity has w_g + x w_g'/V, the
aircraft's own motion there is w - q x, so a gradient acts as a pitch rate of the air -w_g'/V; likewise +v_g'/V in yaw.

Between two instants the aircraft is moved by the air's mean, which has more chance in it than the line between both
ends: a roll rate of the air that is drawn every 10 ms and taken straight in between makes l_p 13 % too small. So a step
gives the mean as well, drawn with the law that it has between the two ends (``gust_step``).

Von Karman's roots are no filter. They are met by rational functions with real poles, least largest error of the
logarithm (``_FIT_U``, ``_FIT_W``): within 2.4 % (u) and 1.7 % (v, w) of the spectrum up to T w = 10^4, T = L / V.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_lyapunov

from wingwatch.kernels.decorators import helper
from wingwatch.simulation.turbulence_spectra import (
    LEVELS,
    MODELS,
    GustScales,
    Turbulence,
    TurbulenceModel,
    gust_scales,
    gust_spectra,
    roll_gust_density,
    span_lags_s,
)

__all__ = [
    "LEVELS",
    "MODELS",
    "NORMALS",
    "ROW",
    "STATES",
    "GustScales",
    "Turbulence",
    "TurbulenceFilter",
    "TurbulenceModel",
    "gust_scales",
    "gust_spectra",
    "gust_step",
    "turbulence_filter",
]

Matrix = NDArray[np.float64]

_FIT_U = (
    0.981415,
    (0.233821, 0.0263889, 0.00295606, 0.000323907),
    (1.15158, 0.162955, 0.0183235, 0.0020518, 0.000219523),
)
"""g, z, p of 1 / (1 + (a x)^2)^(5/6) = g prod(1 + (z x)^2) / prod(1 + (p x)^2), x = T w; a fit of our own."""
_FIT_W = (
    0.987486,
    (3.20121, 0.133571, 0.017299, 0.00224145, 0.000282348),
    (2.65833, 0.770359, 0.0949749, 0.0123066, 0.00159381, 0.000195173),
)
"""The same of (1 + 8/3 (a x)^2) / (1 + (a x)^2)^(11/6)."""

_ALONG, _ACROSS = 5, 6
"""States of a gust along the flight path, and of one across it without its lag."""
_V, _W = _ALONG, _ALONG + _ACROSS + 1
_P = _W + _ACROSS + 1
STATES = _P + 1
"""u; v and its lag; w and its lag; p. Dryden's form leaves some of them at nothing."""
_DOUBLINGS = 60
"""No process here remembers for 2^60 steps."""
_ROUNDING = 1e-15
NORMALS = 7
"""Random numbers a step: one each for u, p and the mean of p, two each for (v, r) and (w, q)."""


@dataclass(frozen=True, slots=True)
class TurbulenceFilter:
    """Discrete filter of one vehicle: x' = Phi x + G n, n standard normal, the air's motion C x.

    The air's motion has exactly the autocovariances of the continuous filter at every lag, and so its law. The state is
    what the air's motion until now tells of the continuous state (its Kalman filter), so a step needs as few random
    numbers as it makes new outputs.

    Attributes:
        transition: Phi, shape (STATES, STATES).
        input_gain: G, shape (STATES, NORMALS).
        output: C, state to (u, v, w, p, q, r) of the air, shape (6, STATES).
        stationary: a square root of the stationary covariance, shape (STATES, STATES).
        row: what ``gust_step`` reads of it, shape (ROW,).
    """

    transition: Matrix
    input_gain: Matrix
    output: Matrix
    stationary: Matrix
    row: Matrix


def _modes(fit: tuple[float, tuple[float, ...], tuple[float, ...]]) -> tuple[Matrix, Matrix]:
    """Time constants and gains of sqrt(g) prod(1 + z s) / prod(1 + p s) = sum of gain_i / (1 + p_i s)."""
    g, z, p = fit[0], np.array(fit[1]), np.array(fit[2])
    others = [np.prod(1.0 - np.delete(p, i) / p[i]) for i in range(p.size)]
    gains = [math.sqrt(g) * np.prod(1.0 - z / p[i]) / others[i] for i in range(p.size)]
    return p, np.array(gains)


def _chain(model: str, across: bool, time_s: float) -> tuple[Matrix, Matrix]:
    """A and B of a gust of variance 1 that is the sum of its states, driven by white noise of intensity 1."""
    size = _ACROSS if across else _ALONG
    a, b = -np.eye(size), np.zeros(size)
    drive = math.sqrt((1.0 if across else 2.0) / time_s)
    if model == "von-karman":
        constants, gains = _modes(_FIT_W if across else _FIT_U)
        a[np.diag_indices(size)] = -1.0 / (constants * time_s)
        return a, drive * gains / constants
    a /= time_s
    if not across:
        b[0] = drive
        return a, b
    # (1 + sqrt(3) T s) / (1 + T s)^2 = sqrt(3) / (1 + T s) + (1 - sqrt(3)) / (1 + T s)^2: states 1 and 0
    a[0, 1] = (1.0 - math.sqrt(3.0)) / math.sqrt(3.0) / time_s
    b[1] = math.sqrt(3.0) * drive
    return a, b


def _sampled(a: Matrix, b: Matrix, dt_s: float) -> tuple[Matrix, Matrix]:
    """Phi and the covariance that a step adds, by the matrix exponential (Van Loan, IEEE Trans. Automatic Control 23,
    1978, 395) of a step short beside every time constant, then doubled: sums of covariances only, nothing cancels."""
    n = a.shape[0]
    doublings = max(0, math.ceil(math.log2(dt_s * float(np.abs(a).max()))))
    short = dt_s / 2**doublings
    grown = np.asarray(expm(short * np.block([[-a, b @ b.T], [np.zeros_like(a), a.T]])), dtype=np.float64)
    transition = grown[n:, n:].T
    added = transition @ grown[:n, n:]
    for _ in range(doublings):
        added = added + transition @ added @ transition.T
        transition = transition @ transition
    return transition, _symmetric(added)


def _steady_error(transition: Matrix, seen: Matrix, added: Matrix, noise: Matrix) -> Matrix:
    """Covariance of what a steady Kalman filter has still to learn, by doubling (Chu, Fan, Lin and Wang, Int. J.
    Control 77, 2004, 767): the covariance after 2^k steps from a known state, until it grows no more."""
    a, g, h = transition.T, _symmetric(seen.T @ np.linalg.solve(noise, seen)), added
    unit = np.eye(len(a))
    for _ in range(_DOUBLINGS):
        inverse = np.linalg.inv(unit + g @ h)
        grown = h + _symmetric(a.T @ h @ inverse @ a)
        g = g + _symmetric(a @ inverse @ g @ a.T)
        a = a @ inverse @ a
        still = bool(np.abs(grown - h).max() <= _ROUNDING * np.abs(grown).max())
        h = grown
        if still:
            break
    return h


def _discrete(a: Matrix, b: Matrix, c: Matrix, dt_s: float) -> tuple[Matrix, Matrix, Matrix]:
    """Phi, G and stationary covariance of the innovations form of x' = A x + B n, y = C x, sampled every ``dt_s``.

    y_(k+1) = C Phi x_k + C w_k measures x_k without error of its own but with noise R = C Q C^T that is correlated with
    w_k: the steady Kalman filter (Anderson and Moore, Optimal Filtering, sections 5.5 and 9.2).
    """
    transition, added = _sampled(a, b, dt_s)
    with_output = added @ c.T
    noise = _symmetric(c @ with_output)
    seen = c @ transition
    known = np.linalg.solve(noise, with_output.T).T
    left = _nearest(added - known @ with_output.T)
    missed = _steady_error(transition - known @ seen, seen, left, noise)
    innovation_covariance = _symmetric(seen @ missed @ seen.T + noise)
    gain = np.linalg.solve(innovation_covariance, (transition @ missed @ seen.T + with_output).T).T
    drive = gain @ np.linalg.cholesky(innovation_covariance)
    return transition, drive, np.asarray(solve_discrete_lyapunov(transition, drive @ drive.T))


@lru_cache(maxsize=512)
def _across(model: str, time_s: float, lag_s: float, dt_s: float) -> tuple[Matrix, Matrix, Matrix]:
    """A gust across the path of variance 1, and its lag, both observed; solved without Dryden's empty states."""
    chain, drive = _chain(model, True, time_s)
    used = _ACROSS if model == "von-karman" else 2
    a, b, c = np.zeros((used + 1, used + 1)), np.zeros((used + 1, 1)), np.zeros((2, used + 1))
    a[:used, :used], b[:used, 0] = chain[:used, :used], drive[:used]
    a[used, :used], a[used, used] = 1.0 / lag_s, -1.0 / lag_s
    c[0, :used], c[1] = 1.0, lag_s * a[used]
    keep = [*range(used), _ACROSS]
    parts = _discrete(a, b, c, dt_s)
    size = _ACROSS + 1
    transition, gain, spread = np.zeros((size, size)), np.zeros((size, 2)), np.zeros((size, size))
    transition[np.ix_(keep, keep)], gain[keep], spread[np.ix_(keep, keep)] = parts
    return transition, gain, spread


@lru_cache(maxsize=512)
def _along(model: str, time_s: float, dt_s: float) -> tuple[Matrix, Matrix, Matrix]:
    """A gust along the path of variance 1."""
    chain, drive = _chain(model, False, time_s)
    used = _ALONG if model == "von-karman" else 1
    parts = _discrete(chain[:used, :used], drive[:used, None], np.ones((1, used)), dt_s)
    transition, gain, spread = np.zeros((_ALONG, _ALONG)), np.zeros((_ALONG, 1)), np.zeros((_ALONG, _ALONG))
    transition[:used, :used], gain[:used], spread[:used, :used] = parts
    return transition, gain, spread


def turbulence_filter(
    level: Turbulence,
    height_m: float,
    airspeed_true_m_s: float,
    span_m: float,
    dt_s: float,
    model: TurbulenceModel = "dryden",
) -> TurbulenceFilter:
    """The filter for steps of ``dt_s`` at a height above ground, an airspeed and a wing span.

    Raises:
        ValueError: a level or a model that is not known.
    """
    g, v = gust_scales(level, height_m, model), airspeed_true_m_s
    lag_q, lag_r = span_lags_s(v, span_m)
    decay = math.exp(-dt_s / lag_q)
    roll = g.sigma_w_m_s**2 * roll_gust_density(g.length_w_m, v, span_m) * math.pi / (2.0 * lag_q)
    blocks = (
        (0, 0, g.sigma_u_m_s, _along(model, g.length_u_m / v, dt_s)),
        (_V, 1, g.sigma_u_m_s, _across(model, g.length_u_m / v, lag_r, dt_s)),
        (_W, 3, g.sigma_w_m_s, _across(model, g.length_w_m / v, lag_q, dt_s)),
        (
            _P,
            5,
            math.sqrt(roll),
            (np.array([[decay]]), np.array([[math.sqrt(1.0 - decay * decay)]]), np.eye(1)),
        ),
    )
    transition, gain, spread = (
        np.zeros((STATES, STATES)),
        np.zeros((STATES, NORMALS)),
        np.zeros((STATES, STATES)),
    )
    for first, normal, sigma, (phi, drive, covariance) in blocks:
        here = slice(first, first + phi.shape[0])
        transition[here, here] = phi
        gain[here, normal : normal + drive.shape[1]] = sigma * drive
        spread[here, here] = sigma**2 * covariance
    c = np.zeros((6, STATES))
    c[0, :_ALONG] = c[1, _V : _V + _ACROSS] = c[2, _W : _W + _ACROSS] = c[3, _P] = 1.0
    c[4, _W : _W + _ACROSS], c[4, _W + _ACROSS] = -1.0 / (lag_q * v), 1.0 / (lag_q * v)
    c[5, _V : _V + _ACROSS], c[5, _V + _ACROSS] = 1.0 / (lag_r * v), -1.0 / (lag_r * v)
    row = _row(transition, gain, c, (lag_r / dt_s, lag_q / dt_s), _mean_of_roll(roll, lag_q, dt_s))
    return TurbulenceFilter(transition, gain, c, _root(spread), row)


def _mean_of_roll(variance: float, lag_s: float, dt_s: float) -> Matrix:
    """Of a first-order process over a step whose ends are known: the mean's part in their sum, and its deviation.

    The integral of the bridge between x_0 and x_1 has mean T tanh(dt / 2 T) (x_0 + x_1) and variance
    2 sigma^2 T (dt - 2 T tanh(dt / 2 T)).
    """
    half = lag_s * math.tanh(0.5 * dt_s / lag_s)
    return np.array([half / dt_s, math.sqrt(max(2.0 * variance * lag_s * (dt_s - 2.0 * half), 0.0)) / dt_s])


def _symmetric(matrix: Matrix) -> Matrix:
    return 0.5 * (matrix + matrix.T)


def _nearest(covariance: Matrix) -> Matrix:
    """A covariance that rounding may have left indefinite by its last digits."""
    values, vectors = np.linalg.eigh(_symmetric(covariance))
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def _root(covariance: Matrix) -> Matrix:
    """Symmetric square root of a covariance."""
    values, vectors = np.linalg.eigh(_symmetric(covariance))
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)


def _row(
    transition: Matrix, gain: Matrix, output: Matrix, lags: tuple[float, float], mean_of_roll: Matrix
) -> Matrix:
    """What ``gust_step`` reads: a gust along the path, two across with the lags of r and q in steps, roll."""
    parts: list[Matrix] = [np.diagonal(transition)[:_ALONG], gain[:_ALONG, 0]]
    for first, normal, rate, steps in ((_V, 1, output[5, _V], lags[0]), (_W, 3, output[4, _W], lags[1])):
        lag = first + _ACROSS
        block = slice(first, lag)
        parts += [
            np.diagonal(transition)[block],
            gain[block, normal],
            gain[block, normal + 1],
            transition[lag, block],
        ]
        parts.append(np.array([transition[lag, lag], *gain[lag, normal : normal + 2]]))
        parts.append(np.array([transition[first, first + 1], rate, steps]))
    parts += [np.array([transition[_P, _P], gain[_P, 5]]), mean_of_roll]
    return np.concatenate(parts)


_ACROSS_NUMBERS = 4 * _ACROSS + 6
_V_NUMBERS = 2 * _ALONG
_W_NUMBERS = _V_NUMBERS + _ACROSS_NUMBERS
_P_NUMBERS = _W_NUMBERS + _ACROSS_NUMBERS
ROW = _P_NUMBERS + 4
"""Numbers in ``TurbulenceFilter.row``."""


@helper
def _step_across(f, a, x, b, n0, n1):  # type: ignore[no-untyped-def]
    """A gust across the path and its lag, numbers ``f[a:]``, states ``x[b:]``.

    Written out, and without slices: each view of an array costs two atomic counts, together four times this step.

    Returns:
        the gust and its angular rate at the end, and how far the middle of the parabola through ends and mean lies
        from the straight line, of both. The means are known without chance: T l' = g - l, so the mean of g - l is
        T (l_1 - l_0) / dt, and that of the smooth l is the trapezoid's less dt (l_1' - l_0') / 12.
    """
    x0, x1, x2, x3, x4, x5 = x[b], x[b + 1], x[b + 2], x[b + 3], x[b + 4], x[b + 5]
    before, smooth_before = (x0 + x1) + (x2 + x3) + (x4 + x5), x[b + 6]
    smooth = (
        f[a + 18] * x0
        + f[a + 19] * x1
        + (f[a + 20] * x2 + f[a + 21] * x3)
        + (f[a + 22] * x4 + f[a + 23] * x5)
    )
    smooth += f[a + 24] * smooth_before + (f[a + 25] * n0 + f[a + 26] * n1)
    x0 = f[a] * x0 + f[a + 27] * x1 + (f[a + 6] * n0 + f[a + 12] * n1)
    x1 = f[a + 1] * x1 + (f[a + 7] * n0 + f[a + 13] * n1)
    x2 = f[a + 2] * x2 + (f[a + 8] * n0 + f[a + 14] * n1)
    x3 = f[a + 3] * x3 + (f[a + 9] * n0 + f[a + 15] * n1)
    x4 = f[a + 4] * x4 + (f[a + 10] * n0 + f[a + 16] * n1)
    x5 = f[a + 5] * x5 + (f[a + 11] * n0 + f[a + 17] * n1)
    x[b], x[b + 1], x[b + 2], x[b + 3], x[b + 4], x[b + 5], x[b + 6] = x0, x1, x2, x3, x4, x5, smooth
    gust = (x0 + x1) + (x2 + x3) + (x4 + x5)
    over, over_before, steps = gust - smooth, before - smooth_before, f[a + 29]
    curve = 1.5 * (steps * (smooth - smooth_before) - 0.5 * (over + over_before))
    return gust, f[a + 28] * over, curve - 0.125 * (over - over_before) / steps, f[a + 28] * curve


@helper
def gust_step(row, state, normals, after, middle):  # type: ignore[no-untyped-def]
    """One step of a ``TurbulenceFilter``.

    Args:
        row: (ROW,), the filter's.
        state: (STATES,), advances.
        normals: (NORMALS,).
        after: (6,), becomes the air's motion at the end of the step.
        middle: (6,), becomes how far the middle of the parabola through both ends and the mean over the step lies from
            the straight line. What moves the aircraft in a step is the mean; u, which turns nothing, is taken straight.
    """
    n0 = normals[0]
    for i in range(_ALONG):
        state[i] = row[i] * state[i] + row[_ALONG + i] * n0
    after[0] = (state[0] + state[1]) + (state[2] + state[3]) + state[4]
    middle[0] = 0.0
    after[1], after[5], middle[1], middle[5] = _step_across(
        row, _V_NUMBERS, state, _V, normals[1], normals[2]
    )
    after[2], after[4], middle[2], middle[4] = _step_across(
        row, _W_NUMBERS, state, _W, normals[3], normals[4]
    )
    after[3] = row[_P_NUMBERS] * state[_P] + row[_P_NUMBERS + 1] * normals[5]
    ends = state[_P] + after[3]
    middle[3] = 1.5 * ((row[_P_NUMBERS + 2] - 0.5) * ends + row[_P_NUMBERS + 3] * normals[6])
    state[_P] = after[3]
