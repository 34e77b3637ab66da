"""Covariances of output error: what the residuals as they are say of the errors of its parameters."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wingwatch.estimators.offline.fit import autocovariance, coloured_sum
from wingwatch.estimators.offline.output_error_problem import Point, Problem, channel_names

__all__ = ["coloured_covariance", "freedom_taken", "may_be_off_by", "rescaled"]

Array = NDArray[np.float64]


def freedom_taken(problem: Problem, point: Point, inverse: Array) -> Array:
    """Degrees of freedom that the parameters take from each channel, (channels,); they add to their number."""
    taken = np.zeros(point.noise.size)
    for m in range(len(problem.parts)):
        index = _indices(problem, m)
        local = inverse[np.ix_(index, index)]
        s = point.sensitivities[m]
        taken += np.einsum("ncp,pq,ncq->c", s, local, s, optimize=True) / point.noise
    return taken


def _indices(problem: Problem, m: int) -> NDArray[np.int64]:
    at = problem.place(m)
    return np.concatenate([np.arange(problem.common), np.arange(at.start, at.stop)])


def rescaled(problem: Problem, point: Point, inverse: Array, growth: Array) -> Array:
    """Inverse information with each channel's noise over its degrees of freedom instead of its samples.

    Args:
        problem, point: the data, and the fit to them.
        inverse: of the information, (parameters, parameters).
        growth: samples over degrees of freedom of each channel, (channels,).
    """
    middle = np.zeros_like(inverse)
    for m in range(len(problem.parts)):
        index = _indices(problem, m)
        s = point.sensitivities[m]
        middle[np.ix_(index, index)] += np.einsum("ncp,c,ncq->pq", s, growth / point.noise, s, optimize=True)
    return np.asarray(inverse @ middle @ inverse)


def coloured_covariance(problem: Problem, point: Point, inverse: Array, growth: Array) -> Array:
    """Covariance for residuals of the correlations that they have, of every channel with itself and with every other
    one: (5.53) with sensitivities as regressors. Arguments and shapes as of ``rescaled``."""
    middle = np.zeros_like(inverse)
    lags = max(min(len(p) for p in problem.parts) // 2, 1)
    total = sum(r.shape[0] for r in point.residuals)
    seen = np.maximum(np.sum([u.sum(axis=0) for u in problem.used], axis=0), 1)
    size = np.sqrt(growth * total / seen)
    channels = range(point.noise.size)
    rows = [[r[:, c] for r in point.residuals] for c in channels]
    for c in channels:
        for d in range(c, point.noise.size):
            both = [autocovariance(rows[c], rows[d], lags), autocovariance(rows[d], rows[c], lags)]
            covariance = np.stack(both) * size[c] * size[d]
            for m in range(len(problem.parts)):
                index = np.ix_(_indices(problem, m), _indices(problem, m))
                s = point.sensitivities[m] / point.noise[:, None]
                part = coloured_sum(s[:, c], s[:, d], covariance)
                middle[index] += part if c == d else part + part.T
    return np.asarray(inverse @ middle @ inverse)


def may_be_off_by(problem: Problem, point: Point, inverse: Array, unexplained: Mapping[str, float]) -> Array:
    """By how much channels that the model does not hold for may have put the parameters off, as a covariance.

    Gusts are no noise of a sensor, and an autopilot answers them: residuals and sensitivities may go together anyhow.
    With v what the sensors leave of a channel's residual, |sum h v| <= |h| |v| (Cauchy and Schwarz, ``endogeneity``).

    Args:
        unexplained: by channel, share of its residual's power that is no sensor's noise.
    """
    names = channel_names(problem)
    middle = np.zeros_like(inverse)
    for name, share in unexplained.items():
        c = names.index(name)
        power = share * sum(float(np.sum(r[:, c] ** 2)) for r in point.residuals) / point.noise[c]
        for m in range(len(problem.parts)):
            index = _indices(problem, m)
            s = point.sensitivities[m][:, c]
            middle[np.ix_(index, index)] += power * (s.T @ s) / point.noise[c]
    return np.asarray(inverse @ middle @ inverse)
