"""What widens the stated error where the data contradict the model (docs/methods/filter_error.md).

Each guard looks for one kind of contradiction and says by how much the errors must grow for it to be none. The largest
counts. None of them changes the estimate.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from wingwatch.estimators.offline.innovations import filter_columns
from wingwatch.estimators.offline.likelihood import (
    Evaluation,
    Problem,
    information_inverse,
    open_loop,
)
from wingwatch.estimators.offline.scoring import Solution

__all__ = ["Guards", "guarded"]

Array = NDArray[np.float64]

_GROUP_S = 2.0
"""Length of the groups whose scores are compared: longer than the modes, shorter than a manoeuvre."""

_PRIOR_GROUPS = 3.0
"""Groups' worth of belief that the scores scatter as they should."""

_LAGS = 25
"""Lags at which innovations are compared with each other."""

_INFORMED = 0.05
"""Least information of a direction for its score to be judged, over that of data and prior."""


@dataclass(frozen=True, slots=True)
class Guards:
    """Factors on the standard errors, at least 1.

    Attributes:
        driven: chi-square of the score of what surfaces drive.
        whiteness: of the innovations.
        scatter: of the scores of 2 s.
        each: of every derivative: sandwich covariance, and difference to what surfaces alone say, (k,).
    """

    driven: float
    whiteness: float
    scatter: float
    each: Array

    @property
    def factors(self) -> Array:
        """The largest of each derivative, (k,)."""
        return np.asarray(np.maximum(self.each, max(self.driven, self.whiteness, self.scatter)))


@dataclass(slots=True)
class _Sums:
    """What the guards need of all windows: scores of groups (groups, size), information of the full likelihood
    (size, size), what noise of surfaces adds to its score's variance (size, size), information and score of what
    surfaces drive (k, k), (k,), and its cross information with the full likelihood (k, size)."""

    groups: list[Array]
    information: Array
    surface_noise: Array
    driven: Array
    driven_score: Array
    cross: Array


def guarded(problem: Problem, solution: Solution) -> Guards:
    """All guards at a solution."""
    sums = _gathered(problem, solution)
    k = problem.model.layout.theta.stop
    error = np.sqrt(np.diagonal(solution.covariance)[:k])
    whole = np.sqrt(_sandwich(problem, solution, sums)[:k])
    difference = _by_surfaces_alone(problem, solution, sums, error)
    each = np.maximum(np.maximum(whole, difference) / error, 1.0)
    driven = _driven_ratio(problem, solution, sums)
    return Guards(driven, _whiteness(problem, solution.point), _scatter(problem, sums), each)


def _gathered(problem: Problem, solution: Solution) -> _Sums:
    size, k = problem.free.size, problem.model.layout.theta.stop
    sums = _Sums(
        [], np.zeros((size, size)), np.zeros((size, size)), np.zeros((k, k)), np.zeros(k), np.zeros((k, size))
    )
    for m, (window, s) in enumerate(zip(problem.windows, solution.slope.windows, strict=True)):
        samples, channels = window.readings.shape
        score = s.score().reshape(size, samples, channels).sum(axis=2)
        sums.groups.extend(_grouped(score, max(round(_GROUP_S / window.dt), 1)))
        sums.information += s.information()
        sums.surface_noise += s.surface_noise_scatter()
        driven = _driven(problem, solution.point, m)
        sums.driven += driven @ driven.T
        sums.driven_score += driven @ s.innovations
        sums.cross += driven @ s.predicted.T
    return sums


def _grouped(score: Array, length: int) -> Sequence[Array]:
    """Sums over whole groups of samples."""
    groups = score.shape[1] // length
    return list(score[:, : groups * length].reshape(score.shape[0], groups, length).sum(axis=2).T)


def _driven(problem: Problem, point: Evaluation, m: int) -> Array:
    """Sensitivities of what is driven by measured surfaces (and gravity) alone, filtered as the data are,
    (k, readings)."""
    window, model, p = problem.windows[m], problem.model, point.parameters
    system, trace = point.systems[m], point.traces[m]
    k = model.layout.theta.stop
    first = open_loop(model, window, system)
    columns = np.zeros((k, *first.shape))
    for i in range(k):
        moved = p.copy()
        moved[i] += problem.prior.step[i]
        columns[i] = open_loop(model, window, model.system(moved, window)) - first
        columns[i] /= problem.prior.step[i]
    filter_columns(system, trace, window.used, columns)
    root = 1.0 / np.sqrt(trace.variances)
    flat = (columns * root).reshape(k, -1)
    x = (point.own_columns[m] * root).reshape(-1, flat.shape[1])
    return np.asarray(flat - (flat @ x.T) @ information_inverse(x @ x.T) @ x)


