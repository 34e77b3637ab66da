"""Errors of a frequency-domain estimate for residuals as they are: (5.53) over bins, all equations together.

A step of the estimate is theta = sum over bins of Re(H e), H = (M - N)^-1 R' W, e the residuals of all equations in a
bin with trims taken out (' conjugate transpose). With the residuals' cross-spectrum S of each bin its covariance is
1/2 sum Re(H S H'): each bin has two real parts. S = W^-1 is what the sensors' noise makes it. As found it is that of
the whitened residuals C'e, W = C C', averaged over the bins near by; bins of a stationary residual at multiples of one
over the record's length are independent of each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from wingwatch.estimators.offline.endogeneity import Difference

__all__ = ["BinResiduals", "as_found", "beyond_chance", "covariance_of", "difference"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_NEAR = 4
"""Bins to either side whose residuals tell how strong a bin's is."""

_LEAST = 0.1
"""Least share of a residual's freedom that a fit is taken to leave, where a few bins decide a derivative."""

_CHANCE = 0.01
"""Chance that residuals which the sensors' noise explains are called stronger."""

_SINGULAR = 1e10
"""Condition of the instruments' products with the regressors beyond which they tell nothing."""


@dataclass(frozen=True, slots=True)
class BinResiduals:
    """One manoeuvre's bins at the solution.

    Attributes:
        regressors: without trims, (bins, equations, k).
        weight: W, (bins, equations, equations).
        residuals: without trims, (bins, equations).
    """

    regressors: Complex
    weight: Complex
    residuals: Complex

    def influence(self, inverse: Array) -> Complex:
        """H, (bins, k, equations)."""
        return np.asarray(np.einsum("kl,bil,bij->bkj", inverse, self.regressors.conj(), self.weight))


def as_found(bins: Sequence[BinResiduals], inverse: Array, left: float) -> list[Complex]:
    """Cross-spectrum of the residuals near each bin, (bins, equations, equations) by manoeuvre.

    Args:
        bins: of all manoeuvres.
        inverse: (M - N)^-1, (k, k).
        left: share of the residuals' freedom that the trims left; where a bin decides a derivative its residual is
            smaller by what that takes.
    """
    window = np.ones(2 * _NEAR + 1)
    found = []
    for b in bins:
        root = np.linalg.cholesky(b.weight)
        white = np.einsum("bij,bi->bj", root.conj(), b.residuals)
        moved = np.einsum("bij,bik->bjk", root.conj(), b.regressors)
        taken = 0.5 * np.einsum("bjk,kl,bjl->b", moved, inverse, moved.conj(), optimize=True).real
        rows = white.shape[1]
        freedom = np.convolve(np.maximum(rows * left - taken, _LEAST * rows), window, mode="same")
        products = np.einsum("bi,bj->bij", white, white.conj()).reshape(len(white), -1)
        near = np.stack([np.convolve(p, window, mode="same")[: len(white)] for p in products.T], axis=-1)
        spectrum = near.reshape(len(white), rows, rows) * (rows / freedom[: len(white), None, None])
        back = np.linalg.inv(root)
        found.append(np.einsum("bji,bjk,bkl->bil", back.conj(), spectrum, back, optimize=True))
    return found


def covariance_of(influences: Sequence[Complex], spectra: Sequence[Complex]) -> Array:
    """1/2 sum Re(H S H'), (k, k)."""
    parts = [
        0.5 * np.einsum("bki,bij,blj->kl", h, s, h.conj(), optimize=True).real
        for h, s in zip(influences, spectra, strict=True)
    ]
    return np.asarray(sum(parts))


def beyond_chance(bins: Sequence[BinResiduals], inverse: Array, white: Array, coloured: Array) -> bool:
    """Whether the residuals found make some derivative's error larger than chance makes that of the sensors' noise.

    The ratio of both variances is a mean over bins of |h e|^2 over its expectation, exponentially distributed, with
    weights w, so a chi-square over its 2 / sum w^2 degrees of freedom.

    Args:
        bins: residuals of each bin.
        inverse: of the information, (k, k).
        white, coloured: covariances of the derivatives for white and for the residuals found, (k, k).
    """
    variance = np.diagonal(white)
    squares = np.zeros_like(variance)
    for b in bins:
        h, spectrum = b.influence(inverse), np.linalg.inv(b.weight)
        own = 0.5 * np.einsum("bki,bij,bkj->bk", h, spectrum, h.conj(), optimize=True).real
        squares += np.sum((own / np.maximum(variance, 1e-300)) ** 2, axis=0)
    freedom = 2.0 / np.maximum(squares, 1e-300)
    most = scipy.stats.chi2.ppf(1.0 - _CHANCE / variance.size, freedom) / freedom
    return bool((np.diagonal(coloured) > most * variance).any())


def difference(
    bins: Sequence[BinResiduals],
    tools: Sequence[Complex],
    spectra: Sequence[Complex],
    inverse: Array,
    own: slice,
    equation: int,
    unexplained: Sequence[Array],
) -> Difference:
    """What an equation's unexplained residual may have done to the estimates (``endogeneity``).

    Args:
        bins, spectra: of all manoeuvres; ``spectra`` as found.
        tools: instruments in the places of the regressors, without trims, (bins, equations, k) each.
        inverse: (M - N)^-1, (k, k).
        own: the equation's own derivatives.
        equation: which.
        unexplained: power of its residual that is not explained, by bin, up to a common factor as the sensors' noise.

    Returns:
        the difference of the instruments' estimate, its covariance, and the bound.
    """
    k = inverse.shape[0]
    plain = [b.influence(inverse) for b in bins]
    total = float(sum(u.size for u in unexplained))
    bound = np.zeros((k, k))
    for h, u in zip(plain, unexplained, strict=True):
        bound += total * np.einsum("bk,b,bl->kl", h[..., equation], u, h[..., equation].conj()).real
    value, covariance = np.zeros(k), np.zeros((k, k))
    parts = [np.einsum("bik,bij->bkj", z.conj(), b.weight) for z, b in zip(tools, bins, strict=True)]
    crossed = sum(np.einsum("bkj,bjl->kl", p, b.regressors).real for p, b in zip(parts, bins, strict=True))
    if not np.isfinite(crossed).all() or np.linalg.cond(crossed) > _SINGULAR:
        return Difference(np.full(k, np.nan), covariance, bound)
    step = np.linalg.solve(
        crossed, sum(np.einsum("bkj,bj->k", p, b.residuals).real for p, b in zip(parts, bins, strict=True))
    )
    back = np.linalg.inv(crossed)
    other = [np.einsum("kl,blj->bkj", back, p) - h for p, h in zip(parts, plain, strict=True)]
    whole = covariance_of(other, spectra)
    value[own], covariance[own, own] = step[own], whole[own, own]
    return Difference(value, covariance, bound)
