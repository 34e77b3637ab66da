"""The guards of ``guards`` as the recursion keeps them: from sums over the window and what faded of those before.

With weights w on samples, z = sum w psi_u e at the estimate has the variance sum w^2 psi_u psi_u' - C P C' with
C = sum w psi_u psi', whatever other data P rests on; so the sums are kept with both weights.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from wingwatch.estimators.filter_error.guards import Guards

__all__ = ["Account", "online_guards"]

Array = NDArray[np.float64]

_PRIOR_GROUPS = 3.0
"""Groups' worth of belief that the scores scatter as they should."""

_INFORMED = 0.05
"""Least information of a direction for its score to be judged, over that of data and prior."""


class Account(NamedTuple):
    """Sums over all groups, as ``recursion.Evidence`` has them, and where they are judged.

    Attributes:
        driven, driven_square, driven_vector, cross, products, squares, scatter, information, groups: see there.
        estimate: parameters, (size,); covariance: of them, (size, size).
        prior_mean, prior_std: of them, (size,).
    """

    driven: Array
    driven_square: Array
    driven_vector: Array
    cross: Array
    products: Array
    squares: Array
    scatter: Array
    information: Array
    groups: float
    estimate: Array
    covariance: Array
    prior_mean: Array
    prior_std: Array


def online_guards(account: Account) -> Guards:
    """All guards at the present estimate."""
    k = account.driven.shape[0]
    score = account.driven_vector - account.cross @ account.estimate
    error = np.sqrt(np.diagonal(account.covariance)[:k])
    difference = _by_surfaces_alone(account, score, error)
    each = np.maximum(np.maximum(_sandwich(account)[:k], difference) / error, 1.0)
    return Guards(_driven_ratio(account, score), _whiteness(account), _scatter(account), each)


def _driven_ratio(account: Account, score: Array) -> float:
    """Root of chi-square over its degrees of freedom (Birge 1932)."""
    k = score.size
    expected = account.driven_square - account.cross @ account.covariance @ account.cross.T
    values, vectors = eigh(
        0.5 * (expected + expected.T), account.driven_square + np.diag(account.prior_std[:k] ** -2)
    )
    seen = values > _INFORMED
    if not seen.any():
        return 1.0
    z = vectors.T[seen] @ score
    return float(np.sqrt(max(1.0, float(np.mean(z**2 / values[seen])))))


def _by_surfaces_alone(account: Account, score: Array, error: Array) -> Array:
    """Error that explains how far one step by surfaces alone goes, beyond what that step's own error does, (k,)."""
    k = error.size
    information = np.diag(account.prior_std[:k] ** -2)
    matrix = np.linalg.inv(account.driven + information)
    step = matrix @ (score + information @ (account.prior_mean - account.estimate)[:k])
    spread = matrix @ (account.driven_square + information) @ matrix
    own = np.maximum(np.diagonal(spread) - error**2, 0.0)
    return np.asarray(np.sqrt(error**2 + np.maximum(step**2 - own, 0.0)))


def _sandwich(account: Account) -> Array:
    """Standard errors with the scores' own scatter in the place of the information, (size,)."""
    p = account.covariance
    # what the groups do not hold is as sure as it was said to be
    rest = np.linalg.inv(p) - account.information
    variance = np.diagonal(p @ (account.scatter + rest) @ p)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _scatter(account: Account) -> float:
    """Root of how much more the scores of groups scatter than their information says."""
    metric = np.linalg.inv(account.information / max(account.groups, 1.0) + np.diag(account.prior_std**-2))
    found = float(np.trace(metric @ account.scatter))
    expected = float(np.trace(metric @ account.information))
    return float(np.sqrt(max(1.0, (_PRIOR_GROUPS + found) / (_PRIOR_GROUPS + expected))))


def _whiteness(account: Account) -> float:
    """By the excess of the portmanteau statistic of all channel pairs over twice its own scatter (``guards``)."""
    seen = account.squares > 0.0
    count = int(np.count_nonzero(seen))
    if count == 0:
        return 1.0
    statistic = float(np.sum(account.products[seen] ** 2 / account.squares[seen]))
    excess = statistic - count - 2.0 * np.sqrt(2.0 * count)
    return float(np.sqrt(1.0 + max(excess, 0.0) / np.sqrt(count)))
