"""Small errors of all coefficients at once: no simulation is right to the last percent, and the likelihood tells it.

Besides its causes a model may have an error in every coefficient, b, normal about 0 with a standard deviation of tau
times the least that matters; tau is fitted, one for derivatives and one for constants of steady flight. With score g
and information H of causes and errors at a fit, T the precision that tau gives,

    gain(tau) = 1/2 g' (H + T)^-1 g - 1/2 ln det (H + T) + 1/2 ln det (H without errors) + 1/2 ln det T        (7)

is what integrating b out adds to the log-likelihood; (H + T)^-1 g moves the causes to where they are most likely
beside such errors, and (H + T)^-1 is their covariance. Where the data ask for no error, tau is 0 and nothing changes.
This is empirical Bayes (Efron and Hastie 2016, chapter 6). docs/methods/diagnosis.md, section 4.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.causes import coefficients_of, of_motion
from wingwatch.diagnosis.evaluation import evaluate, reduce
from wingwatch.diagnosis.fit import Solution
from wingwatch.diagnosis.problem import Problem

__all__ = ["Beside", "SmallErrors", "small_errors"]

Array = NDArray[np.float64]

_LEVELS = np.array([0.0, 0.03, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0])
"""Of tau; 1 is an error in each coefficient that just matters. What is larger is a cause."""


@dataclass(frozen=True, slots=True)
class Beside:
    """Causes beside small errors of everything.

    Attributes:
        gain: of log-likelihood, equation (7) at the best tau.
        levels: the best tau, of derivatives and of constants.
        step: by which the causes' parameters move; covariance: of them.
    """

    gain: float
    levels: tuple[float, float]
    step: Array
    covariance: Array


@dataclass(frozen=True, slots=True)
class SmallErrors:
    """Score and information of a model's causes and of small errors.

    Attributes:
        score, information: causes first, then errors in units of the least that matters.
        causes: how many parameters are of causes.
        constant: which errors are of constants.
    """

    score: Array
    information: Array
    causes: int
    constant: NDArray[np.bool_]

    def beside(self, inflated: float, least: float = 0.0) -> Beside:
        """The causes beside the errors that are most likely.

        Args:
            inflated: variance of the scores over that of independent innovations.
            least: of tau of derivatives, whatever the residual shows: what resembles a cause does not show.
        """
        levels = [(max(one, least), other) for one in _LEVELS for other in _LEVELS]
        found = [self._at(np.where(self.constant, other, one), inflated) for one, other in levels]
        best = int(np.argmax([gain for gain, _, _ in found]))
        gain, step, covariance = found[best]
        return Beside(gain, (float(levels[best][0]), float(levels[best][1])), step, covariance)

    def _at(self, tau: Array, inflated: float) -> tuple[float, Array, Array]:
        n = self.causes
        there = np.concatenate([np.ones(n, dtype=np.bool_), tau > 0.0])
        unit = np.concatenate([np.ones(n), tau])[there]
        h = self.information[there][:, there] * np.outer(unit, unit) / inflated
        g = self.score[there] * unit / inflated
        h[np.arange(n, len(h)), np.arange(n, len(h))] += 1.0
        step = np.linalg.solve(h, g)
        spread = np.linalg.slogdet(h)[1] - np.linalg.slogdet(h[:n, :n])[1]
        return 0.5 * float(g @ step - spread), step[:n], np.linalg.inv(h)[:n, :n]


def small_errors(problem: Problem, solution: Solution) -> SmallErrors:
    """Of a fit."""
    point, n = solution.point, solution.point.theta.size
    coefficients = coefficients_of(problem.subject)
    evaluation = evaluate(problem, point, coefficients, own=solution.evaluation.own)
    reduced = reduce(problem, point, evaluation)
    prior = np.array([p.spread**-2.0 for c in point.causes for p in c.parameters])
    unit = np.concatenate([np.ones(n), [c.parameters[0].least for c in coefficients]])
    score, information = reduced.score * unit, reduced.information * np.outer(unit, unit)
    score[:n] -= prior * point.theta
    information[np.arange(n), np.arange(n)] += prior
    constant = np.array([not of_motion(c) for c in coefficients])
    return SmallErrors(score, information, n, constant)
