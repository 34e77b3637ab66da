"""The maximum of the likelihood by Fisher scoring, damped where a step fails: two starts, and a gate for gusts."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from wingwatch.estimators.offline.likelihood import (
    Evaluation,
    Problem,
    Sensitivities,
    evaluate,
    information_inverse,
    sensitivities,
)

__all__ = ["Search", "Slope", "Solution", "climb", "slope_at", "solve"]

Array = NDArray[np.float64]

_DONE, _NEARLY, _STILL = 0.02, 1.0, 0.1
"""A search is at rest where a full step promises less log-likelihood than the first, or less than the second while no
derivative would move by more than the third of its error."""

_UNSEEN = 1e-14
"""Of the largest information: parameters stay where they are in directions with less."""

_SHORT = 15
"""Steps of the searches beside the main one."""

_NO_GUST = -100.0
"""ln of an intensity that is none."""

_TRIALS = 10
"""Most dampings that are tried for one step."""

_LEAST_SIGNAL = 0.2
"""Least part of a direction's information that is taken to be signal where surfaces are measured with noise."""

_GATE = 8.0
"""Log-likelihood that a gust must gain over none at all (docs/methods/filter_error.md, section 5)."""


@dataclass(frozen=True, slots=True)
class Search:
    """How a maximum is looked for.

    Attributes:
        iterations: most steps.
        longest: no parameter moves further than this in one step: natural sizes of derivatives, factors of e of noises.
        tolerance: the search is at rest where a step moves no combination of parameters by more than this share of its
            error; where None, as ``_DONE`` says.
        damped: whether a step that fails is damped (Levenberg and Marquardt), or halved.
    """

    iterations: int = 40
    longest: float = 1.5
    tolerance: float | None = None
    damped: bool = True


@dataclass(frozen=True, slots=True)
class Solution:
    """Where a search ended.

    Attributes:
        point: the likelihood there.
        slope: what all windows say there.
        inverse: of information and prior together, (size, size); 0 for parameters that are not free.
        covariance: of the parameters: the same, with what noise of measured surfaces adds, (size, size).
        iterations: steps of all searches.
        converged: whether it came to rest.
        gusts: whether gusts are in the model.
    """

    point: Evaluation
    slope: "Slope"
    inverse: Array
    covariance: Array
    iterations: int
    converged: bool
    gusts: bool


def solve(problem: Problem) -> Solution | None:
    """The most likely parameters of several searches: without gusts, with them, and with them from the best so far with
    its noises lifted again. The likelihood has more than one maximum where little is known.

    None where the likelihood cannot be evaluated at the prior's own start.
    """
    start, calm = problem.prior.start, _restricted(problem, False)
    still = climb(calm, _without_gusts(calm, start), Search(_SHORT))
    gusty = climb(problem, start)
    if still is None or gusty is None:
        return still or gusty
    best = _better(gusty, still)
    gusty = _better(gusty, climb(problem, _lifted(problem, best.point.parameters), Search(_SHORT)))
    if _is_weak(problem, gusty):
        still = _better(still, climb(calm, _without_gusts(calm, gusty.point.parameters), Search(_SHORT)))
    best = still if still.point.cost - gusty.point.cost <= _GATE else gusty
    best = replace(best, iterations=still.iterations + gusty.iterations)
    return best if best.converged else _continued(problem, best)


def _continued(problem: Problem, found: Solution) -> Solution:
    """A search that ran out of steps goes on."""
    longer = climb(_restricted(problem, found.gusts), found.point.parameters, Search(100))
    if longer is None:
        return found
    return replace(longer, iterations=longer.iterations + found.iterations)


def _restricted(problem: Problem, gusts: bool) -> Problem:
    """The problem with gusts or without."""
    if gusts:
        return problem
    free = problem.free.copy()
    free[problem.model.layout.gusts] = False
    return replace(problem, free=free)


def _better(one: Solution, other: Solution | None) -> Solution:
    if other is None:
        return one
    best = one if one.point.cost <= other.point.cost else other
    return replace(best, iterations=one.iterations + other.iterations)


def _lifted(problem: Problem, p: Array) -> Array:
    """The same derivatives with noises as at the start and gusts and moments within a factor of e of it."""
    at, start = problem.model.layout, problem.prior.start
    lifted = p.copy()
    lifted[at.log_noise] = start[at.log_noise]
    for i in (at.gust.start, *range(at.disturbance.start, at.disturbance.stop)):
        lifted[i] = max(p[i], start[i] - 1.0)
    return lifted


def _is_weak(problem: Problem, found: Solution) -> bool:
    """Whether gusts are so weak that none at all may do as well."""
    gust = problem.model.layout.gust.start
    return bool(found.point.parameters[gust] < problem.prior.start[gust] - 1.0)


