"""How well a model fits, and what its estimates may be trusted with (thesis 5.4).

All of it works on lists of windows, one a manoeuvre: means are taken out per window, so that trim offsets
neither flatter R2 nor Theil's coefficient, and nothing is correlated across a gap.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.linalg import matmul_toeplitz

from wingwatch.aircraft.structures import ModeStructure

__all__ = [
    "ChannelFit",
    "Fit",
    "autocovariance",
    "channel_fit",
    "coloured_covariance",
    "coloured_sum",
    "confidence_interval",
    "correlated_pairs",
    "crosscovariance",
    "correlation",
    "is_white",
    "no_less_than",
]

Array = NDArray[np.float64]

LAGS = 25
"""Lags of the residual autocorrelation that a fit shows and its whiteness rests on."""

_FALSE_ALARM = 0.01
"""Chance that white residuals are called coloured."""


@dataclass(frozen=True, slots=True)
class ChannelFit:
    """One output or equation against what the model says.

    Attributes:
        name: of the channel, such as ``q``, ``a_z`` or ``dq/dt``.
        r_squared: coefficient of determination (5.31).
        tic: Theil's inequality coefficient, 0 perfect to 1 (5.39), about the measured mean.
        bias: share of the squared error that is a difference of means (5.40).
        variance: share that is a difference of spread, (s_z - s_y)^2 over the squared error (5.42).
        covariance: the rest, noise where the model is right (5.43); the three add to 1.
        residual_std: root of the mean squared residual over its degrees of freedom (5.30).
        autocorrelation: of the residuals at lags 0 to 25 at most, (lags,).
    """

    name: str
    r_squared: float
    tic: float
    bias: float
    variance: float
    covariance: float
    residual_std: float
    autocorrelation: Array


@dataclass(frozen=True, slots=True)
class Fit:
    """Statistics that go with one Estimate; derivatives in its order.

    Attributes:
        channels: one a measured output or equation.
        correlation: pair-wise correlation of the estimates (5.27), (k, k).
        interval: 95 % confidence intervals, (k, 2).
        covariance_white: for white sensor noise (5.22, or the Cramer-Rao bound), (k, k).
        covariance_coloured: for residuals as coloured as they are (5.53), and for what they may have put the estimates
            off by where they go together with the regressors (``endogeneity``), (k, k).
        coloured: whether the estimate carries the second, because the first does not explain the residuals.
        noise_std: of each measured channel as estimated.
        samples: rows used.
        manoeuvres: windows used.
        parameters: unknowns in all, trims and initial states included.
        iterations: of the solution.
        converged: whether it came to rest.
    """

    channels: tuple[ChannelFit, ...]
    correlation: Array
    interval: Array
    covariance_white: Array
    covariance_coloured: Array
    coloured: bool
    noise_std: Mapping[str, float]
    samples: int
    manoeuvres: int
    parameters: int
    iterations: int
    converged: bool


def autocovariance(residuals: Sequence[Array], lags: int = LAGS) -> Array:
    """Mean of v(i) v(i + k) over all windows for k = 0 to ``lags``, divided by the number of samples (5.52).

    ``residuals``: windows of shape (n_m,), of any lengths.
    """
    return np.asarray(crosscovariance(residuals, residuals, lags)[0])


def crosscovariance(residuals: Sequence[Array], others: Sequence[Array], lags: int) -> Array:
    """Mean of v(i) w(i + k), and of w(i) v(i + k), likewise, (2, lags + 1).

    Args:
        residuals, others: v and w in their SI units, windows of the same shapes (n_m,).
        lags: largest k.
    """
    sums = np.zeros((2, lags + 1))
    for v, w in zip(residuals, others, strict=True):
        both, most = scipy.signal.correlate(w, v, "full"), min(lags, v.size - 1) + 1
        sums[0, :most] += both[v.size - 1 : v.size - 1 + most]
        sums[1, :most] += both[v.size - 1 :: -1][:most]
    return np.asarray(sums / max(sum(v.size for v in residuals), 1))


def channel_fit(
    name: str, measured: Sequence[Array], predicted: Sequence[Array], parameters: float = 0.0
) -> ChannelFit:
    """Statistics of one channel.

    Args:
        name: of the channel.
        measured, predicted: windows of shape (n_m,).
        parameters: degrees of freedom that the fit took from this channel.

    Raises:
        ValueError: no sample at all.
    """
    if not sum(z.size for z in measured):
        raise ValueError(f"channel {name} has no sample")
    means = [float(np.mean(z)) for z in measured]
    z = np.concatenate([m - mean for m, mean in zip(measured, means, strict=True)])
    y = np.concatenate([p - mean for p, mean in zip(predicted, means, strict=True)])
    v = z - y
    square = float(np.mean(v**2))
    total = float(np.mean(z**2))
    bias = float(np.mean(v)) ** 2
    spread = (float(z.std()) - float(y.std())) ** 2
    both = float(np.sqrt(total)) + float(np.sqrt(np.mean(y**2)))
    own = autocovariance([a - b for a, b in zip(measured, predicted, strict=True)])
    return ChannelFit(
        name,
        1.0 - square / total if total > 0.0 else float("nan"),
        float(np.sqrt(square)) / both if both > 0.0 else float("nan"),
        bias / square if square > 0.0 else 0.0,
        spread / square if square > 0.0 else 0.0,
        1.0 - (bias + spread) / square if square > 0.0 else 1.0,
        float(np.sqrt(square * z.size / max(z.size - parameters, 1.0))),
        own / own[0] if own[0] > 0.0 else own,
    )


def correlation(covariance: Array) -> Array:
    """Pair-wise correlation, a ratio, from a covariance (5.27), (k, k); NaN without a positive, finite variance."""
    variance = np.diagonal(covariance)
    std = np.sqrt(np.where((variance > 0.0) & np.isfinite(variance), variance, np.nan))
    return np.asarray(covariance / np.outer(std, std))


def correlated_pairs(
    structure: ModeStructure, correlations: Array, threshold: float = 0.9
) -> tuple[tuple[str, str, float], ...]:
    """Pairs of derivatives that the data hardly distinguish, |correlation| at least ``threshold``, worst first.

    ``correlations``: of k derivatives, (k, k), no unit.
    0.9 is the guideline of Tischler and Remple (2006) that thesis 5.4.1 quotes.
    """
    names = structure.derivatives
    found = [
        (names[i], names[j], float(correlations[i, j]))
        for i in range(len(names))
        for j in range(i + 1, len(names))
        if abs(correlations[i, j]) >= threshold
    ]
    return tuple(sorted(found, key=lambda pair: -abs(pair[2])))


def confidence_interval(value: Array, covariance: Array, freedom: float, level: float = 0.95) -> Array:
    """Intervals from Student's distribution (5.48), shape (k, 2).

    Args:
        value: (k,).
        covariance: (k, k).
        freedom: degrees of freedom left to the residuals.
        level: chance that the truth lies within.
    """
    error = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    reach = float(scipy.stats.t.ppf(0.5 + 0.5 * level, max(freedom, 1.0))) * error
    return np.column_stack([value - reach, value + reach])


def is_white(residuals: Sequence[Sequence[Array]], lags: int = LAGS) -> bool:
    """Whether the residuals of all channels pass for white noise (Ljung and Box 1978), wrong in 1 % of cases.

    Args:
        residuals: per channel, windows of shape (n_m,).
    """
    for windows in residuals:
        n = sum(v.size for v in windows)
        c = autocovariance(windows, lags)
        if c[0] <= 0.0 or n <= lags + 2:
            continue
        k = np.arange(1, lags + 1)
        statistic = n * (n + 2.0) * float(np.sum((c[1:] / c[0]) ** 2 / (n - k)))
        if statistic > scipy.stats.chi2.ppf(1.0 - _FALSE_ALARM / len(residuals), lags):
            return False
    return True


def coloured_sum(left: Array, right: Array, covariance: Array, *, taper: bool = True) -> Array:
    """Sum over i and j of x(i) R(i - j) y(j)', the middle of (5.53), for one window.

    Args:
        left: x, (n, p).
        right: y, (n, q).
        covariance: R at lags 0, 1, ... of v(i) w(i + k), (lags + 1,) for one channel, or (2, lags + 1) for two: the
            second row with v and w exchanged.
        taper: whether lags fade out (Parzen), which keeps the variances that an estimated R gives positive.

    Returns:
        (p, q).
    """
    both = np.atleast_2d(covariance)
    n, lags = left.shape[0], both.shape[1] - 1
    window = _parzen(lags) if taper else np.ones(lags + 1)
    forward, backward = np.zeros(n), np.zeros(n)
    most = min(n, lags + 1)
    forward[:most] = (both[0] * window)[:most]
    backward[:most] = (both[-1] * window)[:most]
    return np.asarray(left.T @ matmul_toeplitz((backward, forward), right))


def coloured_covariance(slopes: Sequence[Array], residuals: Sequence[Array], growth: Array) -> Array:
    """Variance of the score for residuals of the correlations that they have, every channel with itself and with every
    other one: the middle of (5.53) with sensitivities as regressors, (k, k).

    Args:
        slopes: by window, (n, channels, k).
        residuals: by window, (n, channels), 0 where there is none.
        growth: by channel, what makes a sum of squares a variance: over samples, for degrees of freedom, (channels,).
    """
    total = sum(len(r) for r in residuals)
    lags = max(min(len(r) for r in residuals) // 2, 1)
    size = np.sqrt(growth * total)
    rows = [[r[:, c] for r in residuals] for c in range(growth.size)]
    middle = np.zeros((slopes[0].shape[2],) * 2)
    for c in range(growth.size):
        for d in range(c, growth.size):
            covariance = crosscovariance(rows[c], rows[d], lags) * size[c] * size[d]
            for s in slopes:
                part = coloured_sum(s[:, c], s[:, d], covariance)
                middle += part if c == d else part + part.T
    return middle


def no_less_than(least: Array, covariance: Array) -> Array:
    """A covariance (k, k) with no variance below ``least``'s, (k, k), and its own correlations.

    Residuals of a short record do not show all of their colour: a fit takes some of it for motion.
    """
    factor = np.sqrt(np.maximum(np.diagonal(least) / np.maximum(np.diagonal(covariance), 1e-300), 1.0))
    return np.asarray(covariance * np.outer(factor, factor))


def _parzen(lags: int) -> Array:
    """Parzen's lag window, 1 at lag 0, 0 past the last."""
    u = np.arange(lags + 1) / (lags + 1.0)
    return np.where(u <= 0.5, 1.0 - 6.0 * u**2 + 6.0 * u**3, 2.0 * (1.0 - u) ** 3)
