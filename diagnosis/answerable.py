"""Which derivatives a flight cannot judge: an error of a third in one of them would not be beyond doubt."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wingwatch.diagnosis.candidate import Candidate
from wingwatch.diagnosis.causes import coefficients_of, of_motion
from wingwatch.diagnosis.evaluation import evaluate, reduce
from wingwatch.diagnosis.evidence import BEYOND_DOUBT
from wingwatch.diagnosis.fit import Solution, inflation
from wingwatch.diagnosis.problem import Problem

__all__ = ["ERROR", "MAIN", "not_judged", "shown_by", "symbol_of"]

Array = NDArray[np.float64]

ERROR = 1.0 / 3.0
"""Of a derivative, of itself, that a flight should show."""
MAIN = ("z_w", "z_eta", "m_w", "m_q", "m_eta", "y_v", "l_v", "l_p", "l_xi", "n_v", "n_r", "n_zeta")
"""Derivatives that make the motion; of the others many flights say little, and it matters little."""


def not_judged(problem: Problem, solution: Solution) -> tuple[str, ...]:
    """Symbols of main derivatives, stated and not 0, of which an error of ``ERROR`` would not show.

    Alone it would gain half its square times the information of log-likelihood, over the inflation f.
    """
    point, stated = solution.point, _stated(problem)
    if not stated:
        return ()
    evaluation = evaluate(problem, point, stated, own=solution.evaluation.own)
    reduced = reduce(problem, point, evaluation)
    first = point.theta.size
    gain = shown_by(np.diagonal(reduced.information)[first:] / inflation(reduced, slice(first, None)))
    return tuple(symbol_of(c) for c, g in zip(stated, gain, strict=True) if not g > BEYOND_DOUBT)


def shown_by(information: Array) -> Array:
    """What an error of ``ERROR`` gains alone, by the information of each derivative's relative error."""
    return np.asarray(0.5 * ERROR**2 * information)


def _stated(problem: Problem) -> Sequence[Candidate]:
    """In the order of ``MAIN``."""
    named = {
        symbol_of(c): c for c in coefficients_of(problem.subject) if of_motion(c) and not c.parameters[0].unit
    }
    return [named[symbol] for symbol in MAIN if symbol in named]


def symbol_of(coefficient: Candidate) -> str:
    """The derivative's symbol of one of ``coefficients_of``."""
    return coefficient.target or "m_q"
