"""Which derivative of a solution is furthest from what is expected, for whoever looks at the vehicle."""

from collections.abc import Callable, Sequence

import numpy as np

from wingwatch.aircraft import ModeStructure
from wingwatch.baselines import Expectation
from wingwatch.estimators import Estimate, Outcome
from wingwatch.monitor.chain import Solution
from wingwatch.monitor.views import WorstDerivative

__all__ = ["furthest"]


def furthest(
    solution: Solution,
    structures: Sequence[ModeStructure],
    expected: Callable[[Estimate], Expectation | None],
) -> WorstDerivative | None:
    """The observable derivative furthest from its expectation, in standard errors of both; None where none can be told.

    Both estimators must say so: of two that stand, the one nearer to the expectation speaks for the pair.

    Args:
        structures: those that are compared.
        expected: the expectation at an estimate's condition, None where there is none.
    """
    worst: WorstDerivative | None = None
    for s in structures:
        mode = solution.modes[s.name]
        for voices in zip(*(_distances(e, expected(e)) for e in (mode.fourier, mode.ekf)), strict=True):
            standing = [v for v in voices if v is not None]
            if standing:
                mildest = min(standing, key=lambda v: abs(v.z))
                if worst is None or abs(mildest.z) > abs(worst.z):
                    worst = mildest
    return worst


def _distances(estimate: Estimate, expected: Expectation | None) -> list[WorstDerivative | None]:
    """Each derivative's distance from its expectation; None where either is missing."""
    symbols = estimate.structure.derivatives
    if expected is None:
        return [None] * len(symbols)
    z = (estimate.value - expected.value) / np.hypot(estimate.standard_error, expected.standard_error)
    stands = [o in (Outcome.CONVERGED, Outcome.SETTLING) for o in estimate.outcomes]
    return [
        WorstDerivative(estimate.estimator, estimate.structure.name, symbol, float(z[k]))
        if stands[k]
        else None
        for k, symbol in enumerate(symbols)
    ]
