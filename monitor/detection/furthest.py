"""Which derivative of a solution is furthest from what is expected, for whoever looks at vehicles.

Many vehicles are looked at together: what is expected of those of one type is worked out at once.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import ModeStructure
from wingwatch.baselines import Envelope
from wingwatch.estimators import Estimate, Outcome
from wingwatch.monitor.detection.judge import Judge
from wingwatch.monitor.detection.judge_state import JudgeState
from wingwatch.monitor.estimation.chain import Solution, condition_of
from wingwatch.monitor.views import WorstDerivative

__all__ = ["PendingWorst", "furthest"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PendingWorst:
    """A solution of one vehicle of which nobody has asked yet which derivative is furthest from its expectation.

    Attributes:
        structures: those that are compared.
        envelopes: of each of them, by name.
        taught: what the judge has learned from the vehicle's own flights.
    """

    solution: Solution
    structures: Sequence[ModeStructure]
    configuration: str
    envelopes: Mapping[str, Envelope]
    judge: Judge
    taught: JudgeState

    def estimates(self, structure: str) -> tuple[Estimate, ...]:
        """Of each online estimator."""
        return self.solution.modes[structure].estimates


def furthest(pending: Sequence[PendingWorst]) -> list[WorstDerivative | None]:
    """Of each vehicle the observable derivative furthest from its expectation, in standard errors of both; None where
    none is known.

    Both estimators must say so: of two that stand, the one nearer to the expectation speaks for the pair.
    """
    worst: list[WorstDerivative | None] = [None] * len(pending)
    alike: dict[tuple[str, int, int], list[int]] = {}
    for n, o in enumerate(pending):
        for s in o.structures:
            key = s.name, id(o.envelopes[s.name]), id(o.judge.coordinates[s.name].aircraft)
            alike.setdefault(key, []).append(n)
    for (structure, *_), numbers in alike.items():
        for n, z in zip(numbers, _distances([pending[n] for n in numbers], structure), strict=True):
            found = _speaker(z, pending[n].estimates(structure))
            best = worst[n]
            if found is not None and (best is None or abs(found.z) > abs(best.z)):
                worst[n] = found
    return worst


def _speaker(z: Array, estimates: Sequence[Estimate]) -> WorstDerivative | None:
    """The derivative furthest off, as the milder estimator has it; ``z``: (2, k), NaN where one does not stand."""
    size = np.where(np.isnan(z), np.inf, np.abs(z))
    milder, mildest = np.argmin(size, axis=0), np.min(size, axis=0)
    if not np.isfinite(mildest).any():
        return None
    k = int(np.argmax(np.where(np.isfinite(mildest), mildest, -1.0)))
    estimate = estimates[milder[k]]
    structure = estimate.structure
    return WorstDerivative(
        estimate.estimator, structure.name, structure.derivatives[k], float(z[milder[k], k])
    )


def _distances(pending: Sequence[PendingWorst], structure: str) -> Array:
    """Distance of each derivative of vehicles of one envelope from its expectation, by estimator, (m, 2, k).

    NaN where a derivative is not observable or nothing is expected.
    """
    both = [o for o in pending for _ in range(2)]
    estimates = [e for o in pending for e in o.estimates(structure)]
    found = [condition_of(e.condition, o.configuration) for e, o in zip(estimates, both, strict=True)]
    known = np.array([i for i, c in enumerate(found) if c is not None], dtype=np.int64)
    conditions = [c for c in found if c is not None]
    z = np.full((len(estimates), len(estimates[0].structure.derivatives)), np.nan)
    if conditions:
        value, covariance = pending[0].envelopes[structure].values_at(conditions)
        inside = np.asarray(np.all(np.isfinite(value), axis=1))
        known, conditions = known[inside], [c for c, i in zip(conditions, inside, strict=True) if i]
    if conditions:
        judge = pending[0].judge
        at = judge.coordinates[structure].at_each(conditions)
        prior = at.from_concise(value[inside], covariance[inside])
        expected = at.to_concise(*judge.expected([both[i].taught for i in known], structure, *prior))
        error = np.sqrt(np.diagonal(expected[1], axis1=1, axis2=2))
        own = (
            np.array([estimates[i].value for i in known]),
            np.array([estimates[i].standard_error for i in known]),
        )
        z[known] = (own[0] - expected[0]) / np.hypot(own[1], error)
    stands = [[o in (Outcome.CONVERGED, Outcome.SETTLING) for o in e.outcomes] for e in estimates]
    return np.where(stands, z, np.nan).reshape(len(pending), 2, -1)
