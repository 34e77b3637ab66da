"""Spans of a flight, integrals over them, and regressions between such integrals whose errors allow for coloured
residuals.

Whatever is compared is integrated over a span first: nothing is differentiated, and noise of an attitude counts at the
ends of a span only. Residuals of neighbouring spans go together, so errors are those of groups of spans
(cluster-robust: (X'X)^-1 sum_g (X_g' e_g)(X_g' e_g)' (X'X)^-1).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.conditioning.windows import runs

__all__ = ["Fit", "Spans", "regress"]

Array = NDArray[np.float64]

_GROUP_S = 4.0
_LEAST_GROUPS = 5


@dataclass(frozen=True, slots=True)
class Spans:
    """Spans of equal length in the rows between gaps.

    Attributes:
        time_s: stamps, (n,).
        first: row at which each span begins, (m,).
        last: row at which it ends, (m,).
    """

    time_s: Array
    first: NDArray[np.int64]
    last: NDArray[np.int64]

    @classmethod
    def of(cls, time_s: Array, length_s: float) -> "Spans":
        """Spans one after another, as near to a length as the stamps allow."""
        steps = np.diff(time_s)
        steps = steps[steps > 0.0]
        count = max(2, round(length_s / float(np.median(steps)))) if steps.size else 2
        firsts, lasts = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        for run in runs(time_s):
            ends = np.arange(run.start, run.stop, count)
            firsts.append(ends[:-1])
            lasts.append(ends[1:])
        return cls(time_s, np.concatenate(firsts), np.concatenate(lasts))

    @property
    def length_s(self) -> Array:
        """Length of each span."""
        return np.asarray(self.time_s[self.last] - self.time_s[self.first])

    def change(self, values: Array) -> Array:
        """From the beginning of each span to its end."""
        return np.asarray(values[self.last] - values[self.first])

    def integral(self, values: Array) -> Array:
        """Over each span, by trapezia."""
        steps = np.diff(self.time_s) * 0.5 * (values[1:] + values[:-1])
        total = np.concatenate([[0.0], np.cumsum(steps)])
        return np.asarray(total[self.last] - total[self.first])

    def mean(self, values: Array) -> Array:
        """Over each span."""
        return np.asarray(self.integral(values) / self.length_s)

    @property
    def groups(self) -> NDArray[np.int64]:
        """Number of the group that each span belongs to."""
        number: NDArray[np.int64] = ((self.time_s[self.first] - self.time_s[0]) // _GROUP_S).astype(np.int64)
        return number


@dataclass(frozen=True, slots=True)
class Fit:
    """A regression.

    Attributes:
        value: coefficients, (k,).
        standard_error: theirs, (k,).
        explained: fraction of the variance explained by all of them.
    """

    value: Array
    standard_error: Array
    explained: float


def regress(y: Array, columns: list[Array], groups: NDArray[np.int64]) -> Fit | None:
    """Ordinary least squares; None where the spans are too few or do not tell the coefficients apart.

    Args:
        y: (m,).
        columns: (m,) each.
        groups: of the spans; residuals of one group may go together.
    """
    x = np.stack(columns, axis=1)
    size = np.sqrt(np.mean(x**2, axis=0)) if x.size else np.zeros(x.shape[1])
    number, index = np.unique(groups, return_inverse=True)
    if number.size < _LEAST_GROUPS + x.shape[1] // 2 or len(y) < 4 * x.shape[1]:
        return None
    used = size > 1e-12
    if not used[0]:
        return None
    scaled = x[:, used] / size[used]
    normal = scaled.T @ scaled
    if np.linalg.cond(normal) > 1e8:
        return None
    inverse = np.linalg.inv(normal)
    beta = inverse @ (scaled.T @ y)
    residual = y - scaled @ beta
    scores = np.zeros((number.size, scaled.shape[1]))
    np.add.at(scores, index, scaled * residual[:, None])
    small = number.size / (number.size - 1.0)
    error = np.sqrt(np.maximum(np.diagonal(inverse @ (scores.T @ scores) @ inverse) * small, 0.0))
    value, spread = np.full(x.shape[1], np.nan), np.full(x.shape[1], np.inf)
    value[used], spread[used] = beta / size[used], error / size[used]
    total = float(np.sum((y - np.mean(y)) ** 2))
    return Fit(value, spread, 1.0 - float(np.sum(residual**2)) / total if total > 0.0 else 0.0)
