"""Fit of a model to all windows: Gauss-Newton on innovations. docs/methods/diagnosis.md, section 3."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import Candidate
from wingwatch.diagnosis.evaluation import Evaluation, Reduced, evaluate, own_offset, own_prior, reduce
from wingwatch.diagnosis.problem import Point, Problem, RunsAwayError

__all__ = ["Solution", "fit", "inflation", "own_fitted"]

Array = NDArray[np.float64]

_MOST_PASSES = 6
_ENOUGH = 0.05
"""Gain of log-likelihood below which a step is not worth another pass."""


@dataclass(frozen=True, slots=True)
class Solution:
    """A fit.

    Attributes:
        point: the best.
        cost: minus log-likelihood there, less constants; without priors.
        covariance: of all parameters, for residuals as correlated as they are.
        evaluation: at the point, with columns of the model's own parameters.
    """

    point: Point
    cost: float
    covariance: Array
    evaluation: Evaluation


def _prior(causes: Sequence[Candidate]) -> Array:
    return np.array([p.spread**-2.0 for c in causes for p in c.parameters])


def _limits(causes: Sequence[Candidate]) -> tuple[Array, Array]:
    low = [p.low for c in causes for p in c.parameters]
    return np.array(low), np.array([p.high for c in causes for p in c.parameters])


def _moved(problem: Problem, point: Point, reduced: Reduced, step: Array, part: float) -> Point:
    """A point some part of a Gauss-Newton step away."""
    low, high = _limits(point.causes)
    theta = np.clip(point.theta + part * step, low, high)
    taken = theta - point.theta
    values, at = [], 0
    for v in point.values:
        values.append(theta[at : at + len(v)])
        at += len(v)
    trims = point.trims.copy()
    for w, (alone, by_theta) in enumerate(reduced.own):
        trims[w, list(problem.free_trims)] += part * alone - by_theta @ taken
    return replace(point, values=tuple(values), trims=trims)


def fit(
    problem: Problem, point: Point, passes: int = _MOST_PASSES, evaluation: Evaluation | None = None
) -> Solution:
    """The parameters of the causes in the model, and trims, that predict best (Ljung 1999, section 7.2).

    Innovations are weighed by the standard deviations of the model to begin with: what a step does to them by gusts
    that it would let in more is no evidence of a parameter.

    Args:
        problem: the flight.
        point: where to begin.
        passes: at most.
        evaluation: at the point, where it is known.

    Raises:
        RunsAwayError: the simulation leaves the flight.
    """
    if evaluation is None:
        evaluation = evaluate(problem, point)
    if not np.isfinite(evaluation.log_spread):
        raise RunsAwayError("the simulation diverges from the flight")
    weights = evaluation.deviations
    reduced = reduce(problem, point, evaluation)
    prior = _prior(point.causes)
    for _ in range(passes):
        gradient = reduced.score - prior * point.theta
        step = np.asarray(np.linalg.solve(reduced.information + np.diag(prior), gradient), dtype=np.float64)
        here = _whole_cost(problem, evaluation, point, prior)
        if _promised(evaluation, reduced, here) < _ENOUGH:
            break
        part, better = 1.0, False
        while part > 0.1 and not better:
            there = _moved(problem, point, reduced, step, part)
            tried = evaluate(problem, there, weights=weights, own=evaluation.own)
            better = bool(_whole_cost(problem, tried, there, prior) < here)  # not where it is not a number
            part *= 0.4
        if not better:
            break
        gained = here - _whole_cost(problem, tried, there, prior)
        point, evaluation = there, tried
        reduced = reduce(problem, point, evaluation)
        if gained < _ENOUGH:
            break
    if evaluation.unweighted is not None:
        evaluation = evaluation.unweighted
        reduced = reduce(problem, point, evaluation)
    if not np.isfinite(reduced.cost):
        raise RunsAwayError("the simulation diverges from the flight")
    return Solution(point, reduced.cost, _covariance(reduced, point, prior), evaluation)


def _promised(evaluation: Evaluation, reduced: Reduced, here: float) -> float:
    return (
        here - reduced.cost + 0.5 * float(reduced.score @ np.linalg.pinv(reduced.information) @ reduced.score)
    )


def _whole_cost(problem: Problem, evaluation: Evaluation, point: Point, prior: Array) -> float:
    """At the point itself."""
    residual = sum(float(b[:, 0, 0].sum()) for b in evaluation.blocks)
    for w in range(len(problem.inputs)):
        residual += float(own_prior(problem) @ own_offset(problem, point, w) ** 2)
    return 0.5 * residual + evaluation.log_spread + 0.5 * float(prior @ point.theta**2)


def _covariance(reduced: Reduced, point: Point, prior: Array) -> Array:
    """Sandwich where residuals are correlated (White 1982): never less than the inverse information."""
    if point.theta.size == 0:
        return np.zeros((0, 0))
    inverse = np.linalg.inv(reduced.information + np.diag(prior))
    return np.asarray(inverse * inflation(reduced, slice(None)))


_PRIOR_BLOCKS = 10.0


def inflation(reduced: Reduced, part: slice | Array) -> float:
    """Variance of the blocks' scores over what independent innovations would have; at least 1."""
    h = reduced.information[part][:, part]
    scale = np.linalg.pinv(h)
    blocks = len(reduced.block_scores)
    moved = scale @ reduced.score[part]
    scores = reduced.block_scores[:, part] - np.einsum(
        "bij,j->bi", reduced.block_information[:, part][:, :, part], moved
    )
    found = float(np.einsum("bi,ij,bj->", scores, scale, scores)) / max(len(h), 1)
    return max(1.0, (found * blocks + _PRIOR_BLOCKS) / (blocks + _PRIOR_BLOCKS))


def own_fitted(problem: Problem, point: Point) -> Point:
    """The point with trims of its windows at their best, causes held."""
    if not problem.free_trims:
        return point
    for _ in range(2):
        reduced = reduce(problem, point, evaluate(problem, point))
        trims = point.trims.copy()
        for w, (alone, _) in enumerate(reduced.own):
            if not np.isfinite(alone).all():
                continue  # it runs away in this window
            trims[w, list(problem.free_trims)] += alone
        point = replace(point, trims=trims)
    return point