def _prior_information(problem: Problem) -> Array:
    return np.diag(problem.prior.std**-2)


def _driven_ratio(problem: Problem, solution: Solution, sums: _Sums) -> float:
    """Root of chi-square over its degrees of freedom (Birge 1932)."""
    k = sums.driven_score.size
    expected = sums.driven - sums.cross @ solution.covariance @ sums.cross.T
    values, vectors = eigh(expected, sums.driven + _prior_information(problem)[:k, :k])
    seen = values > _INFORMED
    if not seen.any():
        return 1.0
    z = vectors.T[seen] @ sums.driven_score
    return float(np.sqrt(max(1.0, float(np.mean(z**2 / values[seen])))))


def _by_surfaces_alone(problem: Problem, solution: Solution, sums: _Sums, error: Array) -> Array:
    """Error that explains how far one step by surfaces alone goes, beyond what that step's own error does, (k,)."""
    k = error.size
    p, prior = solution.point.parameters[:k], problem.prior
    matrix = np.linalg.inv(sums.driven + _prior_information(problem)[:k, :k])
    step = matrix @ (sums.driven_score + (prior.mean[:k] - p) / prior.std[:k] ** 2)
    own = np.maximum(np.diagonal(matrix) - error**2, 0.0)
    return np.asarray(np.sqrt(error**2 + np.maximum(step**2 - own, 0.0)))


def _sandwich(problem: Problem, solution: Solution, sums: _Sums) -> Array:
    """Variances with the scores' own scatter in the place of the information, (size,)."""
    groups = np.array(sums.groups)
    centred = groups - groups.mean(axis=0)
    middle = centred.T @ centred + _prior_information(problem)
    return np.asarray(np.diagonal(solution.inverse @ middle @ solution.inverse))


def _scatter(problem: Problem, sums: _Sums) -> float:
    """Root of how much more the scores of groups scatter than their information says."""
    groups = np.array(sums.groups)
    mean = sums.information / groups.shape[0]
    metric = np.linalg.inv(mean + _prior_information(problem))
    found = float(np.einsum("ga,ab,gb->", groups, metric, groups))
    expected = groups.shape[0] * float(np.trace(mean @ metric)) + float(np.trace(sums.surface_noise @ metric))
    return float(np.sqrt(max(1.0, (_PRIOR_GROUPS + found) / (_PRIOR_GROUPS + expected))))


def _whiteness(problem: Problem, point: Evaluation) -> float:
    """By the excess of the portmanteau statistic of all channel pairs over twice its own scatter.

    Each product's sum is normalised by its own squares (Lo and MacKinlay 1988): innovations that are larger at times
    are not taken for correlated ones. What noise of measured surfaces is expected to add is taken out.
    """
    channels = problem.windows[0].readings.shape[1]
    sums = np.zeros((_LAGS, channels, channels))
    squares = np.zeros_like(sums)
    for window, trace, surface_noises in zip(
        problem.windows, point.traces, point.surface_noises, strict=True
    ):
        e = trace.innovations / np.sqrt(trace.variances)
        for lag in range(1, min(_LAGS, len(window) - 1) + 1):
            sums[lag - 1] += e[lag:].T @ e[:-lag]
            for surface_noise in (row.reshape(-1, channels) for row in surface_noises):
                sums[lag - 1] -= surface_noise[lag:].T @ surface_noise[:-lag]
            squares[lag - 1] += (e[lag:] ** 2).T @ e[:-lag] ** 2
    seen = squares > 0.0
    count = int(np.count_nonzero(seen))
    if count == 0:
        return 1.0
    statistic = float(np.sum(sums[seen] ** 2 / squares[seen]))
    excess = statistic - count - 2.0 * np.sqrt(2.0 * count)
    return float(np.sqrt(1.0 + max(excess, 0.0) / np.sqrt(count)))