def _without_gusts(calm: Problem, p: Array) -> Array:
    """The same parameters without gusts, whose shape is the prior's."""
    without = np.where(calm.free, p, calm.prior.mean)
    without[calm.model.layout.gust] = _NO_GUST
    return without


@dataclass(frozen=True, slots=True)
class Slope:
    """What all windows say at one point.

    Attributes:
        score: gradient of minus the cost, (size,).
        information: as the innovations have it; surface_noise: what of it is noise of measured surfaces, (size, size).
        signal: the first less the second, but of no direction less than a fifth, (size, size).
        windows: sensitivities of each.
    """

    score: Array
    information: Array
    surface_noise: Array
    signal: Array
    windows: list[Sensitivities]


def climb(problem: Problem, start: Array, search: Search | None = None) -> Solution | None:
    """Fisher scoring from one start (size,); None where the likelihood cannot be evaluated there."""
    search = search or Search()
    point = evaluate(problem, start)
    if point is None:
        return None
    damping, n = 0.0, 0
    slope = slope_at(problem, point)
    while n < search.iterations and not _at_rest(problem, slope, search):
        n += 1
        better, damping = _step(problem, point, slope, damping, search)
        if better is None:
            break
        point = better
        slope = slope_at(problem, point)
    inverse, prior = _inverse(problem, slope), np.diag(problem.prior.std**-2)
    spread = slope.information + sum(s.surface_noise_scatter() for s in slope.windows)
    covariance = inverse @ (spread + prior) @ inverse
    gusts = problem.model.air and bool(problem.free[problem.model.layout.gust].all())
    return Solution(point, slope, inverse, covariance, n, _at_rest(problem, slope, search), gusts)


def _inverse(problem: Problem, slope: Slope) -> Array:
    """Of information and prior together; 0 for parameters that are not free."""
    free = problem.free
    whole = slope.signal + np.diag(problem.prior.std**-2)
    inverse = np.zeros_like(whole)
    inverse[np.ix_(free, free)] = information_inverse(whole[np.ix_(free, free)], _UNSEEN)
    return inverse


def _at_rest(problem: Problem, slope: Slope, search: Search) -> bool:
    """Whether a full step would change nothing that matters."""
    inverse, at = _inverse(problem, slope), problem.model.layout.theta
    move = inverse @ slope.score
    promised = 0.5 * float(slope.score @ move)
    if search.tolerance is not None:
        return 2.0 * promised <= search.tolerance**2
    largest = float(np.max(np.abs(move[at]) / np.sqrt(np.diagonal(inverse)[at])))
    return promised < _DONE or (promised < _NEARLY and largest < _STILL)


def slope_at(problem: Problem, point: Evaluation) -> Slope:
    """Score and information of all windows at an evaluated point."""
    p, prior = point.parameters, problem.prior
    score, information = problem.free * (prior.mean - p) / prior.std**2, np.zeros((p.size, p.size))
    surface_noise = np.zeros_like(information)
    windows = [sensitivities(problem, point, m) for m in range(len(problem.windows))]
    for s in windows:
        score = score + s.score().sum(axis=1) + s.surface_noise_score
        information += s.information()
        surface_noise += s.surface_noise_information
    signal = information
    if problem.model.air:
        signal = _signal_information(information, surface_noise, np.diag(prior.std**-2))
    return Slope(score, information, surface_noise, signal, windows)


def _signal_information(information: Array, surface_noise: Array, prior: Array) -> Array:
    """Information without that of the surfaces' noise; a direction that is mostly noise keeps a fifth."""
    if not surface_noise.any():
        return information
    values, vectors = eigh(surface_noise, information + prior)
    back = (information + prior) @ vectors
    return np.asarray(information - (back * np.minimum(values, 1.0 - _LEAST_SIGNAL)) @ back.T)


def _step(
    problem: Problem, point: Evaluation, slope: Slope, damping: float, search: Search
) -> tuple[Evaluation | None, float]:
    """A point of less cost and the damping for the next step; None where there is none."""
    free, share = problem.free, 1.0
    matrix = (slope.signal + np.diag(problem.prior.std**-2))[np.ix_(free, free)]
    for _ in range(_TRIALS):
        move = np.zeros(free.size)
        damped = matrix + damping * np.diag(np.diagonal(matrix))
        move[free] = share * information_inverse(damped, _UNSEEN) @ slope.score[free]
        move *= min(1.0, search.longest / max(float(np.max(np.abs(move))), 1e-9))
        trial = evaluate(problem, point.parameters + move)
        if trial is not None and trial.cost < point.cost + 1e-9:
            return trial, 0.0 if damping < 2e-3 else damping / 10.0
        if search.damped:
            damping = max(5.0 * damping, 1e-3)
        else:
            share *= 0.5
    return None, math.inf
